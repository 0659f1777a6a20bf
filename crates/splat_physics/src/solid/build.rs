//! [`Solid::build`].

use glam::{DMat3, DVec3, UVec3};
use splat_core::Cloud;

use super::candidates::{Candidate, candidates};
use super::fill::{bottom, filled, hull, pieces};
use super::occupancy::{Touch, extinction, occupied, touches};
use super::regions::regions;
use super::wall::hollow;
use super::{Solid, SolidError, SolidReport, SolidSettings, VoxelGrid};

/// A shell encloses nothing if what it fills is less than this many times itself.
const ENCLOSES: f64 = 1.5;
/// A part is a sheet if it is thinner than this many voxels somewhere.
const SHEET: f64 = 4.0;
/// Free voxels around a part: room to close gaps and to flood.
const MARGIN: u32 = 10;
/// A part that takes up less than this of the first grid's diagonal gets a finer one.
const LOOSE: f64 = 0.8;
/// Scales that captures have, in metres for a unit.
const SCALES: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

impl Solid {
    /// Fills what the Gaussians `ids` of a cloud are the shell of.
    ///
    /// `metres_per_unit`: of the cloud. `regions`: for each entry of `ids`, which of the part's materials it is made of; `None`: all
    /// of the first.
    ///
    /// # Errors
    /// [`SolidError`]: there is no shape, or (if asked so) the shell leaks.
    ///
    /// Cost: some 50 ms for 20,000 Gaussians and 64 voxels. The same bits on any number of threads.
    pub fn build(
        cloud: &Cloud,
        ids: &[u32],
        metres_per_unit: f64,
        regions: Option<&[u8]>,
        settings: &SolidSettings,
    ) -> Result<Self, SolidError> {
        settings.check()?;
        if !SCALES.contains(&metres_per_unit) {
            return Err(SolidError::ScaleOutOfRange { metres_per_unit });
        }
        if let Some(labels) = regions
            && labels.len() != ids.len()
        {
            return Err(SolidError::Regions { regions: labels.len(), gaussians: ids.len() });
        }
        let found = candidates(cloud, ids, metres_per_unit)?;
        let first = Shell::of(&found.list, grid_around(found.least, found.most, settings.voxels), settings)?;
        // Floaters stretch the first grid. What is left without them gets one that fits.
        let (least, most) = first.bounds();
        let shell = if (most - least).length() < LOOSE * (found.most - found.least).length() {
            Shell::of(&found.list, grid_around(least, most, settings.voxels), settings)?
        } else {
            first
        };
        shell.fill(ids.len(), found.list.len(), regions, settings)
    }
}

/// A grid with `voxels` along the diagonal of a box and some more around it.
fn grid_around(least: DVec3, most: DVec3, voxels: u32) -> VoxelGrid {
    let size = (most - least).max(DVec3::splat(f64::MIN_POSITIVE));
    let voxel = size.length() / f64::from(voxels);
    let dims = (size / voxel).ceil().max(DVec3::ONE).as_uvec3() + UVec3::splat(2 * MARGIN);
    let origin = 0.5 * (least + most) - dims.as_dvec3() * (0.5 * voxel);
    VoxelGrid { origin, voxel, dims }
}

/// The voxels that a part's Gaussians lie in.
struct Shell {
    grid: VoxelGrid,
    marked: Vec<bool>,
    touches: Vec<Vec<Touch>>,
}

impl Shell {
    /// The shell without its small pieces.
    fn of(list: &[Candidate], grid: VoxelGrid, settings: &SolidSettings) -> Result<Self, SolidError> {
        let touches = touches(list, &grid);
        let mut marked = occupied(&extinction(&touches, &grid), settings.cut);
        keep_pieces(&grid, &mut marked, settings.least_piece);
        if !marked.contains(&true) {
            return Err(SolidError::EmptyOccupancy { cut: settings.cut });
        }
        Ok(Self { grid, marked, touches })
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for v in (0..self.marked.len()).filter(|&v| self.marked[v]) {
            least = least.min(self.grid.center(v));
            most = most.max(self.grid.center(v));
        }
        (least - 0.5 * self.grid.voxel, most + 0.5 * self.grid.voxel)
    }

    fn fill(
        mut self,
        gaussians: usize,
        used: usize,
        labels: Option<&[u8]>,
        settings: &SolidSettings,
    ) -> Result<Solid, SolidError> {
        let grid = self.grid;
        let cube = grid.voxel.powi(3);
        let count = |marked: &[bool]| marked.iter().filter(|&&m| m).count();
        let thin = self.thickness() < SHEET;
        if settings.close_bottom && !thin {
            bottom(&grid, &self.marked, settings.up).into_iter().for_each(|v| self.marked[v] = true);
        }
        let shell = count(&self.marked) as f64 * cube;
        let mut report = SolidReport { gaussians, used, shell_volume: shell, thin, ..SolidReport::default() };
        let mut solid = self.marked.clone();
        if !thin {
            let mut closed = None;
            let mut best = 0.0;
            for closing in 0..=settings.max_closing {
                let full = filled(&grid, &self.marked, closing);
                let volume = count(&full) as f64 * cube;
                best = volume.max(best);
                if volume >= ENCLOSES * shell {
                    closed = Some((full, closing));
                    break;
                }
            }
            solid = match closed {
                Some((full, closing)) => {
                    report.closing = closing;
                    full
                }
                None if settings.hull_if_leaks => {
                    report.leaked = true;
                    hull(&grid, &self.marked)
                }
                None => {
                    return Err(SolidError::ShellLeaks { closing: settings.max_closing, shell, filled: best });
                }
            };
        }
        report.pieces = keep_pieces(&grid, &mut solid, settings.least_piece);
        // The surface runs through the shell; a sheet is nothing but shell.
        let half = |v: usize| if self.marked[v] && !thin { 0.5 } else { 1.0 };
        let mut weights: Vec<f32> = (0..solid.len()).map(|v| if solid[v] { half(v) } else { 0.0 }).collect();
        if let Some(thickness) = settings.hollow {
            hollow(&grid, &self.marked, thickness, &mut weights);
        }
        let regions = match labels {
            Some(labels) => regions(&grid, &solid, &self.touches, labels),
            None => vec![0; grid.len()],
        };
        Ok(Solid { grid, weights, regions, report })
    }

    /// Extent along the direction in which the shell spreads least, in voxels.
    fn thickness(&self) -> f64 {
        let members: Vec<DVec3> =
            (0..self.marked.len()).filter(|&v| self.marked[v]).map(|v| self.grid.at(v).as_dvec3()).collect();
        let n = members.len() as f64;
        let mean = members.iter().sum::<DVec3>() / n;
        let mut spread = DMat3::ZERO;
        for p in &members {
            let d = *p - mean;
            spread += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        let (values, vectors) = crate::linear::symmetric_eigen(spread * (1.0 / n));
        let least = (0..3).min_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        let along = vectors.col(least);
        let ends = members.iter().map(|p| along.dot(*p)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), d| {
            (l.min(d), h.max(d))
        });
        ends.1 - ends.0 + 1.0
    }
}

/// Leaves out pieces smaller than `least` times the largest; how many are left.
fn keep_pieces(grid: &VoxelGrid, marked: &mut [bool], least: f32) -> usize {
    let (sizes, label) = pieces(grid, marked);
    let Some(&largest) = sizes.first() else { return 0 };
    let kept = sizes.iter().take_while(|&&s| s as f32 >= least * largest as f32).count();
    marked.iter_mut().zip(label).for_each(|(m, l)| *m &= (l as usize) < kept);
    kept
}
