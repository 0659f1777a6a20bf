//! Values into the bytes of the arrays.

use std::io::Write;

use glam::{Quat, Vec3};
use rayon::prelude::*;
use splat_core::Cloud;

use super::super::flip::{Flip, RUB_RDF};
use super::super::shared::{alpha_byte, finite_or, usual_losses, wxyz};
use super::gzip;
use super::header::{ANTIALIASED, MAGIC, PLAIN_HEADER};
use crate::WriteError;
use crate::format::Written;

/// The version that most programs read.
const USUAL_VERSION: u32 = 3;
/// Fractional bits of the format's own writer: steps of 1/4096.
const USUAL_BITS: u32 = 12;
const MOST_BITS: u32 = 23;
/// Effort of zstd.
const ZSTD_LEVEL: i32 = 9;
const BLOCK: usize = 1 << 12;

pub(super) fn write(cloud: &Cloud, version: Option<u32>, sink: &mut dyn Write) -> Result<Written, WriteError> {
    let version = version.unwrap_or(USUAL_VERSION);
    if !(2..=4).contains(&version) {
        return Err(WriteError::CannotHold {
            format: "spz",
            what: format!("a cloud as version {version}"),
            advice: "versions 2, 3 and 4 can be written".to_owned(),
        });
    }
    let degree = cloud.sh_degree().min(if version < 4 { 3 } else { 4 });
    let mut losses = usual_losses(cloud, degree);
    if degree < cloud.sh_degree() {
        losses.push("version 4 of SPZ keeps degree 4".to_owned());
    }
    let fractional_bits = fractional_bits(cloud)?;
    let arrays = arrays(cloud, version, degree, fractional_bits, &mut losses);
    let mut header = Vec::with_capacity(PLAIN_HEADER);
    header.extend(MAGIC);
    header.extend(version.to_le_bytes());
    header.extend((cloud.len() as u32).to_le_bytes());
    header.extend([degree, fractional_bits as u8, if cloud.source().antialiased { ANTIALIASED } else { 0 }]);
    let bytes = if version < 4 {
        header.push(0);
        let mut parts = vec![header.as_slice()];
        parts.extend(arrays.iter().map(Vec::as_slice));
        gzip::deflate(&parts, sink)?
    } else {
        let used: Vec<&Vec<u8>> = arrays.iter().filter(|a| !a.is_empty()).collect();
        let streams: Vec<Vec<u8>> =
            used.par_iter().map(|a| zstd::bulk::compress(a, ZSTD_LEVEL)).collect::<Result<_, _>>()?;
        header.push(used.len() as u8);
        header.extend((PLAIN_HEADER as u32).to_le_bytes());
        header.resize(PLAIN_HEADER, 0);
        for (array, stream) in used.iter().zip(&streams) {
            header.extend((stream.len() as u64).to_le_bytes());
            header.extend((array.len() as u64).to_le_bytes());
        }
        sink.write_all(&header)?;
        for stream in &streams {
            sink.write_all(stream)?;
        }
        (header.len() + streams.iter().map(Vec::len).sum::<usize>()) as u64
    };
    Ok(Written { bytes, losses, order: None })
}

/// Bits after the point: as many as the format's own writer uses, more where Gaussians are so small that its step
/// shows (an eighth of their median size), fewer where coordinates would wrap.
fn fractional_bits(cloud: &Cloud) -> Result<u32, WriteError> {
    let farthest = cloud.means().iter().filter(|m| m.is_finite()).map(|m| m.abs().max_element()).fold(0.0, f32::max);
    // 24 bits with a sign, and half a step of rounding.
    let fits = |bits: u32| f64::from(farthest) * f64::from(1u32 << bits) < 8_388_607.0;
    if !fits(0) {
        return Err(WriteError::CannotHold {
            format: "spz",
            what: format!("coordinates as large as {farthest}"),
            advice: "scale the capture down, or write another format".to_owned(),
        });
    }
    let mut sizes: Vec<f32> =
        cloud.log_scales().iter().map(|s| (s.x + s.y + s.z) / 3.0).filter(|s| s.is_finite()).collect();
    let middle = sizes.len() / 2;
    let wanted = if sizes.is_empty() {
        0.0
    } else {
        3.0 - f64::from(*sizes.select_nth_unstable_by(middle, f32::total_cmp).1) * std::f64::consts::LOG2_E
    };
    let wanted = (wanted.ceil().max(0.0) as u32).clamp(USUAL_BITS, MOST_BITS);
    Ok((0..=wanted).rev().find(|&bits| fits(bits)).unwrap_or(0))
}

/// Number of Gaussians for which `test` holds.
fn count(cloud: &Cloud, test: impl Fn(usize) -> bool + Sync) -> usize {
    (0..cloud.len()).into_par_iter().with_min_len(BLOCK).filter(|&i| test(i)).count()
}

