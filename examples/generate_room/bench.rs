//! The benchmark's side of the room: blending weights, label maps, prompts, and the files that hold them.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use serde_json::{Value, json};
use splat_core::{Cloud, Mask2d, View};
use splat_io::npy;
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Features, Rasterizer, Scene, VOTE_UNIT};

use crate::gaussians::IGNORE;
use crate::prompts;
use crate::room::NAMES;

/// What can go wrong: reading, drawing, writing.
pub(crate) type Failure = Box<dyn Error + Send + Sync>;

/// Nothing nearer to a camera is drawn, in metres.
pub(crate) const NEAR: f32 = 0.05;

/// The room with all that is known about it.
#[derive(Debug)]
pub(crate) struct Bench {
    /// The Gaussians as the committed file decodes.
    pub(crate) cloud: Arc<Cloud>,
    /// Per Gaussian: 0, object or [`IGNORE`].
    pub(crate) labels: Vec<u8>,
    /// Per Gaussian: weight over all training cameras, in 255 logarithmic steps.
    pub(crate) weight: Vec<f32>,
    /// Cameras of the capture.
    pub(crate) training: Vec<View>,
    /// Label maps of [`Bench::training`].
    pub(crate) maps: Vec<Vec<u8>>,
    /// Cameras for scoring.
    pub(crate) held_back: Vec<View>,
    /// Label maps of [`Bench::held_back`].
    pub(crate) held_back_maps: Vec<Vec<u8>>,
}

impl Bench {
    /// Draws everything from all cameras.
    ///
    /// # Errors
    /// When a frame cannot be drawn.
    pub(crate) fn new(
        cloud: Cloud,
        labels: Vec<u8>,
        training: Vec<View>,
        held_back: Vec<View>,
    ) -> Result<Self, Failure> {
        let cloud = Arc::new(cloud);
        let scene = Scene::of(cloud.clone());
        let mut raster = CpuRasterizer::new();
        let mut totals = vec![0u64; cloud.len()];
        for view in &training {
            let votes = raster.votes(&scene, view, &[])?;
            for (sum, total) in totals.iter_mut().zip(votes.total) {
                *sum += total;
            }
        }
        let weight = totals.into_iter().map(|t| log_step(t as f64 * VOTE_UNIT)).collect();
        let values = channels(&labels);
        let mut draw = |views: &[View]| {
            views.iter().map(|v| label_map(&mut raster, &scene, v, &values)).collect::<Result<Vec<_>, _>>()
        };
        let (maps, held_back_maps) = (draw(&training)?, draw(&held_back)?);
        Ok(Self { cloud, labels, weight, training, maps, held_back, held_back_maps })
    }

    /// Whether a Gaussian counts in scores over visible ones.
    pub(crate) fn visible(&self, i: usize) -> bool {
        self.weight[i] > 1.0
    }

    /// Writes everything but the scene itself into `folder`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), Failure> {
        for sub in ["gt", "masks"] {
            std::fs::create_dir_all(folder.join(sub))?;
        }
        npy::write_u8(folder.join("labels.npy"), &self.labels)?;
        npy::write_f32(folder.join("weight.npy"), &self.weight)?;
        write_json(&folder.join("cameras.json"), &cameras_json(&self.training, "view"))?;
        write_json(&folder.join("gt/cameras.json"), &cameras_json(&self.held_back, "gt"))?;
        for (k, (view, map)) in self.held_back.iter().zip(&self.held_back_maps).enumerate() {
            write_gray(
                &folder.join(format!("gt/labels_{k:02}.png")),
                (view.width, view.height),
                png::BitDepth::Eight,
                map,
            )?;
        }
        let mut list = Vec::new();
        for label in 1..=NAMES.len() as u8 {
            for prompt in prompts::of(self, label)? {
                list.push(prompt.write(self, folder)?);
            }
        }
        write_json(&folder.join("prompts.json"), &Value::Array(list))?;
        write_json(&folder.join("stats.json"), &self.stats())
    }

    fn stats(&self) -> Value {
        let objects: Vec<Value> = NAMES
            .iter()
            .enumerate()
            .map(|(k, name)| {
                let label = k as u8 + 1;
                let ids: Vec<usize> = (0..self.labels.len()).filter(|&i| self.labels[i] == label).collect();
                let shown: Vec<usize> = ids.iter().copied().filter(|&i| self.visible(i)).collect();
                let means = || shown.iter().map(|&i| self.cloud.means()[i]);
                let low = means().fold(Vec3::INFINITY, Vec3::min);
                let high = means().fold(Vec3::NEG_INFINITY, Vec3::max);
                let weight: f64 = ids.iter().map(|&i| f64::from(self.weight[i])).sum();
                json!({
                    "label": label,
                    "name": name,
                    "labelled": "by construction",
                    "gaussians": ids.len(),
                    "visible": shown.len(),
                    "weight": (weight * 10.0).round() / 10.0,
                    "extent": (high - low).to_array().map(|x| rounded(x, 1e4)),
                })
            })
            .collect();
        let count = |label: u8| self.labels.iter().filter(|&&l| l == label).count();
        let up = crate::cameras::world().0.y_axis;
        json!({
            "gaussians": self.labels.len(),
            "sh_degree": self.cloud.sh_degree(),
            "objects": objects,
            "background": count(0),
            "ignore": count(IGNORE),
            "visible": (0..self.labels.len()).filter(|&i| self.visible(i)).count(),
            "up": up.to_array().map(|x| (x * 1e6).round() / 1e6),
            "near": rounded(NEAR, 1e3),
        })
    }
}

