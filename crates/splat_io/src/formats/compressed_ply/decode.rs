//! Packed words into arrays.

use glam::{Quat, Vec3};
use rayon::prelude::*;
use splat_core::{CloudArrays, sh};

use super::{CHUNK, CHUNK_NAMES, PACKED_NAMES, Table};
use crate::formats::ply::header::{Kind, Scalar};
use crate::formats::shared::logit_of_byte;
use crate::pages::zeroed_vec;
use crate::{ReadError, SourceName};

/// Gaussians decoded together: whole chunks.
const BLOCK: usize = 8 * CHUNK;

pub(super) struct Records<'a> {
    /// `ceil(n / 256)` rows.
    pub(super) chunks: Table<'a>,
    /// n rows.
    pub(super) packed: Table<'a>,
    /// n rows, if present.
    pub(super) sh: Option<Table<'a>>,
}

/// Ranges of a chunk's values.
struct Ranges {
    mean: [Vec3; 2],
    scale: [Vec3; 2],
    color: [Vec3; 2],
}

/// Decodes all Gaussians; row counts were checked.
pub(super) fn decode(records: &Records<'_>, name: &SourceName) -> Result<CloudArrays, ReadError> {
    let chunks = ranges(&records.chunks, name)?;
    let mut packed = [0; 4];
    for (offset, property) in packed.iter_mut().zip(PACKED_NAMES) {
        *offset = records.packed.offset(property, Scalar::U32, name)?;
    }
    let stride = records.packed.stride;
    let count = records.packed.records.len() / stride;
    let rest = match &records.sh {
        Some(table) => rest_offsets(table, name)?,
        None => Vec::new(),
    };
    let per_gaussian = 3 + rest.len();
    let sh_degree = (0..=sh::MAX_DEGREE).find(|&d| 3 * sh::coefficient_count(d) == per_gaussian).unwrap_or(0);
    let mut arrays = CloudArrays {
        means: zeroed_vec::<Vec3>(count),
        log_scales: zeroed_vec::<Vec3>(count),
        rotations: zeroed_vec::<Quat>(count),
        opacity_logits: zeroed_vec::<f32>(count),
        sh_degree,
        sh: zeroed_vec::<f32>(count * per_gaussian),
        ..CloudArrays::default()
    };
    let logits = logit_of_byte();
    let coefficients: [f32; 256] = std::array::from_fn(|b| match b {
        0 => -4.0,
        255 => 4.0,
        b => ((b as f32 + 0.5) / 256.0 - 0.5) * 8.0,
    });
    let columns = (
        arrays.means.par_chunks_mut(BLOCK),
        arrays.log_scales.par_chunks_mut(BLOCK),
        arrays.rotations.par_chunks_mut(BLOCK),
        arrays.opacity_logits.par_chunks_mut(BLOCK),
        arrays.sh.par_chunks_mut(BLOCK * per_gaussian),
        records.packed.records.par_chunks(BLOCK * stride),
        chunks.par_chunks(BLOCK / CHUNK),
    );
    columns.into_par_iter().enumerate().for_each(|(block, (means, scales, rotations, opacities, sh, rows, chunks))| {
        for (i, row) in rows.chunks_exact(stride).enumerate() {
            let word = |k: usize| {
                let bytes = &row[packed[k]..packed[k] + 4];
                u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
            };
            let ranges = &chunks[i / CHUNK];
            means[i] = lerp(ranges.mean, unpack_11_10_11(word(0)));
            scales[i] = lerp(ranges.scale, unpack_11_10_11(word(2)));
            rotations[i] = unpack_rotation(word(1));
            let [r, g, b, a] = word(3).to_be_bytes();
            let color = lerp(ranges.color, Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0);
            let constant = (color - 0.5) / sh::C0;
            sh[i * per_gaussian..i * per_gaussian + 3].copy_from_slice(&constant.to_array());
            opacities[i] = logits[usize::from(a)];
        }
        if let Some(table) = &records.sh {
            let rows = table.records[block * BLOCK * table.stride..].chunks_exact(table.stride);
            for (row, out) in rows.zip(sh.chunks_exact_mut(per_gaussian)) {
                for (out, &offset) in out[3..].iter_mut().zip(&rest) {
                    *out = coefficients[usize::from(row[offset])];
                }
            }
        }
    });
    Ok(arrays)
}

fn ranges(table: &Table<'_>, name: &SourceName) -> Result<Vec<Ranges>, ReadError> {
    let mut offsets = [0; 18];
    // Without a colour range the packed colour is the colour itself.
    let colored = table.element.has("min_r");
    let names = &CHUNK_NAMES[..if colored { 18 } else { 12 }];
    for (offset, property) in offsets.iter_mut().zip(names) {
        *offset = table.offset(property, Scalar::F32, name)?;
    }
    let ranges = table.records.chunks_exact(table.stride.max(1)).map(|row| {
        let f = |k: usize| {
            let bytes = &row[offsets[k]..offsets[k] + 4];
            f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
        };
        let v = |k: usize| Vec3::new(f(k), f(k + 1), f(k + 2));
        let color = if colored { [v(12), v(15)] } else { [Vec3::ZERO, Vec3::ONE] };
        Ranges { mean: [v(0), v(3)], scale: [v(6), v(9)], color }
    });
    Ok(ranges.collect())
}

/// Place in a row of every SH value beyond the constant ones, in the order of the arrays.
fn rest_offsets(table: &Table<'_>, name: &SourceName) -> Result<Vec<usize>, ReadError> {
    let count = table.element.properties.iter().filter(|p| p.kind == Kind::One(Scalar::U8)).count();
    let k = count / 3;
    if count != table.element.properties.len() || ![9, 24, 45, 72].contains(&count) {
        let what = "the number of properties of `sh`";
        return Err(ReadError::malformed(what, "9, 24, 45 or 72 of type uchar", count.to_string(), name));
    }
    (0..count).map(|i| table.offset(&format!("f_rest_{}", i % 3 * k + i / 3), Scalar::U8, name)).collect()
}

fn lerp([low, high]: [Vec3; 2], t: Vec3) -> Vec3 {
    low * (Vec3::ONE - t) + high * t
}

fn unpack_11_10_11(word: u32) -> Vec3 {
    Vec3::new((word >> 21) as f32 / 2047.0, (word >> 11 & 1023) as f32 / 1023.0, (word & 2047) as f32 / 2047.0)
}

fn unpack_rotation(word: u32) -> Quat {
    let part = |shift: u32| ((word >> shift & 1023) as f32 / 1023.0 - 0.5) * std::f32::consts::SQRT_2;
    let (a, b, c) = (part(20), part(10), part(0));
    let m = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
    // The components are in the file's order: w, x, y, z.
    let [w, x, y, z] = match word >> 30 {
        0 => [m, a, b, c],
        1 => [a, m, b, c],
        2 => [a, b, m, c],
        _ => [a, b, c, m],
    };
    Quat::from_xyzw(x, y, z, w)
}
