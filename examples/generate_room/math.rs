//! Numbers that come out the same on every machine: a seeded generator of random numbers, noise, rotations.
//!
//! Sines and the like come from the `libm` crate, not from the system, so that the room is the same everywhere.

use glam::{DMat3, DVec2, DVec3};

/// Shorthand for a vector.
pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Sine and cosine.
pub(crate) fn sin_cos(x: f64) -> (f64, f64) {
    (libm::sin(x), libm::cos(x))
}

/// Smooth step from 0 at `a` to 1 at `b`.
pub(crate) fn smooth(a: f64, b: f64, x: f64) -> f64 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Linear mix.
pub(crate) fn mix(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    a + (b - a) * t
}

/// Rotation about x, y or z (axis 0, 1, 2) by degrees.
pub(crate) fn turn(axis: usize, degrees: f64) -> DMat3 {
    let (s, c) = sin_cos(degrees * std::f64::consts::PI / 180.0);
    match axis {
        0 => DMat3::from_cols(v(1.0, 0.0, 0.0), v(0.0, c, s), v(0.0, -s, c)),
        1 => DMat3::from_cols(v(c, 0.0, -s), v(0.0, 1.0, 0.0), v(s, 0.0, c)),
        _ => DMat3::from_cols(v(c, s, 0.0), v(-s, c, 0.0), v(0.0, 0.0, 1.0)),
    }
}

/// A right-handed frame whose second axis is the unit vector `up`.
pub(crate) fn frame_of(up: DVec3) -> DMat3 {
    let other = if up.x.abs() < 0.8 { v(1.0, 0.0, 0.0) } else { v(0.0, 0.0, 1.0) };
    let z = other.cross(up).normalize();
    DMat3::from_cols(up.cross(z), up, z)
}

/// A small generator of random numbers (PCG XSH-RR 64/32, O'Neill 2014).
#[derive(Clone, Debug)]
pub(crate) struct Rng(u64);

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        let mut r = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x853c_49e6_748f_ea9b);
        r.bits();
        r.bits();
        r
    }

    fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((old >> 18) ^ old) >> 27) as u32;
        x.rotate_right((old >> 59) as u32)
    }

    /// Uniform in 0..1.
    pub(crate) fn unit(&mut self) -> f64 {
        (f64::from(self.bits()) + 0.5) / 4_294_967_296.0
    }

    /// Uniform in a..b.
    pub(crate) fn range(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    /// Roughly normal (sum of twelve uniforms), mean 0, deviation 1, never beyond 6.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }

    /// Three independent roughly normal numbers.
    pub(crate) fn normal3(&mut self) -> DVec3 {
        v(self.normal(), self.normal(), self.normal())
    }

    /// Uniform on the unit sphere.
    pub(crate) fn direction(&mut self) -> DVec3 {
        let z = self.range(-1.0, 1.0);
        let (s, c) = sin_cos(self.range(0.0, std::f64::consts::TAU));
        let r = (1.0 - z * z).max(0.0).sqrt();
        v(r * c, r * s, z)
    }
}

/// A random number in 0..1 that belongs to three integers.
pub(crate) fn hash3(x: i64, y: i64, z: i64) -> f64 {
    let mut h = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
        ^ (z as u64).wrapping_mul(0x1656_67b1_9e37_79f9);
    h ^= h >> 29;
    h = h.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h ^= h >> 32;
    h = h.wrapping_mul(0x94d0_49bb_1331_11eb);
    h ^= h >> 31;
    (h >> 11) as f64 / (1u64 << 53) as f64
}

/// Value noise in 0..1, one feature per unit.
pub(crate) fn noise(p: DVec3) -> f64 {
    let f = p.floor();
    let (x, y, z) = (f.x as i64, f.y as i64, f.z as i64);
    let t = p - f;
    let u = t * t * (DVec3::splat(3.0) - t * 2.0);
    let mut sum = 0.0;
    for k in 0..8 {
        let (i, j, l) = (k & 1, k >> 1 & 1, k >> 2 & 1);
        let w = (if i == 1 { u.x } else { 1.0 - u.x })
            * (if j == 1 { u.y } else { 1.0 - u.y })
            * (if l == 1 { u.z } else { 1.0 - u.z });
        sum += w * hash3(x + i, y + j, z + l);
    }
    sum
}

/// Noise of several octaves in 0..1.
pub(crate) fn fbm(p: DVec3, octaves: u32) -> f64 {
    let (mut sum, mut weight, mut total, mut q) = (0.0, 0.5, 0.0, p);
    for _ in 0..octaves {
        sum += weight * noise(q);
        total += weight;
        weight *= 0.5;
        q = q * 2.03 + v(17.1, 9.2, 5.3);
    }
    sum / total
}

/// Distance from a point to a polyline.
pub(crate) fn polyline_distance(p: DVec2, line: &[DVec2]) -> f64 {
    let mut best = f64::MAX;
    for s in line.windows(2) {
        let (a, ba) = (s[0], s[1] - s[0]);
        let t = ((p - a).dot(ba) / ba.length_squared().max(1e-18)).clamp(0.0, 1.0);
        best = best.min((p - a - ba * t).length_squared());
    }
    best.sqrt()
}
