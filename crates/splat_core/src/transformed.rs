//! Clouds moved for good: [`Cloud::transformed`], and the exact rotation of spherical harmonics it needs.

use glam::{DMat3, DVec3, Mat3, Vec3};
use rayon::prelude::*;

use crate::{Cloud, Similarity, sh};

/// Gaussians per task.
const BLOCK: usize = 1 << 12;

impl Cloud {
    /// The cloud moved by `by`, spherical harmonics included: from a moved camera it looks as it did.
    ///
    /// Extra properties are kept as they are; normals (`nx`, `ny`, `nz`) are no exception, because most files hold zeros.
    /// The identity gives an equal cloud, to the bit.
    pub fn transformed(&self, by: &Similarity) -> Cloud {
        let mut arrays = self.clone().into_arrays();
        if *by == Similarity::IDENTITY {
            return self.clone();
        }
        arrays.means.par_iter_mut().with_min_len(BLOCK).for_each(|mean| *mean = by.apply(*mean));
        // A stored rotation need not be of unit length; the product keeps its length.
        arrays.rotations.par_iter_mut().with_min_len(BLOCK).for_each(|r| *r = by.rotation * *r);
        let log = Vec3::splat(by.scale.ln());
        arrays.log_scales.par_iter_mut().with_min_len(BLOCK).for_each(|s| *s += log);
        rotate(arrays.sh_degree, &mut arrays.sh, by.rotation_matrix());
        // Lengths fit because they were not changed.
        Cloud::new(arrays).unwrap_or_default()
    }
}

/// Rotates the coefficients of all Gaussians of a cloud; layout as in [`CloudArrays::sh`](crate::CloudArrays::sh).
fn rotate(degree: u8, values: &mut [f32], rotation: Mat3) {
    let bands: Vec<Vec<f32>> = (1..=degree).map(|l| sh_band_rotation(l, rotation)).collect();
    values.par_chunks_exact_mut(3 * sh::coefficient_count(degree)).with_min_len(BLOCK).for_each(|values| {
        let mut at = 3;
        for (l, matrix) in (1usize..).zip(&bands) {
            let n = 2 * l + 1;
            let mut turned = [0.0f32; 27];
            for (row, out) in matrix.chunks_exact(n).zip(turned.as_chunks_mut::<3>().0) {
                for (weight, c) in row.iter().zip(values[at..].as_chunks::<3>().0) {
                    for channel in 0..3 {
                        out[channel] += weight * c[channel];
                    }
                }
            }
            values[at..at + 3 * n].copy_from_slice(&turned[..3 * n]);
            at += 3 * n;
        }
    });
}

