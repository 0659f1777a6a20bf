//! `.splat`: 32 bytes a Gaussian, no header, no view-dependent colour.

use std::io::Write;

use glam::{Quat, Vec3};
use rayon::prelude::*;
use splat_core::{Cloud, CloudArrays, sh};

use super::shared::{alpha_byte, finite_or, logit_of_byte, unit_byte, usual_losses, wxyz};
use crate::format::{Format, ReadReport, Siblings, WriteOptions, Written};
use crate::pages::zeroed_vec;
use crate::{ReadError, SourceName, WriteError};

/// Bytes of a record.
const RECORD: usize = 32;
const BLOCK: usize = 4096;
/// Stands for a linear scale of 0, whose logarithm does not exist.
const LEAST_SCALE: f32 = 1e-12;

/// The format of the first web viewers.
#[derive(Clone, Copy, Debug)]
pub struct Splat;

impl Format for Splat {
    fn name(&self) -> &'static str {
        "splat"
    }

    fn description(&self) -> &'static str {
        ".splat of the first web viewers: 32 bytes a Gaussian, no view-dependent colour"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["splat"]
    }

    /// There is no magic number: whole records, plausible numbers in the first of them, and something to see.
    fn sniff(&self, head: &[u8], file_len: u64) -> bool {
        let (records, _) = head.as_chunks::<RECORD>();
        let plausible = |r: &[u8; RECORD]| {
            let f = floats(r);
            let sound = |v: &f32| v.is_finite() && v.abs() < 1e12;
            f.iter().all(sound) && f[3..].iter().all(|s| (0.0..1e6).contains(s))
        };
        let some = &records[..records.len().min(1000)];
        file_len > 0
            && file_len.is_multiple_of(RECORD as u64)
            && some.iter().all(plausible)
            && some.iter().any(|r| r[27] > 0)
    }

    fn read(&self, bytes: &[u8], name: &SourceName, _files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
        let (records, rest) = bytes.as_chunks::<RECORD>();
        if !rest.is_empty() {
            let expected = (records.len() as u64 + 1) * RECORD as u64;
            return Err(ReadError::truncated("bytes of whole records", expected, bytes.len() as u64, name));
        }
        let count = records.len();
        let mut arrays = CloudArrays {
            means: zeroed_vec::<Vec3>(count),
            log_scales: zeroed_vec::<Vec3>(count),
            rotations: zeroed_vec::<Quat>(count),
            opacity_logits: zeroed_vec::<f32>(count),
            sh: zeroed_vec::<f32>(3 * count),
            ..CloudArrays::default()
        };
        let logits = logit_of_byte();
        let colors: [f32; 256] = std::array::from_fn(|b| (b as f32 / 255.0 - 0.5) / sh::C0);
        let columns = (
            arrays.means.par_chunks_mut(BLOCK),
            arrays.log_scales.par_chunks_mut(BLOCK),
            arrays.rotations.par_chunks_mut(BLOCK),
            arrays.opacity_logits.par_chunks_mut(BLOCK),
            arrays.sh.par_chunks_mut(3 * BLOCK),
            records.par_chunks(BLOCK),
        );
        columns.into_par_iter().for_each(|(means, scales, rotations, opacities, colours, records)| {
            for (i, record) in records.iter().enumerate() {
                let f = floats(record);
                means[i] = Vec3::new(f[0], f[1], f[2]);
                scales[i] = Vec3::new(f[3], f[4], f[5]).map(|s| if s < LEAST_SCALE { LEAST_SCALE } else { s }.ln());
                for (colour, &byte) in colours[3 * i..3 * i + 3].iter_mut().zip(&record[24..27]) {
                    *colour = colors[usize::from(byte)];
                }
                opacities[i] = logits[usize::from(record[27])];
                let q = |k: usize| (f32::from(record[28 + k]) - 128.0) / 128.0;
                let rotation = Quat::from_xyzw(q(1), q(2), q(3), q(0));
                let length = rotation.length();
                // A zero quaternion stays zero and is counted.
                rotations[i] = if length > 0.0 { rotation / length } else { rotation };
            }
        });
        arrays.source.format = "splat".to_owned();
        Ok((Cloud::new(arrays).map_err(ReadError::cloud(name))?, ReadReport::default()))
    }

    fn writable(&self) -> bool {
        true
    }

    fn lossy(&self) -> bool {
        true
    }

    fn write(&self, cloud: &Cloud, _: &WriteOptions, sink: &mut dyn Write) -> Result<Written, WriteError> {
        let mut losses = usual_losses(cloud, 0);
        let clipped: usize = (0..cloud.len())
            .into_par_iter()
            .with_min_len(BLOCK)
            .filter(|&i| cloud.base_color(i).to_array().iter().any(|c| !(-0.002..1.002).contains(c)))
            .count();
        if clipped > 0 {
            losses.push(format!("{clipped} colours outside 0 to 1 were clipped"));
        }
        let mut buffer = vec![[0; RECORD]; cloud.len().min(64 * BLOCK)];
        for start in (0..cloud.len()).step_by(64 * BLOCK) {
            let records = &mut buffer[..(cloud.len() - start).min(64 * BLOCK)];
            records.par_iter_mut().with_min_len(BLOCK).enumerate().for_each(|(k, out)| *out = record(cloud, start + k));
            sink.write_all(records.as_flattened())?;
        }
        Ok(Written { bytes: (cloud.len() * RECORD) as u64, losses, order: None })
    }
}

fn floats(record: &[u8; RECORD]) -> [f32; 6] {
    let words = record.as_chunks::<4>().0;
    std::array::from_fn(|k| f32::from_le_bytes(words[k]))
}

fn record(cloud: &Cloud, i: usize) -> [u8; RECORD] {
    let mut out = [0; RECORD];
    let (mean, scale) = (cloud.means()[i], cloud.scale(i));
    let values = mean.to_array().into_iter().chain(scale.to_array());
    for (place, v) in out.as_chunks_mut::<4>().0.iter_mut().zip(values) {
        *place = finite_or(v, 0.0).to_le_bytes();
    }
    for (place, c) in out[24..27].iter_mut().zip(cloud.base_color(i).to_array()) {
        *place = unit_byte(c);
    }
    out[27] = alpha_byte(cloud, i);
    let (q, largest) = wxyz(cloud.rotations()[i]);
    // q and -q are the same rotation, and a byte can hold -1 but not +1.
    let sign = if q[largest] > 0.0 { -1.0 } else { 1.0 };
    for (place, v) in out[28..].iter_mut().zip(q) {
        *place = (v * sign * 128.0 + 128.5) as u8;
    }
    out
}
