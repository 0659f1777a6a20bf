//! Solids as signed distance functions: one description serves sampling, shadows, ambient occlusion and visibility.

use glam::{DMat3, DVec2, DVec3};

use crate::materials::Material;
use crate::math::{frame_of, polyline_distance, v};

/// A solid in its own space, in metres, y up.
#[derive(Clone, Debug)]
pub(crate) enum Shape {
    /// Box with rounded edges: half extents, radius of the edges.
    Block(DVec3, f64),
    /// Box that is thick in the middle and thin at its rim: half extents, radius of the edges.
    Pillow(DVec3, f64),
    /// Upright cylinder: radius, half height, radius of the edges.
    Drum(f64, f64, f64),
    /// Rod along y from 0: length, radius at 0, radius at the end.
    Rod(f64, f64, f64),
    /// Ellipsoid: radii.
    Egg(DVec3),
    /// Torus about y: radius of the ring, radius of the tube.
    Ring(f64, f64),
    /// Shell of revolution about y: line through (radius, height), half thickness.
    Turned(Vec<DVec2>, f64),
    /// Hanging cloth in folds: half width, half height, depth of a fold, folds per metre.
    Cloth(f64, f64, f64, f64),
    /// Leaf along x from 0: length, half width, bend downwards, half thickness.
    Leaf(f64, f64, f64, f64),
}

impl Shape {
    /// Signed distance of a point, or less than that: never more.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        match self {
            Shape::Block(half, r) => block(p, *half, *r),
            Shape::Pillow(half, r) => {
                let (x, z) = (p.x / half.x, p.z / half.z);
                let rim = (1.0 - x * x).max(0.0) * (1.0 - z * z).max(0.0);
                let high = half.y * (0.45 + 0.55 * rim.sqrt().min(1.0));
                block(p, v(half.x, high.max(*r), half.z), *r) * 0.6
            }
            Shape::Drum(radius, half, r) => {
                let d = DVec2::new((p.x * p.x + p.z * p.z).sqrt() - radius + r, p.y.abs() - half + r);
                d.x.max(d.y).min(0.0) + d.max(DVec2::ZERO).length() - r
            }
            Shape::Rod(length, ra, rb) => {
                let t = (p.y / length).clamp(0.0, 1.0);
                (p - v(0.0, t * length, 0.0)).length() - (ra + (rb - ra) * t)
            }
            Shape::Egg(radii) => {
                let k0 = (p / *radii).length();
                let k1 = (p / (*radii * *radii)).length();
                if k1 < 1e-9 { -radii.min_element() } else { k0 * (k0 - 1.0) / k1 }
            }
            Shape::Ring(ring, tube) => DVec2::new((p.x * p.x + p.z * p.z).sqrt() - ring, p.y).length() - tube,
            Shape::Turned(line, half) => {
                polyline_distance(DVec2::new((p.x * p.x + p.z * p.z).sqrt(), p.y), line) - half
            }
            Shape::Cloth(w, h, depth, folds) => {
                let wave = fold(p.x, *folds) * depth * (0.75 + 0.25 * (p.y / h));
                let steep = depth * folds * std::f64::consts::TAU;
                let d = ((p.z - wave).abs() - 0.004) / (1.0 + steep * steep).sqrt();
                d.max(p.x.abs() - w).max(p.y.abs() - h)
            }
            Shape::Leaf(length, w, bend, thick) => {
                let u = p.x / length;
                let across = if (0.0..=1.0).contains(&u) {
                    p.z.abs() - w * 4.0 * u * (1.0 - u)
                } else {
                    DVec2::new(p.x - u.clamp(0.0, 1.0) * length, p.z).length()
                };
                let y = p.y + bend * p.x * p.x / length + 0.6 * p.z.abs() * bend.min(0.3);
                (y.abs() - thick).max(across) * 0.62
            }
        }
    }

    /// Half extents of a box about [`Shape::middle`] that holds the solid.
    pub(crate) fn half(&self) -> DVec3 {
        match self {
            Shape::Block(half, _) | Shape::Pillow(half, _) => *half,
            Shape::Drum(r, half, _) => v(*r, *half, *r),
            Shape::Rod(length, ra, rb) => v(ra.max(*rb), length * 0.5 + ra.max(*rb), ra.max(*rb)),
            Shape::Egg(radii) => *radii,
            Shape::Ring(ring, tube) => v(ring + tube, *tube, ring + tube),
            Shape::Turned(line, half) => {
                let r = line.iter().fold(0.0, |m: f64, p| m.max(p.x)) + half;
                let (lo, hi) = span(line);
                v(r, (hi - lo) * 0.5 + half, r)
            }
            Shape::Cloth(w, h, depth, _) => v(*w, *h, depth + 0.006),
            Shape::Leaf(length, w, bend, thick) => v(length * 0.5, bend * length * 0.5 + thick + w * 0.2, *w),
        }
    }

    /// Middle of the box of [`Shape::half`].
    pub(crate) fn middle(&self) -> DVec3 {
        match self {
            Shape::Rod(length, ..) => v(0.0, length * 0.5, 0.0),
            Shape::Turned(line, _) => {
                let (lo, hi) = span(line);
                v(0.0, (lo + hi) * 0.5, 0.0)
            }
            Shape::Leaf(length, _, bend, _) => v(length * 0.5, -bend * length * 0.5, 0.0),
            _ => DVec3::ZERO,
        }
    }
}

