//! Stage 4: the splats of a tile, front to back, into its pixels.

#![expect(
    clippy::needless_range_loop,
    reason = "iterators over registers are calls where the compiler does not inline them into kernels"
)]

use std::sync::atomic::{AtomicU64, Ordering};

use splat_core::Mask2d;

use super::canvas::Canvas;
use super::simd::{GROUP, Group, Kernel, Simd, exp2};
use super::splat::{Shape, Splat, TILE};
use crate::{Features, Frame, Outputs};

/// Contributions below this are skipped.
pub(super) const SMALLEST_ALPHA: f32 = 1.0 / 255.0;
/// No splat is more opaque than this.
pub(super) const LARGEST_ALPHA: f32 = 0.99;
/// A pixel ends before its transmittance would fall below this.
pub(crate) const LEAST_TRANSMITTANCE: f32 = 1e-4;
/// Sum of weights from which on a pixel has an expected depth.
const LEAST_WEIGHT: f32 = 1e-3;
/// Pixels across and down a block: the pixels that are blended together.
pub(super) const BLOCK: usize = 4;
/// Blocks of a tile.
pub(super) const BLOCKS: usize = (TILE / BLOCK) * (TILE / BLOCK);
/// Splats whose blocks are found together.
const BATCH: usize = 16;
/// Splats between asking for a splat's memory and its use.
const AHEAD: usize = 24;

type Picture = [Group<f32>; BLOCKS];

/// State of the pixels of one tile, block by block; kept from tile to tile for its memory only.
pub(super) struct Pixels {
    /// Transmittance; its sign bit is set once the pixel has ended.
    pub(super) transmittance: Picture,
    pub(super) color: [Picture; 3],
    pub(super) median: Picture,
    /// Sum of weights times z.
    pub(super) depth: Picture,
    /// Bits of ids.
    pub(super) hits: Picture,
    pub(super) strongest: Picture,
    largest: Picture,
    /// Camera z from which on nothing is drawn, where there is a limit.
    limit: Picture,
    /// Weights of the current splat.
    weights: Picture,
    /// A picture per channel.
    pub(super) features: Vec<Group<f32>>,
    /// Values of each mask.
    masks: Vec<[u8; GROUP]>,
}

impl Default for Pixels {
    fn default() -> Self {
        let zero = [Group([0.0; GROUP]); BLOCKS];
        Self {
            transmittance: zero,
            color: [zero; 3],
            median: zero,
            depth: zero,
            hits: zero,
            strongest: zero,
            largest: zero,
            limit: zero,
            weights: zero,
            features: Vec::new(),
            masks: Vec::new(),
        }
    }
}

/// Sums over the picture that all threads add to.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums<'a> {
    /// A bit per Gaussian.
    pub(super) visible: &'a [AtomicU64],
    pub(super) total: &'a [AtomicU64],
    /// Per mask.
    pub(super) inside: &'a [&'a [AtomicU64]],
}

/// What to blend and what for; the same for all tiles.
#[derive(Clone, Copy)]
pub(super) struct Request<'a> {
    /// By id.
    pub(super) splats: &'a [Splat],
    pub(super) size: (usize, usize),
    pub(super) outputs: &'a Outputs<'a>,
    pub(super) sums: Sums<'a>,
    pub(super) canvas: &'a Canvas<'a>,
}

impl Request<'_> {
    fn picks(&self) -> bool {
        let o = self.outputs;
        o.median_depth || o.expected_depth || o.first_hits.is_some() || o.strongest
    }

    fn sums(&self) -> bool {
        let o = self.outputs;
        o.features.is_some() || o.visibility.is_some() || o.votes.is_some()
    }
}

/// Blends one tile and writes it to the canvas.
pub(super) struct Blend<'a> {
    pub(super) request: Request<'a>,
    pub(super) list: &'a [u32],
    /// First pixel.
    pub(super) corner: (usize, usize),
    pub(super) pixels: &'a mut Pixels,
}

