//! [`GpuCloud`]: Gaussians in the GPU's memory, in pages that each fit one binding; and what instances say about them.

use std::sync::Arc;

use rayon::prelude::*;
use splat_core::{Cloud, Selection, sh};
use splat_shaders::constants::{
    BLOCK, DEAD, FULL_GEOMETRY, LOG_SCALE_LEAST, LOG_SCALE_STEP, LOGIT_LEAST, LOGIT_STEP, PACKED_GEOMETRY, SMALL_LEAST,
    SMALL_STEP,
};

use super::context::{Context, Precision};
use super::{Gpu, GpuError};

/// A page takes no larger binding than this, as some devices allow no more.
const LARGEST_PAGE: u64 = 128 << 20;
/// Bytes that are packed and handed to the queue at a time.
const CHUNK: usize = 8 << 20;
/// Bytes that may wait in the queue's own memory: after so many the upload waits for the device.
const WAITING: usize = 64 << 20;
/// The largest half float.
const LARGEST_HALF: f32 = 65504.0;

/// A cloud on a GPU. Uploaded once, shared by instances, frames and views.
#[derive(Debug)]
pub struct GpuCloud {
    pub(super) pages: Vec<Page>,
    len: usize,
    pub(super) sh_degree: u8,
    pub(super) antialiased: bool,
}

/// Consecutive Gaussians in one buffer.
#[derive(Debug)]
pub(super) struct Page {
    pub(super) buffer: wgpu::Buffer,
    /// Id of the first.
    pub(super) first: u32,
    pub(super) count: u32,
}

/// How Gaussians become words; the layout is told in `project.wgsl`.
#[derive(Clone, Copy, Debug)]
struct Layout {
    precision: Precision,
    coefficients: usize,
}

impl GpuCloud {
    /// Copies a cloud to the GPU, packed as its [options](super::GpuOptions) say: 124 bytes a Gaussian at SH degree 3.
    ///
    /// Goes through the cloud in pieces: beside the cloud and its packed form, no more than 72 MiB are used meanwhile.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] where the cloud does not fit, [`GpuError::Lost`] where the device stopped working.
    pub fn new(gpu: &Gpu, cloud: &Cloud) -> Result<Self, GpuError> {
        Self::with_pages(&gpu.context, cloud, LARGEST_PAGE)
    }

    /// As [`GpuCloud::new`], with pages of at most so many bytes.
    pub(super) fn with_pages(context: &Context, cloud: &Cloud, largest_page: u64) -> Result<Self, GpuError> {
        let layout =
            Layout { precision: context.options.precision, coefficients: sh::coefficient_count(cloud.sh_degree()) };
        let block = BLOCK as usize;
        let block_bytes = 4 * layout.words() * block;
        let limit =
            largest_page.min(context.limits.max_storage_buffer_binding_size).min(context.limits.max_buffer_size);
        let blocks_per_page = (limit as usize / block_bytes).max(1);
        let mut pages = Vec::new();
        let mut chunk = vec![0u32; layout.words() * block * (CHUNK / block_bytes).max(1)];
        let mut waiting = 0;
        for first in (0..cloud.len()).step_by(blocks_per_page * block) {
            let count = (cloud.len() - first).min(blocks_per_page * block);
            let blocks = count.div_ceil(block);
            let bytes = (blocks * block_bytes) as u64;
            let buffer = context
                .checked("a cloud's page", bytes, || context.buffer("cloud", bytes, wgpu::BufferUsages::empty()))?;
            let step = chunk.len() / (layout.words() * block);
            for at in (0..blocks).step_by(step) {
                let end = blocks.min(at + step);
                let words = &mut chunk[..(end - at) * layout.words() * block];
                words.par_chunks_mut(layout.words() * block).enumerate().for_each(|(k, words)| {
                    let start = first + (at + k) * block;
                    layout.pack(cloud, start..cloud.len().min(start + block), words);
                });
                context.write(&buffer, (at * block_bytes) as u64, words);
                waiting += 4 * words.len();
                if waiting >= WAITING {
                    context.queue.submit([]);
                    context.wait()?;
                    waiting = 0;
                }
            }
            pages.push(Page { buffer, first: first as u32, count: count as u32 });
        }
        Ok(Self { pages, len: cloud.len(), sh_degree: cloud.sh_degree(), antialiased: cloud.source().antialiased })
    }

    /// Gaussians.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// GPU memory it takes.
    pub fn bytes(&self) -> u64 {
        self.pages.iter().map(|p| p.buffer.size()).sum()
    }
}

impl Layout {
    /// Words of a Gaussian.
    fn words(self) -> usize {
        match self.precision {
            // Pairs of coefficients are three words.
            Precision::Packed => PACKED_GEOMETRY as usize + 3 * self.coefficients.div_ceil(2),
            Precision::Full => FULL_GEOMETRY as usize + 3 * self.coefficients,
        }
    }