/// Nearest of 255 logarithmic steps, 6 % apart, with 1.0 among them; 0 below the lowest.
fn log_step(weight: f64) -> f32 {
    let step = (libm::log(weight.max(1e-9)) / 0.06).round();
    if step < -100.0 { 0.0 } else { libm::exp(step.min(154.0) * 0.06) as f32 }
}

/// One channel per label, the ignore label last.
fn channels(labels: &[u8]) -> Vec<f32> {
    let count = NAMES.len() + 2;
    let mut values = vec![0.0; labels.len() * count];
    for (row, &label) in values.chunks_exact_mut(count).zip(labels) {
        row[if label == IGNORE { count - 1 } else { usize::from(label) }] = 1.0;
    }
    values
}

/// The label map of a view: the label with more than half of the weight; ignored where the ignore label has more than
/// half, or more than a quarter on an object.
fn label_map(raster: &mut CpuRasterizer, scene: &Scene, view: &View, values: &[f32]) -> Result<Vec<u8>, Failure> {
    let channels = NAMES.len() + 2;
    let features = raster.features(scene, view, Features { channels, values })?;
    Ok(features
        .chunks_exact(channels)
        .map(|w| {
            let best = (0..channels - 1).fold(0, |best, k| if w[k] > w[best] { k } else { best });
            let label = if w[best] > 0.5 { best as u8 } else { 0 };
            let ignored = w[channels - 1];
            if ignored > 0.5 || (ignored > 0.25 && label != 0) { IGNORE } else { label }
        })
        .collect())
}

/// Pixels of one label as a mask.
pub(crate) fn mask_of(map: &[u8], view: &View, label: u8) -> Mask2d {
    Mask2d::from_fn(view.width, view.height, |x, y| map[(y * view.width + x) as usize] == label)
}

/// Cameras in INRIA's form.
fn cameras_json(views: &[View], name: &str) -> Value {
    views
        .iter()
        .enumerate()
        .map(|(k, v)| {
            let m = v.pose.world_from_view;
            let rows: Vec<_> = (0..3).map(|r| m.row(r).to_array().map(|x| rounded(x, 1e8))).collect();
            json!({
                "id": k,
                "img_name": format!("{name}_{k:02}"),
                "width": v.width,
                "height": v.height,
                "position": v.pose.position.to_array().map(|x| rounded(x, 1e6)),
                "rotation": rows,
                "fy": rounded(v.intrinsics.fy, 1e4),
                "fx": rounded(v.intrinsics.fx, 1e4),
            })
        })
        .collect()
}

/// Writes a mask with one bit per pixel, as small as it gets.
///
/// # Errors
/// When the file cannot be written.
pub(crate) fn write_mask(path: &Path, mask: &Mask2d) -> Result<(), Failure> {
    let row = |line: &[u8]| -> Vec<u8> {
        let byte =
            |eight: &[u8]| eight.iter().enumerate().fold(0, |b, (k, &v)| b | u8::from(v >= Mask2d::HALF) << (7 - k));
        line.chunks(8).map(byte).collect()
    };
    let bits: Vec<u8> = mask.values().chunks(mask.width() as usize).flat_map(row).collect();
    write_gray(path, (mask.width(), mask.height()), png::BitDepth::One, &bits)
}

fn write_gray(path: &Path, (width, height): (u32, u32), depth: png::BitDepth, bytes: &[u8]) -> Result<(), Failure> {
    let mut encoder = png::Encoder::new(std::fs::File::create(path)?, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::NoFilter);
    encoder.write_header()?.write_image_data(bytes)?;
    Ok(())
}

/// A number as short text: rounded to steps of 1 / `unit`.
fn rounded(x: f32, unit: f64) -> f64 {
    (f64::from(x) * unit).round() / unit
}

/// Writes JSON, one line per entry of a list.
fn write_json(path: &Path, value: &Value) -> Result<(), Failure> {
    let text = match value {
        Value::Array(list) => {
            let lines: Vec<String> = list.iter().map(Value::to_string).collect();
            format!("[\n{}\n]\n", lines.join(",\n"))
        }
        other => format!("{other:#}\n"),
    };
    Ok(std::fs::write(path, text)?)
}
