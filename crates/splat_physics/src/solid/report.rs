//! [`SolidReport`]: what was done to get a solid.

use std::fmt;

/// What [`Solid::build`](super::Solid::build) found and did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SolidReport {
    /// Gaussians the solid was made of.
    pub used: usize,
    /// Gaussians that were not used.
    pub unused: Unused,
    /// Of the solid, in m^3: shell voxels count half, for the surface runs through their middle.
    pub volume: f64,
    /// Of the shell voxels, counted whole, in m^3.
    pub shell_volume: f64,
    /// Voxels that hold anything.
    pub voxels: usize,
    /// Pieces that hold more than 1 % of the largest one, before any was left out.
    pub pieces: usize,
    /// Share of the volume that was left out with pieces, 0..1.
    pub left_out: f64,
    /// Holes of up to twice as many voxels were closed; 0 if nothing needed closing, as in [`Solid::cuboid`](super::Solid::cuboid).
    pub closing: u32,
    /// Voxels that were put in to close the underside.
    pub base: usize,
    /// The surface did not close: the solid is its convex hull, or the shell alone.
    pub leaked: bool,
}

/// Gaussians that were not used, by the first reason that holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unused {
    /// NaN or infinite values.
    pub broken: usize,
    /// Hardly opaque.
    pub faint: usize,
    /// Too large to tell where the surface is.
    pub huge: usize,
    /// Away from the rest.
    pub far: usize,
}

impl Unused {
    /// How many in all.
    pub fn total(&self) -> usize {
        self.broken + self.faint + self.huge + self.far
    }
}

/// Something whoever uses a solid should know, as a sentence by `to_string`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SolidNote {
    /// The surface did not close.
    Leaked {
        /// The largest closing tried, in voxels.
        closing_tried: u32,
    },
    /// The part is in several pieces, which move as one.
    Pieces(usize),
    /// Pieces were left out.
    LeftOut {
        /// Their share of the volume, 0..1.
        share: f64,
    },
    /// Gaussians have NaN or infinite values.
    Broken(usize),
}

impl fmt::Display for SolidNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Leaked { closing_tried } => write!(
                f,
                "the part's surface has holes wider than {} voxels, so it was not filled by what it encloses",
                2 * closing_tried
            ),
            Self::Pieces(pieces) => write!(f, "the part is in {pieces} pieces, which move as one"),
            Self::LeftOut { share } => write!(f, "{:.1} % of the part hangs loose and was left out", 100.0 * share),
            Self::Broken(count) => write!(f, "{count} Gaussians of the part have values that are NaN or infinite"),
        }
    }
}

impl SolidReport {
    /// What whoever uses the solid should know; nothing if all went well.
    pub fn notes(&self) -> impl Iterator<Item = SolidNote> {
        let leaked = self.leaked.then_some(SolidNote::Leaked { closing_tried: self.closing });
        let left_out = (self.left_out > 0.005).then_some(SolidNote::LeftOut { share: self.left_out });
        let pieces = (self.pieces > 1 && left_out.is_none()).then_some(SolidNote::Pieces(self.pieces));
        let broken = (self.unused.broken > 0).then_some(SolidNote::Broken(self.unused.broken));
        [leaked, pieces, left_out, broken].into_iter().flatten()
    }
}
