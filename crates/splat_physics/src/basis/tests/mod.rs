//! Tests of cages and of the lowest modes.

mod cage;
mod modes;

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec3, UVec3, dvec3};

use super::*;
use crate::{Material, Solid};

/// A material of some stiffness.
pub(super) fn material(youngs_modulus: f32, poisson_ratio: f32) -> Material {
    Material {
        density: 1000.0,
        youngs_modulus,
        poisson_ratio,
        friction_static: 0.5,
        friction_dynamic: 0.4,
        restitution: 0.3,
        damping_ratio: 0.05,
    }
}

/// The beam of the measured problems: 1 m x 0.2 m x 0.2 m, 20 x 4 x 4 cells.
pub(super) fn beam() -> Solid {
    Solid::cuboid(DVec3::ZERO, dvec3(1.0, 0.2, 0.2), 0.05)
}

/// A box of voxels with those outside of `inside` taken out; `inside` gets voxel numbers along the axes.
fn carved(dims: UVec3, voxel: f64, inside: impl Fn(UVec3) -> bool) -> Solid {
    let mut solid = Solid::cuboid(DVec3::ZERO, dims.as_dvec3() * voxel, voxel);
    for k in 0..solid.weights.len() {
        let (nx, ny) = (dims.x as usize, dims.y as usize);
        let at = UVec3::new((k % nx) as u32, (k / nx % ny) as u32, (k / (nx * ny)) as u32);
        if !inside(at) {
            solid.weights[k] = 0.0;
        }
    }
    solid
}

/// Counts reports; asks to stop after some of them.
#[derive(Default)]
pub(super) struct Watch {
    pub(super) reports: AtomicU32,
    pub(super) stop_after: Option<u32>,
}

impl Progress for Watch {
    fn report(&self, fraction: f32) {
        assert!((0.0..=1.0).contains(&fraction));
        self.reports.fetch_add(1, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.stop_after.is_some_and(|count| self.reports.load(Ordering::Relaxed) >= count)
    }
}

/// On so many threads.
pub(super) fn on_threads<T: Send>(count: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap().install(work)
}
