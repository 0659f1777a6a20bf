//! [`read`]: any splat file into a [`Cloud`], its format decided by content.

use std::fs::File;
use std::path::{Component, Path, PathBuf};

use rayon::prelude::*;
use splat_core::Cloud;

use crate::format::{Folder, Format, InMemory, ReadReport, Siblings};
use crate::formats::FORMATS;
use crate::{ReadError, SourceName};

/// Bytes shown to [`Format::sniff`].
const HEAD: usize = 1 << 16;

/// Reads a splat file. `path` may also be a folder that holds a `meta.json`, or that `meta.json`.
///
/// The file is mapped into memory, not copied; it must not be shortened by another program meanwhile.
///
/// # Errors
/// [`ReadError`] naming the file, what was expected and what was found.
pub fn read(path: impl AsRef<Path>) -> Result<(Cloud, ReadReport), ReadError> {
    let mut path = path.as_ref().to_path_buf();
    if path.is_dir() {
        let meta = path.join("meta.json");
        if !meta.is_file() {
            return Err(ReadError::Other {
                found: "no `meta.json`".to_owned(),
                expected: "the folder of an unpacked .sog file".to_owned(),
                advice: "name the splat file itself".to_owned(),
                path: SourceName::from(path.as_path()),
            });
        }
        path = meta;
    }
    let name = SourceName::from(path.as_path());
    let bytes = map(&path, &name)?;
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    read_with(&bytes, &name, &Folder(&folder))
}

/// Reads a splat file from memory; `name` appears in errors and its ending helps to tell formats apart.
///
/// # Errors
/// As [`read`]. A file that refers to other files cannot be read this way.
pub fn read_bytes(bytes: &[u8], name: &str) -> Result<(Cloud, ReadReport), ReadError> {
    read_with(bytes, &SourceName::from(name), &InMemory::default())
}

/// Reads a splat file from memory, with the files beside it.
///
/// # Errors
/// As [`read`].
pub fn read_with(bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
    read_as(sniff(bytes, name)?, bytes, name, files)
}

/// Reads a splat file of a given format from memory, with the files beside it.
///
/// # Errors
/// As [`read`]; [`ReadError::Malformed`] and the like if the file is of another format.
pub fn read_as(
    format: &dyn Format,
    bytes: &[u8],
    name: &SourceName,
    files: &dyn Siblings,
) -> Result<(Cloud, ReadReport), ReadError> {
    let (cloud, mut report) = format.read(bytes, name, files)?;
    report.format = format.name();
    report.bytes = report.bytes.max(bytes.len() as u64);
    let (not_finite, bad_rotations, bad_sh) = count_oddities(&cloud);
    report.not_finite = not_finite;
    report.bad_rotations = bad_rotations;
    if bad_sh > 0 {
        report.notes.push(format!("{bad_sh} Gaussians have a NaN or an infinity among their colours"));
    }
    Ok((cloud, report))
}

/// The format of a file: all whose content test passes are candidates, the name's ending decides between them, then
/// the order of [`FORMATS`].
///
/// # Errors
/// [`ReadError::UnknownFormat`] if no test passes.
pub fn sniff(bytes: &[u8], name: &SourceName) -> Result<&'static dyn Format, ReadError> {
    let head = &bytes[..bytes.len().min(HEAD)];
    let candidates: Vec<&'static dyn Format> =
        FORMATS.iter().copied().filter(|f| f.sniff(head, bytes.len() as u64)).collect();
    let by_name = candidates.iter().find(|f| extension_length(**f, name.as_str()) > 0);
    by_name.or(candidates.first()).copied().ok_or_else(|| not_splats(bytes, name))
}

/// Length of the longest extension of `format` that `name` ends with (`.compressed.ply` beats `.ply`), 0 if none.
pub(crate) fn extension_length(format: &dyn Format, name: &str) -> usize {
    let name = name.to_ascii_lowercase();
    let ends = |e: &&&str| name.strip_suffix(**e).is_some_and(|rest| rest.ends_with('.'));
    format.extensions().iter().filter(ends).map(|e| e.len()).max().unwrap_or(0)
}

