//! `.ksplat` (GaussianSplats3D, read only): sections of records in three levels of compression.

mod decode;
mod header;

use std::io::Write;

use splat_core::Cloud;

use crate::format::{Format, ReadReport, Siblings, WriteOptions, Written};
use crate::{ReadError, SourceName, WriteError};

/// The format of the GaussianSplats3D viewer.
#[derive(Clone, Copy, Debug)]
pub struct Ksplat;

impl Format for Ksplat {
    fn name(&self) -> &'static str {
        "ksplat"
    }

    fn description(&self) -> &'static str {
        ".ksplat of the GaussianSplats3D viewer, levels 0 to 2 (read only)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["ksplat"]
    }

    fn sniff(&self, head: &[u8], file_len: u64) -> bool {
        header::sniff(head, file_len)
    }

    fn read(&self, bytes: &[u8], name: &SourceName, _files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
        let file = header::File::parse(bytes, name)?;
        let mut arrays = decode::decode(&file, name)?;
        arrays.source.format = "ksplat".to_owned();
        let report = ReadReport { trailing_bytes: file.trailing as u64, ..ReadReport::default() };
        Ok((Cloud::new(arrays).map_err(ReadError::cloud(name))?, report))
    }

    fn writable(&self) -> bool {
        false
    }

    fn lossy(&self) -> bool {
        true
    }

    fn write(&self, _: &Cloud, _: &WriteOptions, _: &mut dyn Write) -> Result<Written, WriteError> {
        Err(WriteError::CannotHold {
            format: "ksplat",
            what: "a cloud, because it can only be read here".to_owned(),
            advice: "write .spz or .sog, which are smaller".to_owned(),
        })
    }
}