/// Height of a cloth's folds at x, -1..1.
fn fold(x: f64, folds: f64) -> f64 {
    libm::sin(x * folds * std::f64::consts::TAU + 1.3 * libm::sin(x * folds * 2.1))
}

fn block(p: DVec3, half: DVec3, r: f64) -> f64 {
    let q = p.abs() - half + DVec3::splat(r);
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0) - r
}

fn span(line: &[DVec2]) -> (f64, f64) {
    line.iter().fold((f64::MAX, f64::MIN), |(lo, hi), p| (lo.min(p.y), hi.max(p.y)))
}

/// A solid placed in the room.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    /// What it is.
    pub(crate) shape: Shape,
    /// Columns: its axes in the room.
    pub(crate) axes: DMat3,
    /// Its origin in the room.
    pub(crate) at: DVec3,
    /// Label of the object that it is a piece of; 0 is background.
    pub(crate) label: u8,
    /// How it looks.
    pub(crate) material: Material,
    /// Distance between Gaussians where the picture on it is fine, in metres.
    pub(crate) fine: f64,
    /// Distance between Gaussians where it is plain, in metres.
    pub(crate) coarse: f64,
}

impl Solid {
    /// Into the solid's own space.
    pub(crate) fn local(&self, p: DVec3) -> DVec3 {
        self.axes.transpose() * (p - self.at)
    }

    /// Out of the solid's own space.
    pub(crate) fn world(&self, p: DVec3) -> DVec3 {
        self.axes * p + self.at
    }

    /// Signed distance of a point of the room, or less.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        self.shape.distance(self.local(p))
    }

    /// Whether it hides nothing worth a layer of its own below it.
    pub(crate) fn thin(&self) -> bool {
        matches!(self.shape, Shape::Cloth(..) | Shape::Leaf(..) | Shape::Rod(..) | Shape::Ring(..))
    }
}

/// Collects the solids of objects, each placed by a frame of its own.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    /// All solids so far.
    pub(crate) solids: Vec<Solid>,
    label: u8,
    axes: DMat3,
    at: DVec3,
    fine: f64,
    coarse: f64,
}

impl Builder {
    /// Starts an object: what follows is placed by `axes` and `at` and belongs to `label`.
    pub(crate) fn object(&mut self, label: u8, at: DVec3, axes: DMat3) -> &mut Self {
        (self.label, self.at, self.axes) = (label, at, axes);
        self
    }

    /// Distances between Gaussians of what follows, in metres: on fine pictures, on plain faces.
    pub(crate) fn detail(&mut self, fine: f64, coarse: f64) -> &mut Self {
        (self.fine, self.coarse) = (fine, coarse);
        self
    }

    /// Adds a solid, turned, at a place of the object.
    pub(crate) fn add_turned(&mut self, shape: Shape, material: Material, at: DVec3, axes: DMat3) -> &mut Self {
        self.solids.push(Solid {
            shape,
            axes: self.axes * axes,
            at: self.axes * at + self.at,
            label: self.label,
            material,
            fine: self.fine,
            coarse: self.coarse,
        });
        self
    }

    /// Adds an unturned solid.
    pub(crate) fn add(&mut self, shape: Shape, material: Material, at: DVec3) -> &mut Self {
        self.add_turned(shape, material, at, DMat3::IDENTITY)
    }

    /// Adds a rod between two places of the object.
    pub(crate) fn rod(&mut self, a: DVec3, b: DVec3, ra: f64, rb: f64, material: Material) -> &mut Self {
        let along = b - a;
        let length = along.length();
        self.add_turned(Shape::Rod(length, ra, rb), material, a, frame_of(along / length))
    }
}
