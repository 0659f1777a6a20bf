//! Elastic Hessians in reduced coordinates, and the lowest frequency that one has.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::{Llt, Solve};
use faer::{Accum, Mat, Par, Side};
use glam::DMat3;

use super::energy::Hessian;

/// `sum_i V_i G_i H_i G_i^T`, `3 rank x 3 rank`, ordered by axis first: unknown `a rank + k` is coordinate k along axis a.
///
/// The rows of the coordinates along the three axes meet only in the 9 x 9 Hessians, so that this is six products of
/// `3 samples x rank` matrices. In `f32`: what a step needs of it is a direction.
pub(super) fn assemble(gradients: &Mat<f32>, volumes: &[f64], hessians: &[Hessian]) -> Mat<f64> {
    let rank = gradients.ncols();
    let mut out = Mat::<f64>::zeros(3 * rank, 3 * rank);
    let mut turned = Mat::<f32>::zeros(gradients.nrows(), rank);
    let mut block = Mat::<f32>::zeros(rank, rank);
    let mut local = vec![[[0.0f32; 3]; 3]; volumes.len()];
    for a in 0..3 {
        for c in a..3 {
            for (local, (h, &v)) in local.iter_mut().zip(hessians.iter().zip(volumes)) {
                *local = std::array::from_fn(|b| std::array::from_fn(|d| (v * h[3 * a + b][3 * c + d]) as f32));
            }
            for k in 0..rank {
                let from = gradients.col_as_slice(k).as_chunks::<3>().0;
                let to = turned.col_as_slice_mut(k).as_chunks_mut::<3>().0;
                for ((to, g), h) in to.iter_mut().zip(from).zip(&local) {
                    *to = std::array::from_fn(|b| h[b][0] * g[0] + h[b][1] * g[1] + h[b][2] * g[2]);
                }
            }
            matmul(block.as_mut(), Accum::Replace, gradients.as_ref().transpose(), turned.as_ref(), 1.0f32, Par::Seq);
            for k in 0..rank {
                for l in 0..rank {
                    let value = f64::from(block[(l, k)]);
                    out[(a * rank + l, c * rank + k)] = value;
                    out[(c * rank + k, a * rank + l)] = value;
                }
            }
        }
    }
    // Rounding leaves the blocks on the diagonal a little unsymmetric.
    for c in 0..3 * rank {
        for r in 0..c {
            let mean = 0.5 * (out[(r, c)] + out[(c, r)]);
            out[(r, c)] = mean;
            out[(c, r)] = mean;
        }
    }
    out
}

/// Square root of the lowest eigenvalue of `hessian` among motions that are not rigid; coordinates have unit mass.
pub(super) fn lowest_frequency(hessian: &Mat<f64>, rest: &Mat<f64>, ones: &[f64]) -> f64 {
    let n = hessian.nrows();
    let rank = n / 3;
    let trace: f64 = (0..n).map(|k| hessian[(k, k)]).sum();
    if !(trace > 0.0 && trace.is_finite()) {
        return f64::NAN;
    }
    let rigid = rigid_motions(rest, ones);
    // Rigid motions are shifted out of the way instead of deflated, the rest by next to nothing.
    let mut shifted = hessian.clone();
    for c in 0..n {
        shifted[(c, c)] += 1e-12 * trace;
        for r in 0..n {
            shifted[(r, c)] += trace * rigid.iter().map(|v| v[r] * v[c]).sum::<f64>();
        }
    }
    let Ok(factor) = Llt::new(shifted.as_ref(), Side::Lower) else { return f64::NAN };
    let mut lowest = f64::INFINITY;
    let mut block = Mat::from_fn(n, 4, |r, c| ((r * 7 + c * 13 + 3) % 17) as f64 - 8.0 + (r % rank) as f64 * 0.01);
    for _ in 0..40 {
        factor.solve_in_place(block.as_mut());
        orthonormalise(&mut block);
        let applied = super::model::product(hessian, &block);
        // Rayleigh's quotients of the columns: inverse iteration turns the first to the lowest motion.
        let quotient = |c: usize| block.col_as_slice(c).iter().zip(applied.col_as_slice(c)).map(|(a, b)| a * b).sum();
        let next = (0..block.ncols()).map(quotient).fold(f64::INFINITY, f64::min);
        let settled = (next - lowest).abs() <= 1e-6 * lowest;
        lowest = next;
        if settled {
            break;
        }
    }
    lowest.max(0.0).sqrt()
}

fn orthonormalise(block: &mut Mat<f64>) {
    for c in 0..block.ncols() {
        for d in 0..c {
            let along: f64 = block.col_as_slice(c).iter().zip(block.col_as_slice(d)).map(|(x, y)| x * y).sum();
            let other = block.col_as_slice(d).to_vec();
            block.col_as_slice_mut(c).iter_mut().zip(other).for_each(|(x, y)| *x -= along * y);
        }
        let length = block.col_as_slice(c).iter().map(|x| x * x).sum::<f64>().sqrt();
        block.col_as_slice_mut(c).iter_mut().for_each(|x| *x /= length.max(f64::MIN_POSITIVE));
    }
}

/// Orthonormal coordinates of the three translations and the three infinitesimal rotations of the body at rest.
fn rigid_motions(rest: &Mat<f64>, ones: &[f64]) -> Vec<Vec<f64>> {
    let rank = ones.len();
    let mut motions: Vec<Vec<f64>> = Vec::new();
    for a in 0..3 {
        let mut v = vec![0.0; 3 * rank];
        v[a * rank..(a + 1) * rank].copy_from_slice(ones);
        motions.push(v);
    }
    for a in 0..3 {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        let mut v = vec![0.0; 3 * rank];
        for k in 0..rank {
            v[b * rank + k] = -rest[(k, c)];
            v[c * rank + k] = rest[(k, b)];
        }
        motions.push(v);
    }
    for at in 0..motions.len() {
        let (done, left) = motions.split_at_mut(at);
        let own = &mut left[0];
        for other in done.iter() {
            let along: f64 = own.iter().zip(other).map(|(x, y)| x * y).sum();
            own.iter_mut().zip(other).for_each(|(x, y)| *x -= along * y);
        }
        let length = own.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        own.iter_mut().for_each(|x| *x /= length);
    }
    motions
}

/// Turns coordinates (`rank x 3`) by a rotation: every `y_k` is a vector in space.
pub(super) fn turned(y: &Mat<f64>, rotation: &DMat3) -> Mat<f64> {
    let r = rotation.to_cols_array_2d();
    Mat::from_fn(y.nrows(), 3, |k, a| (0..3).map(|b| r[b][a] * y[(k, b)]).sum())
}
