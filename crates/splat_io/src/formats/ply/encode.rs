//! Arrays into records of a PLY file, column by column in blocks that stay in the cache.

use std::io::Write;

use glam::Vec3;
use rayon::prelude::*;
use splat_core::{Cloud, ExtraValues, sh};

use super::comments;
use super::decode::{FLAT_LOG_SCALE, to_f32};
use super::filter::fuse_one;
use super::header::{Element, Encoding, Header, Kind, Property, Scalar};
use super::layout::Layout;
use super::roles::{Role, Schema};
use crate::format::Written;
use crate::{SourceName, WriteError};

/// Records of a block: its bytes stay in the second-level cache while all columns pass over them.
const BLOCK: usize = 512;
/// Blocks filled together before they are written.
const BLOCKS: usize = 64;

/// A column of the file to be written.
struct Column<'a> {
    name: String,
    scalar: Scalar,
    values: Values<'a>,
}

/// Where a column's values come from.
enum Values<'a> {
    Role(Role),
    /// An extra property of the cloud, by position.
    Extra(usize),
    /// Raw bytes, in the file's byte order.
    Raw(&'a [u8]),
    Zero,
}

/// Everything decided before the first byte is written.
struct Plan<'a> {
    header: Vec<u8>,
    before: &'a [u8],
    columns: Vec<Column<'a>>,
    after: &'a [u8],
    big: bool,
}

/// Writes a cloud; an untouched one that came from a binary PLY file equals that file.
pub(super) fn write(cloud: &Cloud, sink: &mut dyn Write) -> Result<Written, WriteError> {
    let mut losses = Vec::new();
    let layout = cloud.source().layout.as_deref().and_then(Layout::parse);
    let plan = layout.and_then(|l| as_before(cloud, &l, &mut losses)).unwrap_or_else(|| afresh(cloud, &mut losses));
    sink.write_all(&plan.header)?;
    sink.write_all(plan.before)?;
    let stride: usize = plan.columns.iter().map(|c| c.scalar.size()).sum();
    let mut buffer = vec![0; stride * BLOCK * BLOCKS.min(cloud.len().div_ceil(BLOCK))];
    for start in (0..cloud.len()).step_by(BLOCK * BLOCKS) {
        let records = (cloud.len() - start).min(BLOCK * BLOCKS);
        let bytes = &mut buffer[..records * stride];
        bytes.par_chunks_mut(BLOCK * stride).enumerate().for_each(|(block, out)| {
            let first = start + block * BLOCK;
            let mut offset = 0;
            for column in &plan.columns {
                fill(out, stride, offset, column, cloud, first, plan.big);
                offset += column.scalar.size();
            }
        });
        sink.write_all(bytes)?;
    }
    sink.write_all(plan.after)?;
    let bytes = plan.header.len() + plan.before.len() + stride * cloud.len() + plan.after.len();
    Ok(Written { bytes: bytes as u64, losses, order: None })
}

/// The plan of a cloud whose file is remembered: same properties in the same order; `None` if the cloud has others now.
fn as_before<'a>(cloud: &Cloud, layout: &Layout<'a>, losses: &mut Vec<String>) -> Option<Plan<'a>> {
    let name = SourceName::from("layout");
    let mut header = Header::parse(layout.header, &name).ok()?;
    let vertex = header.elements.iter().position(|e| e.name == "vertex")?;
    let schema = Schema::of(&header.elements[vertex], &name).ok()?;
    let flat_still = !schema.flat || cloud.log_scales().iter().all(|s| s.z.to_bits() == FLAT_LOG_SCALE.to_bits());
    if schema.sh_degree != cloud.sh_degree() || !flat_still || header.encoding == Encoding::Ascii {
        return None;
    }
    let big = header.encoding == Encoding::Big;
    let same_count = header.elements[vertex].count == cloud.len() as u64;
    let kept = |i: usize| layout.kept.iter().find(|k| k.field == i).map(|k| k.bytes);
    let keeps = same_count && kept_values_hold(cloud, &schema, &kept, big);
    let mut extras = 0;
    let mut changed = !same_count;
    let mut columns = Vec::with_capacity(schema.fields.len());
    for (i, field) in schema.fields.iter().enumerate() {
        let column = |scalar, values| Column { name: field.name.clone(), scalar, values };
        if let Role::Extra(_) = field.role {
            let extra = cloud.extras().get(extras).filter(|e| e.name == field.name);
            match extra {
                Some(extra) if scalar_of(&extra.values) == Some(field.scalar) => {
                    columns.push(column(field.scalar, Values::Extra(extras)));
                    extras += 1;
                }
                None if super::is_normal(&field.name) && field.scalar == Scalar::F32 => {
                    columns.push(column(Scalar::F32, Values::Zero));
                }
                _ => return None,
            }
        } else if let Some(raw) = kept(i) {
            if keeps {
                columns.push(column(field.scalar, Values::Raw(raw)));
            } else {
                changed = true;
                // The filter is part of scales and opacities now.
                if field.role != Role::Filter {
                    columns.push(column(Scalar::F32, Values::Role(field.role)));
                }
            }
        } else if field.scalar == Scalar::F32 {
            columns.push(column(Scalar::F32, Values::Role(field.role)));
        } else {
            return None;
        }
    }
    if extras != cloud.extras().len() {
        return None;
    }
    let comments = comments::to_write(cloud.source());
    changed |= comments != header.comments;
    if !changed {
        let (before, after) = (layout.before, layout.after);
        return Some(Plan { header: layout.header.to_vec(), before, columns, after, big });
    }
    header.comments = comments;
    let (mut before, mut after) = (layout.before, layout.after);
    if !same_count {
        if header.elements.len() > 1 {
            losses
                .push("the file's other elements were left out: they belong to another number of Gaussians".to_owned());
        }
        (before, after) = (&[], &[]);
        header.elements.retain(|e| e.name == "vertex");
    }
    if let Some(vertex) = header.elements.iter_mut().find(|e| e.name == "vertex") {
        *vertex = element(cloud.len(), &columns);
    }
    Some(Plan { header: header.to_text(), before, columns, after, big })
}

