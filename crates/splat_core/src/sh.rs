//! Real spherical harmonics in INRIA's order and signs (Kerbl et al. 2023), degree 0 to 4.

use glam::Vec3;

mod rotation;

pub use rotation::{Rotation, mirror};

/// Highest degree supported.
pub const MAX_DEGREE: u8 = 4;
/// Value of the constant harmonic.
pub const C0: f32 = 0.282_094_8;

/// Coefficients per channel of a degree: `(degree + 1)^2`.
pub fn coefficient_count(degree: u8) -> usize {
    let n = usize::from(degree) + 1;
    n * n
}

/// Values of all harmonics up to `degree` in unit direction `d`, written to the front of `out`.
pub fn basis(degree: u8, d: Vec3, out: &mut [f32; 25]) {
    let (x, y, z) = (d.x, d.y, d.z);
    out[0] = C0;
    if degree >= 1 {
        out[1] = -0.488_602_52 * y;
        out[2] = 0.488_602_52 * z;
        out[3] = -0.488_602_52 * x;
    }
    let (x2, y2, z2) = (x * x, y * y, z * z);
    let (xy, yz, xz) = (x * y, y * z, x * z);
    if degree >= 2 {
        out[4] = 1.092_548_5 * xy;
        out[5] = -1.092_548_5 * yz;
        out[6] = 0.315_391_57 * (2.0 * z2 - x2 - y2);
        out[7] = -1.092_548_5 * xz;
        out[8] = 0.546_274_24 * (x2 - y2);
    }
    if degree >= 3 {
        out[9] = -0.590_043_6 * y * (3.0 * x2 - y2);
        out[10] = 2.890_611_4 * xy * z;
        out[11] = -0.457_045_8 * y * (4.0 * z2 - x2 - y2);
        out[12] = 0.373_176_34 * z * (2.0 * z2 - 3.0 * x2 - 3.0 * y2);
        out[13] = -0.457_045_8 * x * (4.0 * z2 - x2 - y2);
        out[14] = 1.445_305_7 * z * (x2 - y2);
        out[15] = -0.590_043_6 * x * (x2 - 3.0 * y2);
    }
    if degree >= 4 {
        out[16] = 2.503_343 * xy * (x2 - y2);
        out[17] = -1.770_130_8 * yz * (3.0 * x2 - y2);
        out[18] = 0.946_174_7 * xy * (7.0 * z2 - 1.0);
        out[19] = -0.669_046_5 * yz * (7.0 * z2 - 3.0);
        out[20] = 0.105_785_55 * (z2 * (35.0 * z2 - 30.0) + 3.0);
        out[21] = -0.669_046_5 * xz * (7.0 * z2 - 3.0);
        out[22] = 0.473_087_35 * (x2 - y2) * (7.0 * z2 - 1.0);
        out[23] = -1.770_130_8 * xz * (x2 - 3.0 * y2);
        out[24] = 0.625_835_7 * (x2 * (x2 - 3.0 * y2) - y2 * (3.0 * x2 - y2));
    }
}

/// Colour of a Gaussian in unit direction `d` (from the camera to its mean, in the cloud's own frame):
/// `max(0, 0.5 + sum_k c_k Y_k(d))` per channel, sRGB-encoded.
///
/// `sh`: coefficients as in [`Cloud::sh_of`](crate::Cloud::sh_of), at least `3 * (degree + 1)^2` floats.
pub fn color(degree: u8, sh: &[f32], d: Vec3) -> Vec3 {
    let mut y = [0.0; 25];
    basis(degree, d, &mut y);
    let mut c = Vec3::splat(0.5);
    for (k, y) in y.iter().enumerate().take(coefficient_count(degree)) {
        c += Vec3::new(sh[3 * k], sh[3 * k + 1], sh[3 * k + 2]) * *y;
    }
    c.max(Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean over the sphere, by a product rule exact for what harmonics up to degree 4 multiply to.
    fn mean(f: impl Fn(Vec3) -> f64) -> f64 {
        let s = 2.0 * (10.0f64 / 7.0).sqrt();
        let (near, far) = ((5.0 - s).sqrt() / 3.0, (5.0 + s).sqrt() / 3.0);
        let w = 13.0 * 70f64.sqrt();
        let nodes = [(far, 322.0 - w), (-far, 322.0 - w), (near, 322.0 + w), (-near, 322.0 + w), (0.0, 512.0)];
        let ring = |z: f64| {
            let r = (1.0 - z * z).sqrt();
            let at = |k: usize| {
                let (sin, cos) = (k as f64 / 9.0 * std::f64::consts::TAU).sin_cos();
                f(Vec3::new((r * cos) as f32, (r * sin) as f32, z as f32))
            };
            (0..9).map(at).sum::<f64>() / 9.0
        };
        nodes.into_iter().map(|(z, weight)| weight / 1800.0 * ring(z)).sum()
    }

    #[test]
    fn harmonics_are_orthonormal() {
        for k in 0..25 {
            for j in 0..=k {
                let product = mean(|d| {
                    let mut y = [0.0; 25];
                    basis(4, d, &mut y);
                    f64::from(y[k]) * f64::from(y[j])
                });
                let wanted = if k == j { 1.0 } else { 0.0 };
                assert!((4.0 * std::f64::consts::PI * product - wanted).abs() < 1e-5, "{k} {j}: {product}");
            }
        }
    }

    #[test]
    fn first_harmonics_have_the_signs_of_the_trained_files() {
        let mut y = [0.0; 25];
        basis(1, Vec3::Y, &mut y);
        assert!(y[1] < 0.0 && y[4..].iter().all(|&v| v == 0.0), "higher bands are left alone");
        basis(1, Vec3::Z, &mut y);
        assert!(y[2] > 0.0);
        basis(1, Vec3::X, &mut y);
        assert!(y[3] < 0.0);
    }

    #[test]
    fn colours_are_the_sum_over_half_and_never_negative() {
        let mut sh = vec![0.0; 12];
        sh[..3].copy_from_slice(&[1.0, -9.0, 0.0]);
        sh[9] = -1.0;
        let c = color(1, &sh, Vec3::X);
        assert!((c.x - (0.5 + C0 + 0.488_602_52)).abs() < 1e-6);
        assert_eq!((c.y, c.z), (0.0, 0.5));
        assert_eq!((0..=4).map(coefficient_count).collect::<Vec<_>>(), [1, 4, 9, 16, 25]);
    }
}
