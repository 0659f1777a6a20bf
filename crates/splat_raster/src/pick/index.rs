//! [`PickIndex`]: finds the Gaussians near a ray.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use splat_core::deform::Deformation;
use splat_core::{Cloud, Projection, View};

use crate::Instance;

/// Gaussians of a leaf, and children of a node.
const FAN: usize = 8;
/// Standard deviations at which the most opaque Gaussian falls under 1/255: `sqrt(2 ln 255)`.
const REACH: f32 = 3.329_1;
/// Standard deviation of the low-pass, in pixels.
const LOW_PASS: f32 = 0.547_8;

/// Means, and how far the widest of their Gaussians reaches.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vec3,
    high: Vec3,
    reach: f32,
}

impl Node {
    const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, reach: 0.0 };

    /// Where the means are in a bent cloud, and how far their Gaussians may reach.
    fn deformed(&self, by: &Deformation) -> Self {
        let (low, high) = by.bounds_of((self.low, self.high));
        Self { low, high, reach: self.reach * by.largest_stretch().max(1.0) }
    }

    fn join(self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high), reach: self.reach.max(other.reach) }
    }
}

/// Gaussians of like size, in Morton order, with bounds of each 8, each 64, and so on.
#[derive(Clone, Debug)]
struct Tree {
    ids: Vec<u32>,
    /// From the leaves up; the last has one node.
    levels: Vec<Vec<Node>>,
}

/// A hierarchy of bounds over a cloud's Gaussians, for [`pick`](super::pick): about 8 bytes a Gaussian.
///
/// One tree for each size of Gaussian (factors of four), so that a few large ones do not widen all bounds.
#[derive(Clone, Debug)]
pub struct PickIndex {
    len: usize,
    trees: Vec<Tree>,
}

impl PickIndex {
    /// Builds it on all threads of the current rayon pool. Gaussians that are never drawn are left out.
    pub fn new(cloud: &Cloud) -> Self {
        let reaches: Vec<f32> = (0..cloud.len()).into_par_iter().map(|i| reach(cloud, i)).collect();
        let (low, high) = middle(cloud);
        let unit = 1023.0 / (high - low).max_element().max(f32::MIN_POSITIVE);
        let mut keys: Vec<u64> = (0..cloud.len())
            .into_par_iter()
            .filter(|&i| reaches[i] > 0.0)
            .map(|i| {
                let place = ((cloud.means()[i] - low) * unit).clamp(Vec3::ZERO, Vec3::splat(1023.0)).as_uvec3();
                let code = spread(place.x) | spread(place.y) << 1 | spread(place.z) << 2;
                u64::from(code) << 32 | i as u64
            })
            .collect();
        keys.par_sort_unstable();
        let mut by_size: BTreeMap<i32, Vec<u32>> = BTreeMap::new();
        for id in keys.into_iter().map(|key| key as u32) {
            let size = (reaches[id as usize].log2() * 0.5).floor() as i32;
            by_size.entry(size).or_default().push(id);
        }
        let trees = by_size.into_values().map(|ids| Tree::new(cloud, &reaches, ids)).collect();
        Self { len: cloud.len(), trees }
    }

    /// Gaussians of the cloud it was made of.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether that cloud was empty.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Every Gaussian of the instance's cloud that counts at a pixel, and others near it; ids rise.
    pub(super) fn near(&self, instance: &Instance, view: &View, pixel: Vec2) -> Vec<u32> {
        let ray = Ray::new(&instance.transform, view, pixel);
        let deformation = instance.deformation.as_deref();
        let mut ids = Vec::new();
        for tree in &self.trees {
            tree.near(&ray, deformation, &mut ids);
        }
        ids.sort_unstable();
        ids
    }
}

impl Tree {
    fn new(cloud: &Cloud, reaches: &[f32], ids: Vec<u32>) -> Self {
        let leaf = |ids: &[u32]| {
            ids.iter().fold(Node::EMPTY, |node, &id| {
                let mean = cloud.means()[id as usize];
                node.join(&Node { low: mean, high: mean, reach: reaches[id as usize] })
            })
        };
        let mut levels = vec![ids.par_chunks(FAN).map(leaf).collect::<Vec<_>>()];
        while let Some(last) = levels.last().filter(|level| level.len() > 1) {
            let parents = last.par_chunks(FAN).map(|c| c.iter().fold(Node::EMPTY, Node::join)).collect();
            levels.push(parents);
        }
        Self { ids, levels }
    }

    fn near(&self, ray: &Ray, deformation: Option<&Deformation>, ids: &mut Vec<u32>) {
        let mut open = vec![(self.levels.len() - 1, 0)];
        while let Some((level, i)) = open.pop() {
            let node = &self.levels[level][i];
            if !ray.meets(&deformation.map_or(*node, |deformation| node.deformed(deformation))) {
                continue;
            }
            if level == 0 {
                let end = self.ids.len().min((i + 1) * FAN);
                ids.extend_from_slice(&self.ids[i * FAN..end]);
            } else {
                let end = self.levels[level - 1].len().min((i + 1) * FAN);
                open.extend((i * FAN..end).map(|child| (level - 1, child)));
            }
        }
    }
}