/// Whether the raw columns still give the values of the cloud.
fn kept_values_hold<'a>(
    cloud: &Cloud,
    schema: &Schema,
    kept: &(impl Fn(usize) -> Option<&'a [u8]> + Sync),
    big: bool,
) -> bool {
    let fields: Vec<(Role, Scalar, &[u8])> =
        schema.fields.iter().enumerate().filter_map(|(i, f)| kept(i).map(|bytes| (f.role, f.scalar, bytes))).collect();
    if fields.iter().any(|(_, scalar, bytes)| bytes.len() != cloud.len() * scalar.size()) {
        return false;
    }
    let raw = |i: usize, role: Role| {
        let (_, scalar, bytes) = fields.iter().find(|f| f.0 == role)?;
        let size = scalar.size();
        Some(to_f32(&bytes[i * size..][..size], *scalar, big))
    };
    (0..cloud.len()).into_par_iter().with_min_len(4096).all(|i| {
        let current = |role: Role| value(cloud, i, role);
        let same = |a: f32, b: f32| a.to_bits() == b.to_bits();
        let fused = raw(i, Role::Filter).and_then(|filter| {
            let scale = Vec3::new(raw(i, Role::Scale(0))?, raw(i, Role::Scale(1))?, raw(i, Role::Scale(2))?);
            Some(fuse_one(scale, raw(i, Role::Opacity)?, filter))
        });
        fields.iter().all(|&(role, ..)| match (role, fused) {
            (Role::Filter, _) => true,
            (Role::Scale(axis), Some((scale, _))) => same(scale[axis], current(role)),
            (Role::Opacity, Some((_, logit))) => same(logit, current(role)),
            _ => raw(i, role).is_some_and(|v| same(v, current(role))),
        })
    })
}

/// The plan of any other cloud: the order of the reference trainer, normals (zero) included, because some old viewers
/// find values by place.
fn afresh(cloud: &Cloud, losses: &mut Vec<String>) -> Plan<'static> {
    let mut columns: Vec<Column<'static>> = Vec::new();
    let mut add = |name: String, scalar, values| columns.push(Column { name, scalar, values });
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        add(name.to_owned(), Scalar::F32, Values::Role(Role::Mean(axis)));
    }
    for name in ["nx", "ny", "nz"] {
        match cloud.extras().iter().position(|e| e.name == name) {
            Some(i) => {
                add(name.to_owned(), scalar_of(&cloud.extras()[i].values).unwrap_or(Scalar::F32), Values::Extra(i))
            }
            None => add(name.to_owned(), Scalar::F32, Values::Zero),
        }
    }
    for i in 0..3 {
        add(format!("f_dc_{i}"), Scalar::F32, Values::Role(Role::Sh(i)));
    }
    let k = sh::coefficient_count(cloud.sh_degree()) - 1;
    for i in 0..3 * k {
        add(format!("f_rest_{i}"), Scalar::F32, Values::Role(Role::Sh(3 * (i % k + 1) + i / k)));
    }
    add("opacity".to_owned(), Scalar::F32, Values::Role(Role::Opacity));
    for i in 0..3 {
        add(format!("scale_{i}"), Scalar::F32, Values::Role(Role::Scale(i)));
    }
    for i in 0..4 {
        add(format!("rot_{i}"), Scalar::F32, Values::Role(Role::Rotation((i + 3) % 4)));
    }
    for (i, extra) in cloud.extras().iter().enumerate() {
        if super::is_normal(&extra.name) {
            continue;
        }
        let taken = columns.iter().any(|c| c.name == extra.name) || extra.name.starts_with("f_rest_");
        let sound = !extra.name.is_empty() && !extra.name.contains(|c: char| c.is_ascii_whitespace());
        match scalar_of(&extra.values) {
            // A second reading would apply the filter a second time.
            Some(scalar) if sound && !taken && extra.name != "filter_3D" => {
                columns.push(Column { name: extra.name.clone(), scalar, values: Values::Extra(i) });
            }
            _ => losses.push(format!("the extra property `{}` was left out: its name cannot be used here", extra.name)),
        }
    }
    let header = Header {
        encoding: Encoding::Little,
        elements: vec![element(cloud.len(), &columns)],
        comments: comments::to_write(cloud.source()),
        len: 0,
    };
    Plan { header: header.to_text(), before: &[], columns, after: &[], big: false }
}

