//! [`Timings`]: what the stages of a frame took.

use std::time::Duration;

/// One stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stage {
    /// From its begin to its end.
    pub wall: Duration,
    /// Time that threads spent in it, added over all threads.
    pub busy: Duration,
}

/// What the stages of one draw took; zero where a stage was skipped, because the lists of the draw before served.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// Gaussians to splats: culling, projection, colour.
    pub project: Stage,
    /// One order by depth.
    pub sort: Stage,
    /// Lists per tile.
    pub bin: Stage,
    /// Blending, and clearing and writing the outputs.
    pub raster: Stage,
}

impl Timings {
    /// The stages with their names, in order.
    pub fn stages(&self) -> [(&'static str, Stage); 4] {
        [("project", self.project), ("sort", self.sort), ("bin", self.bin), ("raster", self.raster)]
    }
}
