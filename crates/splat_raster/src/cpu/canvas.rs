//! [`Canvas`]: the pictures of a frame, written tile by tile from many threads.

use super::blend::{BLOCK, BLOCKS, Pixels, expected_depth, pixel_of};
use super::shared::Shared;
use super::simd::{GROUP, Group};
use super::splat::TILE;
use crate::{Frame, Outputs};

/// The pictures of a frame.
pub(super) struct Canvas<'a> {
    color: Shared<'a, [f32; 4]>,
    median_depth: Shared<'a, f32>,
    expected_depth: Shared<'a, f32>,
    features: Shared<'a, f32>,
    first_hits: Shared<'a, u32>,
    strongest: Shared<'a, u32>,
}

impl<'a> Canvas<'a> {
    pub(super) fn new(frame: &'a mut Frame) -> Self {
        Self {
            color: Shared::new(&mut frame.color),
            median_depth: Shared::new(&mut frame.median_depth),
            expected_depth: Shared::new(&mut frame.expected_depth),
            features: Shared::new(&mut frame.features),
            first_hits: Shared::new(&mut frame.first_hits),
            strongest: Shared::new(&mut frame.strongest),
        }
    }

    /// Writes a tile to all pictures asked for. Each tile is written by one thread only: its caller's.
    #[inline(always)]
    pub(super) fn write(&self, outputs: &Outputs, size: (usize, usize), corner: (usize, usize), pixels: &Pixels) {
        let channels = outputs.features.map_or(0, |f| f.channels);
        let (width, height) = (TILE.min(size.0 - corner.0), TILE.min(size.1 - corner.1));
        for y in 0..height {
            let start = (corner.1 + y) * size.0 + corner.0;
            if outputs.color {
                // SAFETY: rows of different tiles do not overlap, and one tile is written by one thread.
                let row = unsafe { self.color.part(start, width) };
                for (x, four) in row.chunks_mut(BLOCK).enumerate() {
                    let (b, i) = block_of(x * BLOCK, y);
                    write_colors(pixels, b, i, four);
                }
            }
            macro_rules! row {
                ($on:expr, $picture:ident, |$b:ident, $i:ident| $value:expr) => {
                    if $on {
                        // SAFETY: as above.
                        let row = unsafe { self.$picture.part(start, width) };
                        for (x, to) in row.iter_mut().enumerate() {
                            let ($b, $i) = block_of(x, y);
                            *to = $value;
                        }
                    }
                };
            }
            row!(outputs.median_depth, median_depth, |b, i| pixels.median[b].0[i]);
            row!(outputs.expected_depth, expected_depth, |b, i| {
                expected_depth(pixels.depth[b].0[i], pixels.transmittance[b].0[i])
            });
            row!(outputs.first_hits.is_some(), first_hits, |b, i| pixels.hits[b].0[i].to_bits());
            row!(outputs.strongest, strongest, |b, i| pixels.strongest[b].0[i].to_bits());
            if channels > 0 {
                // SAFETY: as above.
                let row = unsafe { self.features.part(start * channels, width * channels) };
                for (x, to) in row.chunks_exact_mut(channels).enumerate() {
                    let (b, i) = block_of(x, y);
                    for (c, to) in to.iter_mut().enumerate() {
                        *to = pixels.features[c * BLOCKS + b].0[i];
                    }
                }
            }
        }
    }
}

/// Colours of the (up to four) pixels of one row of a block, whose first is `i`.
#[inline(always)]
fn write_colors(pixels: &Pixels, b: usize, i: usize, to: &mut [[f32; 4]]) {
    let four = |group: &Group<f32>| -> [f32; BLOCK] {
        let mut out = [0.0; BLOCK];
        out.copy_from_slice(&group.0[i..i + BLOCK]);
        out
    };
    let [red, green, blue] = [&pixels.color[0][b], &pixels.color[1][b], &pixels.color[2][b]];
    let (red, green, blue, t) = (four(red), four(green), four(blue), four(&pixels.transmittance[b]));
    let mut out = [[0.0; 4]; BLOCK];
    for k in 0..BLOCK {
        out[k] = [red[k], green[k], blue[k], 1.0 - t[k].abs()];
    }
    match to.first_chunk_mut::<BLOCK>() {
        Some(to) => *to = out,
        None => to.copy_from_slice(&out[..to.len()]),
    }
}

/// Block of a pixel of a tile, and which of the block's pixels it is: the inverse of [`pixel_of`].
#[inline(always)]
fn block_of(x: usize, y: usize) -> (usize, usize) {
    let b = y / BLOCK * (TILE / BLOCK) + x / BLOCK;
    let i = y % BLOCK * BLOCK + x % BLOCK;
    debug_assert!(i < GROUP && pixel_of(b, i) == (x, y));
    (b, i)
}
