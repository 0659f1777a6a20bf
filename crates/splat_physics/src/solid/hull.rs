//! The convex hull of voxels, as voxels.

use glam::DVec3;
use rayon::prelude::*;

use super::VoxelGrid;
use super::morphology::Mask;

/// Planes that cut the hull out.
const PLANES: usize = 512;

/// The voxels whose centres are in the convex hull of the centres of those set, to 512 directions.
pub(super) fn hull(mask: &Mask, grid: &VoxelGrid) -> Mask {
    let center = |voxel: usize| grid.at(voxel).as_dvec3();
    let set: Vec<DVec3> = (0..mask.voxels.len()).filter(|&voxel| mask.voxels[voxel] != 0).map(center).collect();
    let planes: Vec<(DVec3, f64)> = (0..PLANES)
        .into_par_iter()
        .map(|k| {
            let direction = direction(k);
            (direction, set.iter().map(|p| p.dot(direction)).fold(f64::NEG_INFINITY, f64::max) + 1e-9)
        })
        .collect();
    let inside = |voxel: usize| {
        let p = center(voxel);
        u8::from(planes.iter().all(|(direction, reach)| p.dot(*direction) <= *reach))
    };
    Mask { dims: mask.dims, voxels: (0..mask.voxels.len()).into_par_iter().map(inside).collect() }
}

/// The axes, then points of a Fibonacci spiral on the unit sphere.
fn direction(k: usize) -> DVec3 {
    if k < 6 {
        return [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z][k];
    }
    let (k, count) = ((k - 6) as f64, (PLANES - 6) as f64);
    let z = 1.0 - (2.0 * k + 1.0) / count;
    let (sin, cos) = (k * std::f64::consts::PI * (3.0 - 5f64.sqrt())).sin_cos();
    DVec3::new(cos, sin, z / (1.0 - z * z).sqrt()) * (1.0 - z * z).sqrt()
}
