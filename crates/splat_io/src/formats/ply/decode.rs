//! Records of a binary PLY file into arrays, in parallel blocks.

use glam::{Quat, Vec3};
use rayon::prelude::*;
use splat_core::{CloudArrays, ExtraProperty, ExtraValues, sh};

use super::header::{Encoding, Scalar};
use super::roles::{Role, Schema};
use crate::pages::zeroed_vec;

/// Records of a block: small enough for the second-level cache, large enough to hide the scheduling.
const BLOCK: usize = 2048;

/// What log scale the missing third axis of a surfel gets: ln(1e-6), flat for every scene in metres.
pub(super) const FLAT_LOG_SCALE: f32 = -13.815_511;

/// Decodes whole records. `records` holds a multiple of the schema's stride.
pub(super) fn decode(schema: &Schema, records: &[u8], encoding: Encoding) -> CloudArrays {
    let count = records.len().checked_div(schema.stride).unwrap_or(0);
    let per_gaussian = 3 * sh::coefficient_count(schema.sh_degree);
    // Zeroed memory comes from the kernel untouched, so that every page is written once, by the thread that fills it.
    let mut arrays = CloudArrays {
        means: zeroed_vec::<Vec3>(count),
        log_scales: zeroed_vec::<Vec3>(count),
        rotations: zeroed_vec::<Quat>(count),
        opacity_logits: zeroed_vec::<f32>(count),
        sh_degree: schema.sh_degree,
        sh: zeroed_vec::<f32>(count * per_gaussian),
        extras: extras(schema, count),
        ..CloudArrays::default()
    };
    let words = Words::of(schema, encoding);
    let mut columns: Vec<_> = arrays.extras.iter_mut().map(|e| blocks_of(&mut e.values)).collect();
    let mut blocks: Vec<Block> = Vec::with_capacity(count.div_ceil(BLOCK));
    let mut means = arrays.means.chunks_mut(BLOCK);
    let mut log_scales = arrays.log_scales.chunks_mut(BLOCK);
    let mut rotations = arrays.rotations.chunks_mut(BLOCK);
    let mut opacity_logits = arrays.opacity_logits.chunks_mut(BLOCK);
    let mut sh = arrays.sh.chunks_mut(BLOCK * per_gaussian);
    for records in records.chunks(BLOCK * schema.stride.max(1)) {
        let parts = (means.next(), log_scales.next(), rotations.next(), opacity_logits.next(), sh.next());
        let (Some(means), Some(log_scales), Some(rotations), Some(opacity_logits), Some(sh)) = parts else { break };
        let extras = columns.iter_mut().filter_map(Iterator::next).collect();
        blocks.push(Block { records, means, log_scales, rotations, opacity_logits, sh, extras });
    }
    blocks.into_par_iter().for_each(|mut block| match &words {
        Some(words) => fast(&mut block, words, schema),
        None => slow(&mut block, schema, encoding == Encoding::Big),
    });
    arrays
}

/// Arrays for the properties beyond the standard ones.
fn extras(schema: &Schema, count: usize) -> Vec<ExtraProperty> {
    let extras = schema.fields.iter().filter(|f| matches!(f.role, Role::Extra(_)));
    extras
        .map(|f| ExtraProperty {
            name: f.name.clone(),
            values: match f.scalar {
                Scalar::I8 => ExtraValues::I8(zeroed_vec(count)),
                Scalar::U8 => ExtraValues::U8(zeroed_vec(count)),
                Scalar::I16 => ExtraValues::I16(zeroed_vec(count)),
                Scalar::U16 => ExtraValues::U16(zeroed_vec(count)),
                Scalar::I32 => ExtraValues::I32(zeroed_vec(count)),
                Scalar::U32 => ExtraValues::U32(zeroed_vec(count)),
                Scalar::F32 => ExtraValues::F32(zeroed_vec(count)),
                Scalar::F64 => ExtraValues::F64(zeroed_vec(count)),
            },
        })
        .collect()
}

