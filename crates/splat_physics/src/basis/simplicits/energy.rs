//! The loss: elastic energy of random motions, and how far the weights are from orthonormal.
//!
//! `F = I + sum_j (w_j Z_j[:, :3] + (Z_j [X; 1]) (grad w_j)^T)`. With `G_(jc),b = w_j delta_cb + [X; 1]_c d_b w_j` the deformation
//! gradients of all points and motions are one product of matrices.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use super::super::random;

/// Random motions `Z_j` of all handles but the constant one.
pub(super) struct Motions {
    pub(super) count: usize,
    weights: usize,
    /// `(3 count) x (4 weights)`: row `3 motion + a`, column `4 j + c`.
    matrix: Vec<f32>,
}

/// Standard deviation of a motion's numbers.
const SIGMA: f64 = 0.1;

impl Motions {
    /// `Z ~ 0.1 N(0, 1)`.
    pub(super) fn random(count: usize, weights: usize, seed: u64, stream: u64) -> Self {
        let pairs = 3 * count * 4 * weights / 2;
        let mut matrix = Vec::with_capacity(2 * pairs);
        for k in 0..pairs as u64 {
            // Box and Muller; the logarithm's argument lies in 0..=1 without 0.
            let (u, v) = (1.0 - random::unit(seed, stream, 2 * k), random::unit(seed, stream, 2 * k + 1));
            let (length, angle) = (SIGMA * (-2.0 * u.ln()).sqrt(), std::f64::consts::TAU * v);
            matrix.push((length * angle.cos()) as f32);
            matrix.push((length * angle.sin()) as f32);
        }
        Self { count, weights, matrix }
    }

    /// `Z_j` of a motion, row `a`, column `c`.
    #[cfg(test)]
    pub(super) fn at(&self, motion: usize, j: usize, a: usize, c: usize) -> f64 {
        f64::from(self.matrix[3 * motion + a + 3 * self.count * (4 * j + c)])
    }
}

/// Where the energy is measured: a place and the constants of its material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// In the normalised box.
    pub(super) at: [f32; 3],
    pub(super) lambda: f32,
    pub(super) mu: f32,
}

/// Room for the energy of some points.
pub(super) struct Elastic {
    /// `(4 weights) x (3 points)`: row `4 j + c`, column `b points + point`.
    g: Vec<f32>,
    /// `(3 motions) x (3 points)`.
    f: Vec<f32>,
}

impl Elastic {
    pub(super) fn new(weights: usize, motions: usize, points: usize) -> Self {
        Self { g: vec![0.0; 4 * weights * 3 * points], f: vec![0.0; 3 * motions * 3 * points] }
    }

    /// Energy of all points and motions times `scale`; sets `gradient` to its gradient by the network's outputs.
    ///
    /// `outputs`: `weights x (4 points)` as the network gives them. `ramp`: 0 is the linear energy, 1 the neo-Hookean one.
    pub(super) fn evaluate(
        &mut self,
        motions: &Motions,
        points: &[Point],
        outputs: &[f32],
        (scale, ramp): (f32, f32),
        gradient: &mut [f32],
    ) -> f64 {
        let (n, k, rows) = (points.len(), motions.weights, 3 * motions.count);
        for (p, point) in points.iter().enumerate() {
            let place = [point.at[0], point.at[1], point.at[2], 1.0];
            for b in 0..3 {
                let column = &mut self.g[4 * k * (b * n + p)..][..4 * k];
                let (values, slopes) = (&outputs[k * p..][..k], &outputs[k * ((1 + b) * n + p)..][..k]);
                for ((four, value), slope) in column.chunks_exact_mut(4).zip(values).zip(slopes) {
                    four.iter_mut().zip(place).for_each(|(g, x)| *g = x * slope);
                    four[b] += value;
                }
            }
        }
        let z = MatRef::from_column_major_slice(&motions.matrix, rows, 4 * k);
        let g = MatMut::from_column_major_slice_mut(&mut self.g, 4 * k, 3 * n);
        let f = MatMut::from_column_major_slice_mut(&mut self.f, rows, 3 * n);
        matmul(f, Accum::Replace, z, g.as_ref(), 1.0, Par::Seq);
        let mut sum = 0.0;
        let (fx, rest) = self.f.split_at_mut(rows * n);
        let (fy, fz) = rest.split_at_mut(rows * n);
        for (p, point) in points.iter().enumerate() {
            let (x, y, z) = (&mut fx[rows * p..][..rows], &mut fy[rows * p..][..rows], &mut fz[rows * p..][..rows]);
            let mut own = 0.0;
            for ((x, y), z) in x.chunks_exact_mut(3).zip(y.chunks_exact_mut(3)).zip(z.chunks_exact_mut(3)) {
                let delta = [[x[0], x[1], x[2]], [y[0], y[1], y[2]], [z[0], z[1], z[2]]];
                let (energy, stress) = density(delta, point.lambda, point.mu, ramp);
                own += energy;
                for a in 0..3 {
                    (x[a], y[a], z[a]) = (scale * stress[0][a], scale * stress[1][a], scale * stress[2][a]);
                }
            }
            sum += f64::from(own);
        }
        let f = MatRef::from_column_major_slice(&self.f, rows, 3 * n);
        let g = MatMut::from_column_major_slice_mut(&mut self.g, 4 * k, 3 * n);
        matmul(g, Accum::Replace, z.transpose(), f, 1.0, Par::Seq);
        gradient.fill(0.0);
        for (p, point) in points.iter().enumerate() {
            let place = [point.at[0], point.at[1], point.at[2], 1.0];
            for b in 0..3 {
                let column = &self.g[4 * k * (b * n + p)..][..4 * k];
                let (values, slopes) = gradient.split_at_mut(k * n);
                let (values, slopes) = (&mut values[k * p..][..k], &mut slopes[k * (b * n + p)..][..k]);
                for ((four, value), slope) in column.chunks_exact(4).zip(values).zip(slopes) {
                    *slope = four.iter().zip(place).map(|(g, x)| g * x).sum();
                    *value += four[b];
                }
            }
        }
        sum * f64::from(scale)
    }
}

