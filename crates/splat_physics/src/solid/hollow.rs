//! Walls: what of a filled solid is near its surface.

use rayon::prelude::*;

use super::morphology::{Mask, faces};

/// Changes weights to those of a wall of `wall` voxels below the surface.
///
/// A voxel's weight becomes the part of it that lies between the surface and the wall's inner side, seen along the way to the
/// surface; so also walls much thinner than a voxel weigh what they should.
pub(super) fn hollow(weights: &mut [f32], filled: &Mask, wall: f64) {
    let voxels: Vec<usize> = (0..weights.len()).filter(|&voxel| filled.voxels[voxel] != 0).collect();
    let depths = depths(filled, &voxels);
    let between = |depth: f64, wall: f64| ((depth + 0.5).min(wall) - (depth - 0.5).max(0.0)).clamp(0.0, 1.0);

    // How deep the surface is below the boundary of what is filled: so that all below it has the solid's volume.
    let volume: f64 = weights.iter().map(|&weight| f64::from(weight)).sum();
    let (mut low, mut high) = (0.0, 4.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        let below: f64 = depths.iter().map(|depth| between(depth - middle, f64::INFINITY)).sum();
        if below > volume {
            low = middle;
        } else {
            high = middle;
        }
    }
    for (&voxel, depth) in voxels.iter().zip(&depths) {
        weights[voxel] = between(depth - low, wall) as f32;
    }
}

/// Distance of the centres of `voxels` to the nearest centre of a face between what is set and what is not, in voxels.
///
/// Those of faces, for they lie in the middle of the staircase that a slanted surface is. Exact, an axis at a time (Felzenszwalb
/// and Huttenlocher, "Distance transforms of sampled functions", 2012), on a grid twice as fine, which has points at both.
fn depths(filled: &Mask, voxels: &[usize]) -> Vec<f64> {
    let fine = 2 * filled.dims + 1;
    let (nx, ny) = (fine.x as usize, fine.y as usize);
    let strides = [1, nx, nx * ny];
    let (coarse_x, coarse_y) = (filled.dims.x as usize, filled.dims.y as usize);
    let center = |voxel: usize| {
        let (x, y, z) = (voxel % coarse_x, voxel / coarse_x % coarse_y, voxel / (coarse_x * coarse_y));
        2 * x + 1 + nx * (2 * y + 1 + ny * (2 * z + 1))
    };
    let mut values = vec![1e12f32; nx * ny * fine.z as usize];
    for &voxel in voxels {
        for (near, axis) in faces(voxel, filled.dims).filter(|&(near, _)| filled.voxels[near] == 0) {
            let at = center(voxel);
            values[if near < voxel { at - strides[axis] } else { at + strides[axis] }] = 0.0;
        }
    }
    values.par_chunks_mut(nx).for_each(|row| along(row, 1));
    values.par_chunks_mut(nx * ny).for_each(|layer| (0..nx).for_each(|x| along(&mut layer[x..], nx)));
    (0..nx * ny).for_each(|start| along(&mut values[start..], nx * ny));
    voxels.iter().map(|&voxel| 0.5 * f64::from(values[center(voxel)]).sqrt()).collect()
}

/// Replaces every `stride`th value by the least of all of them plus the squared distance to where it is.
fn along(values: &mut [f32], stride: usize) {
    let line: Vec<f32> = values.iter().step_by(stride).copied().collect();
    // Parabolas whose lower envelope is the answer, and from where on each is lowest.
    let mut lowest: Vec<(usize, f32)> = Vec::with_capacity(line.len());
    for (q, &value) in line.iter().enumerate() {
        let mut from = f32::NEG_INFINITY;
        while let Some(&(p, start)) = lowest.last() {
            let square = |k: usize| (k * k) as f32;
            from = (value - line[p] + square(q) - square(p)) / (2 * (q - p)) as f32;
            if from > start {
                break;
            }
            lowest.pop();
            from = f32::NEG_INFINITY;
        }
        lowest.push((q, from));
    }
    let mut k = 0;
    for (q, value) in values.iter_mut().step_by(stride).enumerate() {
        while k + 1 < lowest.len() && lowest[k + 1].1 < q as f32 {
            k += 1;
        }
        let p = lowest[k].0;
        let distance = q.abs_diff(p) as f32;
        *value = distance * distance + line[p];
    }
}
