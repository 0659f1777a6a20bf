//! Bytes of the arrays into values, in parallel blocks.

use crate::pages::zeroed_vec;
use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::super::flip::Flip;
use super::super::half;
use super::super::shared::logit_of_byte;
use super::header::Header;

/// Gaussians per block.
const BLOCK: usize = 1 << 13;

/// Fills one value per record of `size` bytes.
fn map<T: bytemuck::Zeroable + Send, const N: usize>(raw: &[u8], decode: impl Fn(&[u8; N]) -> T + Sync) -> Vec<T> {
    let records = raw.as_chunks::<N>().0;
    let mut out = zeroed_vec::<T>(records.len());
    out.par_chunks_mut(BLOCK).zip(records.par_chunks(BLOCK)).for_each(|(out, records)| {
        for (out, record) in out.iter_mut().zip(records) {
            *out = decode(record);
        }
    });
    out
}

pub(super) fn means(header: &Header, raw: &[u8], flip: &Flip) -> Vec<Vec3> {
    let signs = flip.mean;
    if header.version == 1 {
        let axis = |r: &[u8; 6], k: usize| half::from_bits(u16::from_le_bytes([r[2 * k], r[2 * k + 1]]));
        return map(raw, |r: &[u8; 6]| Vec3::new(axis(r, 0), axis(r, 1), axis(r, 2)) * signs);
    }
    let step = signs / (1u32 << header.fractional_bits) as f32;
    // Three bytes at the top of a signed word, shifted down: the sign comes along.
    let axis = |r: &[u8; 9], k: usize| (i32::from_le_bytes([0, r[3 * k], r[3 * k + 1], r[3 * k + 2]]) >> 8) as f32;
    map(raw, |r: &[u8; 9]| Vec3::new(axis(r, 0), axis(r, 1), axis(r, 2)) * step)
}

pub(super) fn opacity_logits(raw: &[u8]) -> Vec<f32> {
    let table = logit_of_byte();
    map(raw, |[b]: &[u8; 1]| table[usize::from(*b)])
}

pub(super) fn log_scales(raw: &[u8]) -> Vec<Vec3> {
    map(raw, |r: &[u8; 3]| Vec3::from_array(r.map(|b| f32::from(b) / 16.0 - 10.0)))
}

pub(super) fn rotations(header: &Header, raw: &[u8], flip: &Flip) -> Vec<Quat> {
    if header.version >= 3 {
        map(raw, |r: &[u8; 4]| flip.rotation(smallest_three(u32::from_le_bytes(*r))))
    } else {
        map(raw, |r: &[u8; 3]| flip.rotation(first_three(*r)))
    }
}

/// Versions 1 and 2: x, y, z as bytes, w not negative.
fn first_three(bytes: [u8; 3]) -> Quat {
    let [x, y, z] = bytes.map(|b| f32::from(b) / 127.5 - 1.0);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    Quat::from_xyzw(x, y, z, w)
}

/// Versions 3 and 4: which of x, y, z, w is largest, and the other three with 9 bits and a sign each.
fn smallest_three(packed: u32) -> Quat {
    let largest = (packed >> 30) as usize;
    let value = |shift: u32| {
        let magnitude = (packed >> shift & 511) as f32 * (std::f32::consts::FRAC_1_SQRT_2 / 511.0);
        if packed >> shift & 512 == 0 { magnitude } else { -magnitude }
    };
    let [a, b, c] = [value(20), value(10), value(0)];
    let m = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
    match largest {
        0 => Quat::from_xyzw(m, a, b, c),
        1 => Quat::from_xyzw(a, m, b, c),
        2 => Quat::from_xyzw(a, b, m, c),
        _ => Quat::from_xyzw(a, b, c, m),
    }
}

/// Decodes the colours, which have a range of their own, and the further coefficients of spherical harmonics.
pub(super) struct Harmonics {
    constant: [f32; 256],
    /// Sign and step of every value after the constant ones.
    factors: Vec<f32>,
}

impl Harmonics {
    pub(super) fn new(header: &Header, flip: &Flip) -> Self {
        let factors = flip.sh_values(header.degree, 1.0 / 128.0).split_off(3);
        Self { constant: std::array::from_fn(|b| (b as f32 / 255.0 - 0.5) / 0.15), factors }
    }

    /// Floats per Gaussian.
    pub(super) fn stride(&self) -> usize {
        3 + self.factors.len()
    }

    /// Fills the values of as many Gaussians as `colors` has triples.
    pub(super) fn decode(&self, colors: &[u8], raw: &[u8], out: &mut [f32]) {
        match self.factors.len() {
            0 => {
                for (out, byte) in out.iter_mut().zip(colors) {
                    *out = self.constant[usize::from(*byte)];
                }
            }
            9 => self.with_bands::<9>(colors, raw, out),
            24 => self.with_bands::<24>(colors, raw, out),
            45 => self.with_bands::<45>(colors, raw, out),
            _ => self.with_bands::<72>(colors, raw, out),
        }
    }

    fn with_bands<const N: usize>(&self, colors: &[u8], raw: &[u8], out: &mut [f32]) {
        let Some(factors) = self.factors.first_chunk::<N>() else { return };
        let records = colors.as_chunks::<3>().0.iter().zip(raw.as_chunks::<N>().0);
        for (out, (color, raw)) in out.chunks_exact_mut(3 + N).zip(records) {
            let (constant, rest) = out.split_at_mut(3);
            for (out, byte) in constant.iter_mut().zip(color) {
                *out = self.constant[usize::from(*byte)];
            }
            for ((out, byte), factor) in rest.iter_mut().zip(raw).zip(factors) {
                *out = (f32::from(*byte) - 128.0) * factor;
            }
        }
    }
}
