//! PlayCanvas' compressed PLY: 16 bytes a Gaussian within the boxes of chunks of 256, and a byte per SH coefficient.

mod decode;
mod encode;

use std::io::Write;

use splat_core::Cloud;

use super::ply::body;
use super::ply::comments;
use super::ply::header::{Element, Encoding, Header, Kind, Scalar};
use crate::format::{Format, ReadReport, Siblings, WriteOptions, Written};
use crate::{ReadError, SourceName, WriteError};

/// Gaussians that share a chunk's box.
const CHUNK: usize = 256;
/// Properties of a chunk, in the order in which they are written; the last six are absent from old files.
const CHUNK_NAMES: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];
/// Properties of a Gaussian.
const PACKED_NAMES: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

/// PLY in chunks, as PlayCanvas' tools write it.
#[derive(Clone, Copy, Debug)]
pub struct CompressedPly;

impl Format for CompressedPly {
    fn name(&self) -> &'static str {
        "compressed-ply"
    }

    fn description(&self) -> &'static str {
        "compressed PLY of PlayCanvas: about 16 bytes a Gaussian, in Morton order"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["compressed.ply"]
    }

    fn sniff(&self, head: &[u8], _file_len: u64) -> bool {
        Header::sniff(head) && Self::has_packed_values(head)
    }

    fn read(&self, bytes: &[u8], name: &SourceName, _files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
        let header = Header::parse(bytes, name)?;
        if header.encoding != Encoding::Little {
            return Err(ReadError::unsupported(
                "a compressed PLY that is not binary_little_endian",
                "write it again",
                name,
            ));
        }
        let find = |element: &str| header.elements.iter().position(|e| e.name == element);
        let missing =
            |element: &str| ReadError::malformed(format!("the element `{element}`"), "present", "missing", name);
        let chunk = find("chunk").ok_or_else(|| missing("chunk"))?;
        let vertex = find("vertex").ok_or_else(|| missing("vertex"))?;
        let part = |index: usize| body::split(&header, bytes, index, name);
        let count = header.elements[vertex].count;
        let expect_rows = |element: &Element, rows: u64| {
            if element.count == rows {
                return Ok(());
            }
            let what = format!("the number of rows of `{}` for {count} Gaussians", element.name);
            Err(ReadError::malformed(what, rows.to_string(), element.count.to_string(), name))
        };
        expect_rows(&header.elements[chunk], count.div_ceil(CHUNK as u64))?;
        let records = decode::Records {
            chunks: Table::of(&header.elements[chunk], part(chunk)?.records),
            packed: Table::of(&header.elements[vertex], part(vertex)?.records),
            sh: match find("sh") {
                Some(sh) => {
                    expect_rows(&header.elements[sh], count)?;
                    Some(Table::of(&header.elements[sh], part(sh)?.records))
                }
                None => None,
            },
        };
        let mut arrays = decode::decode(&records, name)?;
        arrays.source.format = self.name().to_owned();
        arrays.source.antialiased = comments::antialiased(&header.comments);
        arrays.source.comments = header.comments.clone();
        let report = ReadReport { trailing_bytes: part(vertex)?.trailing, ..ReadReport::default() };
        Ok((Cloud::new(arrays).map_err(ReadError::cloud(name))?, report))
    }

    fn writable(&self) -> bool {
        true
    }

    fn lossy(&self) -> bool {
        true
    }

    fn write(&self, cloud: &Cloud, _: &WriteOptions, sink: &mut dyn Write) -> Result<Written, WriteError> {
        encode::write(cloud, sink)
    }
}

impl CompressedPly {
    /// Whether a PLY header names packed values.
    pub(super) fn has_packed_values(head: &[u8]) -> bool {
        let text = &head[..head.len().min(8192)];
        text.windows(16).any(|w| w == b" packed_position")
    }
}

/// The records of an element whose properties all have one size.
struct Table<'a> {
    element: &'a Element,
    records: &'a [u8],
    stride: usize,
}

impl<'a> Table<'a> {
    fn of(element: &'a Element, records: &'a [u8]) -> Self {
        Self { element, records, stride: element.stride().unwrap_or(0) }
    }

    /// Offset of a property within a record.
    fn offset(&self, property: &str, scalar: Scalar, name: &SourceName) -> Result<usize, ReadError> {
        let mut offset = 0;
        for p in &self.element.properties {
            if p.name == property && p.kind == Kind::One(scalar) {
                return Ok(offset);
            }
            offset += match p.kind {
                Kind::One(scalar) => scalar.size(),
                Kind::List { .. } => break,
            };
        }
        let what = format!("property `{property}` of `{}`", self.element.name);
        Err(ReadError::malformed(what, format!("a {}", scalar.word()), "missing or of another type", name))
    }
}
