//! The CPU back end: project, one sort by depth, tiles, blend.

mod plain;

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
    fn draw(
        &mut self,
        scene: &Scene,
        view: &View,
        outputs: &Outputs,
        frame: &mut Frame,
    ) -> Result<(), RasterError> {
        check(scene, view, outputs)?;
        plain::draw(scene, view, outputs, frame);
        Ok(())
    }
}

/// Everything that can be wrong with a request.
fn check(scene: &Scene, view: &View, outputs: &Outputs) -> Result<(), RasterError> {
    view.check()?;
    for instance in &scene.instances {
        if let Some(hidden) = &instance.hidden {
            if hidden.len() != instance.cloud.len() {
                return Err(RasterError::Length {
                    what: "hidden",
                    found: hidden.len(),
                    expected: instance.cloud.len(),
                });
            }
        }
    }
    if let Some(features) = &outputs.features {
        let expected = scene.len() * features.channels.max(1);
        if features.channels == 0 || features.values.len() != expected {
            return Err(RasterError::Length { what: "features", found: features.values.len(), expected });
        }
    }
    for mask in outputs.votes.unwrap_or_default() {
        if (mask.width(), mask.height()) != (view.width, view.height) {
            return Err(RasterError::SizeMismatch {
                mask: (mask.width(), mask.height()),
                view: (view.width, view.height),
            });
        }
    }
    Ok(())
}