    /// Packs up to a block of Gaussians, each word of all of them together; those missing cannot be drawn.
    fn pack(self, cloud: &Cloud, ids: std::ops::Range<usize>, to: &mut [u32]) {
        let block = BLOCK as usize;
        to[..block].fill(DEAD);
        for (lane, id) in ids.enumerate() {
            if !cloud.drawable(id) {
                continue;
            }
            let mut put = |word: usize, value: u32| to[word * block + lane] = value;
            let mean = cloud.means()[id];
            let rotation = cloud.rotation(id).to_array();
            let log_scale = cloud.log_scales()[id];
            let logit = cloud.opacity_logits()[id];
            for (k, v) in mean.to_array().into_iter().enumerate() {
                put(k, v.to_bits());
            }
            let sh = cloud.sh_of(id);
            match self.precision {
                Precision::Packed => {
                    for (k, word) in pack_geometry(rotation, log_scale.to_array(), logit).into_iter().enumerate() {
                        put(3 + k, word);
                    }
                    let half = |i: usize| {
                        let v = sh.get(i).copied().unwrap_or(0.0);
                        u32::from(half_bits(coefficient(sh, i, v, LARGEST_HALF)))
                    };
                    for k in 0..3 * self.coefficients.div_ceil(2) {
                        put(PACKED_GEOMETRY as usize + k, half(2 * k) | half(2 * k + 1) << 16);
                    }
                }
                Precision::Full => {
                    for (k, v) in rotation.into_iter().chain(log_scale.to_array()).enumerate() {
                        put(3 + k, v.to_bits());
                    }
                    put(10, logit.clamp(-100.0, 100.0).to_bits());
                    for (i, v) in sh.iter().enumerate() {
                        put(FULL_GEOMETRY as usize + i, coefficient(sh, i, *v, 1e30).to_bits());
                    }
                }
            }
        }
    }
}

/// Rotation (of unit length), log scales and logit in 128 bits, as `geometry` of `project.wgsl` reads them.
fn pack_geometry(rotation: [f32; 4], log_scale: [f32; 3], logit: f32) -> [u32; 4] {
    let steps = |v: f32, least: f32, step: f32, bits: u32| {
        // In f64: 21 bits of a quotient are near the end of an f32's.
        let steps = (f64::from(v) - f64::from(least)) / f64::from(step);
        steps.round().clamp(0.0, f64::from((1u32 << bits) - 1)) as u32
    };
    let mut largest = 0;
    for k in 1..4 {
        if rotation[k].abs() > rotation[largest].abs() {
            largest = k;
        }
    }
    // A quaternion and its negative are the same rotation.
    let sign = if rotation[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut small = (0..4).filter(|k| *k != largest).map(|k| steps(sign * rotation[k], SMALL_LEAST, SMALL_STEP, 15));
    let [a, b, c] = std::array::from_fn(|_| small.next().unwrap_or_default());
    let [x, y, z] = log_scale.map(|v| steps(v, LOG_SCALE_LEAST, LOG_SCALE_STEP, 20));
    let logit = steps(logit, LOGIT_LEAST, LOGIT_STEP, 21);
    [a | b << 15 | (largest as u32) << 30, c | logit << 15, x | z << 20, y | z >> 12 << 20 | logit >> 17 << 28]
}

/// What a shader can add up: a channel with a coefficient that is not a number is black, as on the CPU.
fn coefficient(sh: &[f32], i: usize, v: f32, largest: f32) -> f32 {
    if v.is_nan() {
        return 0.0;
    }
    if i < 3 && !v.is_finite() {
        return v.clamp(-largest, largest);
    }
    // Only looked for where something is wrong with the sum, which no finite coefficient can make.
    if i < 3 && sh.iter().skip(i).step_by(3).any(|v| v.is_nan()) {
        return -largest;
    }
    v.clamp(-largest, largest)
}

/// The nearest half float (ties to even) of a number no larger than [`LARGEST_HALF`].
fn half_bits(v: f32) -> u16 {
    let bits = v.to_bits();
    let sign = (bits >> 16 & 0x8000) as u16;
    let magnitude = f32::from_bits(bits & 0x7fff_ffff);
    // Below 2^-14 halves are multiples of 2^-24; adding 0.5 leaves that multiple in the low bits, rounded as f32 rounds.
    if magnitude < 6.103_515_6e-5 {
        return sign | ((magnitude + 0.5).to_bits() - 0.5f32.to_bits()) as u16;
    }
    let bits = magnitude.to_bits();
    let rounded = bits + 0x0fff + (bits >> 13 & 1);
    sign | ((rounded >> 13) - (112 << 10)).min(0x7bff) as u16
}

/// A bit per Gaussian of a cloud, on a GPU.
#[derive(Debug)]
pub struct GpuBits {
    pub(super) buffer: wgpu::Buffer,
    pub(super) len: usize,
}

/// Ids of Gaussians of a cloud, rising, on a GPU.
#[derive(Debug)]
pub struct GpuIds {
    pub(super) buffer: wgpu::Buffer,
    /// Which of them are on which page is looked up when a frame is drawn.
    pub(super) ids: Arc<[u32]>,
}

/// Red, green, blue (sRGB-encoded) and strength per Gaussian of a cloud, on a GPU.
#[derive(Debug)]
pub struct GpuTint {
    pub(super) buffer: wgpu::Buffer,
    pub(super) len: usize,
}

impl GpuBits {
    /// Copies a selection to the GPU.
    pub fn new(gpu: &Gpu, selection: &Selection) -> Self {
        let words: Vec<u32> = selection.words().iter().flat_map(|w| [*w as u32, (w >> 32) as u32]).collect();
        Self { buffer: gpu.context.buffer_of("bits", &words, wgpu::BufferUsages::empty()), len: selection.len() }
    }
}

impl GpuIds {
    /// Copies rising ids to the GPU.
    pub fn new(gpu: &Gpu, ids: Arc<[u32]>) -> Self {
        Self { buffer: gpu.context.buffer_of("ids", &ids, wgpu::BufferUsages::empty()), ids }
    }
}

impl GpuTint {
    /// Copies colours to the GPU.
    pub fn new(gpu: &Gpu, tint: &[[u8; 4]]) -> Self {
        Self { buffer: gpu.context.buffer_of("tint", tint, wgpu::BufferUsages::empty()), len: tint.len() }
    }
}
