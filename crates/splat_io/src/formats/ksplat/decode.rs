//! Records of all sections into arrays, in parallel blocks.

use bytemuck::zeroed_vec;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use splat_core::{CloudArrays, sh};

use super::super::half;
use super::super::shared::logit_of_byte;
use super::header::{File, Section};
use crate::{ReadError, SourceName};

/// Records of a block.
const BLOCK: usize = 4096;
/// Stands for a linear scale of 0, whose logarithm does not exist.
const LEAST_SCALE: f32 = 1e-12;

/// Values of the records of one block of a section.
struct Block<'a> {
    section: &'a Section<'a>,
    partial_ends: &'a [u64],
    /// Number in the section of the first record.
    first: usize,
    means: &'a mut [Vec3],
    log_scales: &'a mut [Vec3],
    rotations: &'a mut [Quat],
    opacity_logits: &'a mut [f32],
    sh: &'a mut [f32],
}

/// Byte tables shared by all records.
struct Tables {
    level: u16,
    logits: [f32; 256],
    colors: [f32; 256],
    harmonics: [f32; 256],
    /// Floats per Gaussian in the output.
    stride: usize,
}

pub(super) fn decode(file: &File<'_>, name: &SourceName) -> Result<CloudArrays, ReadError> {
    let count: usize = file.sections.iter().map(|s| s.count).sum();
    let degree = file.sections.iter().map(|s| s.degree).max().unwrap_or(0);
    let stride = 3 * sh::coefficient_count(degree);
    let [low, high] = file.sh_range;
    if !(low.is_finite() && high.is_finite()) {
        return Err(ReadError::malformed(
            "the range of the harmonics",
            "two numbers",
            format!("{low} to {high}"),
            name,
        ));
    }
    let tables = Tables {
        level: file.level,
        logits: logit_of_byte(),
        colors: std::array::from_fn(|b| (b as f32 / 255.0 - 0.5) / sh::C0),
        harmonics: std::array::from_fn(|b| low + (high - low) * (b as f32 / 255.0)),
        stride,
    };
    let mut arrays = CloudArrays {
        means: zeroed_vec::<Vec3>(count),
        log_scales: zeroed_vec::<Vec3>(count),
        rotations: zeroed_vec::<Quat>(count),
        opacity_logits: zeroed_vec::<f32>(count),
        sh_degree: degree,
        sh: zeroed_vec::<f32>(count * stride),
        ..CloudArrays::default()
    };
    let ends: Vec<Vec<u64>> = file.sections.iter().map(Section::partial_ends).collect();
    let mut blocks = Vec::new();
    let (mut means, mut log_scales, mut rotations, mut opacity_logits, mut harmonics) = (
        arrays.means.as_mut_slice(),
        arrays.log_scales.as_mut_slice(),
        arrays.rotations.as_mut_slice(),
        arrays.opacity_logits.as_mut_slice(),
        arrays.sh.as_mut_slice(),
    );
    for (section, partial_ends) in file.sections.iter().zip(&ends) {
        for first in (0..section.count).step_by(BLOCK) {
            let n = BLOCK.min(section.count - first);
            blocks.push(Block {
                section,
                partial_ends,
                first,
                means: front(&mut means, n),
                log_scales: front(&mut log_scales, n),
                rotations: front(&mut rotations, n),
                opacity_logits: front(&mut opacity_logits, n),
                sh: front(&mut harmonics, n * stride),
            });
        }
    }
    blocks.into_par_iter().for_each(|mut block| block.decode(&tables));
    Ok(arrays)
}

/// Takes `n` values off the front.
fn front<'a, T>(slice: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    let (front, rest) = std::mem::take(slice).split_at_mut(n);
    *slice = rest;
    front
}

/// A number of the width that the level has, at place `k` counted in such numbers.
fn number(level: u16, bytes: &[u8], k: usize) -> f32 {
    if level == 0 {
        f32::from_le_bytes([bytes[4 * k], bytes[4 * k + 1], bytes[4 * k + 2], bytes[4 * k + 3]])
    } else {
        half::from_bits(u16::from_le_bytes([bytes[2 * k], bytes[2 * k + 1]]))
    }
}

impl Block<'_> {
    fn decode(&mut self, tables: &Tables) {
        let (section, level) = (self.section, tables.level);
        let width = if level == 0 { 4 } else { 2 };
        let bands = section.degree;
        let records = section.records[self.first * section.stride..].chunks_exact(section.stride);
        for (i, record) in records.take(self.means.len()).enumerate() {
            self.means[i] = if level == 0 {
                Vec3::new(number(0, record, 0), number(0, record, 1), number(0, record, 2))
            } else {
                self.mean(self.first + i, record)
            };
            let v = |k: usize| number(level, record, k);
            self.log_scales[i] =
                Vec3::new(v(3), v(4), v(5)).map(|s| if s < LEAST_SCALE { LEAST_SCALE } else { s }.ln());
            self.rotations[i] = Quat::from_xyzw(v(7), v(8), v(9), v(6));
            let (color, rest) = record[10 * width..].split_at(4);
            self.opacity_logits[i] = tables.logits[usize::from(color[3])];
            let out = &mut self.sh[i * tables.stride..(i + 1) * tables.stride];
            for (out, byte) in out.iter_mut().zip(&color[..3]) {
                *out = tables.colors[usize::from(*byte)];
            }
            // Band after band, and in a band all of red, then green, then blue.
            let mut at = 0;
            for band in 1..=usize::from(bands) {
                for channel in 0..3 {
                    for k in band * band..(band + 1) * (band + 1) {
                        let value =
                            if level == 2 { tables.harmonics[usize::from(rest[at])] } else { number(level, rest, at) };
                        out[3 * k + channel] = value;
                        at += 1;
                    }
                }
            }
        }
    }

    /// Levels 1 and 2: 16 bits per axis within the bucket.
    fn mean(&self, i: usize, record: &[u8]) -> Vec3 {
        let section = self.section;
        let center = &section.centers[section.bucket(i, self.partial_ends)];
        let axis = |k: usize| {
            let stored = f32::from(u16::from_le_bytes([record[2 * k], record[2 * k + 1]]));
            let center = f32::from_le_bytes([center[4 * k], center[4 * k + 1], center[4 * k + 2], center[4 * k + 3]]);
            (stored - section.middle) * section.step + center
        };
        Vec3::new(axis(0), axis(1), axis(2))
    }
}
