//! Boxes, balls and capsules that fit a solid.

use std::f64::consts::PI;

use glam::{DMat3, DQuat, DVec3};

use super::Shape;
use crate::linear::symmetric_eigen;
use crate::{Solid, SurfaceMesh};

/// Share of the surface's vertices on each side that do not decide where a box ends: steps of slanted faces.
const TAIL: f64 = 0.002;
/// Turns about an axis that are tried for a box, over a quarter of a circle.
const TURNS: usize = 18;
/// A box must be smaller by this share to be preferred to one along the grid's axes.
const BETTER: f64 = 0.02;

/// What shapes are fitted to.
pub(super) struct Body<'a> {
    pub(super) solid: &'a Solid,
    pub(super) mesh: SurfaceMesh,
    pub(super) volume: f64,
    pub(super) center: DVec3,
    /// Standard deviations along the axes, falling.
    pub(super) spread: DVec3,
    /// Principal axes, right-handed.
    pub(super) axes: DMat3,
}

impl<'a> Body<'a> {
    /// `None` where there is nothing, or nothing finite.
    pub(super) fn new(solid: &'a Solid) -> Option<Self> {
        let mass: f64 = solid.weights.iter().map(|&w| f64::from(w)).sum();
        let sound = mass > 0.0 && mass.is_finite() && solid.grid.voxel > 0.0 && solid.grid.voxel.is_finite();
        if !sound || !solid.grid.origin.is_finite() {
            return None;
        }
        let each = || solid.occupied().map(|v| (f64::from(solid.weights[v]), solid.grid.center(v)));
        let center = each().map(|(w, p)| w * p).sum::<DVec3>() / mass;
        let mut second = DMat3::from_diagonal(DVec3::splat(solid.grid.voxel.powi(2) / 12.0));
        for (w, p) in each() {
            let d = p - center;
            second += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * (w / mass);
        }
        let (values, vectors) = symmetric_eigen(second);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
        let (x, y) = (vectors.col(order[0]), vectors.col(order[1]));
        let spread = DVec3::from_array(order.map(|k| values[k].max(0.0).sqrt()));
        let axes = DMat3::from_cols(x, y, x.cross(y));
        let mesh = SurfaceMesh::full(solid);
        Some(Self { solid, mesh, volume: solid.volume(), center, spread, axes })
    }

    /// The smallest box of those along the grid's axes, along the principal axes, and turned about each of both.
    pub(super) fn cuboid(&self) -> Shape {
        let mut best = self.cuboid_along(DMat3::IDENTITY);
        let mut offer = |axes: DMat3| {
            let next = self.cuboid_along(axes);
            if next.2.element_product() < (1.0 - BETTER) * best.2.element_product() {
                best = next;
            }
        };
        for frame in [DMat3::IDENTITY, self.axes] {
            offer(frame);
            for axis in 0..3 {
                for turn in 1..TURNS {
                    let angle = turn as f64 * 0.5 * PI / TURNS as f64;
                    offer(DMat3::from_axis_angle(frame.col(axis), angle) * frame);
                }
            }
        }
        let (axes, center, half) = best;
        Shape::Box { center, rotation: DQuat::from_mat3(&axes).normalize(), half }
    }

    fn cuboid_along(&self, axes: DMat3) -> (DMat3, DVec3, DVec3) {
        let (mut middle, mut half) = (DVec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            let (low, high) = self.ends(axes.col(axis), TAIL);
            middle += axes.col(axis) * (0.5 * (low + high));
            half[axis] = (0.5 * (high - low)).max(0.25 * self.solid.grid.voxel);
        }
        (axes, middle, half)
    }

    /// Where the surface begins and ends along a direction, without the tails.
    fn ends(&self, along: DVec3, tail: f64) -> (f64, f64) {
        let mut reach: Vec<f64> = self.mesh.vertices.iter().map(|p| p.dot(along)).collect();
        let Some(last) = reach.len().checked_sub(1) else {
            let at = self.center.dot(along);
            return (at, at);
        };
        let skip = (tail * reach.len() as f64) as usize;
        let low = *reach.select_nth_unstable_by(skip, f64::total_cmp).1;
        let high = *reach.select_nth_unstable_by(last - skip, f64::total_cmp).1;
        (low, high)
    }

    /// The ball of the same volume about the centre.
    pub(super) fn ball(&self) -> Shape {
        Shape::Ball { center: self.center, radius: (0.75 * self.volume / PI).cbrt() }
    }

    /// Along the longest principal axis; as thick as the middle is on average, with round ends where the solid ends.
    pub(super) fn capsule(&self) -> Shape {
        let along = self.axes.x_axis;
        let (low, high) = self.ends(along, 0.0);
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let (mut weight, mut moment) = (0.0, 0.0);
        for v in self.solid.occupied() {
            let p = self.solid.grid.center(v);
            if (p.dot(along) - middle).abs() <= 0.5 * half {
                let w = f64::from(self.solid.weights[v]);
                weight += w;
                moment += w * (p - self.center).reject_from_normalized(along).length_squared();
            }
        }
        // The second moment of a disc about its middle is half its radius squared.
        let mean = if weight > 0.0 { moment / weight } else { self.spread.y.powi(2) + self.spread.z.powi(2) };
        let radius =
            (2.0 * mean + self.solid.grid.voxel.powi(2) / 12.0).sqrt().min(half).max(0.25 * self.solid.grid.voxel);
        let center = self.center + along * (middle - self.center.dot(along));
        // Ends that coincide have no direction.
        let reach = along * (half - radius).max(1e-3 * radius);
        Shape::Capsule { a: center - reach, b: center + reach, radius }
    }

    /// How much of the solid and a simple shape is in both, 0..=1; `None` for others.
    pub(super) fn overlap(&self, shape: &Shape) -> Option<f64> {
        let volume = shape.simple_volume()?;
        let inside = |v: &usize| shape.holds(self.solid.grid.center(*v));
        let both: f64 = self.solid.occupied().filter(inside).map(|v| f64::from(self.solid.weights[v])).sum();
        let both = both * self.solid.grid.voxel_volume();
        Some(both / (self.volume + volume - both).max(f64::MIN_POSITIVE))
    }
}
