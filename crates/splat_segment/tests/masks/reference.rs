//! A slow, obvious rasteriser written from the formulas, in f64: these tests need no other, and so also show that
//! everything here runs on whatever implements the trait.

use splat_core::glam::{DMat3, DVec3, Mat3};
use splat_core::{Mask2d, Projection, Selection, View, sh};
use splat_raster::{Frame, Outputs, RasterError, Rasterizer, Scene};

#[derive(Default)]
pub(crate) struct Reference {
    /// Frames drawn so far, to see what was redone.
    pub(crate) frames: usize,
}

struct Splat {
    id: usize,
    z: f64,
    center: [f64; 2],
    conic: [f64; 3],
    opacity: f64,
    half: [f64; 2],
    color: [f32; 3],
}

fn splat(id: usize, view: &View, mean: DVec3, cov: DMat3, opacity: f64) -> Option<Splat> {
    let w = dmat(view.pose.world_from_view).transpose();
    let t = w * (mean - view.pose.position.as_dvec3());
    if t.z.is_nan() || t.z <= f64::from(view.near) {
        return None;
    }
    let i = &view.intrinsics;
    let (fx, fy, cx, cy) = (f64::from(i.fx), f64::from(i.fy), f64::from(i.cx), f64::from(i.cy));
    assert_eq!(view.projection, Projection::Perspective);
    let (width, height) = (f64::from(view.width), f64::from(view.height));
    let x = (t.x / t.z).clamp(-cx / fx - 0.15 * width / fx, (width - cx) / fx + 0.15 * width / fx);
    let y = (t.y / t.z).clamp(-cy / fy - 0.15 * height / fy, (height - cy) / fy + 0.15 * height / fy);
    let c = w * cov * w.transpose();
    let rx = DVec3::new(fx / t.z, 0.0, -fx * x / t.z);
    let ry = DVec3::new(0.0, fy / t.z, -fy * y / t.z);
    let (a, b, d) = (rx.dot(c * rx) + 0.3, rx.dot(c * ry), ry.dot(c * ry) + 0.3);
    let det = a * d - b * b;
    let k = 2.0 * (255.0 * opacity).ln();
    (det > 0.0 && k > 0.0).then(|| Splat {
        id,
        z: t.z,
        center: [fx * t.x / t.z + cx, fy * t.y / t.z + cy],
        conic: [d / det, -b / det, a / det],
        opacity,
        half: [(k * a).sqrt(), (k * d).sqrt()],
        color: [0.0; 3],
    })
}

fn dmat(m: Mat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.as_dvec3(), m.y_axis.as_dvec3(), m.z_axis.as_dvec3())
}

impl Rasterizer for Reference {
    fn draw(&mut self, scene: &Scene, view: &View, outputs: &Outputs, frame: &mut Frame) -> Result<(), RasterError> {
        self.frames += 1;
        view.check()?;
        let n = scene.len();
        let mut splats = Vec::new();
        let mut offset = 0;
        for instance in &scene.instances {
            let cloud = &instance.cloud;
            for i in 0..cloud.len() {
                if instance.hidden.as_ref().is_some_and(|h| h.contains(i)) || !cloud.drawable(i) {
                    continue;
                }
                let (mean, cov) = splat_segment::project::placed(instance, i);
                let Some(mut s) = splat(offset + i, view, mean.as_dvec3(), dmat(cov), f64::from(cloud.opacity(i)))
                else {
                    continue;
                };
                let d = (mean - view.pose.position).normalize();
                let c = sh::color(cloud.sh_degree(), cloud.sh_of(i), instance.transform.rotation.inverse() * d);
                s.color = c.to_array();
                splats.push(s);
            }
            offset += cloud.len();
        }
        splats.sort_by(|a, b| a.z.total_cmp(&b.z).then(a.id.cmp(&b.id)));

        let (width, height) = (view.width as usize, view.height as usize);
        let pixels = width * height;
        *frame = Frame { width: view.width, height: view.height, ..Frame::default() };
        let mut t = vec![1.0f64; pixels];
        let mut done = vec![false; pixels];
        let mut color = vec![[0.0f32; 4]; pixels];
        let mut depth = vec![f32::NAN; pixels];
        let mut hits = vec![Frame::NO_ID; pixels];
        let channels = outputs.features.map_or(0, |f| f.channels);
        let mut features = vec![0.0f64; pixels * channels];
        let mut largest = vec![0.0f64; n];
        let masks: &[&Mask2d] = outputs.votes.unwrap_or(&[]);
        for mask in masks {
            if (mask.width(), mask.height()) != (view.width, view.height) {
                let (mask, view) = ((mask.width(), mask.height()), (view.width, view.height));
                return Err(RasterError::SizeMismatch { mask, view });
            }
        }
        let mut inside = vec![vec![0u64; n]; masks.len()];
        let mut total = vec![0u64; n];
        for s in &splats {
            let span = |k: usize, size: usize| {
                let from = (s.center[k] - s.half[k] - 1.0).floor().max(0.0) as usize;
                let to = (s.center[k] + s.half[k] + 1.0).ceil().clamp(0.0, size as f64) as usize;
                from..to
            };
            for y in span(1, height) {
                for x in span(0, width) {
                    let p = y * width + x;
                    let (dx, dy) = (x as f64 + 0.5 - s.center[0], y as f64 + 0.5 - s.center[1]);
                    let q = s.conic[0] * dx * dx + 2.0 * s.conic[1] * dx * dy + s.conic[2] * dy * dy;
                    let alpha = (s.opacity * (-0.5 * q).exp()).min(0.99);
                    if done[p] || alpha < 1.0 / 255.0 {
                        continue;
                    }
                    let after = t[p] * (1.0 - alpha);
                    if after < 1e-4 {
                        done[p] = true;
                        continue;
                    }
                    let w = alpha * t[p];
                    if t[p] > 0.5 && after <= 0.5 {
                        depth[p] = s.z as f32;
                    }
                    if let Some(tau) = outputs.first_hits {
                        let edge = 1.0 - f64::from(tau);
                        if t[p] > edge && after <= edge {
                            hits[p] = s.id as u32;
                        }
                    }
                    t[p] = after;
                    color[p].iter_mut().zip(s.color).for_each(|(sum, c)| *sum += w as f32 * c);
                    largest[s.id] = largest[s.id].max(w);
                    if let Some(f) = outputs.features {
                        for c in 0..channels {
                            features[p * channels + c] += w * f64::from(f.values[s.id * channels + c]);
                        }
                    }
                    let fixed = (w * 65_536.0).round() as u64;
                    total[s.id] += fixed;
                    for (mask, inside) in masks.iter().zip(&mut inside) {
                        inside[s.id] += fixed * u64::from(mask.values()[p]);
                    }
                }
            }
        }
        inside.iter_mut().flatten().for_each(|v| *v /= 255);
        if outputs.color {
            color.iter_mut().zip(&t).for_each(|(c, t)| c[3] = 1.0 - *t as f32);
            frame.color = color;
        }
        if outputs.median_depth {
            frame.median_depth = depth;
        }
        if outputs.first_hits.is_some() {
            frame.first_hits = hits;
        }
        if outputs.features.is_some() {
            frame.features = features.into_iter().map(|v| v as f32).collect();
        }
        if let Some(least) = outputs.visibility {
            frame.visibility = Selection::from_fn(n, |i| largest[i] > f64::from(least));
        }
        if outputs.votes.is_some() {
            frame.votes = splat_raster::Votes { inside, total };
        }
        Ok(())
    }
}
