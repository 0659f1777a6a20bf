//! SOG (PlayCanvas): one texel per Gaussian in lossless WebP pictures, and a `meta.json`, in a folder or a ZIP archive.

mod codebook;
mod image;
mod meta;
mod palette;
mod read;
mod vp8l;
mod write;
mod zip;

use std::borrow::Cow;
use std::io::Write;

use splat_core::Cloud;

use self::meta::Meta;
use self::zip::Archive;
use crate::format::{Format, ReadReport, Siblings, WriteOptions, Written};
use crate::{ReadError, SourceName, WriteError};

/// The format of PlayCanvas and SuperSplat.
#[derive(Clone, Copy, Debug)]
pub struct Sog;

const META: &str = "meta.json";

impl Format for Sog {
    fn name(&self) -> &'static str {
        "sog"
    }

    fn description(&self) -> &'static str {
        "SOG of PlayCanvas: the smallest, values in pictures, zipped or in a folder"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["sog"]
    }

    fn sniff(&self, head: &[u8], _file_len: u64) -> bool {
        // Whether an archive holds a capture shows only at its end.
        head.starts_with(&zip::MAGIC) || meta::sniff(head)
    }

    fn read(&self, bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
        let mut report = ReadReport::default();
        let packed: Vec<Cow<'_, [u8]>>;
        let (meta, names);
        let mut total = bytes.len();
        if bytes.starts_with(&zip::MAGIC) {
            let archive = Archive::open(bytes, name)?;
            let Some(folder) = archive.folder_of(META) else {
                let streamed = archive.folder_of("lod-meta.json").is_some();
                return Err(if streamed { streamed_capture(name) } else { other_archive(name) });
            };
            meta = Meta::parse(&archive.get(&format!("{folder}{META}"))?, name)?;
            names = read::files(&meta, name)?;
            packed = names.iter().map(|file| archive.get(&format!("{folder}{file}"))).collect::<Result<_, _>>()?;
        } else {
            if meta::is_streamed(bytes) {
                return Err(streamed_capture(name));
            }
            meta = Meta::parse(bytes, name)?;
            names = read::files(&meta, name)?;
            packed = names.iter().map(|file| files.get(file).map(Cow::Owned)).collect::<Result<_, _>>()?;
            total += packed.iter().map(|data| data.len()).sum::<usize>();
        }
        report.bytes = total as u64;
        let mut arrays = read::decode(&meta, &names, &packed, total, name)?;
        arrays.source.format = "sog".to_owned();
        arrays.source.antialiased = meta.antialias == Some(true);
        Ok((Cloud::new(arrays).map_err(ReadError::cloud(name))?, report))
    }

    fn writable(&self) -> bool {
        true
    }

    fn lossy(&self) -> bool {
        true
    }

    fn write(&self, cloud: &Cloud, _: &WriteOptions, sink: &mut dyn Write) -> Result<Written, WriteError> {
        write::write(cloud, sink)
    }
}

fn streamed_capture(name: &SourceName) -> ReadError {
    ReadError::unsupported(
        "a streamed SOG capture (`lod-meta.json`)",
        "open the `meta.json` of one of its levels of detail",
        name,
    )
}

fn other_archive(name: &SourceName) -> ReadError {
    ReadError::Other {
        found: format!("a ZIP archive without `{META}`"),
        expected: "a SOG capture".to_owned(),
        advice: "unpack it and open the splat file inside".to_owned(),
        path: name.clone(),
    }
}
