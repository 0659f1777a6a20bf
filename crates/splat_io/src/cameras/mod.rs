//! Camera files: which pictures a capture was made from, or should be drawn from.
//!
//! [`read`] finds the format by name and content; a folder is searched for the usual names. [`CAMERA_FORMATS`] lists them.
//! Lenses are pinholes here: the pinhole part of a distorted model is kept and a note says so.

mod colmap;
mod inria;
mod model;
mod nerfstudio;
mod order;

use std::path::{Path, PathBuf};

use splat_core::{Projection, View};

pub use self::colmap::{ColmapBinary, ColmapText};
pub use self::inria::Inria;
pub use self::nerfstudio::Nerfstudio;
pub use self::order::{natural_order, sort_by_name};
use crate::format::{Folder, Siblings};
use crate::read::map;
use crate::write::write_file;
use crate::{ReadError, SourceName, WriteError};

/// A view with the name and number its file gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedView {
    /// Number in the file (INRIA `id`, COLMAP image id), else the position in the file.
    pub id: u32,
    /// Name of the picture, as in the file.
    pub name: String,
    /// Pose, intrinsics and size.
    pub view: View,
}

/// The views of a camera file.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Cameras {
    /// Short name of the format found.
    pub format: &'static str,
    /// In the order of the file; see [`sort_by_name`].
    pub views: Vec<NamedView>,
    /// Sentences about anything that was not taken over (lens distortion).
    pub notes: Vec<String>,
}

/// A file written by [`CameraFormat::write`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraFile {
    /// Name within its folder.
    pub name: &'static str,
    /// Content.
    pub bytes: Vec<u8>,
}

/// A camera file format. To add one: a file in `cameras/` and a line in [`CAMERA_FORMATS`].
pub trait CameraFormat: Sync {
    /// Short name in lower case.
    fn name(&self) -> &'static str;

    /// One line for lists.
    fn description(&self) -> &'static str;

    /// Names of files to look for in a folder; any of them stands for the whole.
    fn file_names(&self) -> &'static [&'static str];

    /// Whether a file looks like this format. `file_name`: without folders; `bytes`: the whole file.
    fn sniff(&self, file_name: &str, bytes: &[u8]) -> bool;

    /// Reads a file; `files` gives those beside it.
    ///
    /// # Errors
    /// [`ReadError`]; never a panic.
    fn read(&self, bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<Cameras, ReadError>;

    /// The files that hold these perspective views, the main one first.
    ///
    /// # Errors
    /// [`WriteError::CannotHold`].
    fn write(&self, views: &[NamedView]) -> Result<Vec<CameraFile>, WriteError>;
}

/// Every camera format, in the order in which a folder is searched and content tests are tried.
pub static CAMERA_FORMATS: &[&dyn CameraFormat] = &[&Inria, &Nerfstudio, &ColmapBinary, &ColmapText];

/// Folders below a given one where COLMAP and its users put a model.
const SUB_FOLDERS: [&str; 4] = ["", "sparse/0", "sparse", "colmap/sparse/0"];

/// Reads a camera file, or the first one found in a folder.
///
/// # Errors
/// [`ReadError`] naming the file, what was expected and what was found.
pub fn read(path: impl AsRef<Path>) -> Result<Cameras, ReadError> {
    let path = path.as_ref();
    let file = if path.is_dir() { find(path)? } else { path.to_path_buf() };
    let name = SourceName::from(file.as_path());
    let bytes = map(&file, &name)?;
    let folder = file.parent().unwrap_or(Path::new(""));
    read_with(&bytes, &name, &Folder(folder))
}

/// Reads a camera file from memory, with the files beside it.
///
/// # Errors
/// As [`read`].
pub fn read_with(bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<Cameras, ReadError> {
    let file_name = file_name(name);
    let format = CAMERA_FORMATS.iter().find(|f| f.sniff(file_name, bytes)).ok_or_else(|| ReadError::UnknownFormat {
        known: CAMERA_FORMATS.iter().map(|f| f.name()).collect::<Vec<_>>().join(", "),
        head: format!("\"{}\"", bytes[..bytes.len().min(16)].escape_ascii()),
        path: name.clone(),
    })?;
    let cameras = format.read(bytes, name, files)?;
    Ok(Cameras { format: format.name(), ..cameras })
}

fn find(folder: &Path) -> Result<PathBuf, ReadError> {
    for sub in SUB_FOLDERS {
        for format in CAMERA_FORMATS {
            let mut files = format.file_names().iter().map(|name| folder.join(sub).join(name));
            if let Some(file) = files.find(|f| f.is_file()) {
                return Ok(file);
            }
        }
    }
    let names: Vec<&str> = CAMERA_FORMATS.iter().flat_map(|f| f.file_names()).copied().collect();
    Err(ReadError::Other {
        found: "no camera file".to_owned(),
        expected: format!("one of {}", names.join(", ")),
        advice: "name the file itself".to_owned(),
        path: SourceName::from(folder),
    })
}

fn file_name(name: &SourceName) -> &str {
    name.as_str().rsplit(['/', '\\']).next().unwrap_or_default()
}

/// Writes views in the format that the name asks for: `transforms*.json` nerfstudio, other `.json` INRIA, a `.txt` COLMAP
/// text and a `.bin` COLMAP binary in that file's folder, anything else a folder with a COLMAP binary model.
///
/// # Errors
/// [`WriteError`] naming the file.
pub fn write(path: impl AsRef<Path>, views: &[NamedView]) -> Result<(), WriteError> {
    let path = path.as_ref();
    let file = path.file_name().map(|n| n.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match file.rsplit_once('.').map(|(_, extension)| extension) {
        Some("json") if file.starts_with("transforms") => write_as(&Nerfstudio, path, views),
        Some("json") => write_as(&Inria, path, views),
        Some("txt") => write_as(&ColmapText, path, views),
        Some("bin") => write_as(&ColmapBinary, path, views),
        _ => {
            let io = |source| WriteError::Io { source, path: SourceName::from(path) };
            std::fs::create_dir_all(path).map_err(io)?;
            write_as(&ColmapBinary, &path.join("images.bin"), views)
        }
    }
}

/// Writes views in a given format: a format of one file as `path`, one of several beside `path` under their usual names.
///
/// # Errors
/// [`WriteError`] naming the file.
pub fn write_as(format: &dyn CameraFormat, path: &Path, views: &[NamedView]) -> Result<(), WriteError> {
    if let Some(view) = views.iter().find(|v| v.view.projection != Projection::Perspective) {
        return Err(WriteError::CannotHold {
            format: format.name(),
            what: format!("the orthographic view `{}`", view.name),
            advice: "leave it out".to_owned(),
        });
    }
    let files = format.write(views)?;
    let single = files.len() == 1;
    for file in files {
        let to = if single { path.to_path_buf() } else { path.with_file_name(file.name) };
        write_file(&to, |sink| Ok(sink.write_all(&file.bytes)?))?;
    }
    Ok(())
}
