//! [`Film`]: pictures of the part among the rest.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use splat_core::{Selection, View};
use splat_io::picture;
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Frame, Instance, Outputs, Rasterizer, Scene};

use super::body::Body;
use crate::capture::Capture;
use crate::failure::Failure;
use crate::paint;

/// Draws frames into a folder.
pub(super) struct Film {
    folder: PathBuf,
    view: View,
    raster: CpuRasterizer,
    frame: Frame,
    /// What stays, and the part.
    rest: Instance,
    part: Instance,
    count: usize,
}

impl Film {
    pub(super) fn new(capture: &Capture, part: &Selection, view: View, folder: &Path) -> Self {
        let hidden = Some(Arc::new(part.clone()));
        Self {
            folder: folder.to_owned(),
            view,
            raster: CpuRasterizer::new(),
            frame: Frame::default(),
            rest: Instance { hidden, ..Instance::new(capture.cloud.clone()) },
            part: Instance { subset: Some(part.ids().into()), ..Instance::new(capture.cloud.clone()) },
            count: 0,
        }
    }

    /// Pictures drawn.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Draws the body as it lies now.
    ///
    /// # Errors
    /// [`Failure::Failed`] if the picture cannot be drawn or written.
    pub(super) fn shoot(&mut self, body: &Body, number: u64) -> Result<(), Failure> {
        let part = Instance {
            transform: body.placed(),
            deformation: Some(Arc::new(body.deformation()?)),
            ..self.part.clone()
        };
        let scene = Scene { instances: vec![self.rest.clone(), part] };
        self.raster.draw(&scene, &self.view, &Outputs { color: true, ..Outputs::default() }, &mut self.frame)?;
        let path = self.folder.join(format!("frame_{number:04}.png"));
        let pixels = paint::over(&self.frame.color, [0.0; 3]);
        picture::write_png_rgb8(&path, self.frame.width, self.frame.height, &pixels)?;
        self.count += 1;
        Ok(())
    }
}
