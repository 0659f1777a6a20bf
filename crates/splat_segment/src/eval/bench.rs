//! [`BenchScene`]: a labelled capture with prompts.

use std::sync::Arc;

use splat_core::{Cloud, Mask2d, View};

use super::metrics::IGNORE;
use crate::SegmentError;
use crate::project::check_size;

/// Label per pixel of a view, row-major: 0, an object, or 255 for "do not score".
#[derive(Clone, Debug, PartialEq)]
pub struct LabelMap {
    /// The camera.
    pub view: View,
    /// One label per pixel.
    pub labels: Vec<u8>,
}

impl LabelMap {
    /// The pixels of `label`.
    pub fn mask(&self, label: u8) -> Mask2d {
        let width = self.view.width as usize;
        Mask2d::from_fn(self.view.width, self.view.height, |x, y| self.labels[y as usize * width + x as usize] == label)
    }

    /// Takes the pixels that are not scored out of a mask of the same size.
    pub fn clear_ignored(&self, mask: &mut Mask2d) {
        for (value, _) in mask.values_mut().iter_mut().zip(&self.labels).filter(|(_, l)| **l == IGNORE) {
            *value = 0;
        }
    }
}

/// Whether the object is wholly inside the prompt's picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PromptKind {
    /// The best view of it that has it whole.
    Main,
    /// The picture's edge cuts it.
    Cut,
}

/// A further view of a prompted object.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// Index of the camera.
    pub camera: usize,
    /// A pixel well inside the object.
    pub click: [u32; 2],
    /// The object's visible part.
    pub mask: Mask2d,
}

/// How an object is pointed at.
#[derive(Clone, Debug, PartialEq)]
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
    /// Left, top, right, bottom in pixels; inclusive.
    pub rectangle: [u32; 4],
    /// The object's visible part.
    pub mask: Mask2d,
    /// Further views, two by convention.
    pub corrections: Vec<Correction>,
}

impl Prompt {
    /// Camera and mask of the prompt's view, then of its corrections.
    pub fn masked(&self) -> impl Iterator<Item = (usize, &Mask2d)> {
        std::iter::once((self.camera, &self.mask)).chain(self.corrections.iter().map(|c| (c.camera, &c.mask)))
    }
}

/// A labelled capture.
#[derive(Clone, Debug)]
pub struct BenchScene {
    /// Its name.
    pub name: String,
    /// The Gaussians.
    pub cloud: Arc<Cloud>,
    /// Label per Gaussian; 0 is the background, 255 is left out of every score.
    pub labels: Vec<u8>,
    /// Blending weight of every Gaussian, summed over all pixels of all cameras, in pixels.
    pub weight: Vec<f32>,
    /// Training cameras, which methods may use.
    pub cameras: Vec<View>,
    /// Held-back views, for scores only.
    pub held_back: Vec<LabelMap>,
    /// The prompts.
    pub prompts: Vec<Prompt>,
}

impl BenchScene {
    /// Checks that everything has the size that it must have.
    ///
    /// # Errors
    /// [`SegmentError::Length`], [`SegmentError::Missing`] for a camera that does not exist, [`SegmentError::Raster`] for a
    /// mask of another size than its view.
    pub fn check(&self) -> Result<(), SegmentError> {
        let length = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(SegmentError::Length { what, found, expected }) }
        };
        length("labels", self.labels.len(), self.cloud.len())?;
        length("weight", self.weight.len(), self.cloud.len())?;
        for map in &self.held_back {
            length("label map", map.labels.len(), map.view.width as usize * map.view.height as usize)?;
        }
        for (camera, mask) in self.prompts.iter().flat_map(Prompt::masked) {
            let count = self.cameras.len();
            let view = self.cameras.get(camera);
            check_size(view.ok_or(SegmentError::Missing { what: "camera", found: camera as u64, count })?, mask)?;
        }
        Ok(())
    }
}