impl Kernel for Blend<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        // One copy of the loop for each set of outputs, so that those not asked for cost nothing.
        let r = &self.request;
        match (r.outputs.color, r.picks(), r.sums()) {
            (false, false, false) => {}
            (true, false, false) => self.all::<S, true, false, false>(s),
            (false, true, false) => self.all::<S, false, true, false>(s),
            (true, true, false) => self.all::<S, true, true, false>(s),
            (false, false, true) => self.all::<S, false, false, true>(s),
            (true, false, true) => self.all::<S, true, false, true>(s),
            (false, true, true) => self.all::<S, false, true, true>(s),
            (true, true, true) => self.all::<S, true, true, true>(s),
        }
    }
}

/// Lane tables: left and top of the blocks of a tile, and of the pixels of a block.
static BLOCK_X: Group<f32> = corners(BLOCK, TILE / BLOCK, false);
static BLOCK_Y: Group<f32> = corners(BLOCK, TILE / BLOCK, true);
static PIXEL_X: Group<f32> = corners(1, BLOCK, false);
static PIXEL_Y: Group<f32> = corners(1, BLOCK, true);

const fn corners(step: usize, across: usize, vertical: bool) -> Group<f32> {
    let mut group = Group([0.0; GROUP]);
    let mut i = 0;
    while i < GROUP {
        group.0[i] = (step * if vertical { i / across } else { i % across }) as f32;
        i += 1;
    }
    group
}

/// Asks for the line of cache where `at` begins.
#[inline(always)]
fn prefetch<T>(at: &T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a prefetch of a valid address; every x86-64 has it.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(at).cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}

/// Which blocks of a tile a splat reaches.
#[derive(Clone, Copy, Default)]
struct Reached {
    /// A bit per block.
    mask: u32,
    /// Both factors of the exponent at the first pixel of each block; they are linear in the pixel, so that a part for
    /// the pixel's place in its block is added.
    block: [Group<f32>; 2],
}

#[inline(always)]
fn reach<S: Simd>(s: S, splat: &Splat, corner: (usize, usize), to: &mut Reached) {
    let x = s.splat(corner.0 as f32 + 0.5 - splat.mean[0]);
    let y = s.splat(corner.1 as f32 + 0.5 - splat.mean[1]);
    let (along, shear, across) = (s.splat(splat.along), s.splat(splat.shear), s.splat(splat.across));
    let shape = Shape::new(s, splat);
    let span = s.splat((BLOCK - 1) as f32);
    to.mask = 0;
    for part in 0..GROUP / S::LANES {
        let left = s.add(s.load(&BLOCK_X, part), x);
        let top = s.add(s.load(&BLOCK_Y, part), y);
        to.mask |= shape.touches(s, left, top, s.add(left, span), s.add(top, span)) << (part * S::LANES);
        s.store(&mut to.block[0], part, s.mul(along, s.fnma(shear, top, left)));
        s.store(&mut to.block[1], part, s.mul(across, top));
    }
}

