//! What pictures of a capture say about its Gaussians: colour as blended, surface direction from rendered depth.
//!
//! A Gaussian's own colour and shortest axis are poor witnesses: training spreads one surface over many overlapping,
//! half-transparent Gaussians. What a camera sees of them together is smooth. So a few small pictures are drawn, and
//! every pixel testifies for the Gaussian that contributes most to it.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use splat_core::{Cloud, View, color};
use splat_raster::{Features, Frame, Outputs, Rasterizer, Scene};

use crate::views::evenly_spaced;
use crate::{Run, SegmentError};

/// How many pictures are drawn and how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvidenceSettings {
    /// Views at most; evenly spaced among those given.
    pub views: usize,
    /// Pixels of a picture, about.
    pub pixels: u32,
}

impl Default for EvidenceSettings {
    fn default() -> Self {
        Self { views: 12, pixels: 76_800 }
    }
}

/// Testimony of all pixels, per Gaussian.
#[derive(Clone, Debug, Default)]
pub struct Evidence {
    /// Pixels to which the Gaussian contributes most.
    pub pixels: Vec<u32>,
    /// Mean colour of those pixels, CIE Lab; zero where there are none.
    pub lab: Vec<Vec3>,
    /// Mean unit normal of those pixels, turned towards the camera: its length tells how well they agree.
    pub normal: Vec<Vec3>,
}

/// Neighbouring pixels whose depths differ by more than this share do not lie on one surface.
pub(super) const DEPTH_STEP: f32 = 0.02;

impl Evidence {
    /// Draws up to `settings.views` of `views`, small, and sums up what they show.
    ///
    /// # Errors
    /// [`SegmentError::Raster`] if a view cannot be drawn, [`SegmentError::Cancelled`].
    pub fn gather(
        scene: &Scene,
        views: &[View],
        settings: &EvidenceSettings,
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<Self, SegmentError> {
        let count = scene.len();
        let mut sums = Self { pixels: vec![0; count], lab: vec![Vec3::ZERO; count], normal: vec![Vec3::ZERO; count] };
        let chosen = evenly_spaced(views.len(), settings.views);
        // Base colours: what shines differently from view to view is still one thing, and SH would cost half the frame.
        let colors: Vec<f32> = scene
            .instances
            .iter()
            .flat_map(|i| (0..i.cloud.len()).flat_map(|g| base_color(&i.cloud, g).to_array()))
            .collect();
        let features = Some(Features { channels: 3, values: &colors });
        let outputs = Outputs { features, median_depth: true, strongest: true, ..Outputs::default() };
        let mut frame = Frame::default();
        for (done, &k) in chosen.iter().enumerate() {
            run.step("look", done, chosen.len())?;
            let view = shrunk(&views[k], settings.pixels);
            raster.draw(scene, &view, &outputs, &mut frame)?;
            sums.add(&frame, &view);
        }
        for g in 0..count {
            if sums.pixels[g] > 0 {
                let share = 1.0 / sums.pixels[g] as f32;
                sums.lab[g] *= share;
                sums.normal[g] *= share;
            }
        }
        Ok(sums)
    }

    fn add(&mut self, frame: &Frame, view: &View) {
        let normals = smooth_normals(&frame.median_depth, view);
        let seen = |pixel: usize| frame.strongest[pixel] != Frame::NO_ID && !frame.median_depth[pixel].is_nan();
        let lab: Vec<Vec3> = (0..frame.strongest.len())
            .into_par_iter()
            .map(|pixel| {
                let rgb = Vec3::from_slice(&frame.features[3 * pixel..]);
                if seen(pixel) { color::lab_from_srgb(rgb.clamp(Vec3::ZERO, Vec3::ONE)) } else { Vec3::ZERO }
            })
            .collect();
        for (pixel, &id) in frame.strongest.iter().enumerate() {
            if !seen(pixel) {
                continue;
            }
            let g = id as usize;
            self.pixels[g] += 1;
            self.lab[g] += lab[pixel];
            self.normal[g] += normals[pixel];
        }
    }
}

/// Base colour, black where the file has none.
fn base_color(cloud: &Cloud, g: usize) -> Vec3 {
    let c = cloud.base_color(g);
    if c.is_finite() { c.max(Vec3::ZERO) } else { Vec3::ZERO }
}

/// The same camera with about `pixels` pixels, never more than it has.
pub(super) fn shrunk(view: &View, pixels: u32) -> View {
    let k = (pixels as f32 / (view.width as f32 * view.height as f32)).sqrt().min(1.0);
    let side = |n: u32| ((n as f32 * k).round() as u32).max(1);
    view.resized(side(view.width), side(view.height))
}

/// Whether two camera depths may belong to one surface; NaN never does.
fn continuous(a: f32, b: f32) -> bool {
    (a - b).abs() < DEPTH_STEP * a.min(b)
}

/// Unit normals from a depth picture, turned towards the camera, averaged over 5 x 5 pixels of the same surface;
/// zero where there is none and along the picture's edge.
fn smooth_normals(depth: &[f32], view: &View) -> Vec<Vec3> {
    let (w, h) = (view.width as usize, view.height as usize);
    if w < 5 || h < 5 {
        return vec![Vec3::ZERO; w * h];
    }
    let position: Vec<Vec3> = (0..w * h)
        .into_par_iter()
        .map(|i| view.unproject(Vec2::new((i % w) as f32 + 0.5, (i / w) as f32 + 0.5), depth[i]))
        .collect();
    let inner = |i: usize| (2..w - 2).contains(&(i % w)) && (2..h - 2).contains(&(i / w)) && depth[i].is_finite();
    let raw: Vec<Vec3> = (0..w * h)
        .into_par_iter()
        .map(|i| {
            if !inner(i) {
                return Vec3::ZERO;
            }
            let along = |step: usize| {
                let mut sum = Vec3::ZERO;
                for k in [step, 2 * step] {
                    if continuous(depth[i], depth[i + k]) {
                        sum += position[i + k] - position[i];
                    }
                    if continuous(depth[i], depth[i - k]) {
                        sum += position[i] - position[i - k];
                    }
                }
                sum
            };
            let n = along(w).cross(along(1)).normalize_or_zero();
            if n.dot(view.pose.position - position[i]) < 0.0 { -n } else { n }
        })
        .collect();
    (0..w * h)
        .into_par_iter()
        .map(|i| {
            if !inner(i) {
                return Vec3::ZERO;
            }
            let mut sum = Vec3::ZERO;
            for row in 0..5 {
                for column in 0..5 {
                    let k = i + row * w + column - 2 * w - 2;
                    if continuous(depth[i], depth[k]) {
                        sum += raw[k];
                    }
                }
            }
            sum.normalize_or_zero()
        })
        .collect()
}
