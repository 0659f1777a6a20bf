//! Shared by the integration tests: where the captures are, seeded random numbers, random clouds.
#![allow(dead_code, reason = "every test file uses a part of this")]
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "this is a test")]

use std::path::PathBuf;

use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays, sh};

/// A file or folder of the expanded captures; prints why and gives `None` if it is absent.
pub(crate) fn capture(name: &str) -> Option<PathBuf> {
    let scenes = std::env::var_os("SPLAT_SCENES")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/scenes")), PathBuf::from);
    let path = scenes.join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: needs the captures of ../shared/scenes");
    None
}

/// SplitMix64: the same numbers everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In 0..1.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}

/// Clouds with values as training makes them, unit rotations included.
pub(crate) fn random_cloud(seed: u64, count: usize, sh_degree: u8) -> Cloud {
    let mut r = Random(seed);
    let mut arrays = CloudArrays { sh_degree, ..CloudArrays::default() };
    for _ in 0..count {
        arrays.means.push(Vec3::new(r.between(-4.0, 4.0), r.between(-2.0, 3.0), r.between(-5.0, 5.0)));
        arrays.log_scales.push(Vec3::new(r.between(-8.0, -1.0), r.between(-8.0, -1.0), r.between(-8.0, -1.0)));
        let q = Quat::from_xyzw(r.between(-1.0, 1.0), r.between(-1.0, 1.0), r.between(-1.0, 1.0), r.between(-1.0, 1.0));
        arrays.rotations.push(if q.length() > 0.1 { q.normalize() } else { Quat::IDENTITY });
        arrays.opacity_logits.push(r.between(-4.0, 5.0));
        for k in 0..3 * sh::coefficient_count(sh_degree) {
            arrays.sh.push(if k < 3 { r.between(-1.7, 1.7) } else { r.between(-0.4, 0.4) });
        }
    }
    Cloud::new(arrays).unwrap()
}
