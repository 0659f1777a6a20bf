//! [`Look`]: which Gaussian and which patch every pixel of the user's view shows.

use glam::Vec2;
use splat_core::View;
use splat_raster::{Frame, Outputs, Rasterizer, Scene};

use super::prepared::Prepared;
use crate::SegmentError;

/// Pixels of the small picture on which silhouettes are compared, about.
const PIXELS: u32 = 19_200;

/// The user's view as Gaussians and patches; drawn once per view, then every click in it is answered from memory.
#[derive(Clone, Debug)]
pub struct Look {
    /// The user's view.
    pub view: View,
    /// Per pixel of the view the Gaussian that contributes most, however faint; [`Frame::NO_ID`] where nothing is seen.
    pub strongest: Vec<u32>,
    /// The same, [`Frame::NO_ID`] also where more than half of the background shows through: what silhouettes are made of.
    pub solid: Vec<u32>,
    /// Pixels of the view per pixel of the small picture, along each side.
    pub step: u32,
    /// Pixels across the small picture.
    pub width: usize,
    /// Pixels down the small picture.
    pub height: usize,
    /// Patch per pixel of the small picture; [`Look::NOTHING`] where nothing is seen.
    pub patch: Vec<u32>,
    /// Median depth per pixel of the small picture; NaN where there is none.
    pub depth: Vec<f32>,
}

impl Look {
    /// Stands for "no patch".
    pub const NOTHING: u32 = u32::MAX;

    /// Draws a view.
    ///
    /// # Errors
    /// [`SegmentError::Raster`].
    pub fn draw(
        prepared: &Prepared,
        scene: &Scene,
        view: &View,
        raster: &mut dyn Rasterizer,
    ) -> Result<Self, SegmentError> {
        let mut frame = Frame::default();
        let outputs = Outputs { median_depth: true, strongest: true, ..Outputs::default() };
        raster.draw(scene, view, &outputs, &mut frame)?;
        let step = (((view.width as f32 * view.height as f32) / PIXELS as f32).sqrt().round() as u32).max(1);
        let (width, height) = (view.width.div_ceil(step) as usize, view.height.div_ceil(step) as usize);
        let solid: Vec<u32> = frame
            .strongest
            .iter()
            .zip(&frame.median_depth)
            .map(|(&id, depth)| if depth.is_nan() { Frame::NO_ID } else { id })
            .collect();
        let (mut patch, mut depth) = (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
        for y in 0..height as u32 {
            for x in 0..width as u32 {
                let (fx, fy) = ((x * step + step / 2).min(view.width - 1), (y * step + step / 2).min(view.height - 1));
                let k = fy as usize * view.width as usize + fx as usize;
                patch.push(match solid[k] {
                    Frame::NO_ID => Self::NOTHING,
                    id => prepared.graph.of[id as usize],
                });
                depth.push(frame.median_depth[k]);
            }
        }
        Ok(Self { view: *view, strongest: frame.strongest, solid, step, width, height, patch, depth })
    }

    /// The Gaussian that contributes most at a pixel of the view; `None` where nothing is seen or outside the picture.
    pub fn gaussian(&self, at: Vec2) -> Option<u32> {
        if !self.view.contains(at) {
            return None;
        }
        let id = self.strongest[at.y as usize * self.view.width as usize + at.x as usize];
        (id != Frame::NO_ID).then_some(id)
    }

    /// The small picture's pixel under a pixel of the view.
    pub fn pixel(&self, at: Vec2) -> usize {
        let fit = |v: f32, n: usize| ((v.max(0.0) as u32 / self.step) as usize).min(n - 1);
        fit(at.y, self.height) * self.width + fit(at.x, self.width)
    }
}

/// Distance of every pixel that is inside to the nearest one that is not, in pixels (0 outside); what lies beyond the
/// picture does not count as outside. Steps of 1 and 1.41: within 8 % of the Euclidean distance, one pass each way.
pub(super) fn inside_distance(inside: &[bool], width: usize, height: usize) -> Vec<f32> {
    const DIAGONAL: f32 = 1.41;
    let mut d: Vec<f32> = inside.iter().map(|&x| if x { 1e6 } else { 0.0 }).collect();
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            if d[i] > 0.0 {
                let mut v = d[i];
                if x > 0 {
                    v = v.min(d[i - 1] + 1.0);
                }
                if y > 0 {
                    v = v.min(d[i - width] + 1.0);
                    if x > 0 {
                        v = v.min(d[i - width - 1] + DIAGONAL);
                    }
                    if x + 1 < width {
                        v = v.min(d[i - width + 1] + DIAGONAL);
                    }
                }
                d[i] = v;
            }
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            let i = y * width + x;
            if d[i] > 0.0 {
                let mut v = d[i];
                if x + 1 < width {
                    v = v.min(d[i + 1] + 1.0);
                }
                if y + 1 < height {
                    v = v.min(d[i + width] + 1.0);
                    if x > 0 {
                        v = v.min(d[i + width - 1] + DIAGONAL);
                    }
                    if x + 1 < width {
                        v = v.min(d[i + width + 1] + DIAGONAL);
                    }
                }
                d[i] = v;
            }
        }
    }
    d
}
