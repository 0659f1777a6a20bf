//! Prompts: for every object its best view, a view that cuts it off, clicks, boxes and two correction views each.

use std::path::Path;

use glam::Vec3;
use serde_json::{Value, json};
use splat_core::Mask2d;

use crate::bench::{Bench, Failure, mask_of, write_mask};
use crate::room::NAMES;

/// A prompt and the views that correct it.
#[derive(Debug)]
pub(crate) struct Prompt {
    label: u8,
    kind: &'static str,
    camera: usize,
    corrections: Vec<usize>,
}

/// How an object looks in a view.
#[derive(Clone, Copy, Debug)]
struct Sight {
    camera: usize,
    /// Pixels of its mask.
    area: usize,
    /// Whether the mask reaches the picture's edge.
    cut: bool,
    /// Share of its visible Gaussians inside the picture.
    inside: f64,
    /// Unit direction from the object to the camera.
    from: Vec3,
}

/// Smallest mask worth a prompt, in pixels.
const SMALLEST: usize = 120;

/// Prompts of an object: the main one first, then one that the picture's edge cuts off, where there is such a view.
///
/// # Errors
/// When no view shows enough of the object.
pub(crate) fn of(bench: &Bench, label: u8) -> Result<Vec<Prompt>, Failure> {
    let sights = sights(bench, label);
    let name = NAMES[usize::from(label) - 1];
    let best = |list: &mut dyn Iterator<Item = &Sight>| list.max_by_key(|s| (s.area, usize::MAX - s.camera)).copied();
    let whole = best(&mut sights.iter().filter(|s| !s.cut && s.inside > 0.995));
    let main = whole
        .or_else(|| best(&mut sights.iter()))
        .ok_or_else(|| format!("no camera shows {SMALLEST} pixels of the {name}; move it or a camera"))?;
    let mut out = vec![prompt(&sights, label, "main", main)];
    let cut = best(&mut sights.iter().filter(|s| s.cut && (0.2..0.93).contains(&s.inside) && s.area >= 400));
    if let Some(cut) = cut.filter(|c| c.camera != main.camera) {
        out.push(prompt(&sights, label, "cut", cut));
    }
    Ok(out)
}

fn sights(bench: &Bench, label: u8) -> Vec<Sight> {
    let means: Vec<Vec3> = (0..bench.labels.len())
        .filter(|&i| bench.labels[i] == label && bench.visible(i))
        .map(|i| bench.cloud.means()[i])
        .collect();
    let middle = means.iter().copied().sum::<Vec3>() / means.len().max(1) as f32;
    let mut out = Vec::new();
    for (camera, (view, map)) in bench.training.iter().zip(&bench.maps).enumerate() {
        let (width, height) = (view.width as usize, view.height as usize);
        let area = map.iter().filter(|&&l| l == label).count();
        if area < SMALLEST {
            continue;
        }
        let edge = |k: usize| {
            let (x, y) = (k % width, k / width);
            x < 2 || y < 2 || x + 2 >= width || y + 2 >= height
        };
        let cut = map.iter().enumerate().any(|(k, &l)| l == label && edge(k));
        let shown = means.iter().filter(|&&m| view.project(m).is_some_and(|(p, _)| view.contains(p))).count();
        let inside = shown as f64 / means.len() as f64;
        let from = (view.pose.position - middle).normalize_or_zero();
        out.push(Sight { camera, area, cut, inside, from });
    }
    out
}

/// Adds the two largest other views that look from another side; if there are none, from less far aside.
fn prompt(sights: &[Sight], label: u8, kind: &'static str, main: Sight) -> Prompt {
    let mut chosen = vec![main];
    for closest in [0.92, 0.97, 0.995, 1.1] {
        while chosen.len() < 3 {
            let next = sights
                .iter()
                .filter(|s| chosen.iter().all(|c| c.camera != s.camera && c.from.dot(s.from) < closest))
                .max_by_key(|s| (s.area, usize::MAX - s.camera));
            let Some(next) = next else { break };
            chosen.push(*next);
        }
    }
    Prompt { label, kind, camera: main.camera, corrections: chosen[1..].iter().map(|s| s.camera).collect() }
}

impl Prompt {
    /// Writes the masks and gives the entry of `prompts.json`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(crate) fn write(&self, bench: &Bench, folder: &Path) -> Result<Value, Failure> {
        let name = NAMES[usize::from(self.label) - 1];
        let mask_in = |camera: usize, kind: &str| -> Result<(Mask2d, String), Failure> {
            let mask = mask_of(&bench.maps[camera], &bench.training[camera], self.label);
            let path = format!("masks/{:02}_{}_{kind}_v{camera:02}.png", self.label, name.replace(' ', "-"));
            write_mask(&folder.join(&path), &mask)?;
            Ok((mask, path))
        };
        let (mask, path) = mask_in(self.camera, self.kind)?;
        let (click, radius) = deepest(&mask);
        let mut corrections = Vec::new();
        for &camera in &self.corrections {
            // Both prompts of an object may share a correction view: one file serves both.
            let (mask, path) = mask_in(camera, "corr")?;
            corrections.push(json!({
                "camera": camera,
                "click": deepest(&mask).0,
                "mask": path,
                "area": mask.count(),
            }));
        }
        Ok(json!({
            "label": self.label,
            "name": name,
            "kind": self.kind,
            "camera": self.camera,
            "click": click,
            "click_radius": (f64::from(radius) * 10.0).round() / 10.0,
            "box": extent(&mask),
            "area": mask.count(),
            "mask": path,
            "corrections": corrections,
        }))
    }
}

/// Corners of a mask, both inclusive.
fn extent(mask: &Mask2d) -> [u32; 4] {
    let mut out = [u32::MAX, u32::MAX, 0, 0];
    for y in 0..mask.height() {
        for x in (0..mask.width()).filter(|&x| mask.contains(x, y)) {
            out = [out[0].min(x), out[1].min(y), out[2].max(x), out[3].max(y)];
        }
    }
    out
}

/// The pixel of a mask farthest from anything outside it, beyond the picture included, and that distance in pixels.
pub(crate) fn deepest(mask: &Mask2d) -> ([u32; 2], f32) {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    // Distance within the column to the nearest pixel outside.
    let mut column = vec![0i64; width * height];
    for x in 0..width {
        let mut run = 0;
        for y in 0..height {
            run = if mask.contains(x as u32, y as u32) { run + 1 } else { 0 };
            column[y * width + x] = run;
        }
        run = 0;
        for y in (0..height).rev() {
            run = if column[y * width + x] > 0 { run + 1 } else { 0 };
            column[y * width + x] = column[y * width + x].min(run);
        }
    }
    let (mut best, mut at) = (0, [0, 0]);
    for y in 0..height {
        for x in 0..width {
            let own = column[y * width + x];
            let mut least = own * own;
            // The picture's sides are outside too.
            let side = (x.min(width - 1 - x) + 1) as i64;
            least = least.min(side * side);
            if least <= best {
                continue;
            }
            for d in 1..own {
                let far = d * d;
                if far >= least || least <= best {
                    break;
                }
                for other in [x as i64 - d, x as i64 + d] {
                    if (0..width as i64).contains(&other) {
                        let c = column[y * width + other as usize];
                        least = least.min(far + c * c);
                    }
                }
            }
            if least > best {
                (best, at) = (least, [x as u32, y as u32]);
            }
        }
    }
    (at, (best as f32).sqrt())
}