fn arrays(cloud: &Cloud, version: u32, degree: u8, fractional_bits: u32, losses: &mut Vec<String>) -> [Vec<u8>; 6] {
    let flip = Flip::new(RUB_RDF);
    let n = cloud.len();
    let step = f64::from(1u32 << fractional_bits);
    let positions = fill(n, 9, |i, out| {
        let mean = cloud.means()[i] * flip.mean;
        for (out, v) in out.as_chunks_mut::<3>().0.iter_mut().zip(mean.to_array()) {
            let [a, b, c, _] = ((f64::from(finite_or(v, 0.0)) * step).round() as i32).to_le_bytes();
            *out = [a, b, c];
        }
    });
    let opacities = fill(n, 1, |i, out| out[0] = alpha_byte(cloud, i));
    let colors = fill(n, 3, |i, out| {
        for (out, dc) in out.iter_mut().zip(cloud.sh_of(i)) {
            *out = (dc * (0.15 * 255.0) + 128.0) as u8;
        }
    });
    let scales = fill(n, 3, |i, out| {
        for (out, s) in out.iter_mut().zip(cloud.log_scales()[i].to_array()) {
            *out = ((s + 10.0) * 16.0 + 0.5) as u8;
        }
    });
    let size = if version < 3 { 3 } else { 4 };
    let rotations = fill(n, size, |i, out| {
        let q = flip.rotation(cloud.rotations()[i]);
        if version < 3 { out.copy_from_slice(&first_three(q)) } else { out.copy_from_slice(&smallest_three(q)) }
    });
    let signs = flip.sh_values(degree, 128.0).split_off(3);
    let harmonics = fill(n, signs.len(), |i, out| {
        for (k, ((out, v), sign)) in out.iter_mut().zip(&cloud.sh_of(i)[3..]).zip(&signs).enumerate() {
            // Band 1 keeps 5 bits, the others 4: what the format's own writer spends.
            let bucket = if k < 9 { 8.0 } else { 16.0 };
            *out = ((v * sign / bucket).round() * bucket + 128.0) as u8;
        }
    });
    let limit = Vec3::splat(5.97);
    let clipped = count(cloud, |i| {
        let s = cloud.log_scales()[i];
        s.cmplt(Vec3::splat(-10.04)).any() || s.cmpgt(limit).any()
    });
    if clipped > 0 {
        losses.push(format!("{clipped} Gaussians have scales outside exp(-10) to exp(5.94); they were clipped"));
    }
    let clipped = count(cloud, |i| cloud.sh_of(i)[..3].iter().any(|dc| dc.abs() > 3.35));
    if clipped > 0 {
        losses.push(format!("{clipped} Gaussians have colours far outside 0 to 1; they were clipped"));
    }
    let clipped = count(cloud, |i| cloud.sh_of(i)[3..].iter().any(|v| !(-1.04..=1.04).contains(v)));
    if clipped > 0 && degree > 0 {
        losses.push(format!("{clipped} Gaussians have SH coefficients outside -1 to 1; they were clipped"));
    }
    [positions, opacities, colors, scales, rotations, harmonics]
}

/// An array of `size` bytes per Gaussian, in parallel.
fn fill(count: usize, size: usize, encode: impl Fn(usize, &mut [u8]) + Sync) -> Vec<u8> {
    let mut out = vec![0; count * size];
    if size > 0 {
        out.par_chunks_exact_mut(size).with_min_len(BLOCK).enumerate().for_each(|(i, out)| encode(i, out));
    }
    out
}

/// Version 2: x, y, z of the unit rotation with w not negative, a byte each.
fn first_three(q: Quat) -> [u8; 3] {
    let ([w, x, y, z], _) = wxyz(q);
    let sign = if w < 0.0 { -127.5 } else { 127.5 };
    [x, y, z].map(|v| (v * sign + 128.0) as u8)
}

/// Versions 3 and 4; see the decoder.
fn smallest_three(q: Quat) -> [u8; 4] {
    let ([w, x, y, z], _) = wxyz(q);
    let c = [x, y, z, w];
    let largest = (1..4).fold(0, |best, k| if c[k].abs() > c[best].abs() { k } else { best });
    let mut packed = (largest as u32) << 30;
    let mut shift = 20;
    for (k, v) in c.into_iter().enumerate() {
        if k == largest {
            continue;
        }
        let magnitude = (v.abs() * (511.0 * std::f32::consts::SQRT_2) + 0.5) as u32;
        let negative = (v < 0.0) != (c[largest] < 0.0);
        packed |= (magnitude.min(511) | if negative { 512 } else { 0 }) << shift;
        shift -= 10_i32;
    }
    packed.to_le_bytes()
}
