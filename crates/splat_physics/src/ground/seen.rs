//! Which voxels Gaussians lie in, and where in them.

use glam::{DMat3, DQuat, DVec3, IVec3, Vec3};
use rayon::prelude::*;
use splat_core::Cloud;

use super::lattice::{PlaceMap, Seen};

/// Less opaque Gaussians are haze.
const LEAST_OPACITY: f32 = 0.05;
/// What is fainter adds nothing.
const FAINTEST: f64 = 0.02;
/// Nothing is more opaque than this.
const MOST_OPAQUE: f64 = 0.999;
/// Gaussians with a larger standard deviation, in metres, are sky and background.
const LARGEST: f64 = 3.0;
/// Steps along an axis of a Gaussian to each side, at most.
const MOST_STEPS: f64 = 48.0;
/// Voxels farther than this from the origin are not of this world.
const FARTHEST: f64 = 1e6;
/// Gaussians handled together: results are added in this order, whatever the number of threads.
const CHUNK: usize = 2048;

/// A Gaussian that counts, in metres, in the grid's frame.
pub(super) struct Grain {
    mean: DVec3,
    /// Axes scaled by the standard deviations along them.
    axes: DMat3,
    sizes: DVec3,
    opacity: f64,
}

/// The Gaussians of `ids`, which are in the cloud, that say where a surface is.
pub(super) fn grains(cloud: &Cloud, ids: &[u32], metres_per_unit: f64, grid_from_body: DQuat) -> Vec<Grain> {
    let grain = |&id: &u32| {
        let id = id as usize;
        let opacity = cloud.opacity(id);
        let mean = grid_from_body * (cloud.means()[id].as_dvec3() * metres_per_unit);
        let sizes = cloud.log_scales()[id].as_dvec3().exp() * metres_per_unit;
        let turn = cloud.rotations()[id].as_dquat();
        let usable = cloud.drawable(id) && opacity >= LEAST_OPACITY && sizes.max_element() <= LARGEST;
        if !usable || !mean.is_finite() || !(turn.length_squared() > 1e-12) {
            return None;
        }
        let turn = DMat3::from_quat(grid_from_body * turn.normalize());
        let axes = DMat3::from_cols(turn.x_axis * sizes.x, turn.y_axis * sizes.y, turn.z_axis * sizes.z);
        Some(Grain { mean, axes, sizes, opacity: f64::from(opacity) })
    };
    ids.par_iter().filter_map(grain).collect()
}

/// The voxels in which Gaussians add up to the opacity `cut`.
///
/// Each is followed in half-voxel steps along its axes, and adds to a voxel what it adds where it is densest there.
pub(super) fn seen(grains: &[Grain], voxel: f64, cut: f32) -> PlaceMap<Seen> {
    let mut sums: PlaceMap<(f32, Vec3)> = PlaceMap::default();
    // In batches, so that memory does not grow with the number of Gaussians.
    for batch in grains.chunks(64 * CHUNK) {
        let touched: Vec<Vec<(IVec3, f32, Vec3)>> = batch
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut out = Vec::new();
                let mut own = Vec::new();
                for grain in chunk {
                    own.clear();
                    follow(grain, voxel, &mut own);
                    own.sort_by_key(|seen| seen.0.to_array());
                    for group in own.chunk_by(|a, b| a.0 == b.0) {
                        let densest = group.iter().map(|t| t.1).fold(0.0, f32::max);
                        let total: f32 = group.iter().map(|t| t.1).sum();
                        let mean = group.iter().map(|t| t.2 * t.1).sum::<Vec3>() / total;
                        out.push((group[0].0, densest, mean));
                    }
                }
                out
            })
            .collect();
        for (at, extinction, offset) in touched.into_iter().flatten() {
            let sum = sums.entry(at).or_default();
            sum.0 += extinction;
            sum.1 += extinction * offset;
        }
    }
    let least = -(1.0 - cut).ln();
    let kept = sums.into_iter().filter(|(_, (weight, _))| *weight >= least);
    kept.map(|(at, (weight, sum))| (at, Seen { weight, offset: sum / weight })).collect()
}

fn follow(grain: &Grain, voxel: f64, out: &mut Vec<(IVec3, f32, Vec3)>) {
    // Out to where it is as faint as the faintest.
    let reach = (2.0 * (grain.opacity / FAINTEST).ln()).max(0.0).sqrt();
    let steps = (reach * grain.sizes / (0.5 * voxel)).ceil().clamp(DVec3::ZERO, DVec3::splat(MOST_STEPS)).as_ivec3();
    let place = |axis: usize, i: i32| reach * f64::from(i) / f64::from(steps[axis].max(1));
    for w in -steps.z..=steps.z {
        for v in -steps.y..=steps.y {
            for u in -steps.x..=steps.x {
                let at = DVec3::new(place(0, u), place(1, v), place(2, w));
                let r2 = at.length_squared();
                if r2 > reach * reach {
                    continue;
                }
                let p = (grain.mean + grain.axes * at) / voxel;
                let cell = p.floor();
                if !(cell.abs().max_element() < FARTHEST) {
                    continue;
                }
                let opacity = (grain.opacity * (-0.5 * r2).exp()).min(MOST_OPAQUE);
                out.push((cell.as_ivec3(), -(1.0 - opacity).ln() as f32, (p - cell - 0.5).as_vec3()));
            }
        }
    }
}