impl Blend<'_> {
    #[inline(always)]
    fn all<S: Simd, const COLOR: bool, const PICKS: bool, const SUMS: bool>(self, s: S) {
        let Self { request, list, corner, pixels } = self;
        let parts = GROUP / S::LANES;
        let mut live = open::<COLOR, PICKS, SUMS>(&request, corner, pixels);
        let limited = request.outputs.limit.is_some();
        // No splat of the tile from this depth on is drawn.
        let farthest = request.outputs.limit.map_or(f32::INFINITY, |limit| load_limit(limit, &request, corner, pixels));
        // Thresholds at or above 1 would ask about the pixel before anything was drawn; 1/255 is the least that is.
        let threshold = 1.0 - request.outputs.first_hits.unwrap_or(2.0).max(1e-3);
        let mut reached = [Reached::default(); BATCH];
        'tile: for (n, batch) in list.chunks(BATCH).enumerate() {
            // Which blocks each splat reaches, for all of the batch first: how often the loop over blocks runs is then
            // known long before it begins, and a wrong guess of the branch predictor is cheap.
            for (k, &id) in batch.iter().enumerate() {
                if let Some(&next) = list.get(n * BATCH + k + AHEAD) {
                    prefetch(&request.splats[next as usize]);
                    if SUMS && request.outputs.votes.is_some() {
                        prefetch(&request.sums.total[next as usize]);
                        for inside in request.sums.inside {
                            prefetch(&inside[next as usize]);
                        }
                    }
                }
                reach(s, &request.splats[id as usize], corner, &mut reached[k]);
            }
            for (k, &id) in batch.iter().enumerate() {
                let Reached { mask, block } = &reached[k];
                let mask = mask & live;
                if mask == 0 {
                    continue;
                }
                let splat = &request.splats[id as usize];
                if limited && splat.z >= farthest {
                    break 'tile;
                }
                let (along, shear, across) = (s.splat(splat.along), s.splat(splat.shear), s.splat(splat.across));
                let mut pixel = [(along, along); GROUP / 4];
                for part in 0..parts {
                    let (dx, dy) = (s.load(&PIXEL_X, part), s.load(&PIXEL_Y, part));
                    pixel[part] = (s.mul(along, s.fnma(shear, dy, dx)), s.mul(across, dy));
                }
                let level = s.splat(splat.level);
                let color = [s.splat(splat.color[0]), s.splat(splat.color[1]), s.splat(splat.color[2])];
                let (z, name) = (s.splat(splat.z), s.splat(f32::from_bits(id)));
                let mut blocks = mask;
                while blocks != 0 {
                    let b = blocks.trailing_zeros() as usize;
                    blocks &= blocks - 1;
                    let mut ended = 0;
                    for part in 0..parts {
                        let t = s.load(&pixels.transmittance[b], part);
                        let e = s.add(pixel[part].0, s.splat(block[0].0[b]));
                        let f = s.add(pixel[part].1, s.splat(block[1].0[b]));
                        let power = s.fnma(e, e, s.fnma(f, f, level));
                        let alpha = s.min(exp2(s, power), s.splat(LARGEST_ALPHA));
                        let seen = s.ge(alpha, s.splat(SMALLEST_ALPHA));
                        // Negative where the pixel has ended, so that it stays so.
                        let after = s.fnma(alpha, t, t);
                        let mut drawn = s.and(seen, s.ge(after, s.splat(LEAST_TRANSMITTANCE)));
                        if limited {
                            // What comes later is deeper still: the pixel ends.
                            drawn = s.and(drawn, s.gt(s.load(&pixels.limit[b], part), z));
                        }
                        let weight = s.zero_unless(drawn, s.mul(alpha, t));
                        let kept = s.negative_where(s.and_not(seen, drawn), s.select(drawn, after, t));
                        s.store(&mut pixels.transmittance[b], part, kept);
                        ended |= s.signs(kept) << (part * S::LANES);
                        if COLOR {
                            for c in 0..3 {
                                let sum = s.load(&pixels.color[c][b], part);
                                s.store(&mut pixels.color[c][b], part, s.fma(weight, color[c], sum));
                            }
                        }
                        if PICKS {
                            if request.outputs.expected_depth {
                                let sum = s.load(&pixels.depth[b], part);
                                s.store(&mut pixels.depth[b], part, s.fma(weight, z, sum));
                            }
                            if request.outputs.median_depth {
                                let half = s.splat(0.5);
                                let falls = s.and(drawn, s.and(s.gt(t, half), s.ge(half, after)));
                                let old = s.load(&pixels.median[b], part);
                                s.store(&mut pixels.median[b], part, s.select(falls, z, old));
                            }
                            if request.outputs.first_hits.is_some() {
                                let threshold = s.splat(threshold);
                                let falls = s.and(drawn, s.and(s.gt(t, threshold), s.ge(threshold, after)));
                                let old = s.load(&pixels.hits[b], part);
                                s.store(&mut pixels.hits[b], part, s.select(falls, name, old));
                            }
                            if request.outputs.strongest {
                                let largest = s.load(&pixels.largest[b], part);
                                let old = s.load(&pixels.strongest[b], part);
                                let more = s.gt(weight, largest);
                                s.store(&mut pixels.largest[b], part, s.max(weight, largest));
                                s.store(&mut pixels.strongest[b], part, s.select(more, name, old));
                            }
                        }
                        if SUMS {
                            s.store(&mut pixels.weights[b], part, weight);
                        }
                    }
                    if ended == 0xffff {
                        live &= !(1 << b);
                    }
                }
                if SUMS {
                    sum(s, &request, pixels, mask, id as usize);
                }
                if live == 0 {
                    break 'tile;
                }
            }
        }
        request.canvas.write(request.outputs, request.size, corner, pixels);
    }
}

