//! What the tests share: seeded clouds and views, and the slow reference.

#![allow(dead_code, clippy::print_stdout, reason = "each test program uses its part; skipped tests say so")]

pub(crate) mod slow;

use std::path::PathBuf;
use std::sync::Arc;

use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays, Pose, Projection, Similarity, View};

/// A small generator of random numbers (splitmix64), so that a seed means the same for ever.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// From `low` to `high`.
    pub(crate) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (self.bits() >> 40) as f32 / (1u64 << 24) as f32 * (high - low)
    }

    pub(crate) fn vector(&mut self, low: f32, high: f32) -> Vec3 {
        Vec3::new(self.range(low, high), self.range(low, high), self.range(low, high))
    }

    pub(crate) fn rotation(&mut self) -> Quat {
        let q =
            Quat::from_xyzw(self.range(-1.0, 1.0), self.range(-1.0, 1.0), self.range(-1.0, 1.0), self.range(-1.0, 1.0));
        // Stored ones need not be of unit length.
        if q.length() > 0.1 { q } else { Quat::IDENTITY }
    }

    pub(crate) fn similarity(&mut self) -> Similarity {
        let rotation = self.rotation().normalize();
        Similarity { rotation, scale: self.range(0.5, 2.0), translation: self.vector(-0.5, 0.5) }
    }
}

/// `count` Gaussians about the origin, up to 1.5 away on each axis: needles, discs and blobs, faint and opaque.
pub(crate) fn cloud(seed: u64, count: usize, sh_degree: u8) -> Cloud {
    let mut r = Random(seed);
    let mut a = CloudArrays { sh_degree, ..CloudArrays::default() };
    for _ in 0..count {
        a.means.push(r.vector(-1.5, 1.5));
        let size = r.range(-5.5, -1.5);
        a.log_scales.push(Vec3::splat(size) + r.vector(-1.5, 0.7));
        a.rotations.push(r.rotation());
        a.opacity_logits.push(r.range(-4.0, 6.0));
        for _ in 0..3 {
            a.sh.push(r.range(-1.5, 2.0));
        }
        for _ in 3..3 * (usize::from(sh_degree) + 1).pow(2) {
            a.sh.push(r.range(-0.3, 0.3));
        }
    }
    Cloud::new(a).expect("arrays that fit")
}

/// The same Gaussians, said to be trained with the antialiased low-pass.
pub(crate) fn antialiased(cloud: Cloud) -> Cloud {
    let mut arrays = cloud.into_arrays();
    arrays.source.antialiased = true;
    Cloud::new(arrays).expect("arrays that fit")
}

/// A view of the origin from somewhere at distance 2 to 4, its principal point off the middle.
pub(crate) fn view(seed: u64, width: u32, height: u32) -> View {
    let mut r = Random(seed ^ 0xabcd);
    let eye = r.rotation().normalize() * Vec3::new(0.0, 0.0, r.range(2.0, 4.0));
    let pose = Pose::look_at(eye, r.vector(-0.2, 0.2), r.vector(-1.0, 1.0));
    let mut view = View::perspective(pose, 0.9, width, height);
    view.intrinsics.cx += r.range(-4.0, 4.0);
    view.intrinsics.cy += r.range(-4.0, 4.0);
    view
}

/// The same eye, without perspective.
pub(crate) fn orthographic(mut view: View) -> View {
    view.projection = Projection::Orthographic;
    view.intrinsics.fx = 0.3 * view.width as f32;
    view.intrinsics.fy = 0.3 * view.width as f32;
    view
}

/// A cloud of one Gaussian per entry of (mean, scale, opacity logit), grey, not rotated.
pub(crate) fn plain(gaussians: &[(Vec3, f32, f32)]) -> Arc<Cloud> {
    let arrays = CloudArrays {
        means: gaussians.iter().map(|g| g.0).collect(),
        log_scales: gaussians.iter().map(|g| Vec3::splat(g.1.ln())).collect(),
        rotations: vec![Quat::IDENTITY; gaussians.len()],
        opacity_logits: gaussians.iter().map(|g| g.2).collect(),
        sh: vec![0.3; 3 * gaussians.len()],
        ..CloudArrays::default()
    };
    Arc::new(Cloud::new(arrays).expect("arrays that fit"))
}

/// A view from the origin along +z.
pub(crate) fn forward_view(width: u32, height: u32) -> View {
    View::perspective(
        Pose { world_from_view: splat_core::glam::Mat3::IDENTITY, position: Vec3::ZERO },
        0.9,
        width,
        height,
    )
}

/// The folder of a real capture, if it is there.
pub(crate) fn capture(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("SPLAT_SCENES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../target/scenes"), PathBuf::from);
    let folder = folder.join(name);
    if folder.join("scene.ply").is_file() {
        return Some(folder);
    }
    println!("skipped: needs the captures of ../shared/scenes");
    None
}
