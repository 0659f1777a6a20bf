//! SPZ (Niantic): quantised arrays, compressed as one gzip stream (versions 1 to 3) or as one zstd stream each (4).
//!
//! The axes in a file are right, up, back unless it says otherwise; reading turns them to the right, down, forward of
//! PLY files, and writing turns them back. Both are changes of sign and lose nothing.

mod decode;
mod encode;
mod gzip;
mod header;
mod read;

use std::io::{Read, Write};

use splat_core::{Cloud, CloudArrays};

use self::header::MAGIC;
pub(crate) use self::read::Axes;
use crate::format::{Format, ReadReport, Siblings, WriteOptions, Written};
use crate::{ReadError, SourceName, WriteError};

/// The format of Niantic's Scaniverse.
#[derive(Clone, Copy, Debug)]
pub struct Spz;

impl Format for Spz {
    fn name(&self) -> &'static str {
        "spz"
    }

    fn description(&self) -> &'static str {
        "SPZ of Niantic: about a tenth of a PLY, quantised"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["spz"]
    }

    fn sniff(&self, head: &[u8], _file_len: u64) -> bool {
        let mut magic = [0; 4];
        match head {
            [0x1f, 0x8b, ..] => {
                let inflated = flate2::bufread::GzDecoder::new(head).read_exact(&mut magic);
                inflated.is_ok() && magic == MAGIC
            }
            _ => head.starts_with(&MAGIC),
        }
    }

    fn read(&self, bytes: &[u8], name: &SourceName, _files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
        let mut report = ReadReport::default();
        let mut arrays = read_arrays(bytes, name, Axes::Rdf, &mut report)?;
        arrays.source.format = "spz".to_owned();
        Ok((Cloud::new(arrays).map_err(ReadError::cloud(name))?, report))
    }

    fn writable(&self) -> bool {
        true
    }

    fn lossy(&self) -> bool {
        true
    }

    fn write(&self, cloud: &Cloud, options: &WriteOptions, sink: &mut dyn Write) -> Result<Written, WriteError> {
        encode::write(cloud, options.version, sink)
    }
}

/// Reads a whole SPZ file, which may also lie inside a glTF file.
pub(crate) fn read_arrays(
    bytes: &[u8],
    name: &SourceName,
    axes: Axes,
    report: &mut ReadReport,
) -> Result<CloudArrays, ReadError> {
    if bytes.starts_with(&MAGIC) {
        read::streams(bytes, name, axes, report)
    } else {
        read::gzip(bytes, name, axes, report)
    }
}
