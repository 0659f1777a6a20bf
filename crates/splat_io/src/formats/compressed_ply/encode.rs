//! Arrays into chunks, in Morton order so that a chunk's box is small.

use std::io::Write;

use glam::Vec3;
use rayon::prelude::*;
use splat_core::{Cloud, sh};

use super::{CHUNK, CHUNK_NAMES, PACKED_NAMES};
use crate::WriteError;
use crate::format::Written;
use crate::formats::morton;
use crate::formats::ply::comments;
use crate::formats::ply::header::{Element, Encoding, Header, Kind, Property, Scalar};
use crate::formats::shared::{alpha_byte, finite_or, unit_byte, usual_losses, wxyz};

/// Highest SH degree of the format.
const HIGHEST_DEGREE: u8 = 3;

pub(super) fn write(cloud: &Cloud, sink: &mut dyn Write) -> Result<Written, WriteError> {
    let mut losses = usual_losses(cloud, HIGHEST_DEGREE);
    let coefficients = sh::coefficient_count(cloud.sh_degree().min(HIGHEST_DEGREE)) - 1;
    let beyond = clipped(cloud, coefficients);
    if beyond > 0 {
        losses.push(format!("{beyond} Gaussians have SH coefficients outside -4 to 4, which were clipped"));
    }
    let order = morton::order(cloud.means());
    let chunks: Vec<(Vec<u8>, Vec<u8>)> = order.par_chunks(CHUNK).map(|ids| chunk(cloud, ids)).collect();
    let header = header(cloud, chunks.len(), coefficients).to_text();
    sink.write_all(&header)?;
    let mut bytes = header.len();
    for part in chunks.iter().map(|c| &c.0).chain(chunks.iter().map(|c| &c.1)) {
        sink.write_all(part)?;
        bytes += part.len();
    }
    if coefficients > 0 {
        let stride = cloud.sh_stride();
        for ids in order.chunks(1 << 16) {
            let mut rows = vec![0; ids.len() * 3 * coefficients];
            rows.par_chunks_mut(3 * coefficients).with_min_len(1024).zip(ids).for_each(|(row, &id)| {
                let values = &cloud.sh()[id as usize * stride + 3..(id as usize + 1) * stride];
                for (i, place) in row.iter_mut().enumerate() {
                    let v = values[3 * (i % coefficients) + i / coefficients];
                    *place = ((finite_or(v, 0.0) / 8.0 + 0.5) * 256.0) as u8;
                }
            });
            sink.write_all(&rows)?;
            bytes += rows.len();
        }
    }
    Ok(Written { bytes: bytes as u64, losses, order: Some(order) })
}

fn clipped(cloud: &Cloud, coefficients: usize) -> usize {
    let values = 3..3 + 3 * coefficients;
    let out = |i: &usize| cloud.sh_of(*i)[values.clone()].iter().any(|v| v.abs() > 4.0);
    (0..cloud.len()).into_par_iter().with_min_len(4096).filter(out).count()
}

fn header(cloud: &Cloud, chunks: usize, coefficients: usize) -> Header {
    let element = |name: &str, count: usize, names: &[&str], scalar| Element {
        name: name.to_owned(),
        count: count as u64,
        properties: names.iter().map(|n| Property { name: (*n).to_owned(), kind: Kind::One(scalar) }).collect(),
    };
    let mut elements = vec![
        element("chunk", chunks, &CHUNK_NAMES, Scalar::F32),
        element("vertex", cloud.len(), &PACKED_NAMES, Scalar::U32),
    ];
    if coefficients > 0 {
        let names: Vec<String> = (0..3 * coefficients).map(|i| format!("f_rest_{i}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        elements.push(element("sh", cloud.len(), &names, Scalar::U8));
    }
    Header { encoding: Encoding::Little, elements, comments: comments::to_write(cloud.source()), len: 0 }
}

/// Bytes of a chunk's ranges and of its Gaussians.
fn chunk(cloud: &Cloud, ids: &[u32]) -> (Vec<u8>, Vec<u8>) {
    let means = Range::of(ids.iter().map(|&i| cloud.means()[i as usize]));
    let scale = |i: u32| cloud.log_scales()[i as usize].map(|s| s.clamp(-20.0, 20.0));
    let scales = Range::of(ids.iter().map(|&i| scale(i)));
    let colors = Range::of(ids.iter().map(|&i| cloud.base_color(i as usize)));
    let mut ranges = Vec::with_capacity(18 * 4);
    for range in [&means, &scales, &colors] {
        for v in range.low.to_array().into_iter().chain(range.high.to_array()) {
            ranges.extend(v.to_le_bytes());
        }
    }
    let mut rows = Vec::with_capacity(16 * ids.len());
    for &id in ids {
        let i = id as usize;
        let color = colors.unit(cloud.base_color(i)).to_array().map(unit_byte);
        let words = [
            pack_11_10_11(means.unit(cloud.means()[i])),
            pack_rotation(cloud, i),
            pack_11_10_11(scales.unit(scale(id))),
            u32::from_be_bytes([color[0], color[1], color[2], alpha_byte(cloud, i)]),
        ];
        rows.extend(words.iter().flat_map(|w| w.to_le_bytes()));
    }
    (ranges, rows)
}

/// Box of values; those that are not finite do not count.
struct Range {
    low: Vec3,
    high: Vec3,
}

impl Range {
    fn of(values: impl Iterator<Item = Vec3>) -> Self {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for v in values {
            for axis in 0..3 {
                if v[axis].is_finite() {
                    low[axis] = low[axis].min(v[axis]);
                    high[axis] = high[axis].max(v[axis]);
                }
            }
        }
        for axis in 0..3 {
            if low[axis] > high[axis] {
                (low[axis], high[axis]) = (0.0, 0.0);
            }
        }
        Self { low, high }
    }

    /// Place within the box, 0..=1; 0 along an axis without extent.
    fn unit(&self, v: Vec3) -> Vec3 {
        let mut t = Vec3::ZERO;
        for axis in 0..3 {
            let extent = self.high[axis] - self.low[axis];
            if extent >= 1e-5 && extent.is_finite() {
                t[axis] = finite_or((v[axis] - self.low[axis]) / extent, 0.0).clamp(0.0, 1.0);
            }
        }
        t
    }
}

fn pack_11_10_11(t: Vec3) -> u32 {
    let bits = |v: f32, top: f32| (v * top + 0.5) as u32;
    bits(t.x, 2047.0) << 21 | bits(t.y, 1023.0) << 11 | bits(t.z, 2047.0)
}

fn pack_rotation(cloud: &Cloud, i: usize) -> u32 {
    let (q, largest) = wxyz(cloud.rotations()[i]);
    let sign = if q[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut word = largest as u32;
    for (k, v) in q.iter().enumerate() {
        if k != largest {
            let t = (v * sign * std::f32::consts::FRAC_1_SQRT_2 + 0.5).clamp(0.0, 1.0);
            word = word << 10 | (t * 1023.0 + 0.5) as u32;
        }
    }
    word
}