/// Energy per volume and its gradient by `F`; `delta[b][a]` is `F_ab - delta_ab`.
///
/// `(1 - ramp)` of the linear energy and `ramp` of the stable neo-Hookean one (Smith, de Goes, Kim 2018) with `lambda + mu` in the
/// place of `lambda`, both written in what differs from rest.
fn density(delta: [[f32; 3]; 3], lambda: f32, mu: f32, ramp: f32) -> (f32, [[f32; 3]; 3]) {
    let d = delta;
    let trace = d[0][0] + d[1][1] + d[2][2];
    let mut stress = [[0.0; 3]; 3];
    let mut strain_squared = 0.0;
    let mut squared = 0.0;
    for b in 0..3 {
        for a in 0..3 {
            let strain = 0.5 * (d[b][a] + d[a][b]);
            strain_squared += strain * strain;
            squared += d[b][a] * d[b][a];
            stress[b][a] = (1.0 - ramp) * 2.0 * mu * strain;
        }
        stress[b][b] += (1.0 - ramp) * lambda * trace;
    }
    let linear = mu * strain_squared + 0.5 * lambda * trace * trace;

    let mut f = d;
    (0..3).for_each(|k| f[k][k] += 1.0);
    let cross =
        |u: [f32; 3], v: [f32; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let cofactor = [cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1])];
    let j = f[0][0] * cofactor[0][0] + f[0][1] * cofactor[0][1] + f[0][2] * cofactor[0][2] - 1.0;
    // |F|^2 - 3 = |delta|^2 + 2 tr(delta).
    let stable = 0.5 * mu * (squared + 2.0 * trace) + 0.5 * (lambda + mu) * j * j - mu * j;
    let pressure = (lambda + mu) * j - mu;
    for b in 0..3 {
        for a in 0..3 {
            stress[b][a] += ramp * (mu * f[b][a] + pressure * cofactor[b][a]);
        }
    }
    ((1.0 - ramp) * linear + ramp * stable, stress)
}

/// `weight * mean((W^T W - I)^2)` of the Gram matrix, and what the outputs' values are to be multiplied by from the left for its
/// gradient.
///
/// `gram`: `weights x weights`, summed over the points.
pub(super) fn orthogonality(gram: &[f64], weights: usize, weight: f64) -> (f64, Vec<f32>) {
    let scale = weight / (weights * weights) as f64;
    let off = |k: usize| gram[k] - f64::from(u8::from(k / weights == k % weights));
    let loss = (0..gram.len()).map(|k| off(k) * off(k)).sum::<f64>() * scale;
    (loss, (0..gram.len()).map(|k| (4.0 * scale * off(k)) as f32).collect())
}

/// The Gram matrix of the outputs' values: `sum over points of w w^T`.
pub(super) fn gram(outputs: &[f32], weights: usize, points: usize) -> Vec<f32> {
    let values = MatRef::from_column_major_slice(&outputs[..weights * points], weights, points);
    let mut gram = vec![0.0; weights * weights];
    let target = MatMut::from_column_major_slice_mut(&mut gram, weights, weights);
    matmul(target, Accum::Replace, values, values.transpose(), 1.0, Par::Seq);
    gram
}

/// Adds the gradient of the orthogonality loss to that by the outputs' values.
pub(super) fn add_orthogonality(factor: &[f32], outputs: &[f32], weights: usize, points: usize, gradient: &mut [f32]) {
    let factor = MatRef::from_column_major_slice(factor, weights, weights);
    let values = MatRef::from_column_major_slice(&outputs[..weights * points], weights, points);
    let target = MatMut::from_column_major_slice_mut(&mut gradient[..weights * points], weights, points);
    matmul(target, Accum::Add, factor, values, 1.0, Par::Seq);
}
