//! Hollow parts: only what is near the surface is solid.

use super::VoxelGrid;

/// Distance from each voxel's centre to the nearest marked centre, in voxels; infinite where none is marked.
///
/// Exact Euclidean, one axis after the other (Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", 2012).
pub(super) fn distances(grid: &VoxelGrid, marked: &[bool]) -> Vec<f32> {
    const FAR: f32 = 1e12;
    let mut squared: Vec<f32> = marked.iter().map(|&m| if m { 0.0 } else { FAR }).collect();
    let n = grid.dims.as_usizevec3();
    let strides = [1, n.x, n.x * n.y];
    for axis in 0..3 {
        let (len, stride) = (n[axis], strides[axis]);
        let (mut line, mut low, mut from) = (vec![0.0f32; len], vec![0usize; len], vec![0.0f32; len + 1]);
        for begin in (0..grid.len()).filter(|&v| grid.at(v)[axis] == 0) {
            (0..len).for_each(|k| line[k] = squared[begin + k * stride]);
            // The lower envelope of parabolas, one for each voxel of the line.
            let mut top = 0;
            (low[0], from[0], from[1]) = (0, f32::NEG_INFINITY, f32::INFINITY);
            for k in 1..len {
                loop {
                    let p = low[top];
                    let (kf, pf) = (k as f32, p as f32);
                    let meet = ((line[k] + kf * kf) - (line[p] + pf * pf)) / (2.0 * (kf - pf));
                    if meet > from[top] {
                        top += 1;
                        (low[top], from[top], from[top + 1]) = (k, meet, f32::INFINITY);
                        break;
                    }
                    top -= 1;
                }
            }
            let mut at = 0;
            for k in 0..len {
                while from[at + 1] < k as f32 {
                    at += 1;
                }
                let d = k as f32 - low[at] as f32;
                squared[begin + k * stride] = (d * d + line[low[at]]).min(FAR);
            }
        }
    }
    squared.into_iter().map(|s| if s < FAR { s.sqrt() } else { f32::INFINITY }).collect()
}

/// Takes out what lies deeper below the shell than `thickness` metres.
pub(super) fn hollow(grid: &VoxelGrid, shell: &[bool], thickness: f64, weights: &mut [f32]) {
    let wall = (thickness / grid.voxel) as f32;
    for (w, depth) in weights.iter_mut().zip(distances(grid, shell)) {
        *w = w.min((wall - depth + 0.5).clamp(0.0, 1.0));
    }
}
