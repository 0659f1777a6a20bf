//! From the room's Gaussians to a [`Cloud`] in the capture's space, ready to be packed.

use glam::{DMat3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays, CloudError, sh};

use crate::cameras::{to_world, world};
use crate::gaussians::Dab;

/// Degree of the harmonics: enough for a broad highlight.
const DEGREE: u8 = 2;
/// Shares of the constant, linear and quadratic Legendre polynomials in a highlight.
const LOBE: [f64; 3] = [0.12, 0.30, 0.33];

/// The cloud, in Morton order of the means, and the label of every Gaussian.
///
/// # Errors
/// Never in practice: the arrays are built together.
pub(crate) fn cloud(dabs: &[Dab]) -> Result<(Cloud, Vec<u8>), CloudError> {
    let mut order: Vec<(u64, usize)> = dabs.iter().enumerate().map(|(k, d)| (morton(d), k)).collect();
    order.sort_unstable();
    let mut a = CloudArrays { sh_degree: DEGREE, ..CloudArrays::default() };
    let mut labels = Vec::with_capacity(dabs.len());
    for (_, k) in order {
        let d = &dabs[k];
        // Half millimetres: every format with 12 fractional bits holds them exactly, and they compress.
        a.means.push(((to_world(d.at) * 2048.0).round() / 2048.0).as_vec3());
        let s = d.sigma.max(glam::DVec3::splat(1e-4));
        a.log_scales.push(Vec3::new(eighth(s.x), eighth(s.y), eighth(s.z)));
        a.rotations.push(quaternion(world().0 * d.axes));
        // Steps of 1/51: opacities that compress.
        let o = ((d.opacity * 51.0).round() / 51.0).clamp(1.0 / 255.0, 254.0 / 255.0);
        a.opacity_logits.push(libm::log(o / (1.0 - o)) as f32);
        harmonics(d, &mut a.sh);
        labels.push(d.label);
    }
    Ok((Cloud::new(a)?, labels))
}

/// Logarithm in steps of 1/8, which every format holds exactly or nearly so.
fn eighth(sigma: f64) -> f32 {
    ((libm::log(sigma) * 8.0).round() / 8.0) as f32
}

/// Place along a Morton curve with 1024 steps per axis.
fn morton(d: &Dab) -> u64 {
    let q = ((d.at + glam::DVec3::splat(8.0)) * 64.0).clamp(glam::DVec3::ZERO, glam::DVec3::splat(1023.0));
    let spread = |x: f64| (0..10).map(|b| (x as u64 >> b & 1) << (3 * b)).sum::<u64>();
    spread(q.x) | spread(q.y) << 1 | spread(q.z) << 2
}

/// Unit quaternion of a rotation, by its largest component (Shepperd 1978).
fn quaternion(m: DMat3) -> Quat {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let trace = x.x + y.y + z.z;
    let (a, b, c, w) = if trace > 0.0 {
        (y.z - z.y, z.x - x.z, x.y - y.x, 1.0 + trace)
    } else if x.x >= y.y && x.x >= z.z {
        (1.0 + x.x - y.y - z.z, y.x + x.y, z.x + x.z, y.z - z.y)
    } else if y.y >= z.z {
        (y.x + x.y, 1.0 + y.y - x.x - z.z, z.y + y.z, z.x - x.z)
    } else {
        (z.x + x.z, z.y + y.z, 1.0 + z.z - x.x - y.y, x.y - y.x)
    };
    let k = 1.0 / (a * a + b * b + c * c + w * w).sqrt();
    Quat::from_xyzw((a * k) as f32, (b * k) as f32, (c * k) as f32, (w * k) as f32)
}

/// Coefficients of a Gaussian: its colour and, where it shines, a lobe about the direction that mirrors the light.
fn harmonics(d: &Dab, out: &mut Vec<f32>) {
    let mut c = [[0.0f64; 3]; 9];
    let base = d.color + d.sheen * LOBE[0];
    c[0] = ((base - glam::DVec3::splat(0.5)) / f64::from(sh::C0)).to_array();
    if d.sheen != glam::DVec3::ZERO {
        let mut y = [0.0f32; 25];
        sh::basis(DEGREE, (world().0 * d.mirror).as_vec3(), &mut y);
        for (k, value) in c.iter_mut().enumerate().skip(1) {
            let band = if k < 4 { 1 } else { 2 };
            // Addition theorem: P_l(a . b) = 4 pi / (2 l + 1) sum_m Y_lm(a) Y_lm(b).
            let share = LOBE[band] * 4.0 * std::f64::consts::PI / (2 * band + 1) as f64 * f64::from(y[k]);
            *value = (d.sheen * share).to_array();
        }
    }
    out.extend(c.iter().flatten().map(|&x| x as f32));
}
