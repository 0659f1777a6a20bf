//! PLY as the INRIA trainer writes it (Kerbl et al. 2023), and everything near it.
//!
//! Properties are found by name, in any order and of any type; text, little and big endian; further properties become
//! extras, further elements are kept for the writer. [`Source::layout`](splat_core::Source) keeps what an untouched
//! cloud needs to be written bit for bit.

mod body;
mod decode;
mod header;
mod roles;

use std::io::Write;

use splat_core::{Cloud, CloudArrays, Source};

use self::header::{Encoding, Header};
use self::roles::Schema;
use crate::format::{Format, ReadReport, Siblings, WriteOptions, Written};
use crate::{ReadError, SourceName, WriteError};

/// The format of the INRIA trainer and of nearly every tool since.
#[derive(Clone, Copy, Debug)]
pub struct Ply;

impl Format for Ply {
    fn name(&self) -> &'static str {
        "ply"
    }

    fn description(&self) -> &'static str {
        "PLY of the INRIA trainer: full precision, any extra properties"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["ply"]
    }

    fn sniff(&self, head: &[u8], _file_len: u64) -> bool {
        Header::sniff(head)
    }

    fn read(&self, bytes: &[u8], name: &SourceName, _files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
        let header = Header::parse(bytes, name)?;
        let Some(index) = header.elements.iter().position(|e| e.name == "vertex") else {
            return Err(ReadError::malformed("the element `vertex`", "one record per Gaussian", "missing", name));
        };
        let schema = Schema::of(&header.elements[index], name)?;
        let mut report = ReadReport::default();
        let arrays = if header.encoding == Encoding::Ascii {
            decode::decode(&schema, &body::from_text(&header, bytes, index, name)?, Encoding::Little)
        } else {
            let parts = body::split(&header, bytes, index, name)?;
            report.trailing_bytes = parts.trailing;
            decode::decode(&schema, parts.records, header.encoding)
        };
        let source = Source::default();
        let cloud = Cloud::new(CloudArrays { source, ..arrays }).map_err(ReadError::cloud(name))?;
        Ok((cloud, report))
    }

    fn writable(&self) -> bool {
        false
    }

    fn lossy(&self) -> bool {
        false
    }

    fn write(&self, _: &Cloud, _: &WriteOptions, _: &mut dyn Write) -> Result<Written, WriteError> {
        Err(WriteError::ReadOnly { format: "ply", known: String::new() })
    }
}