/// The error for bytes of no known format; what commonly takes the place of a download is named.
fn not_splats(bytes: &[u8], name: &SourceName) -> ReadError {
    let text = bytes.trim_ascii_start();
    let known: [(&[u8], &str, &str); 3] = [
        (b"version https://git-lfs", "a pointer of Git LFS", "fetch the file itself with `git lfs pull`"),
        (b"<!DOCTYPE", "a web page", "download the file itself"),
        (b"<html", "a web page", "download the file itself"),
    ];
    for (start, found, advice) in known {
        if text.get(..start.len()).is_some_and(|t| t.eq_ignore_ascii_case(start)) {
            return ReadError::Other {
                found: found.to_owned(),
                expected: "Gaussian splats".to_owned(),
                advice: advice.to_owned(),
                path: name.clone(),
            };
        }
    }
    ReadError::UnknownFormat {
        known: FORMATS.iter().map(|f| f.name()).collect::<Vec<_>>().join(", "),
        head: printable(&bytes[..bytes.len().min(16)]),
        path: name.clone(),
    }
}

fn printable(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "nothing (it is empty)".to_owned();
    }
    format!("\"{}\"", bytes.escape_ascii())
}

/// Maps a file; an empty one is an empty slice.
pub(crate) fn map(path: &Path, name: &SourceName) -> Result<Bytes, ReadError> {
    let file = File::open(path).map_err(ReadError::io(name))?;
    let length = file.metadata().map_err(ReadError::io(name))?.len();
    if length == 0 {
        return Ok(Bytes::Owned(Vec::new()));
    }
    // SAFETY: the map is read-only and private to this call. A program that shortens the file meanwhile could end this
    // process; no program that writes files by rename does, and `read` documents it.
    match unsafe { memmap2::Mmap::map(&file) } {
        Ok(map) => Ok(Bytes::Mapped(map)),
        // Pipes and some file systems cannot be mapped.
        Err(_) => std::fs::read(path).map(Bytes::Owned).map_err(ReadError::io(name)),
    }
}

/// The bytes of a file, mapped or owned.
pub(crate) enum Bytes {
    /// A memory map.
    Mapped(memmap2::Mmap),
    /// A copy.
    Owned(Vec<u8>),
}

impl std::ops::Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Owned(bytes) => bytes,
        }
    }
}

/// Gaussians that cannot be drawn, that have no rotation, and that have NaN or infinite colours.
fn count_oddities(cloud: &Cloud) -> (usize, usize, usize) {
    const BLOCK: usize = 1 << 14;
    let stride = cloud.sh_stride();
    (0..cloud.len().div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let range = block * BLOCK..cloud.len().min((block + 1) * BLOCK);
            let mut counts = (0, 0, 0);
            for i in range.clone() {
                counts.0 += usize::from(!cloud.drawable(i));
                let q = cloud.rotations()[i];
                let length = q.length_squared();
                counts.1 += usize::from(!(length > 1e-24 && length.is_finite()));
            }
            // One sum per block: any NaN or infinity makes `x * 0` NaN, and finite values leave it at zero.
            let colours = &cloud.sh()[range.start * stride..range.end * stride];
            if !all_finite(colours) {
                counts.2 = colours.chunks(stride).filter(|c| !all_finite(c)).count();
            }
            counts
        })
        .reduce(|| (0, 0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2))
}

fn all_finite(values: &[f32]) -> bool {
    // The largest exponent means NaN or infinity; a maximum of bit patterns runs in lanes.
    values.iter().fold(0, |m: u32, v| m.max(v.to_bits() & 0x7fff_ffff)) < 0x7f80_0000
}

impl Siblings for InMemory {
    fn get(&self, name: &str) -> Result<Vec<u8>, ReadError> {
        let path = SourceName::from(name);
        inside(name)?;
        self.files.get(name).cloned().ok_or_else(|| ReadError::Io {
            source: std::io::Error::new(std::io::ErrorKind::NotFound, "no file of this name was given"),
            path,
        })
    }
}

impl Siblings for Folder<'_> {
    fn get(&self, name: &str) -> Result<Vec<u8>, ReadError> {
        let path = self.0.join(inside(name)?);
        let shown = SourceName::from(path.as_path());
        std::fs::read(&path).map_err(ReadError::io(&shown))
    }
}

/// A relative path that stays in its folder.
fn inside(name: &str) -> Result<PathBuf, ReadError> {
    let path = Path::new(name);
    let stays = path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    // A backslash or a drive letter would leave the folder on another operating system.
    if name.is_empty() || !stays || name.contains(['\\', ':', '\0']) {
        return Err(ReadError::Outside { name: name.to_owned(), path: SourceName::from(name) });
    }
    Ok(path.to_path_buf())
}