fn element(count: usize, columns: &[Column<'_>]) -> Element {
    let properties = columns.iter().map(|c| Property { name: c.name.clone(), kind: Kind::One(c.scalar) }).collect();
    Element { name: "vertex".to_owned(), count: count as u64, properties }
}

fn scalar_of(values: &ExtraValues) -> Option<Scalar> {
    Some(match values {
        ExtraValues::I8(_) => Scalar::I8,
        ExtraValues::U8(_) => Scalar::U8,
        ExtraValues::I16(_) => Scalar::I16,
        ExtraValues::U16(_) => Scalar::U16,
        ExtraValues::I32(_) => Scalar::I32,
        ExtraValues::U32(_) => Scalar::U32,
        ExtraValues::F32(_) => Scalar::F32,
        ExtraValues::F64(_) => Scalar::F64,
        _ => return None,
    })
}

/// A standard value of Gaussian `i`.
fn value(cloud: &Cloud, i: usize, role: Role) -> f32 {
    match role {
        Role::Mean(axis) => cloud.means()[i][axis],
        Role::Scale(axis) => cloud.log_scales()[i][axis],
        Role::Rotation(axis) => cloud.rotations()[i].to_array()[axis],
        Role::Opacity => cloud.opacity_logits()[i],
        Role::Sh(at) => cloud.sh_of(i)[at],
        Role::Filter | Role::Extra(_) => 0.0,
    }
}

/// Writes one column of the records `first..` into a block.
fn fill(out: &mut [u8], stride: usize, offset: usize, column: &Column<'_>, cloud: &Cloud, first: usize, big: bool) {
    let count = out.len() / stride;
    let range = first..first + count;
    let mut put = Put { out, stride, offset, big };
    match column.values {
        Values::Zero => put.column(range.map(|_| [0; 4])),
        Values::Raw(bytes) => {
            let size = column.scalar.size();
            let places = put.out.chunks_exact_mut(stride).map(|r| &mut r[offset..offset + size]);
            for (place, raw) in places.zip(bytes[first * size..].chunks_exact(size)) {
                place.copy_from_slice(raw);
            }
        }
        Values::Role(role) => match role {
            Role::Mean(axis) => put.column(cloud.means()[range].iter().map(|v| v[axis].to_le_bytes())),
            Role::Scale(axis) => put.column(cloud.log_scales()[range].iter().map(|v| v[axis].to_le_bytes())),
            Role::Rotation(axis) => {
                put.column(cloud.rotations()[range].iter().map(|v| v.to_array()[axis].to_le_bytes()));
            }
            Role::Opacity => put.column(cloud.opacity_logits()[range].iter().map(|v| v.to_le_bytes())),
            Role::Sh(at) => {
                let per_gaussian = cloud.sh_stride();
                let rows = cloud.sh()[range.start * per_gaussian..range.end * per_gaussian].chunks_exact(per_gaussian);
                put.column(rows.map(|row| row[at].to_le_bytes()));
            }
            Role::Filter | Role::Extra(_) => {}
        },
        Values::Extra(i) => match &cloud.extras()[i].values {
            ExtraValues::I8(v) => put.column(v[range].iter().map(|v| v.to_le_bytes())),
            ExtraValues::U8(v) => put.column(v[range].iter().map(|v| v.to_le_bytes())),
            ExtraValues::I16(v) => put.column(v[range].iter().map(|v| v.to_le_bytes())),
            ExtraValues::U16(v) => put.column(v[range].iter().map(|v| v.to_le_bytes())),
            ExtraValues::I32(v) => put.column(v[range].iter().map(|v| v.to_le_bytes())),
            ExtraValues::U32(v) => put.column(v[range].iter().map(|v| v.to_le_bytes())),
            ExtraValues::F32(v) => put.column(v[range].iter().map(|v| v.to_le_bytes())),
            ExtraValues::F64(v) => put.column(v[range].iter().map(|v| v.to_le_bytes())),
            _ => {}
        },
    }
}

struct Put<'a> {
    out: &'a mut [u8],
    stride: usize,
    offset: usize,
    big: bool,
}

impl Put<'_> {
    fn column<const N: usize>(&mut self, values: impl Iterator<Item = [u8; N]>) {
        let places = self.out.chunks_exact_mut(self.stride).map(|r| &mut r[self.offset..self.offset + N]);
        if self.big {
            for (place, mut value) in places.zip(values) {
                value.reverse();
                place.copy_from_slice(&value);
            }
        } else {
            for (place, value) in places.zip(values) {
                place.copy_from_slice(&value);
            }
        }
    }
}
