//! [`VoxelGrid`].

use glam::{DVec3, UVec3, uvec3};

/// Cubes of equal size in rows; in metres, in the body's frame.
///
/// Voxels are numbered x fastest, then y, then z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelGrid {
    /// Least corner.
    pub origin: DVec3,
    /// Side of a voxel, in metres.
    pub voxel: f64,
    /// Voxels along x, y and z.
    pub dims: UVec3,
}

impl VoxelGrid {
    /// How many voxels there are.
    pub fn len(&self) -> usize {
        self.dims.x as usize * self.dims.y as usize * self.dims.z as usize
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of the voxel at `at`, which must be below [`dims`](Self::dims).
    pub fn index(&self, at: UVec3) -> usize {
        at.x as usize + self.dims.x as usize * (at.y as usize + self.dims.y as usize * at.z as usize)
    }

    /// Where the voxel of a number is: the inverse of [`index`](Self::index).
    pub fn at(&self, index: usize) -> UVec3 {
        let (x, y) = (self.dims.x as usize, self.dims.y as usize);
        uvec3((index % x) as u32, (index / x % y) as u32, (index / (x * y)) as u32)
    }

    /// Centre of the voxel of a number.
    pub fn center(&self, index: usize) -> DVec3 {
        self.origin + (self.at(index).as_dvec3() + 0.5) * self.voxel
    }

    /// The voxel that holds a point; `None` outside the grid, and for NaN.
    pub fn locate(&self, point: DVec3) -> Option<UVec3> {
        let at = ((point - self.origin) / self.voxel).floor();
        (at.cmpge(DVec3::ZERO).all() && at.cmplt(self.dims.as_dvec3()).all()).then(|| at.as_uvec3())
    }

    /// Volume of one voxel, in m^3.
    pub fn voxel_volume(&self) -> f64 {
        self.voxel * self.voxel * self.voxel
    }
}
