//! Exact rotation and mirroring of spherical harmonics.

use glam::{BVec3, DMat3, DVec3, Mat3};

/// Turns the harmonics of Gaussians with them: made once, applied to many.
///
/// With `c'` the coefficients after [`Rotation::apply`], `c' . Y(d) = c . Y(R^T d)` for every direction d. Bands do not mix; the
/// constant one stays. Exact in every band up to [`MAX_DEGREE`](super::MAX_DEGREE), up to rounding.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotation {
    /// Of bands 1 and up: a square matrix, row by row.
    bands: Vec<Vec<f32>>,
}

impl Rotation {
    /// The rotation of harmonics up to `degree` that goes with `rotation`. Mirrors (orthogonal, determinant -1) work as well.
    ///
    /// Degrees above [`MAX_DEGREE`](super::MAX_DEGREE) are taken as that.
    pub fn new(degree: u8, rotation: Mat3) -> Self {
        Self { bands: (1..=degree.min(super::MAX_DEGREE)).map(|l| band_rotation(l, rotation)).collect() }
    }

    /// Turns the coefficients of one Gaussian, coefficient-major, red green blue inner, as in
    /// [`Cloud::sh_of`](crate::Cloud::sh_of).
    ///
    /// # Panics
    /// If there are fewer than `3 * (degree + 1)^2` values.
    pub fn apply(&self, coefficients: &mut [f32]) {
        let mut at = 3;
        for (l, matrix) in (1usize..).zip(&self.bands) {
            let n = 2 * l + 1;
            let mut turned = [0.0f32; 27];
            for (row, out) in matrix.chunks_exact(n).zip(turned.as_chunks_mut::<3>().0) {
                for (weight, c) in row.iter().zip(coefficients[at..].as_chunks::<3>().0) {
                    for channel in 0..3 {
                        out[channel] += weight * c[channel];
                    }
                }
            }
            coefficients[at..at + 3 * n].copy_from_slice(&turned[..3 * n]);
            at += 3 * n;
        }
    }
}

/// Which axes (bits 1, 2 and 4 for x, y and z) every harmonic is odd in.
const ODD: [u8; 25] = [
    0, //
    2, 4, 1, //
    3, 6, 0, 5, 0, //
    2, 7, 2, 4, 1, 4, 1, //
    3, 6, 3, 6, 0, 5, 0, 5, 0,
];

/// Mirrors the coefficients of one Gaussian along the `axes` that are set: the sign of every harmonic that is odd in an odd number of
/// them changes. Layout as in [`Cloud::sh_of`](crate::Cloud::sh_of); any degree.
pub fn mirror(axes: BVec3, coefficients: &mut [f32]) {
    let axes = axes.bitmask() as u8;
    for (odd, rgb) in ODD.iter().zip(coefficients.as_chunks_mut::<3>().0) {
        if (odd & axes).count_ones() % 2 == 1 {
            *rgb = rgb.map(|c| -c);
        }
    }
}

/// The matrix, row by row, `2 l + 1` a side, that rotates the coefficients of band `l` (1 to 4): with `c' = M c`,
/// `c' . Y(d) = c . Y(R^T d)` for every direction d.
///
/// Harmonics are orthonormal, so `M_kj = integral of Y_k(d) Y_j(R^T d)` over the sphere. The integrand is a polynomial of
/// degree 8 at most: five Gauss-Legendre nodes in z and nine even steps around it integrate that exactly.
fn band_rotation(l: u8, rotation: Mat3) -> Vec<f32> {
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
        super::basis(l, d.as_vec3(), &mut y);
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
    use glam::{Quat, Vec3};

    use super::*;
    use crate::sh;

    fn directions() -> impl Iterator<Item = Vec3> {
        (0..40).map(|i| {
            let i = i as f32;
            Vec3::new((1.3 * i).sin(), (2.1 * i + 0.4).cos(), (0.7 * i + 1.0).sin()).normalize()
        })
    }

    fn coefficients(degree: u8) -> Vec<f32> {
        (0..3 * sh::coefficient_count(degree)).map(|k| 0.2 * (1.7 * k as f32).sin()).collect()
    }

    /// Sums in f64, not clamped as colours are.
    fn value(degree: u8, c: &[f32], d: Vec3) -> [f64; 3] {
        let mut y = [0.0; 25];
        sh::basis(degree, d, &mut y);
        let pick = |channel: usize| {
            c.iter().skip(channel).step_by(3).zip(&y).map(|(&c, &y)| f64::from(c) * f64::from(y)).sum()
        };
        [pick(0), pick(1), pick(2)]
    }

    fn assert_same(degree: u8, a: &[f32], at: Vec3, b: &[f32], bt: Vec3) {
        for (x, y) in value(degree, a, at).into_iter().zip(value(degree, b, bt)) {
            assert!((x - y).abs() < 1e-5, "degree {degree}, {at}: {x} {y}");
        }
    }

    #[test]
    fn turned_coefficients_seen_from_a_turned_direction_are_as_before() {
        for degree in 0..=4 {
            for k in 0..12 {
                let k = k as f32;
                let q = Quat::from_euler(glam::EulerRot::YXZ, 0.9 * k, 2.3 * k + 0.1, 1.4 * k);
                let before = coefficients(degree);
                let mut after = before.clone();
                Rotation::new(degree, Mat3::from_quat(q)).apply(&mut after);
                directions().for_each(|d| assert_same(degree, &before, d, &after, q * d));
            }
        }
    }

    #[test]
    fn mirrors_change_signs_by_parity_in_every_band() {
        for bits in 0..8 {
            let axes = BVec3::new(bits & 1 != 0, bits & 2 != 0, bits & 4 != 0);
            let flip = Vec3::select(axes, Vec3::NEG_ONE, Vec3::ONE);
            for degree in 0..=4 {
                let before = coefficients(degree);
                let mut after = before.clone();
                mirror(axes, &mut after);
                directions().for_each(|d| assert_same(degree, &before, d, &after, flip * d));
                let mut turned = before.clone();
                Rotation::new(degree, Mat3::from_diagonal(flip)).apply(&mut turned);
                directions().for_each(|d| assert_same(degree, &turned, d, &after, d));
                mirror(axes, &mut after);
                assert_eq!(after, before);
            }
        }
    }

    #[test]
    fn matrices_of_bands_are_orthogonal_and_compose_as_rotations_do() {
        let (a, b) = (Quat::from_rotation_y(1.1), Quat::from_euler(glam::EulerRot::ZYX, 0.3, 2.0, -0.7));
        let matrix = |l: u8, q: Quat| band_rotation(l, Mat3::from_quat(q));
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
}