/// A pixel's ray in the cloud's space, and how wide splats are about it.
///
/// A splat counts at a pixel only where the ray crosses the plane of its mean's camera z within
/// `sqrt(k) (s |J| z / f + 0.55 z / f)` of the mean: s is its longest standard deviation, J the projection linearised at a slope
/// of at most the view's limits. So the ray passes at most as far from the mean, and from any box that holds it.
struct Ray {
    origin: Vec3,
    /// Per unit of camera z.
    direction: Vec3,
    /// Camera z of a point x is `depth . x + depth_0`.
    depth: Vec3,
    depth_0: f32,
    near: f32,
    /// Largest |J| z / f.
    slant: f32,
    /// Width of the low-pass per unit of camera z (perspective) or at all.
    low_pass: f32,
    perspective: bool,
}

impl Ray {
    fn new(transform: &splat_core::Similarity, view: &View, pixel: Vec2) -> Self {
        let inverse = transform.inverse();
        let origin = inverse.apply(view.unproject(pixel, 0.0));
        let direction = inverse.apply(view.unproject(pixel, 1.0)) - origin;
        let forward = transform.rotation_matrix().transpose() * view.forward();
        let camera = inverse.apply(view.pose.position);
        let depth = forward * transform.scale;
        let i = &view.intrinsics;
        let (width, height) = (view.width as f32, view.height as f32);
        let perspective = view.projection == Projection::Perspective;
        let side = |size: f32, center: f32, focal: f32| center.max(size - center).abs() / focal + 0.15 * size / focal;
        let (x, y) = (side(width, i.cx, i.fx), side(height, i.cy, i.fy));
        // Where pixels are not square, the wider axis decides.
        let (least, most) = (i.fx.min(i.fy), i.fx.max(i.fy));
        Self {
            origin,
            direction,
            depth,
            depth_0: -depth.dot(camera),
            near: view.near,
            slant: if perspective { (1.0 + x * x + y * y).sqrt() } else { 1.0 } * (most / least),
            low_pass: REACH * LOW_PASS / (least * transform.scale),
            perspective,
        }
    }

    fn meets(&self, node: &Node) -> bool {
        let (middle, half) = ((node.low + node.high) * 0.5, (node.high - node.low) * 0.5);
        let farthest = self.depth.dot(middle) + self.depth.abs().dot(half) + self.depth_0;
        // NaN stays in: the exact test decides.
        if farthest <= self.near {
            return false;
        }
        let low_pass = self.low_pass * if self.perspective { farthest } else { 1.0 };
        // A little more than exact, for rounding.
        let width = (node.reach * self.slant + low_pass) * 1.001 + 1e-5 * (middle.abs() + half).max_element();
        let inverse = self.direction.recip();
        let a = (node.low - width - self.origin) * inverse;
        let b = (node.high + width - self.origin) * inverse;
        // A ray within a slab that it runs along: infinities of both signs, or NaN on its very border, which min and max leave out.
        let enter = a.min(b).max_element();
        let leave = a.max(b).min_element();
        !(enter > leave) && !(leave < 0.0)
    }
}

/// How far a Gaussian reaches from its mean, in the cloud's space; 0 where it is never drawn.
fn reach(cloud: &Cloud, i: usize) -> f32 {
    if !cloud.drawable(i) {
        return 0.0;
    }
    let level = 255.0 * cloud.opacity(i);
    if level < 1.0 {
        return 0.0;
    }
    // Scales end where the projection ends them.
    let widest = cloud.log_scales()[i].max_element().min(40.0 * std::f32::consts::LN_2).exp();
    (2.0 * level.ln()).sqrt().max(1e-3) * widest.max(f32::MIN_POSITIVE)
}

/// A box about the middle of the means: a floater far out must not press all others into one cell.
fn middle(cloud: &Cloud) -> (Vec3, Vec3) {
    let sample: Vec<Vec3> = {
        let step = (cloud.len() / 4096).max(1);
        cloud.means().iter().step_by(step).copied().filter(|m| m.is_finite()).collect()
    };
    if sample.is_empty() {
        return (Vec3::ZERO, Vec3::ONE);
    }
    let side = |axis: usize| {
        let mut values: Vec<f32> = sample.iter().map(|m| m[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        (values[values.len() / 100], values[values.len() - 1 - values.len() / 100])
    };
    let (x, y, z) = (side(0), side(1), side(2));
    (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1))
}

/// Ten bits, each followed by two zeros.
fn spread(v: u32) -> u32 {
    let v = (v | v << 16) & 0x0300_00ff;
    let v = (v | v << 8) & 0x0300_f00f;
    let v = (v | v << 4) & 0x030c_30c3;
    (v | v << 2) & 0x0924_9249
}
