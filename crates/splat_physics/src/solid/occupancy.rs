//! Which voxels a part's Gaussians make opaque.

use glam::{Mat3, UVec3, Vec3};
use rayon::prelude::*;

use super::VoxelGrid;
use super::candidates::Splat;
use super::morphology::Mask;

/// Squared distance in standard deviations that holds 99 % of a Gaussian: chi squared with three degrees of freedom.
const FAR: f32 = 11.345;
/// Layers of voxels worked on at once. Each voxel sees its Gaussians in rising order, whoever works on it.
const LAYERS: usize = 4;
/// Thinner is taken for so thin, in voxels: no surface is thinner to a voxel.
const THINNEST: f64 = 0.01;

/// The opaque voxels, and by voxel the region of the Gaussian that makes it most opaque.
pub(super) struct Occupancy {
    pub(super) mask: Mask,
    pub(super) regions: Vec<u8>,
}

/// A Gaussian in voxels.
struct Blob {
    mean: Vec3,
    /// From the grid's axes to its own.
    turn: Mat3,
    inverse_sigma: Vec3,
    /// How far along each of its own axes a voxel reaches to meet it.
    reach: Vec3,
    /// Half sides of the box around what counts, along its own axes.
    half: Vec3,
    /// Of a voxel it meets: less than the Gaussian's own where it covers only a part of the voxel's face.
    opacity: f32,
    region: u8,
    /// First and last voxel of the box along the grid's axes.
    low: UVec3,
    high: UVec3,
}

impl Blob {
    fn new(splat: &Splat, grid: &VoxelGrid) -> Self {
        let mean = ((splat.mean - grid.origin) / grid.voxel).as_vec3();
        let sigma = (splat.sigma / grid.voxel).max(glam::DVec3::splat(THINNEST)).as_vec3();
        let axes = splat.axes.as_mat3();
        // Half a voxel where it is thin; nothing where it is wider than a voxel, for there its centre speaks for all of it.
        let reach = 0.5 * (1.0 - sigma).max(Vec3::ZERO);
        let half = sigma * FAR.sqrt() + reach;
        let around = axes.x_axis.abs() * half.x + axes.y_axis.abs() * half.y + axes.z_axis.abs() * half.z;
        let last = (grid.dims - 1).as_vec3();
        // Centres are half a voxel from the corner.
        let low = (mean - around - 0.5).ceil().clamp(Vec3::ZERO, last).as_uvec3();
        let high = (mean + around - 0.5).floor().clamp(Vec3::ZERO, last).as_uvec3();
        let (turn, inverse_sigma) = (axes.transpose(), 1.0 / sigma);
        let mut area: [f32; 3] = (sigma * std::f32::consts::TAU.sqrt()).min(Vec3::ONE).to_array();
        area.sort_unstable_by(f32::total_cmp);
        let opacity = splat.opacity * area[1] * area[2];
        Self { mean, turn, inverse_sigma, reach, half, opacity, region: splat.region, low, high }
    }

    /// How opaque it makes the voxel whose centre is at `q` along its own axes, from its mean.
    ///
    /// The voxel is taken for a box along those axes, at its point nearest to the mean: a surface thinner than a voxel counts
    /// wherever it passes through one.
    fn opacity_at(&self, q: Vec3) -> f32 {
        let near = (q.abs() - self.reach).max(Vec3::ZERO) * self.inverse_sigma;
        let squared = near.length_squared();
        if squared > FAR { 0.0 } else { (self.opacity * (-0.5 * squared).exp()).min(0.999) }
    }

    /// Calls `visit` with each voxel along x at (y, z) that its box holds, and the voxel's opacity.
    fn row(&self, y: usize, z: usize, mut visit: impl FnMut(usize, f32)) {
        let start = self.turn * (Vec3::new(0.5, y as f32 + 0.5, z as f32 + 0.5) - self.mean);
        let step = self.turn.x_axis;
        let (mut first, mut last) = (self.low.x as f32, self.high.x as f32);
        for k in 0..3 {
            if step[k].abs() > 1e-6 {
                let (a, b) = ((-self.half[k] - start[k]) / step[k], (self.half[k] - start[k]) / step[k]);
                first = first.max(a.min(b));
                last = last.min(a.max(b));
            } else if start[k].abs() > self.half[k] {
                return;
            }
        }
        if first > last {
            return;
        }
        for x in first.ceil() as usize..=last.floor() as usize {
            visit(x, self.opacity_at(start + step * x as f32));
        }
    }
}

/// Voxels that let through at most `1 - cut` of what passes.
pub(super) fn occupancy(splats: &[Splat], grid: &VoxelGrid, cut: f32, with_regions: bool) -> Occupancy {
    let (nx, ny, nz) = (grid.dims.x as usize, grid.dims.y as usize, grid.dims.z as usize);
    let blobs: Vec<Blob> = splats.par_iter().map(|splat| Blob::new(splat, grid)).collect();
    let mut slabs: Vec<Vec<u32>> = vec![Vec::new(); nz.div_ceil(LAYERS)];
    for (k, blob) in blobs.iter().enumerate() {
        let range = blob.low.z as usize / LAYERS..=blob.high.z as usize / LAYERS;
        slabs[range].iter_mut().for_each(|slab| slab.push(k as u32));
    }
    let limit = 1.0 - cut;
    let mut voxels = vec![0u8; grid.len()];
    let mut regions = vec![0u8; grid.len()];
    let size = nx * ny * LAYERS;
    voxels.par_chunks_mut(size).zip(regions.par_chunks_mut(size)).zip(&slabs).enumerate().for_each(
        |(slab, ((voxels, regions), ids))| {
            let first = slab * LAYERS;
            let layers = voxels.len() / (nx * ny);
            let mut through = vec![1.0f32; voxels.len()];
            let mut strongest = vec![0.0f32; if with_regions { voxels.len() } else { 0 }];
            for blob in ids.iter().map(|&k| &blobs[k as usize]) {
                for z in first.max(blob.low.z as usize)..(first + layers).min(blob.high.z as usize + 1) {
                    for y in blob.low.y as usize..=blob.high.y as usize {
                        let row = nx * (y + ny * (z - first));
                        blob.row(y, z, |x, opacity| {
                            through[row + x] *= 1.0 - opacity;
                            if with_regions && opacity > strongest[row + x] {
                                strongest[row + x] = opacity;
                                regions[row + x] = blob.region;
                            }
                        });
                    }
                }
            }
            voxels.iter_mut().zip(&through).for_each(|(voxel, through)| *voxel = u8::from(*through <= limit));
        },
    );
    Occupancy { mask: Mask { dims: grid.dims, voxels }, regions }
}
