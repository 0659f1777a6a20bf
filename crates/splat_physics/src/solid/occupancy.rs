//! Which voxels Gaussians lie in.

use glam::DVec3;
use rayon::prelude::*;

use super::VoxelGrid;
use super::candidates::Candidate;

/// What is fainter adds nothing.
const FAINTEST: f64 = 0.05;
/// Nothing is more opaque than this.
const MOST_OPAQUE: f64 = 0.999;
/// Candidates handled together: results are added in this order, whatever the number of threads.
const CHUNK: usize = 1024;
/// Steps along an axis of a Gaussian, at most to each side.
const MOST_STEPS: f64 = 64.0;

/// Extinction that a candidate adds to a voxel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    pub(super) voxel: u32,
    pub(super) extinction: f32,
    pub(super) position: u32,
}

/// The extinction (`-ln(1 - opacity)`) that each candidate adds to each voxel it runs through, candidate after candidate.
///
/// Gaussians of captures are mostly thinner than a voxel: each is followed in half-voxel steps along its three axes, and adds to a
/// voxel what it adds where it is densest there.
pub(super) fn touches(list: &[Candidate], grid: &VoxelGrid) -> Vec<Vec<Touch>> {
    list.par_chunks(CHUNK)
        .map(|chunk| {
            let mut out = Vec::new();
            let mut own: Vec<(u32, f32)> = Vec::new();
            for candidate in chunk {
                own.clear();
                follow(candidate, grid, &mut own);
                own.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
                own.dedup_by_key(|t| t.0);
                out.extend(own.iter().map(|&(voxel, extinction)| Touch {
                    voxel,
                    extinction,
                    position: candidate.position,
                }));
            }
            out
        })
        .collect()
}

/// Extinction of each voxel.
pub(super) fn extinction(touches: &[Vec<Touch>], grid: &VoxelGrid) -> Vec<f32> {
    let mut sums = vec![0.0; grid.len()];
    for touch in touches.iter().flatten() {
        sums[touch.voxel as usize] += touch.extinction;
    }
    sums
}

/// Whether each voxel is as opaque as `cut`.
pub(super) fn occupied(extinction: &[f32], cut: f32) -> Vec<bool> {
    let least = -(1.0 - cut).ln();
    extinction.iter().map(|&e| e >= least).collect()
}

fn follow(candidate: &Candidate, grid: &VoxelGrid, out: &mut Vec<(u32, f32)>) {
    // Out to where it is as faint as the faintest.
    let reach = (2.0 * (candidate.opacity / FAINTEST).ln()).max(0.0).sqrt();
    let steps = (0..3).map(|k| {
        let half = reach * candidate.sizes[k];
        (half / (0.5 * grid.voxel)).ceil().min(MOST_STEPS) as i32
    });
    let steps: Vec<i32> = steps.collect();
    let place = |k: usize, i: i32| if steps[k] == 0 { 0.0 } else { reach * f64::from(i) / f64::from(steps[k]) };
    for w in -steps[2]..=steps[2] {
        for v in -steps[1]..=steps[1] {
            for u in -steps[0]..=steps[0] {
                let at = DVec3::new(place(0, u), place(1, v), place(2, w));
                let r2 = at.length_squared();
                if r2 > reach * reach {
                    continue;
                }
                let Some(voxel) = grid.locate(candidate.mean + candidate.axes * at) else { continue };
                let opacity = (candidate.opacity * (-0.5 * r2).exp()).min(MOST_OPAQUE);
                out.push((voxel as u32, -(1.0 - opacity).ln() as f32));
            }
        }
    }
}
