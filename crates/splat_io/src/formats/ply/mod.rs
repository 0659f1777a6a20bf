//! PLY as the INRIA trainer writes it (Kerbl et al. 2023), and everything near it.
//!
//! Properties are found by name, in any order and of any type; text, little and big endian; further properties become
//! extras, further elements are kept for the writer. [`Source::layout`](splat_core::Source) keeps what an untouched
//! cloud needs to be written bit for bit.

pub(crate) mod body;
pub(crate) mod comments;
mod decode;
mod encode;
mod filter;
pub(crate) mod header;
mod layout;
mod roles;

use std::io::Write;

use rayon::prelude::*;
use splat_core::{Cloud, CloudArrays, ExtraValues};

use self::header::{Encoding, Header, Scalar};
use self::layout::{Kept, Layout};
use self::roles::{Role, Schema};
use super::compressed_ply::CompressedPly;
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
        // A compressed PLY starts in the same way and is another format.
        Header::sniff(head) && !CompressedPly::has_packed_values(head)
    }

    fn read(&self, bytes: &[u8], name: &SourceName, _files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
        let header = Header::parse(bytes, name)?;
        let Some(index) = header.elements.iter().position(|e| e.name == "vertex") else {
            return Err(ReadError::malformed("the element `vertex`", "one record per Gaussian", "missing", name));
        };
        let schema = Schema::of(&header.elements[index], name)?;
        let mut report = ReadReport::default();
        let big = header.encoding == Encoding::Big;
        let mut layout = None;
        let mut arrays;
        if header.encoding == Encoding::Ascii {
            let records = body::from_text(&header, bytes, index, name)?;
            arrays = decode::decode(&schema, &records, Encoding::Little);
            fuse_filter(&schema, &records, false, &mut arrays);
            for element in header.elements.iter().filter(|e| e.name != "vertex") {
                report.notes.push(format!("the element `{}` of a text file is not kept", element.name));
            }
        } else {
            let parts = body::split(&header, bytes, index, name)?;
            report.trailing_bytes = parts.trailing;
            arrays = decode::decode(&schema, parts.records, header.encoding);
            fuse_filter(&schema, parts.records, big, &mut arrays);
            let kept: Vec<(usize, Vec<u8>)> =
                changed_fields(&schema).map(|i| (i, raw_column(&schema, parts.records, i))).collect();
            let kept = kept.iter().map(|(field, bytes)| Kept { field: *field, bytes }).collect();
            let header = &bytes[..header.len];
            layout = Some(Layout { header, before: parts.before, after: parts.after, kept }.to_bytes());
        }
        note(&schema, &mut report);
        drop_zero_normals(&mut arrays);
        arrays.source.format = "ply".to_owned();
        arrays.source.antialiased = comments::antialiased(&header.comments);
        arrays.source.comments = header.comments;
        arrays.source.layout = layout;
        Ok((Cloud::new(arrays).map_err(ReadError::cloud(name))?, report))
    }

    fn writable(&self) -> bool {
        true
    }

    fn lossy(&self) -> bool {
        false
    }

    fn write(&self, cloud: &Cloud, _: &WriteOptions, sink: &mut dyn Write) -> Result<Written, WriteError> {
        encode::write(cloud, sink)
    }
}

/// Fields whose values change on the way into the arrays, so that the file's own are kept for the writer.
fn changed_fields(schema: &Schema) -> impl Iterator<Item = usize> {
    let fused = schema.field(Role::Filter).is_some();
    schema.fields.iter().enumerate().filter_map(move |(i, field)| {
        let changed = match field.role {
            Role::Extra(_) => false,
            Role::Scale(_) | Role::Opacity | Role::Filter => fused || field.scalar != Scalar::F32,
            _ => field.scalar != Scalar::F32,
        };
        changed.then_some(i)
    })
}

fn raw_column(schema: &Schema, records: &[u8], field: usize) -> Vec<u8> {
    let field = &schema.fields[field];
    let size = field.scalar.size();
    let mut column = Vec::with_capacity(records.len() / schema.stride * size);
    for record in records.chunks_exact(schema.stride) {
        column.extend_from_slice(&record[field.offset..field.offset + size]);
    }
    column
}

fn fuse_filter(schema: &Schema, records: &[u8], big: bool, arrays: &mut CloudArrays) {
    if let Some(field) = schema.field(Role::Filter) {
        let strengths: Vec<f32> = records
            .chunks_exact(schema.stride)
            .map(|record| decode::to_f32(&record[field.offset..field.offset + field.scalar.size()], field.scalar, big))
            .collect();
        filter::fuse(&mut arrays.log_scales, &mut arrays.opacity_logits, &strengths);
    }
}

fn note(schema: &Schema, report: &mut ReadReport) {
    let notes = &mut report.notes;
    if schema.field(Role::Filter).is_some() {
        notes.push("the 3D filter of Mip-Splatting (`filter_3D`) was fused into scales and opacities".to_owned());
    }
    if schema.flat {
        notes.push("2D Gaussians (no `scale_2`): the third axis was made flat, exp(-13.8)".to_owned());
    }
    if schema.unused_rest > 0 {
        notes.push(format!(
            "{} properties `f_rest_*` beyond SH degree {} are not used; they are kept as extras",
            schema.unused_rest, schema.sh_degree
        ));
    }
}

/// The reference trainer writes normals that are all zero; the writer makes them again, so nobody needs to hold them.
fn drop_zero_normals(arrays: &mut CloudArrays) {
    let zero = |values: &ExtraValues| match values {
        ExtraValues::F32(v) => v.par_iter().with_min_len(1 << 16).all(|x| x.to_bits() == 0),
        _ => false,
    };
    let normals = arrays.extras.iter().filter(|e| is_normal(&e.name));
    if normals.clone().count() == 3 && normals.clone().all(|e| zero(&e.values)) {
        arrays.extras.retain(|e| !is_normal(&e.name));
    }
}

fn is_normal(name: &str) -> bool {
    matches!(name, "nx" | "ny" | "nz")
}
