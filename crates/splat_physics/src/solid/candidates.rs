//! Which Gaussians of a part tell where its surface is.

use glam::{DMat3, DQuat, DVec3, UVec3};
use splat_core::Cloud;

use super::morphology::{Mask, pieces};
use super::{SolidError, Unused, VoxelGrid};

/// Fewer say nothing about a surface.
const NEEDED: usize = 50;
/// Fainter Gaussians are haze.
const OPACITY: f32 = 0.1;
/// Gaussians with a larger standard deviation, as a share of the part's size, are background.
const HUGE: f64 = 0.25;
/// Cells along the part's size in which what hangs together is found.
const CELLS: f64 = 16.0;
/// How far from the middle anything may be, in sizes of the part.
const REACH: f64 = 4.0;

/// A Gaussian in metres.
pub(super) struct Splat {
    pub(super) mean: DVec3,
    /// Standard deviations along its own axes.
    pub(super) sigma: DVec3,
    /// Its own axes as columns.
    pub(super) axes: DMat3,
    pub(super) opacity: f32,
    pub(super) region: u8,
}

impl Splat {
    /// Standard deviations along the axes of the body's frame.
    pub(super) fn spread(&self) -> DVec3 {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = self.axes;
        let s = self.sigma * self.sigma;
        (x * x * s.x + y * y * s.y + z * z * s.z).map(f64::sqrt)
    }
}

/// The Gaussians a solid is made of.
pub(super) struct Candidates {
    pub(super) splats: Vec<Splat>,
    pub(super) unused: Unused,
    /// Least and greatest mean.
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Candidates {
    /// The solid, small, connected Gaussians of `ids`, in that order.
    pub(super) fn new(cloud: &Cloud, ids: &[u32], unit: f64, regions: Option<&[u8]>) -> Result<Self, SolidError> {
        if let Some(&id) = ids.iter().find(|&&id| id as usize >= cloud.len()) {
            return Err(SolidError::UnknownGaussian { id, len: cloud.len() });
        }
        if let Some(regions) = regions.filter(|regions| regions.len() != ids.len()) {
            return Err(SolidError::RegionsMismatch { regions: regions.len(), ids: ids.len() });
        }
        if !(unit > 0.0 && unit.is_finite()) {
            return Err(SolidError::ScaleOutOfRange { metres_per_unit: unit, size: f64::NAN });
        }
        let few = |have: usize| SolidError::TooFewSplats { have, of: ids.len(), need: NEEDED };
        let mut unused = Unused::default();
        let mut splats = Vec::with_capacity(ids.len());
        for (k, &id) in ids.iter().enumerate() {
            let i = id as usize;
            let sigma = cloud.scale(i).as_dvec3() * unit;
            if !cloud.drawable(i) || !sigma.is_finite() {
                unused.broken += 1;
            } else if cloud.opacity(i) < OPACITY {
                unused.faint += 1;
            } else {
                splats.push(Splat {
                    mean: cloud.means()[i].as_dvec3() * unit,
                    sigma,
                    axes: DMat3::from_quat(DQuat::from_array(cloud.rotation(i).to_array().map(f64::from)).normalize()),
                    opacity: cloud.opacity(i),
                    region: regions.map_or(0, |regions| regions[k]),
                });
            }
        }
        if unused.broken == ids.len() && !ids.is_empty() {
            return Err(SolidError::NotFinite { count: ids.len() });
        }
        if splats.len() < NEEDED {
            return Err(few(splats.len()));
        }

        // The middle 80 % of the means: no tenth of them can decide it.
        let (inner_low, inner_high) = quantiles(&splats, 0.1);
        let middle = 0.5 * (inner_low + inner_high);
        let mut sigmas: Vec<f64> = splats.iter().map(|splat| splat.sigma.max_element()).collect();
        let half = sigmas.len() / 2;
        let typical = *sigmas.select_nth_unstable_by(half, f64::total_cmp).1;
        let size = (inner_high - inner_low).length() / 0.8 + 2.0 * typical;
        if !(size > 1e-5 && size < 1e6) {
            return Err(SolidError::ScaleOutOfRange { metres_per_unit: unit, size });
        }
        unused.huge += retain(&mut splats, |splat| splat.sigma.max_element() <= HUGE * size);
        unused.far += retain(&mut splats, |splat| (splat.mean - middle).abs().max_element() < REACH * size);
        if splats.len() < NEEDED {
            return Err(few(splats.len()));
        }
        unused.far += drop_islands(&mut splats, size);
        if splats.len() < NEEDED {
            return Err(few(splats.len()));
        }
        // What still strays lies beyond all but a few.
        let (low, high) = quantiles(&splats, 0.005);
        let slack = 0.1 * (high - low).length() + 2.0 * typical;
        unused.far += retain(&mut splats, |s| s.mean.cmpge(low - slack).all() && s.mean.cmple(high + slack).all());
        let (low, high) = extent(&splats);
        Ok(Self { splats, unused, low, high })
    }
}

/// Keeps what is good; how many are gone.
fn retain(splats: &mut Vec<Splat>, good: impl FnMut(&Splat) -> bool) -> usize {
    let before = splats.len();
    splats.retain(good);
    before - splats.len()
}

/// Least and greatest mean.
fn extent(splats: &[Splat]) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    splats.iter().fold(none, |(low, high), splat| (low.min(splat.mean), high.max(splat.mean)))
}

