//! Made-up captures: flat Gaussians on the surfaces of things, as training leaves them.

use bevy::math::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays};

/// Thickness of a surface, as a standard deviation.
const THIN: f32 = 0.002;

/// Gaussians on surfaces, one thing after the other.
#[derive(Clone, Default)]
pub(super) struct Shells {
    pub(super) means: Vec<Vec3>,
    rotations: Vec<Quat>,
    scales: Vec<Vec3>,
}

impl Shells {
    pub(super) fn len(&self) -> usize {
        self.means.len()
    }

    /// A Gaussian on a surface.
    pub(super) fn push(&mut self, mean: Vec3, normal: Vec3, size: f32) {
        self.means.push(mean);
        self.rotations.push(Quat::from_rotation_arc(Vec3::Z, normal));
        self.scales.push(Vec3::new(size, size, THIN));
    }

    /// A rectangle around `center`, spanned by `u` and `v` (half its sides), with Gaussians `spacing` apart.
    pub(super) fn plate(mut self, center: Vec3, u: Vec3, v: Vec3, spacing: f32) -> Self {
        let normal = u.cross(v).normalize();
        let count = |side: Vec3| (2.0 * side.length() / spacing).ceil().max(1.0) as usize;
        let at = |k: usize, count: usize| 2.0 * (k as f32 + 0.5) / count as f32 - 1.0;
        for a in 0..count(u) {
            for b in 0..count(v) {
                let mean = center + u * at(a, count(u)) + v * at(b, count(v));
                self.push(mean, normal, 0.6 * spacing);
            }
        }
        self
    }

    /// All six faces of a box.
    pub(super) fn cuboid(mut self, center: Vec3, half: Vec3, spacing: f32) -> Self {
        for axis in 0..3 {
            let of = |k: usize| Vec3::AXES[k % 3] * half[k % 3];
            for sign in [-1.0, 1.0] {
                self = self.plate(center + sign * of(axis), of(axis + 1), of(axis + 2), spacing);
            }
        }
        self
    }

    /// A ball.
    pub(super) fn ball(mut self, center: Vec3, radius: f32, count: usize) -> Self {
        let size = radius * (4.0 * std::f32::consts::PI / count as f32).sqrt();
        let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
        for k in 0..count {
            let y = 1.0 - (2 * k + 1) as f32 / count as f32;
            let (sin, cos) = (golden * k as f32).sin_cos();
            let normal = Vec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin);
            self.push(center + radius * normal, normal, 0.6 * size);
        }
        self
    }

    /// The same in another unit and about another origin, turned.
    pub(super) fn moved(mut self, rotation: Quat, scale: f32, by: Vec3) -> Self {
        for k in 0..self.len() {
            self.means[k] = rotation * (self.means[k] * scale) + by;
            self.rotations[k] = rotation * self.rotations[k];
            self.scales[k] *= scale;
        }
        self
    }

    pub(super) fn cloud(&self) -> Cloud {
        let len = self.len();
        let arrays = CloudArrays {
            means: self.means.clone(),
            log_scales: self.scales.iter().map(|s| Vec3::new(s.x.ln(), s.y.ln(), s.z.ln())).collect(),
            rotations: self.rotations.clone(),
            opacity_logits: vec![3.0; len],
            sh: vec![0.0; 3 * len],
            ..CloudArrays::default()
        };
        Cloud::new(arrays).unwrap()
    }
}
