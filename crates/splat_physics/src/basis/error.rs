//! [`BasisError`].

/// Why there is no cage or no basis.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BasisError {
    /// Somebody asked to stop.
    #[error("the work on the elastic part's weights was cancelled")]
    Cancelled,
    /// Nothing to put a cage around.
    #[error("the solid is empty: no voxel of it has any weight")]
    EmptySolid,
    /// Too fine a solid or too many cells.
    #[error("{have} cells along the longest side were asked for, 1 to {most} are possible")]
    CellsOutOfRange {
        /// Asked for.
        have: u32,
        /// Possible.
        most: u32,
    },
    /// No cage is so small.
    #[error("a cage of {have} nodes at most was asked for, at least {least} are needed")]
    TooFewNodes {
        /// Asked for.
        have: usize,
        /// Needed.
        least: usize,
    },
    /// Each piece takes a handle of its own, and none would be left for bending.
    #[error(
        "the part has {pieces} separate pieces, more than half of its {handles} handles; remove specks, make the voxels larger, \
         or ask for more handles"
    )]
    Disconnected {
        /// Pieces that touch nowhere.
        pieces: usize,
        /// Handles asked for.
        handles: usize,
    },
    /// No weights for so many.
    #[error("{have} handles were asked for, 1 to {most} are possible")]
    HandlesOutOfRange {
        /// Asked for.
        have: usize,
        /// Possible.
        most: usize,
    },
    /// The cage names a region that the list of materials lacks.
    #[error("the solid has a region {region}, but only {materials} materials are given")]
    MaterialMissing {
        /// Number of the region.
        region: u8,
        /// How many there are.
        materials: usize,
    },
    /// A material that cannot be.
    #[error("the material of region {region} has no positive, finite stiffness (lambda + 4 mu = {stiffness} Pa)")]
    Stiffness {
        /// Number of the region.
        region: u8,
        /// `lambda + 4 mu` in Pa.
        stiffness: f64,
    },
    /// A setting that makes no sense.
    #[error("`{name}` is {value}, which is out of range")]
    Setting {
        /// Which.
        name: &'static str,
        /// Given.
        value: f64,
    },
    /// Rounding ate the answer.
    #[error("the weights could not be computed: {what}")]
    Numerical {
        /// Which step of the work failed.
        what: &'static str,
    },
    /// What was saved belongs to another part or other settings.
    #[error("the saved training belongs to another part, other materials or other settings")]
    OtherTraining,
}