/// Along each axis the mean that a share of all are below, and the one that as many are above.
fn quantiles(splats: &[Splat], share: f64) -> (DVec3, DVec3) {
    let axis = |k: usize| {
        let mut values: Vec<f64> = splats.iter().map(|splat| splat.mean[k]).collect();
        let last = values.len() - 1;
        let rank = (share * last as f64).round() as usize;
        let low = *values.select_nth_unstable_by(rank, f64::total_cmp).1;
        (low, *values.select_nth_unstable_by(last - rank, f64::total_cmp).1)
    };
    let [x, y, z] = [axis(0), axis(1), axis(2)];
    (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1))
}

/// Drops what hangs together with less than 1 % of what the largest piece has: floaters. How many are gone.
fn drop_islands(splats: &mut Vec<Splat>, size: f64) -> usize {
    let voxel = size / CELLS;
    let (low, high) = extent(splats);
    let dims = ((high - low) / voxel).ceil().as_uvec3() + 3;
    let grid = VoxelGrid { origin: low - voxel, voxel, dims };
    let last = (dims - 1).as_dvec3();
    let cell = |p: DVec3| ((p - grid.origin) / voxel).clamp(DVec3::ZERO, last).as_uvec3();
    let mut counts = vec![0u16; grid.len()];
    for splat in splats.iter() {
        let spread = splat.spread();
        let (low, high) = (cell(splat.mean - spread), cell(splat.mean + spread));
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let count = &mut counts[grid.index(UVec3::new(x, y, z))];
                    *count = count.saturating_add(1);
                }
            }
        }
    }
    let homes: Vec<usize> = splats.iter().map(|splat| grid.index(cell(splat.mean))).collect();
    let mut seen: Vec<u16> = homes.iter().map(|&home| counts[home]).collect();
    let half = seen.len() / 2;
    // Where Gaussians are many, one alone is a floater.
    let alone = u16::from(*seen.select_nth_unstable(half).1 >= 50);
    let mask = Mask { dims: grid.dims, voxels: counts.iter().map(|&count| u8::from(count > alone)).collect() };
    let (labels, mut held) = pieces(&mask, false);
    held.iter_mut().for_each(|count| *count = 0);
    homes.iter().filter(|&&home| labels[home] > 0).for_each(|&home| held[labels[home] as usize - 1] += 1);
    let most = held.iter().copied().max().unwrap_or(0);
    let mut homes = homes.into_iter();
    retain(splats, |_| {
        let label = homes.next().map_or(0, |home| labels[home]);
        label > 0 && 100 * held[label as usize - 1] >= most
    })
}
