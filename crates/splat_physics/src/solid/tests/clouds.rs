//! Shells of Gaussians of known bodies.

use glam::{DQuat, DVec3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays};

use crate::solid::{Solid, SolidError, SolidSettings};

/// Numbers from 0 to 1 that are the same on every run.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    pub(super) fn vector(&mut self, low: f64, high: f64) -> DVec3 {
        DVec3::new(self.between(low, high), self.between(low, high), self.between(low, high))
    }
}

/// Flat Gaussians, one after another.
#[derive(Clone, Default)]
pub(super) struct Shell {
    pub(super) arrays: CloudArrays,
}

impl Shell {
    /// A Gaussian at `mean`, flat along `normal`, of the sizes and opacities of `facts`.
    pub(super) fn push(&mut self, mean: DVec3, normal: DVec3, random: &mut Random) {
        let tangential = random.between(0.012, 0.022).ln() as f32;
        let other = random.between(0.012, 0.022).ln() as f32;
        let opacity = random.between(0.3, 0.95);
        let turn = Quat::from_rotation_arc(Vec3::Z, normal.as_vec3().normalize());
        self.arrays.means.push(mean.as_vec3());
        self.arrays.log_scales.push(Vec3::new(tangential, other, 0.002f32.ln()));
        self.arrays.rotations.push(turn);
        self.arrays.opacity_logits.push((opacity / (1.0 - opacity)).ln() as f32);
        self.arrays.sh.extend([0.0; 3]);
    }

    /// A sphere around the origin of radius 0.5, as in `facts`: what of it is good.
    pub(super) fn sphere(count: usize, good: impl Fn(DVec3) -> bool) -> Self {
        let (mut shell, mut random) = (Self::default(), Random(1));
        for _ in 0..count {
            let z = random.between(-1.0, 1.0);
            let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
            let normal = DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
            let mean = normal * random.between(0.498, 0.502);
            if good(mean) {
                shell.push(mean, normal, &mut random);
            }
        }
        shell
    }

    /// The surface of boxes from corner to corner, where no other box covers it.
    pub(super) fn boxes(boxes: &[(DVec3, DVec3)], per_square: f64) -> Self {
        let (mut shell, mut random) = (Self::default(), Random(2));
        for (n, &(low, high)) in boxes.iter().enumerate() {
            for axis in 0..3 {
                let size = high - low;
                let area = size[(axis + 1) % 3] * size[(axis + 2) % 3];
                for k in 0..2 * (area * per_square) as usize {
                    let mut mean = low + size * random.vector(0.0, 1.0);
                    mean[axis] = if k % 2 == 0 { low[axis] } else { high[axis] };
                    let mut normal = DVec3::ZERO;
                    normal[axis] = if k % 2 == 0 { -1.0 } else { 1.0 };
                    let covered = |&(l, h): &(DVec3, DVec3)| {
                        let outward = mean + 1e-6 * normal;
                        outward.cmpge(l).all() && outward.cmple(h).all()
                    };
                    if !boxes.iter().enumerate().any(|(m, other)| m != n && covered(other)) {
                        shell.push(mean, normal, &mut random);
                    }
                }
            }
        }
        shell
    }

    /// With small Gaussians anywhere in a cube of half side `half`.
    pub(super) fn floaters(mut self, count: usize, half: f64) -> Self {
        let mut random = Random(3);
        for _ in 0..count {
            let (mean, normal) = (random.vector(-half, half), random.vector(-1.0, 1.0));
            self.push(mean, normal, &mut random);
        }
        self
    }

    pub(super) fn moved(mut self, scale: f64, turn: DQuat, by: DVec3) -> Self {
        for k in 0..self.arrays.means.len() {
            self.arrays.means[k] = (scale * (turn * self.arrays.means[k].as_dvec3()) + by).as_vec3();
            self.arrays.log_scales[k] += scale.ln() as f32;
            self.arrays.rotations[k] = turn.as_quat() * self.arrays.rotations[k];
        }
        self
    }

    pub(super) fn joined(mut self, other: Self) -> Self {
        self.arrays.means.extend(other.arrays.means);
        self.arrays.log_scales.extend(other.arrays.log_scales);
        self.arrays.rotations.extend(other.arrays.rotations);
        self.arrays.opacity_logits.extend(other.arrays.opacity_logits);
        self.arrays.sh.extend(other.arrays.sh);
        self
    }

    pub(super) fn len(&self) -> usize {
        self.arrays.means.len()
    }

    pub(super) fn cloud(&self) -> Cloud {
        Cloud::new(self.arrays.clone()).unwrap()
    }

    pub(super) fn solid(&self, settings: &SolidSettings) -> Result<Solid, SolidError> {
        let ids: Vec<u32> = (0..self.len() as u32).collect();
        Solid::build(&self.cloud(), &ids, 1.0, None, settings)
    }
}

/// Up along z.
pub(super) fn settings() -> SolidSettings {
    SolidSettings { up: DVec3::Z, ..SolidSettings::default() }
}
