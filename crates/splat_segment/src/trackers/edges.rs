//! Smoothing that stops at edges of colour and depth.

use rayon::prelude::*;

/// How hard it is to cross from a pixel to its right and lower neighbour.
pub(super) struct Guide {
    width: usize,
    height: usize,
    /// Domain distance from (x - 1, y) to (x, y), at least 1.
    across: Vec<f32>,
    /// Domain distance from (x, y - 1) to (x, y), at least 1.
    down: Vec<f32>,
}

impl Guide {
    /// `color`: premultiplied with alpha; `depth`: median depth, NaN where there is none.
    ///
    /// `reach_px`: how far smoothing goes where there is no edge; `color_step`: sum of channel differences that stops it.
    pub(super) fn new(
        (width, height): (usize, usize),
        color: &[[f32; 4]],
        depth: &[f32],
        reach_px: f32,
        color_step: f32,
    ) -> Self {
        let cost = |k: usize, step: usize, before: bool, after: bool| {
            let (a, b) = (k - step, k);
            let c: f32 = (0..4).map(|i| (color[a][i] - color[b][i]).abs()).sum();
            let beyond = (before.then(|| depth[a - step]), after.then(|| depth[b + step]));
            1.0 + reach_px * (c / color_step + if jumps(depth[a], depth[b], beyond) { 8.0 } else { 0.0 })
        };
        let mut across = vec![1.0; width * height];
        let mut down = vec![1.0; width * height];
        across.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            for (x, d) in row.iter_mut().enumerate().skip(1) {
                *d = cost(y * width + x, 1, x > 1, x + 1 < width);
            }
        });
        down.par_chunks_mut(width.max(1)).enumerate().skip(1).for_each(|(y, row)| {
            for (x, d) in row.iter_mut().enumerate() {
                *d = cost(y * width + x, width, y > 1, y + 1 < height);
            }
        });
        Self { width, height, across, down }
    }

    /// Smooths pictures in place by the recursive domain-transform filter (Gastal and Oliveira 2011), three rounds.
    pub(super) fn smooth(&self, pictures: &mut [&mut Vec<f32>], reach_px: f32) {
        const ROUNDS: i32 = 3;
        if self.width == 0 || self.height == 0 {
            return;
        }
        for round in 0..ROUNDS {
            let sigma = reach_px * 3f32.sqrt() * 2f32.powi(ROUNDS - 1 - round) / (4f32.powi(ROUNDS) - 1.0).sqrt();
            // exp(-sqrt(2) / sigma) to the power of the distance.
            let rate = -std::f32::consts::SQRT_2 / sigma;
            for picture in pictures.iter_mut() {
                self.along_rows(picture, rate);
                self.along_columns(picture, rate);
            }
        }
    }

    fn along_rows(&self, picture: &mut [f32], rate: f32) {
        let w = self.width;
        picture.par_chunks_mut(w).zip(self.across.par_chunks(w)).for_each(|(row, distance)| {
            for x in 1..w {
                let a = (rate * distance[x]).exp();
                row[x] += a * (row[x - 1] - row[x]);
            }
            for x in (1..w).rev() {
                let a = (rate * distance[x]).exp();
                row[x - 1] += a * (row[x] - row[x - 1]);
            }
        });
    }

    fn along_columns(&self, picture: &mut [f32], rate: f32) {
        let w = self.width;
        for y in 1..self.height {
            let (above, here) = picture.split_at_mut(y * w);
            let (above, here) = (&above[(y - 1) * w..], &mut here[..w]);
            for x in 0..w {
                let a = (rate * self.down[y * w + x]).exp();
                here[x] += a * (above[x] - here[x]);
            }
        }
        for y in (1..self.height).rev() {
            let (above, here) = picture.split_at_mut(y * w);
            let (above, here) = (&mut above[(y - 1) * w..], &here[..w]);
            for x in 0..w {
                let a = (rate * self.down[y * w + x]).exp();
                above[x] += a * (here[x] - above[x]);
            }
        }
    }
}

/// Whether depth jumps between two neighbouring pixels: by more than the slope on either side explains.
pub(crate) fn jumps(a: f32, b: f32, (before, after): (Option<f32>, Option<f32>)) -> bool {
    if a.is_nan() != b.is_nan() {
        return true;
    }
    let step = (a - b).abs();
    let slope = |near: f32, far: Option<f32>| far.map(|f| (f - near).abs()).filter(|s| s.is_finite()).unwrap_or(0.0);
    // Both NaN: no surface on either side, no jump.
    step > 0.01 * a.min(b) + 2.0 * slope(a, before).max(slope(b, after)).min(0.05 * a.min(b))
}