/// The matrix, row by row, `2 l + 1` a side, that rotates the coefficients of band `l` (1 to 4): with `c' = M c`,
/// `c' . Y(d) = c . Y(R^T d)` for every direction d.
///
/// Harmonics are orthonormal, so `M_kj = integral of Y_k(d) Y_j(R^T d)` over the sphere. The integrand is a polynomial of
/// degree 8 at most: five Gauss-Legendre nodes in z and nine even steps around it integrate that exactly.
pub(crate) fn sh_band_rotation(l: u8, rotation: Mat3) -> Vec<f32> {
    const STEPS: usize = 9;
    // Roots of P_5, +-(1/3) sqrt(5 +- 2 sqrt(10/7)) and 0, with weights (322 +- 13 sqrt(70)) / 900 and 128 / 225.
    let inner = 2.0 * (10.0f64 / 7.0).sqrt();
    let (near, far) = ((5.0 - inner).sqrt() / 3.0, (5.0 + inner).sqrt() / 3.0);
    let spread = 13.0 * 70f64.sqrt();
    let (heavy, light) = ((322.0 + spread) / 900.0, (322.0 - spread) / 900.0);
    let nodes = [(-far, light), (-near, heavy), (0.0, 128.0 / 225.0), (near, heavy), (far, light)];

    let n = 2 * usize::from(l) + 1;
    let first = usize::from(l) * usize::from(l);
    let back = rotation.as_dmat3().transpose();
    let band = |d: DVec3| {
        let mut y = [0.0f32; 25];
        sh::basis(l, d.as_vec3(), &mut y);
        let band: [f64; 9] = std::array::from_fn(|k| if k < n { f64::from(y[first + k]) } else { 0.0 });
        band
    };
    let mut matrix = vec![0.0f64; n * n];
    for (z, weight) in nodes {
        let across = (1.0 - z * z).sqrt();
        for step in 0..STEPS {
            let (sin, cos) = (std::f64::consts::TAU * step as f64 / STEPS as f64).sin_cos();
            let d = DVec3::new(across * cos, across * sin, z);
            let (to, from) = (band(d), band(DMat3::mul_vec3(&back, d)));
            let area = weight * std::f64::consts::TAU / STEPS as f64;
            for k in 0..n {
                for j in 0..n {
                    matrix[k * n + j] += area * to[k] * from[j];
                }
            }
        }
    }
    matrix.into_iter().map(|v| v as f32).collect()
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::CloudArrays;

    fn directions() -> impl Iterator<Item = Vec3> {
        (0..40).map(|i| {
            let i = i as f32;
            Vec3::new((1.3 * i).sin(), (2.1 * i + 0.4).cos(), (0.7 * i + 1.0).sin()).normalize()
        })
    }

    fn one(degree: u8) -> Cloud {
        let sh = (0..3 * sh::coefficient_count(degree)).map(|k| 0.3 * (1.7 * k as f32).sin()).collect();
        Cloud::new(CloudArrays {
            means: vec![Vec3::new(1.0, 2.0, 3.0)],
            log_scales: vec![Vec3::new(-1.0, -2.0, -3.0)],
            rotations: vec![Quat::from_rotation_x(0.4) * 2.0],
            opacity_logits: vec![0.5],
            sh_degree: degree,
            sh,
            ..CloudArrays::default()
        })
        .unwrap()
    }

    #[test]
    fn colours_turn_with_the_cloud_in_every_band() {
        let rotation = Quat::from_euler(glam::EulerRot::YXZ, 0.8, -1.9, 2.7);
        let by = Similarity { rotation, scale: 2.0, translation: Vec3::X };
        for degree in 0..=4 {
            let (before, after) = (one(degree), one(degree).transformed(&by));
            for d in directions() {
                let (a, b) = (sh::color(degree, before.sh_of(0), d), sh::color(degree, after.sh_of(0), rotation * d));
                assert!(a.distance(b) < 2e-5, "degree {degree}: {a} {b}");
            }
        }
    }

    #[test]
    fn matrices_of_bands_are_orthogonal_and_compose_as_rotations_do() {
        let (a, b) = (Quat::from_rotation_y(1.1), Quat::from_euler(glam::EulerRot::ZYX, 0.3, 2.0, -0.7));
        let matrix = |l: u8, q: Quat| sh_band_rotation(l, Mat3::from_quat(q));
        for l in 1..=4u8 {
            let n = 2 * usize::from(l) + 1;
            let product =
                |x: &[f32], y: &[f32], k: usize, j: usize| (0..n).map(|i| x[k * n + i] * y[i * n + j]).sum::<f32>();
            let (ma, mb, mab) = (matrix(l, a), matrix(l, b), matrix(l, a * b));
            let back = matrix(l, a.conjugate());
            for k in 0..n {
                for j in 0..n {
                    assert!((product(&ma, &mb, k, j) - mab[k * n + j]).abs() < 1e-5);
                    assert!((product(&ma, &back, k, j) - if k == j { 1.0 } else { 0.0 }).abs() < 1e-5);
                    assert!((ma[k * n + j] - back[j * n + k]).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn covariances_and_means_move_as_points_do() {
        let by =
            Similarity { rotation: Quat::from_rotation_z(0.9), scale: 0.5, translation: Vec3::new(3.0, -1.0, 2.0) };
        let (before, after) = (one(1), one(1).transformed(&by));
        assert!(after.means()[0].distance(by.apply(before.means()[0])) < 1e-6);
        let linear = by.rotation_matrix() * by.scale;
        let wanted = linear * before.covariance(0) * linear.transpose();
        assert!(after.covariance(0).abs_diff_eq(wanted, 1e-6));
        assert!((after.rotations()[0].length() - 2.0).abs() < 1e-5, "the stored length is kept");
        assert_eq!(before.transformed(&Similarity::IDENTITY), before);
        assert!(Cloud::default().transformed(&by).is_empty());
    }
}
