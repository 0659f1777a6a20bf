//! From a part's Gaussians, a shell with floaters, holes and no underside, to a filled [`Solid`] of voxels.
//!
//! | stage | what | where |
//! |---|---|---|
//! | candidates | leave out haze, monsters, floaters | `candidates.rs` |
//! | occupancy | voxels that the Gaussians make opaque: the shell | `occupancy.rs` |
//! | base | close the underside | `base.rs` |
//! | filling | close holes, flood from outside; what is not reached is inside | `morphology.rs` |
//! | thickness | tell what is flat | `thickness.rs` |
//! | leaks | where it does not close: its hull | `hull.rs` |
//! | weights | half for the shell, walls of hollow things | `build.rs`, `hollow.rs` |
//! | regions | materials from the shell inwards | `regions.rs` |
//! | mass | mass, centre, inertia | `mass.rs` |

mod base;
mod build;
mod candidates;
mod error;
mod grid;
mod hollow;
mod hull;
mod mass;
mod morphology;
mod occupancy;
mod regions;
mod report;
mod settings;
#[cfg(test)]
mod tests;
mod thickness;

use glam::{DVec3, UVec3};

pub use error::SolidError;
pub use grid::VoxelGrid;
pub use report::{SolidNote, SolidReport, Unused};
pub use settings::{Leaks, Pieces, SolidSettings};

/// A filled body of voxels; in metres, in the body's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Where the voxels are.
    pub grid: VoxelGrid,
    /// By voxel, how much of it is inside: 1 inside, 0.5 in the shell (the surface runs through its middle), 0 outside, and
    /// between them at the inner side of a wall.
    pub weights: Vec<f32>,
    /// By voxel, which of the materials it is made of.
    pub regions: Vec<u8>,
    /// How it came about.
    pub report: SolidReport,
}

impl Solid {
    /// A box from corner to corner, all of it region 0. Exact if its sides are multiples of `voxel`, else to the nearest multiple
    /// of it, at least one. What is not finite counts as one voxel.
    pub fn cuboid(min: DVec3, max: DVec3, voxel: f64) -> Self {
        let dims = ((max - min) / voxel).round().as_uvec3().max(UVec3::ONE);
        let grid = VoxelGrid { origin: min, voxel, dims };
        let mut solid =
            Self { grid, weights: vec![1.0; grid.len()], regions: vec![0; grid.len()], report: SolidReport::default() };
        solid.report = SolidReport { volume: solid.volume(), voxels: grid.len(), pieces: 1, ..SolidReport::default() };
        solid
    }

    /// In m^3.
    pub fn volume(&self) -> f64 {
        self.weights.iter().map(|&weight| f64::from(weight)).sum::<f64>() * self.grid.voxel_volume()
    }

    /// Least and greatest corner of the box around all voxels that hold anything; twice the grid's origin if none does.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let corners = self.occupied().map(|voxel| self.grid.at(voxel)).fold(None, |bounds, at| {
            let (low, high) = bounds.unwrap_or((at, at));
            Some((low.min(at), high.max(at)))
        });
        let Some((low, high)) = corners else { return (self.grid.origin, self.grid.origin) };
        let place = |at: UVec3| self.grid.origin + at.as_dvec3() * self.grid.voxel;
        (place(low), place(high + 1))
    }

    /// Numbers of the voxels that hold anything, rising.
    pub fn occupied(&self) -> impl Iterator<Item = usize> {
        self.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0).map(|(voxel, _)| voxel)
    }
}
