//! Arrays turned, mirrored, scaled and moved as a whole, spherical harmonics included.

use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use splat_core::{CloudArrays, sh};

use super::flip::Flip;

/// Gaussians per task.
const BLOCK: usize = 1 << 12;

/// Maps every Gaussian by `x -> scale * m * x + translation`; `m` is orthogonal and may mirror.
///
/// Changes of sign are exact to the bit; everything else rounds.
pub(crate) fn apply(arrays: &mut CloudArrays, m: Mat3, scale: f32, translation: Vec3) {
    let signs = Vec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
    if m == Mat3::from_diagonal(signs) && signs.abs() == Vec3::ONE {
        if signs != Vec3::ONE {
            Flip::new(signs).apply(arrays);
        }
    } else {
        // A mirror is a change of one sign and a rotation.
        let mirror = if m.determinant() < 0.0 { Vec3::new(1.0, 1.0, -1.0) } else { Vec3::ONE };
        if mirror != Vec3::ONE {
            Flip::new(mirror).apply(arrays);
        }
        rotate(arrays, m * Mat3::from_diagonal(mirror));
    }
    if scale != 1.0 {
        let log = scale.ln();
        arrays.means.par_iter_mut().with_min_len(BLOCK).for_each(|mean| *mean *= scale);
        arrays.log_scales.par_iter_mut().with_min_len(BLOCK).for_each(|s| *s += log);
    }
    if translation != Vec3::ZERO {
        arrays.means.par_iter_mut().with_min_len(BLOCK).for_each(|mean| *mean += translation);
    }
}

fn rotate(arrays: &mut CloudArrays, m: Mat3) {
    let q = Quat::from_mat3(&m).normalize();
    arrays.means.par_iter_mut().with_min_len(BLOCK).for_each(|mean| *mean = m * *mean);
    arrays.rotations.par_iter_mut().with_min_len(BLOCK).for_each(|r| *r = q * *r);
    let degree = arrays.sh_degree;
    let bands: Vec<Vec<f32>> = (1..=degree).map(|l| band_rotation(l, m)).collect();
    arrays.sh.par_chunks_exact_mut(3 * sh::coefficient_count(degree)).with_min_len(BLOCK).for_each(|values| {
        let mut at = 3;
        for (l, matrix) in (1..).zip(&bands) {
            let n = 2 * l + 1;
            let mut turned = [[0.0f32; 3]; 9];
            let band = &mut values[at..at + 3 * n];
            for (out, row) in turned.iter_mut().zip(matrix.chunks_exact(n)) {
                for (weight, c) in row.iter().zip(band.as_chunks::<3>().0) {
                    for channel in 0..3 {
                        out[channel] += weight * c[channel];
                    }
                }
            }
            band.copy_from_slice(turned[..n].as_flattened());
            at += 3 * n;
        }
    });
}

/// The matrix, row by row, that turns the coefficients of band `l`: `M_kj = integral of Y_k(d) Y_j(R^T d)` over all
/// directions, by a product rule (Gauss-Legendre in z, equal steps around it) that is exact up to degree 9.
fn band_rotation(l: u8, m: Mat3) -> Vec<f32> {
    /// Nodes and weights of the five-point Gauss-Legendre rule on -1..1.
    const NODES: [(f64, f64); 5] = [
        (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    ];
    const AROUND: usize = 10;
    let n = 2 * usize::from(l) + 1;
    let first = usize::from(l) * usize::from(l);
    let mut matrix = vec![0.0f64; n * n];
    let (mut here, mut there) = ([0.0; 25], [0.0; 25]);
    for (z, weight) in NODES {
        let weight = weight * std::f64::consts::TAU / AROUND as f64;
        for step in 0..AROUND {
            let angle = std::f64::consts::TAU * step as f64 / AROUND as f64;
            let r = (1.0 - z * z).sqrt();
            let d = Vec3::new((r * angle.cos()) as f32, (r * angle.sin()) as f32, z as f32);
            sh::basis(l, d, &mut here);
            sh::basis(l, m.transpose() * d, &mut there);
            for k in 0..n {
                for j in 0..n {
                    matrix[k * n + j] += weight * f64::from(here[first + k]) * f64::from(there[first + j]);
                }
            }
        }
    }
    matrix.into_iter().map(|v| v as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(degree: u8) -> CloudArrays {
        CloudArrays {
            means: vec![Vec3::new(1.0, 2.0, 3.0)],
            log_scales: vec![Vec3::new(-1.0, -2.0, -3.0)],
            rotations: vec![Quat::from_xyzw(0.1, -0.5, 0.3, 0.7).normalize()],
            opacity_logits: vec![0.0],
            sh_degree: degree,
            sh: (0..3 * sh::coefficient_count(degree)).map(|i| ((i * 37 % 19) as f32 - 9.0) / 40.0).collect(),
            ..CloudArrays::default()
        }
    }

    fn covariance(arrays: &CloudArrays) -> Mat3 {
        let s = arrays.log_scales[0];
        let m = Mat3::from_quat(arrays.rotations[0]) * Mat3::from_diagonal(Vec3::new(s.x.exp(), s.y.exp(), s.z.exp()));
        m * m.transpose()
    }

    #[test]
    fn a_turned_gaussian_looks_the_same_from_the_turned_direction() {
        let rotation = Mat3::from_quat(Quat::from_xyzw(0.3, 0.2, -0.6, 0.5).normalize());
        let mirrored = rotation * Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0));
        let swapped = Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::NEG_Y);
        for m in [rotation, mirrored, swapped, Mat3::from_diagonal(Vec3::new(-1.0, -1.0, 1.0))] {
            for degree in 0..=4 {
                let before = one(degree);
                let mut after = before.clone();
                apply(&mut after, m, 2.0, Vec3::new(5.0, 0.0, -1.0));
                let mean = 2.0 * (m * before.means[0]) + Vec3::new(5.0, 0.0, -1.0);
                assert!(after.means[0].abs_diff_eq(mean, 1e-5));
                let expected = m * covariance(&before) * m.transpose() * 4.0;
                assert!(covariance(&after).abs_diff_eq(expected, 1e-5), "{m}");
                for direction in [Vec3::X, Vec3::new(0.36, 0.48, 0.8), Vec3::new(-0.6, 0.64, -0.48)] {
                    let old = sh::color(degree, &before.sh, direction);
                    let new = sh::color(degree, &after.sh, m * direction);
                    assert!(old.abs_diff_eq(new, 1e-5), "degree {degree}: {old} {new}");
                }
            }
        }
    }
}