/// Prepares the pixels of a tile; which blocks have pixels of the picture.
#[inline(always)]
fn open<const COLOR: bool, const PICKS: bool, const SUMS: bool>(
    request: &Request,
    corner: (usize, usize),
    pixels: &mut Pixels,
) -> u32 {
    let zero = [Group([0.0; GROUP]); BLOCKS];
    let none = f32::from_bits(Frame::NO_ID);
    let (width, height) = (TILE.min(request.size.0 - corner.0), TILE.min(request.size.1 - corner.1));
    pixels.transmittance = [Group([1.0; GROUP]); BLOCKS];
    let mut live = (1 << BLOCKS) - 1;
    if (width, height) != (TILE, TILE) {
        live = 0;
        for b in 0..BLOCKS {
            for i in 0..GROUP {
                let (x, y) = pixel_of(b, i);
                let inside = x < width && y < height;
                live |= u32::from(inside) << b;
                if !inside {
                    pixels.transmittance[b].0[i] = -1.0;
                }
            }
        }
    }
    if COLOR {
        pixels.color = [zero; 3];
    }
    if PICKS {
        pixels.median = [Group([f32::NAN; GROUP]); BLOCKS];
        pixels.depth = zero;
        pixels.hits = [Group([none; GROUP]); BLOCKS];
        pixels.strongest = pixels.hits;
        pixels.largest = zero;
    }
    if SUMS {
        let channels = request.outputs.features.map_or(0, |f| f.channels);
        pixels.features.clear();
        pixels.features.resize(channels * BLOCKS, Group([0.0; GROUP]));
        pixels.masks.clear();
        for mask in request.outputs.votes.unwrap_or_default() {
            load_mask(mask, request.size.0, corner, (width, height), &mut pixels.masks);
        }
    }
    live
}

/// Loads the limits of a tile; the farthest of them.
fn load_limit(limit: &[f32], request: &Request, corner: (usize, usize), pixels: &mut Pixels) -> f32 {
    let (width, height) = (TILE.min(request.size.0 - corner.0), TILE.min(request.size.1 - corner.1));
    let mut farthest = f32::NEG_INFINITY;
    for y in 0..height {
        let row = &limit[(corner.1 + y) * request.size.0 + corner.0..][..width];
        for (x, &z) in row.iter().enumerate() {
            let z = if z.is_nan() { f32::INFINITY } else { z };
            farthest = farthest.max(z);
            pixels.limit[y / BLOCK * (TILE / BLOCK) + x / BLOCK].0[y % BLOCK * BLOCK + x % BLOCK] = z;
        }
    }
    farthest
}

/// Position in its tile of pixel `i` of block `b`.
pub(super) fn pixel_of(b: usize, i: usize) -> (usize, usize) {
    let across = TILE / BLOCK;
    (b % across * BLOCK + i % BLOCK, b / across * BLOCK + i / BLOCK)
}

