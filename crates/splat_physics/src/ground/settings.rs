//! [`GroundSettings`], [`GroundError`], [`GroundReport`].

use glam::DVec3;

/// How what is left of a capture becomes something to stand on.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundSettings {
    /// What kind of surface.
    pub source: GroundSource,
    /// Edge of a voxel in metres, above 0. It is doubled until the ground has at most [`most_voxels`](Self::most_voxels).
    pub voxel: f64,
    /// A voxel is part of the surface from this opacity on, above 0 and below 1.
    pub cut: f32,
    /// What is filled, so that nothing falls in.
    pub fill: Fill,
    /// Edge of a piece in metres, above 0.
    pub chunk: f64,
    /// A unit vector, in the cloud's axes.
    pub up: DVec3,
    /// Voxels on the surface, at most.
    pub most_voxels: usize,
}

impl Default for GroundSettings {
    fn default() -> Self {
        Self {
            source: GroundSource::Auto,
            voxel: 0.05,
            cut: 0.1,
            fill: Fill::None,
            chunk: 16.0,
            up: DVec3::Y,
            most_voxels: 4_000_000,
        }
    }
}

impl GroundSettings {
    pub(super) fn check(&self) -> Result<(), GroundError> {
        let fail = |setting, value, range| Err(GroundError::Setting { setting, value, range });
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if !positive(self.voxel) {
            return fail("voxel", self.voxel, "a number of metres above 0");
        }
        if !positive(self.chunk) {
            return fail("chunk", self.chunk, "a number of metres above 0");
        }
        if !(self.cut > 0.0 && self.cut < 1.0) {
            return fail("cut", self.cut.into(), "above 0 and below 1");
        }
        if !((self.up.length() - 1.0).abs() < 1e-3) {
            return fail("the length of up", self.up.length(), "1");
        }
        if self.most_voxels < 1000 {
            return fail("most_voxels", self.most_voxels as f64, "1000 or more");
        }
        Ok(())
    }
}

/// A kind of surface that stands still.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum GroundSource {
    /// A plane if all is within two voxels of one, else a mesh.
    #[default]
    Auto,
    /// The plane of the floor ([`splat_core::orient::floor_plane`]).
    Plane,
    /// A height above each place: the highest voxel of the lowest connected run of each column.
    Heightfield,
    /// Triangles.
    Mesh,
    /// Voxels.
    Voxels,
}

/// What is filled beside the surface. What is below the lowest surface of a column is always filled for some voxels: nothing was
/// seen there, and a surface without thickness lets things through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Fill {
    /// Nothing more.
    #[default]
    None,
    /// A metre below the lowest surface of each column, and columns that lack one between others: open scenes.
    Floor,
    /// What cannot be reached from the middle of the capture, within half a metre of its surface: rooms.
    Exterior,
}

/// Why there is no ground.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GroundError {
    /// Too little is left of the capture.
    #[error("{have} of the capture's {of} remaining Gaussians can be used, but its ground needs {need}")]
    TooFewSplats {
        /// How many are finite and opaque enough.
        have: usize,
        /// How many were given.
        of: usize,
        /// How many there must be.
        need: usize,
    },
    /// Nothing is dense enough.
    #[error("nothing of the capture is {:.0} % opaque, so there is no ground; lower the cut", 100.0 * cut)]
    EmptyOccupancy {
        /// [`GroundSettings::cut`].
        cut: f32,
    },
    /// No plane has the scene on one side.
    #[error("no plane has the capture on one side, so it has no floor; choose a mesh")]
    NoFloor,
    /// The capture cannot be measured in metres.
    #[error("{metres_per_unit} metres per unit is no scale")]
    Scale {
        /// As given.
        metres_per_unit: f64,
    },
    /// A Gaussian that is not in the cloud.
    #[error("the ground names Gaussian {id}, but the cloud has only {len}")]
    UnknownGaussian {
        /// The first such.
        id: u32,
        /// Gaussians of the cloud.
        len: usize,
    },
    /// A setting has no meaning.
    #[error("{setting} cannot be {value}; it is {range}")]
    Setting {
        /// Its name.
        setting: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
}

/// What was found and done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GroundReport {
    /// Gaussians the ground was made of.
    pub used: usize,
    /// Edge of a voxel in metres, after doubling.
    pub voxel: f64,
    /// How often it was doubled.
    pub doubled: u32,
    /// Voxels on the surface.
    pub voxels: usize,
    /// Voxels that were put in where parts stood.
    pub closed: usize,
    /// Parts that nothing was seen around to stand on: what is under them stays as it is.
    pub hanging: usize,
    /// [`Fill::Exterior`] was asked for, but the room is open.
    pub open: bool,
}

impl GroundReport {
    /// What whoever uses the ground should know, a sentence each.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        let coarse = (self.doubled > 0).then(|| {
            format!("the capture is large: its ground has voxels of {:.2} m instead of finer ones", self.voxel)
        });
        let hanging = (self.hanging > 0).then(|| {
            format!("nothing was seen around {} parts to stand on: the ground under them stays open", self.hanging)
        });
        let open = self.open.then(|| "the room is not closed, so what is around it was not filled".to_owned());
        [coarse, hanging, open].into_iter().flatten()
    }
}
