//! Which material where.

use std::collections::VecDeque;

use super::VoxelGrid;
use super::occupancy::Touch;

/// Labels of voxels: of the shell, the label with most extinction there; of the rest, that of the nearest labelled voxel.
pub(super) fn regions(grid: &VoxelGrid, solid: &[bool], touches: &[Vec<Touch>], labels: &[u8]) -> Vec<u8> {
    let mut best = vec![(0.0f32, None::<u8>); grid.len()];
    let mut present = [false; 256];
    labels.iter().for_each(|&l| present[usize::from(l)] = true);
    for label in (0..=255u8).filter(|&l| present[usize::from(l)]) {
        let mut sums = vec![0.0f32; grid.len()];
        for touch in touches.iter().flatten().filter(|t| labels[t.position as usize] == label) {
            sums[touch.voxel as usize] += touch.extinction;
        }
        for (best, sum) in best.iter_mut().zip(sums) {
            if sum > best.0 {
                *best = (sum, Some(label));
            }
        }
    }
    let mut out = vec![0; grid.len()];
    let mut known = vec![false; grid.len()];
    let mut front = VecDeque::new();
    for v in (0..grid.len()).filter(|&v| solid[v]) {
        if let Some(label) = best[v].1 {
            (out[v], known[v]) = (label, true);
            front.push_back(v);
        }
    }
    while let Some(v) = front.pop_front() {
        for n in grid.neighbours(v) {
            if solid[n] && !known[n] {
                (out[n], known[n]) = (out[v], true);
                front.push_back(n);
            }
        }
    }
    out
}
