//! The prompts of the benchmark layout, and what a method is asked with them.

use std::sync::Arc;
use std::time::Instant;

use splat_core::{Cloud, Mask2d, Selection, View};
use splat_raster::{Features, Frame, Outputs, RasterError, Rasterizer, Scene};

use super::metrics::{self, IGNORE};

/// Label per pixel of a view, row-major: 0, an object, or 255 for "do not score".
#[derive(Clone, Debug)]
pub struct LabelMap {
    /// The camera.
    pub view: View,
    /// One label per pixel.
    pub labels: Vec<u8>,
}

/// Whether the object is wholly inside the prompt's picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PromptKind {
    /// It is.
    Main,
    /// The picture's edge cuts it.
    Cut,
}

/// A further view of a prompted object.
#[derive(Clone, Debug)]
pub struct Correction {
    /// Index of the camera.
    pub camera: usize,
    /// A pixel well inside the object.
    pub click: [u32; 2],
    /// The object's visible part.
    pub mask: Mask2d,
}

/// How the object is pointed at.
#[derive(Clone, Debug)]
pub struct Prompt {
    /// The object.
    pub label: u8,
    /// Its name.
    pub name: String,
    /// Whole or cut.
    pub kind: PromptKind,
    /// Index of the camera.
    pub camera: usize,
    /// A pixel well inside the object.
    pub click: [u32; 2],
    /// Left, top, right, bottom; inclusive.
    pub rectangle: [u32; 4],
    /// The object's visible part.
    pub mask: Mask2d,
    /// Two further views.
    pub corrections: Vec<Correction>,
}

/// A labelled capture.
#[derive(Clone, Debug)]
pub struct BenchScene {
    /// Its name.
    pub name: String,
    /// The Gaussians.
    pub cloud: Arc<Cloud>,
    /// Label per Gaussian; 255 is left out of every score.
    pub labels: Vec<u8>,
    /// Blending weight per Gaussian over all cameras; visible means above 1.0.
    pub weight: Vec<f32>,
    /// Training cameras.
    pub cameras: Vec<View>,
    /// Held-back views.
    pub held_back: Vec<LabelMap>,
    /// The prompts.
    pub prompts: Vec<Prompt>,
}
