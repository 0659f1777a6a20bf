//! What a frame is, and back ends that draw it.
//!
//! For pixel centre p and Gaussians in order of camera depth of their means (ties by id):
//! `alpha_i(p) = min(0.99, opacity_i * exp(-q_i(p) / 2))`; contributions under 1/255 are skipped;
//! `w_i = alpha_i * T`, then `T <- T * (1 - alpha_i)`; the pixel ends before the Gaussian that would bring T under 1e-4.
//! `q_i` is the Mahalanobis distance under the projected covariance plus 0.3 px^2 on both diagonal entries, or the
//! antialiased (mip) form where [`Source::antialiased`](splat_core::Source::antialiased) says so.
//!
//! ```
//! use std::sync::Arc;
//! use splat_core::glam::{Quat, Vec3};
//! use splat_core::{Cloud, CloudArrays, Pose, View};
//! use splat_raster::cpu::CpuRasterizer;
//! use splat_raster::{Rasterizer, Scene};
//!
//! // One red Gaussian, seen from two units away.
//! let cloud = Cloud::new(CloudArrays {
//!     means: vec![Vec3::ZERO],
//!     log_scales: vec![Vec3::splat(-1.0)],
//!     rotations: vec![Quat::IDENTITY],
//!     opacity_logits: vec![4.0],
//!     sh: vec![1.7, -1.7, -1.7],
//!     ..CloudArrays::default()
//! })?;
//! let scene = Scene::of(Arc::new(cloud));
//! let pose = Pose::look_at(Vec3::new(0.0, 0.0, -2.0), Vec3::ZERO, Vec3::NEG_Y);
//! let view = View::perspective(pose, 0.9, 64, 48);
//! let mut rasterizer = CpuRasterizer::new();
//! let [red, green, _, alpha] = rasterizer.render(&scene, &view)?[24 * 64 + 32];
//! assert!(red > 0.9 && green < 0.1 && alpha > 0.9);
//! assert_eq!(rasterizer.first_hits(&scene, &view, 0.5)?[24 * 64 + 32], 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Every output ([`Outputs`]) is made of these weights `w_i(p)` and nothing else, so that what is seen is what is
//! picked, voted for and selected. An output that is not asked for costs nothing.

pub mod cpu;
mod frame;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod pick;
mod scene;

pub use frame::{Depth, Features, Frame, Outputs, RasterError, VOTE_UNIT, Votes};
pub use scene::{Instance, Scene};

use splat_core::{Mask2d, Selection, View};

/// A way to draw a [`Scene`]. Ids and per-Gaussian arrays count through all instances in order ([`Scene::offset`]).
pub trait Rasterizer {
    /// Draws all outputs asked for in one pass; buffers of `frame` are reused, outputs not asked for are left empty.
    ///
    /// # Errors
    /// [`RasterError`] when the view is unusable or an input does not fit the scene or the view; `frame` is unspecified then.
    fn draw(&mut self, scene: &Scene, view: &View, outputs: &Outputs, frame: &mut Frame) -> Result<(), RasterError>;

    /// Colour: premultiplied red, green, blue and alpha per pixel, row-major, sRGB-encoded (the paper's `render`).
    ///
    /// # Errors
    /// As [`Rasterizer::draw`].
    fn render(&mut self, scene: &Scene, view: &View) -> Result<Vec<[f32; 4]>, RasterError> {
        let mut frame = Frame::default();
        self.draw(scene, view, &Outputs { color: true, ..Outputs::default() }, &mut frame)?;
        Ok(frame.color)
    }

    /// Depth per pixel, row-major, in scene units; NaN where there is none (the paper's `depth`).
    ///
    /// # Errors
    /// As [`Rasterizer::draw`].
    fn depth(&mut self, scene: &Scene, view: &View, kind: Depth) -> Result<Vec<f32>, RasterError> {
        let mut frame = Frame::default();
        let outputs = Outputs {
            median_depth: kind == Depth::Median,
            expected_depth: kind == Depth::Expected,
            ..Outputs::default()
        };
        self.draw(scene, view, &outputs, &mut frame)?;
        Ok(if kind == Depth::Median { frame.median_depth } else { frame.expected_depth })
    }

    /// `sum_i w_i f_i` for any number of channels, pixel-major (the paper's `features`).
    ///
    /// # Errors
    /// As [`Rasterizer::draw`].
    fn features(&mut self, scene: &Scene, view: &View, features: Features<'_>) -> Result<Vec<f32>, RasterError> {
        let mut frame = Frame::default();
        self.draw(scene, view, &Outputs { features: Some(features), ..Outputs::default() }, &mut frame)?;
        Ok(frame.features)
    }

    /// Gaussians whose largest weight over the picture is above `threshold`, 1/255 by convention (the paper's `viz`).
    ///
    /// # Errors
    /// As [`Rasterizer::draw`].
    fn visibility(&mut self, scene: &Scene, view: &View, threshold: f32) -> Result<Selection, RasterError> {
        let mut frame = Frame::default();
        self.draw(scene, view, &Outputs { visibility: Some(threshold), ..Outputs::default() }, &mut frame)?;
        Ok(frame.visibility)
    }

    /// Per pixel the id of the Gaussian at which T first falls to `1 - tau` or below, [`Frame::NO_ID`] where none does
    /// (the paper's `first_hits`).
    ///
    /// # Errors
    /// As [`Rasterizer::draw`].
    fn first_hits(&mut self, scene: &Scene, view: &View, tau: f32) -> Result<Vec<u32>, RasterError> {
        let mut frame = Frame::default();
        self.draw(scene, view, &Outputs { first_hits: Some(tau), ..Outputs::default() }, &mut frame)?;
        Ok(frame.first_hits)
    }

    /// Votes of masks for every Gaussian: the adjoint of `features`, in integers.
    ///
    /// # Errors
    /// As [`Rasterizer::draw`].
    fn votes(&mut self, scene: &Scene, view: &View, masks: &[&Mask2d]) -> Result<Votes, RasterError> {
        let mut frame = Frame::default();
        self.draw(scene, view, &Outputs { votes: Some(masks), ..Outputs::default() }, &mut frame)?;
        Ok(frame.votes)
    }
}