/// A part of an extra property's values.
enum ColumnMut<'a> {
    I8(&'a mut [i8]),
    U8(&'a mut [u8]),
    I16(&'a mut [i16]),
    U16(&'a mut [u16]),
    I32(&'a mut [i32]),
    U32(&'a mut [u32]),
    F32(&'a mut [f32]),
    F64(&'a mut [f64]),
}

fn blocks_of(values: &mut ExtraValues) -> std::vec::IntoIter<ColumnMut<'_>> {
    let columns: Vec<ColumnMut<'_>> = match values {
        ExtraValues::I8(v) => v.chunks_mut(BLOCK).map(ColumnMut::I8).collect(),
        ExtraValues::U8(v) => v.chunks_mut(BLOCK).map(ColumnMut::U8).collect(),
        ExtraValues::I16(v) => v.chunks_mut(BLOCK).map(ColumnMut::I16).collect(),
        ExtraValues::U16(v) => v.chunks_mut(BLOCK).map(ColumnMut::U16).collect(),
        ExtraValues::I32(v) => v.chunks_mut(BLOCK).map(ColumnMut::I32).collect(),
        ExtraValues::U32(v) => v.chunks_mut(BLOCK).map(ColumnMut::U32).collect(),
        ExtraValues::F32(v) => v.chunks_mut(BLOCK).map(ColumnMut::F32).collect(),
        ExtraValues::F64(v) => v.chunks_mut(BLOCK).map(ColumnMut::F64).collect(),
        // The enum is open to additions; `extras` above makes none of them.
        _ => Vec::new(),
    };
    columns.into_iter()
}

/// The parts of all arrays that one run of records fills.
struct Block<'a> {
    records: &'a [u8],
    means: &'a mut [Vec3],
    log_scales: &'a mut [Vec3],
    rotations: &'a mut [Quat],
    opacity_logits: &'a mut [f32],
    sh: &'a mut [f32],
    extras: Vec<ColumnMut<'a>>,
}

/// Places of the values in records of little-endian floats, in words of 4 bytes.
struct Words {
    mean: [usize; 3],
    scale: [usize; 3],
    rotation: [usize; 4],
    opacity: usize,
    constant: [usize; 3],
    /// First of the `f_rest` where they lie together in the usual order.
    rest: Option<usize>,
    /// Place of every SH value otherwise.
    sh: Vec<usize>,
    extras: Vec<usize>,
}

impl Words {
    fn of(schema: &Schema, encoding: Encoding) -> Option<Self> {
        if encoding != Encoding::Little || schema.flat || schema.fields.iter().any(|f| f.scalar != Scalar::F32) {
            return None;
        }
        let word = |role: Role| schema.field(role).map(|f| f.offset / 4);
        let values = 3 * sh::coefficient_count(schema.sh_degree);
        let sh: Vec<usize> = (0..values).map_while(|i| word(Role::Sh(i))).collect();
        if sh.len() != values {
            return None;
        }
        let k = values / 3 - 1;
        let together = (0..3 * k).all(|i| sh[3 * (i % k + 1) + i / k] == sh[3] + i);
        let extras = (0..schema.extra_count()).map_while(|i| word(Role::Extra(i))).collect();
        Some(Self {
            mean: [word(Role::Mean(0))?, word(Role::Mean(1))?, word(Role::Mean(2))?],
            scale: [word(Role::Scale(0))?, word(Role::Scale(1))?, word(Role::Scale(2))?],
            rotation: [
                word(Role::Rotation(0))?,
                word(Role::Rotation(1))?,
                word(Role::Rotation(2))?,
                word(Role::Rotation(3))?,
            ],
            opacity: word(Role::Opacity)?,
            constant: [sh[0], sh[1], sh[2]],
            rest: (k > 0 && together).then(|| sh[3]),
            sh,
            extras,
        })
    }
}

/// Records of little-endian floats.
fn fast(block: &mut Block<'_>, words: &Words, schema: &Schema) {
    match (schema.sh_degree, words.rest) {
        (1, Some(rest)) => fast_sh::<3>(block, words, schema.stride, rest),
        (2, Some(rest)) => fast_sh::<8>(block, words, schema.stride, rest),
        (3, Some(rest)) => fast_sh::<15>(block, words, schema.stride, rest),
        (4, Some(rest)) => fast_sh::<24>(block, words, schema.stride, rest),
        _ => {
            let per_gaussian = words.sh.len();
            for (record, out) in block.records.chunks_exact(schema.stride).zip(block.sh.chunks_exact_mut(per_gaussian))
            {
                let record = record.as_chunks::<4>().0;
                for (out, &word) in out.iter_mut().zip(&words.sh) {
                    *out = f32::from_le_bytes(record[word]);
                }
            }
            fast_rest(block, words, schema.stride);
        }
    }
}

/// SH with `K` coefficients per channel beyond the constant one, channel after channel.
fn fast_sh<const K: usize>(block: &mut Block<'_>, words: &Words, stride: usize, rest: usize) {
    for (record, out) in block.records.chunks_exact(stride).zip(block.sh.chunks_exact_mut(3 * (K + 1))) {
        let record = record.as_chunks::<4>().0;
        let f = |word: usize| f32::from_le_bytes(record[word]);
        for (out, &word) in out.iter_mut().zip(&words.constant) {
            *out = f(word);
        }
        let rest = &record[rest..rest + 3 * K];
        let (red, rest) = rest.split_at(K);
        let (green, blue) = rest.split_at(K);
        for (((out, r), g), b) in out[3..].as_chunks_mut::<3>().0.iter_mut().zip(red).zip(green).zip(blue) {
            *out = [f32::from_le_bytes(*r), f32::from_le_bytes(*g), f32::from_le_bytes(*b)];
        }
    }
    fast_rest(block, words, stride);
}

/// All but SH.
fn fast_rest(block: &mut Block<'_>, words: &Words, stride: usize) {
    let outs =
        block.means.iter_mut().zip(&mut *block.log_scales).zip(&mut *block.rotations).zip(&mut *block.opacity_logits);
    for (record, (((mean, scale), rotation), opacity)) in block.records.chunks_exact(stride).zip(outs) {
        let record = record.as_chunks::<4>().0;
        let f = |word: usize| f32::from_le_bytes(record[word]);
        *mean = Vec3::new(f(words.mean[0]), f(words.mean[1]), f(words.mean[2]));
        *scale = Vec3::new(f(words.scale[0]), f(words.scale[1]), f(words.scale[2]));
        let r = &words.rotation;
        *rotation = Quat::from_xyzw(f(r[0]), f(r[1]), f(r[2]), f(r[3]));
        *opacity = f(words.opacity);
    }
    for (column, &word) in block.extras.iter_mut().zip(&words.extras) {
        let ColumnMut::F32(column) = column else { continue };
        for (record, out) in block.records.chunks_exact(stride).zip(column.iter_mut()) {
            *out = f32::from_le_bytes(record.as_chunks::<4>().0[word]);
        }
    }
}

/// Records of any types, value by value.
fn slow(block: &mut Block<'_>, schema: &Schema, big: bool) {
    let per_gaussian = 3 * sh::coefficient_count(schema.sh_degree);
    for (i, record) in block.records.chunks_exact(schema.stride).enumerate() {
        if schema.flat {
            block.log_scales[i].z = FLAT_LOG_SCALE;
        }
        for field in &schema.fields {
            let bytes = &record[field.offset..field.offset + field.scalar.size()];
            let value = || to_f32(bytes, field.scalar, big);
            match field.role {
                Role::Mean(axis) => block.means[i][axis] = value(),
                Role::Scale(axis) => block.log_scales[i][axis] = value(),
                Role::Rotation(axis) => {
                    let mut q = block.rotations[i].to_array();
                    q[axis] = value();
                    block.rotations[i] = Quat::from_array(q);
                }
                Role::Opacity => block.opacity_logits[i] = value(),
                Role::Sh(at) => block.sh[i * per_gaussian + at] = value(),
                Role::Filter => {}
                Role::Extra(n) => store(&mut block.extras[n], i, bytes, big),
            }
        }
    }
}

/// A value of any type as a float; floats keep their bits, NaN payloads included.
pub(super) fn to_f32(bytes: &[u8], scalar: Scalar, big: bool) -> f32 {
    match scalar {
        Scalar::I8 => f32::from(i8::from_le_bytes(take(bytes, big))),
        Scalar::U8 => f32::from(u8::from_le_bytes(take(bytes, big))),
        Scalar::I16 => f32::from(i16::from_le_bytes(take(bytes, big))),
        Scalar::U16 => f32::from(u16::from_le_bytes(take(bytes, big))),
        Scalar::I32 => i32::from_le_bytes(take(bytes, big)) as f32,
        Scalar::U32 => u32::from_le_bytes(take(bytes, big)) as f32,
        Scalar::F32 => f32::from_le_bytes(take(bytes, big)),
        Scalar::F64 => f64::from_le_bytes(take(bytes, big)) as f32,
    }
}

fn store(column: &mut ColumnMut<'_>, i: usize, bytes: &[u8], big: bool) {
    match column {
        ColumnMut::I8(v) => v[i] = i8::from_le_bytes(take(bytes, big)),
        ColumnMut::U8(v) => v[i] = u8::from_le_bytes(take(bytes, big)),
        ColumnMut::I16(v) => v[i] = i16::from_le_bytes(take(bytes, big)),
        ColumnMut::U16(v) => v[i] = u16::from_le_bytes(take(bytes, big)),
        ColumnMut::I32(v) => v[i] = i32::from_le_bytes(take(bytes, big)),
        ColumnMut::U32(v) => v[i] = u32::from_le_bytes(take(bytes, big)),
        ColumnMut::F32(v) => v[i] = f32::from_le_bytes(take(bytes, big)),
        ColumnMut::F64(v) => v[i] = f64::from_le_bytes(take(bytes, big)),
    }
}

/// The bytes of one value, little end first.
fn take<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
    let mut value = [0; N];
    value.copy_from_slice(bytes);
    if big {
        value.reverse();
    }
    value
}

/// A value of any type, exactly.
pub(super) fn to_f64(bytes: &[u8], scalar: Scalar, big: bool) -> f64 {
    match scalar {
        Scalar::I32 => f64::from(i32::from_le_bytes(take(bytes, big))),
        Scalar::U32 => f64::from(u32::from_le_bytes(take(bytes, big))),
        Scalar::F64 => f64::from_le_bytes(take(bytes, big)),
        _ => f64::from(to_f32(bytes, scalar, big)),
    }
}