/// A tile of a mask, block by block; 0 outside the picture.
fn load_mask(mask: &Mask2d, stride: usize, corner: (usize, usize), size: (usize, usize), to: &mut Vec<[u8; GROUP]>) {
    let first = to.len();
    to.resize(first + BLOCKS, [0; GROUP]);
    for y in 0..size.1 {
        let row = &mask.values()[(corner.1 + y) * stride + corner.0..][..size.0];
        for (x, &value) in row.iter().enumerate() {
            to[first + y / BLOCK * (TILE / BLOCK) + x / BLOCK][y % BLOCK * BLOCK + x % BLOCK] = value;
        }
    }
}

/// Adds the weights of one splat in the blocks of `mask` to what is summed per Gaussian and per channel.
#[inline(always)]
fn sum<S: Simd>(s: S, request: &Request, pixels: &mut Pixels, mask: u32, id: usize) {
    let parts = GROUP / S::LANES;
    if let Some(threshold) = request.outputs.visibility {
        let threshold = s.splat(threshold);
        let mut above = 0;
        let mut blocks = mask;
        while blocks != 0 {
            let b = blocks.trailing_zeros() as usize;
            blocks &= blocks - 1;
            for part in 0..parts {
                above |= s.bits(s.gt(s.load(&pixels.weights[b], part), threshold));
            }
        }
        let (word, bit) = (&request.sums.visible[id / 64], 1 << (id % 64));
        // Most splats are seen in several tiles: look before writing to a line that others want.
        if above != 0 && word.load(Ordering::Relaxed) & bit == 0 {
            word.fetch_or(bit, Ordering::Relaxed);
        }
    }
    if let Some(masks) = request.outputs.votes {
        // 1.5 * 2^23: adding it leaves the nearest integer in the low bits.
        let (unit, magic, low) = (s.splat(65_536.0), s.splat(12_582_912.0), s.splat_i(0x3f_ffff));
        macro_rules! units {
            ($b:expr, $part:expr) => {
                s.and_i(s.as_int(s.fma(s.load(&pixels.weights[$b], $part), unit, magic)), low)
            };
        }
        let mut total = s.splat_i(0);
        let mut blocks = mask;
        while blocks != 0 {
            let b = blocks.trailing_zeros() as usize;
            blocks &= blocks - 1;
            for part in 0..parts {
                total = s.add_i(total, units!(b, part));
            }
        }
        let total = s.sum_i(total);
        if total != 0 {
            request.sums.total[id].fetch_add(u64::from(total), Ordering::Relaxed);
            for m in 0..masks.len() {
                // At most 0.99 * 2^16 * 255 * 256 pixels: fits 32 bits.
                let mut inside = s.splat_i(0);
                let mut blocks = mask;
                while blocks != 0 {
                    let b = blocks.trailing_zeros() as usize;
                    blocks &= blocks - 1;
                    for part in 0..parts {
                        let value = s.load_u8(&pixels.masks[m * BLOCKS + b], part);
                        inside = s.add_i(inside, s.mul_i(units!(b, part), value));
                    }
                }
                let inside = s.sum_i(inside);
                if inside != 0 {
                    request.sums.inside[m][id].fetch_add(u64::from(inside), Ordering::Relaxed);
                }
            }
        }
    }
    if let Some(Features { channels, values }) = request.outputs.features {
        let values = &values[id * channels..][..channels];
        for (picture, &value) in pixels.features.chunks_exact_mut(BLOCKS).zip(values) {
            let value = s.splat(value);
            let mut blocks = mask;
            while blocks != 0 {
                let b = blocks.trailing_zeros() as usize;
                blocks &= blocks - 1;
                for part in 0..parts {
                    let sum = s.load(&picture[b], part);
                    s.store(&mut picture[b], part, s.fma(s.load(&pixels.weights[b], part), value, sum));
                }
            }
        }
    }
}

/// Expected depth of a pixel from its sum and its transmittance.
pub(super) fn expected_depth(sum: f32, transmittance: f32) -> f32 {
    let weight = 1.0 - transmittance.abs();
    if weight > LEAST_WEIGHT { sum / weight } else { f32::NAN }
}
