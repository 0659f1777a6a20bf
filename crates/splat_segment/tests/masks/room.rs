//! A small generated room: a floor, a ball and a box on it that nearly touch, a post in front of the box.

use std::sync::Arc;

use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays, Mask2d, Pose, Selection, View, sh};
use splat_raster::{Features, Rasterizer, Scene};

pub(crate) const FLOOR: u16 = 0;
pub(crate) const BALL: u16 = 1;
pub(crate) const BOX: u16 = 2;
pub(crate) const POST: u16 = 3;

pub(crate) struct Room {
    pub(crate) cloud: Arc<Cloud>,
    pub(crate) scene: Arc<Scene>,
    pub(crate) labels: Vec<u16>,
}

/// A generator of numbers that is the same everywhere (xorshift).
pub(crate) struct Seed(pub(crate) u64);

impl Seed {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() >> 33) as usize % n
    }

    pub(crate) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }
}

#[derive(Default)]
pub(crate) struct Builder {
    arrays: CloudArrays,
    labels: Vec<u16>,
}

impl Builder {
    pub(crate) fn add(&mut self, label: u16, mean: Vec3, scale: Vec3, rotation: Quat, opacity: f32, color: Vec3) {
        let a = &mut self.arrays;
        a.means.push(mean);
        a.log_scales.push(Vec3::new(scale.x.ln(), scale.y.ln(), scale.z.ln()));
        a.rotations.push(rotation);
        a.opacity_logits.push((opacity / (1.0 - opacity)).ln());
        a.sh.extend(((color - 0.5) / sh::C0).to_array());
        self.labels.push(label);
    }

    pub(crate) fn build(self) -> Room {
        let cloud = Arc::new(Cloud::new(self.arrays).unwrap());
        Room { scene: Arc::new(Scene::of(cloud.clone())), cloud, labels: self.labels }
    }
}

/// y points down, as in captures; the floor is at y = 0 and the things stand on it.
pub(crate) fn room() -> Room {
    let mut b = Builder::default();
    let mut seed = Seed(0x5eed);
    let jitter = |seed: &mut Seed| Vec3::new(seed.unit(), seed.unit(), seed.unit()) * 0.12 - 0.06;
    for i in 0..28 {
        for k in 0..28 {
            let mean = Vec3::new(i as f32 * 0.2 - 2.7, 0.0, k as f32 * 0.2 - 2.7);
            let color = Vec3::new(0.25, 0.5, 0.25) + jitter(&mut seed);
            b.add(FLOOR, mean, Vec3::new(0.12, 0.01, 0.12), Quat::IDENTITY, 0.95, color);
        }
    }
    for k in 0..500 {
        // A Fibonacci sphere.
        let y = 1.0 - 2.0 * (k as f32 + 0.5) / 500.0;
        let r = (1.0 - y * y).sqrt();
        let angle = 2.399_963_2 * k as f32;
        let normal = Vec3::new(r * angle.cos(), y, r * angle.sin());
        let rotation = Quat::from_rotation_arc(Vec3::Y, normal);
        let color = Vec3::new(0.75, 0.25, 0.2) + jitter(&mut seed);
        b.add(BALL, Vec3::new(-0.7, -0.52, 0.0) + 0.5 * normal, Vec3::new(0.035, 0.01, 0.035), rotation, 0.95, color);
    }
    for side in 0..5 {
        let turn = match side {
            0 => Quat::IDENTITY,
            s => {
                Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 * s as f32)
                    * Quat::from_rotation_x(std::f32::consts::FRAC_PI_2)
            }
        };
        for i in 0..11 {
            for k in 0..11 {
                let local = Vec3::new(i as f32 * 0.08 - 0.4, -0.4, k as f32 * 0.08 - 0.4);
                let mean = Vec3::new(0.55, -0.42, 0.1) + turn * local;
                let color = Vec3::new(0.25, 0.3, 0.7) + jitter(&mut seed);
                b.add(BOX, mean, Vec3::new(0.045, 0.01, 0.045), turn, 0.95, color);
            }
        }
    }
    for k in 0..40 {
        let angle = 2.4 * k as f32;
        let mean = Vec3::new(0.5 + 0.05 * angle.cos(), -0.05 - 0.03 * k as f32, -1.2 + 0.05 * angle.sin());
        b.add(
            POST,
            mean,
            Vec3::new(0.04, 0.04, 0.04),
            Quat::IDENTITY,
            0.95,
            Vec3::new(0.8, 0.75, 0.3) + jitter(&mut seed),
        );
    }
    b.build()
}

/// A camera on a circle about the room, `turn` in full circles.
pub(crate) fn camera(turn: f32, height: f32, distance: f32, (width, pixels_high): (u32, u32)) -> View {
    let angle = turn * std::f32::consts::TAU;
    let eye = Vec3::new(distance * angle.sin(), -height, -distance * angle.cos());
    let pose = Pose::look_at(eye, Vec3::new(0.0, -0.4, 0.0), -Vec3::Y);
    View::perspective(pose, 0.9, width, pixels_high)
}

pub(crate) const SIZE: (u32, u32) = (80, 60);

pub(crate) fn cameras(count: usize) -> Vec<View> {
    (0..count).map(|k| camera(k as f32 / count as f32, if k % 2 == 0 { 1.4 } else { 2.2 }, 3.4, SIZE)).collect()
}

impl Room {
    pub(crate) fn object(&self, label: u16) -> Selection {
        Selection::from_fn(self.labels.len(), |i| self.labels[i] == label)
    }

    /// Label with the most weight per pixel, the floor where nothing has more than half.
    pub(crate) fn label_map(&self, raster: &mut dyn Rasterizer, view: &View) -> Vec<u16> {
        let values: Vec<f32> =
            self.labels.iter().flat_map(|&l| (0..4).map(move |k| if k == l { 1.0 } else { 0.0 })).collect();
        let picture = raster.features(&self.scene, view, Features { channels: 4, values: &values }).unwrap();
        let best = |c: &[f32]| (0..4).max_by(|&a, &b| c[a].total_cmp(&c[b])).filter(|&k| c[k] > 0.5).unwrap_or(0);
        picture.chunks_exact(4).map(|c| best(c) as u16).collect()
    }

    /// The exact mask of what is seen of an object.
    pub(crate) fn mask(&self, raster: &mut dyn Rasterizer, view: &View, label: u16) -> Mask2d {
        let values = self.label_map(raster, view).iter().map(|&l| if l == label { 255 } else { 0 }).collect();
        Mask2d::new(view.width, view.height, values).unwrap()
    }

    /// IoU with an object over Gaussians that some view gives at least a pixel of weight.
    pub(crate) fn iou(&self, selection: &Selection, label: u16, total: &[u64]) -> f64 {
        let (mut both, mut either) = (0, 0);
        for (i, &l) in self.labels.iter().enumerate().filter(|(i, _)| total[*i] > 65_536) {
            both += usize::from(selection.contains(i) && l == label);
            either += usize::from(selection.contains(i) || l == label);
        }
        both as f64 / either.max(1) as f64
    }
}
