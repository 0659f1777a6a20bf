//! [`SolidSettings`].

use glam::DVec3;

use super::SolidError;

/// How a part's Gaussians are made a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidSettings {
    /// Voxels along the diagonal of the part, 8..=512. More: finer and slower, with the cube of it.
    pub voxels: u32,
    /// A voxel is part of the surface from this opacity on, above 0 and below 1. Lower: thicker, with fewer holes.
    pub cut: f32,
    /// Close the underside, which no camera sees of what stands on something.
    pub close_bottom: bool,
    /// A unit vector, in the cloud's axes.
    pub up: DVec3,
    /// Thickness of its wall in metres, where it is hollow; `None`: it is solid.
    pub hollow: Option<f64>,
    /// Holes of up to twice as many voxels are closed, 1..=16; the least that suffices is taken.
    pub max_closing: u32,
    /// What to do if there are wider ones.
    pub leaks: Leaks,
    /// What to do if the part is not in one piece.
    pub pieces: Pieces,
}

/// What to do with a surface that does not close.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Leaks {
    /// Try voxels twice as large, once; then fill its convex hull, and say so in the [report](super::SolidReport::leaked).
    #[default]
    Hull,
    /// Keep the shell alone, as of a bowl or a leaf.
    Shell,
    /// [`SolidError::ShellLeaks`].
    Refuse,
}

/// What to do with a part in several pieces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pieces {
    /// Keep those that hold more than 1 % of the largest, at most 32 of them.
    #[default]
    Large,
    /// Keep the largest.
    Largest,
    /// [`SolidError::Disconnected`] if there is more than one that is large.
    One,
}

impl Default for SolidSettings {
    fn default() -> Self {
        Self {
            voxels: 64,
            cut: 0.35,
            close_bottom: true,
            up: DVec3::Y,
            hollow: None,
            max_closing: 4,
            leaks: Leaks::Hull,
            pieces: Pieces::Large,
        }
    }
}

impl SolidSettings {
    /// Whether every setting has a meaning.
    pub(super) fn check(&self) -> Result<(), SolidError> {
        let fail = |setting, value, range| Err(SolidError::Setting { setting, value, range });
        if !(8..=512).contains(&self.voxels) {
            return fail("voxels", self.voxels.into(), "8 to 512");
        }
        if !(self.cut > 0.0 && self.cut < 1.0) {
            return fail("cut", self.cut.into(), "above 0 and below 1");
        }
        if !(1..=16).contains(&self.max_closing) {
            return fail("max_closing", self.max_closing.into(), "1 to 16");
        }
        // What is not finite has no such length either.
        if !((self.up.length() - 1.0).abs() < 1e-3) {
            return fail("the length of up", self.up.length(), "1");
        }
        match self.hollow {
            Some(wall) if !(wall > 0.0 && wall.is_finite()) => fail("hollow", wall, "a number of metres above 0"),
            _ => Ok(()),
        }
    }
}
