//! From a shape in metres to a collider of avian3d, in the units of the cloud: avian scales colliders by their `Transform`.

use std::panic::{AssertUnwindSafe, catch_unwind};

use avian3d::parry::math::{Pose, Vector};
use avian3d::parry::shape::SharedShape;
use avian3d::parry::transformation::vhacd::{VHACD, VHACDParameters};
use avian3d::prelude::*;
use bevy::math::{DVec3, Quat, UVec3, Vec3};
use splat_physics::{Shape, SurfaceMesh};

/// Convex pieces of a decomposition at most.
const PIECES: u32 = 32;
/// Points of a convex piece at most: more cost time and change nothing that is felt.
const POINTS: usize = 64;
/// How much of a piece's volume may be air before it is cut. At 0.01 a ball of voxels falls into nine pieces, an L into eight;
/// at 0.05 an L is two.
const CONCAVITY: f32 = 0.05;
/// Cells along the longest side of what is decomposed.
const RESOLUTION: u32 = 64;
/// A hull thinner than this share of its own size cubed is flat.
const FLAT: f32 = 1e-6;

/// A collider and what it is, in a word.
#[derive(Clone, Debug)]
pub(super) struct Fitted {
    pub(super) collider: Collider,
    pub(super) name: &'static str,
    pub(super) pieces: usize,
}

/// The collider of a shape; `None` if it is flat or not finite.
pub(super) fn collider(shape: &Shape, metres_per_unit: f64) -> Option<Fitted> {
    let unit = |p: DVec3| (p / metres_per_unit).as_vec3();
    let length = |l: f64| (l / metres_per_unit) as f32;
    let one = |name, shape: SharedShape| Some(Fitted { collider: shape.into(), name, pieces: 1 });
    match shape {
        Shape::Box { center, rotation, half } => {
            let half = unit(*half);
            let pose = Pose::from_parts(unit(*center), rotation.as_quat().normalize());
            let sound = half.is_finite() && half.min_element() > 0.0 && sound(&pose);
            let cuboid = SharedShape::cuboid(half.x, half.y, half.z);
            sound.then(|| one("box", SharedShape::compound(vec![(pose, cuboid)])))?
        }
        Shape::Ball { center, radius } => {
            let radius = length(*radius);
            let pose = Pose::from_parts(unit(*center), Quat::IDENTITY);
            let sound = radius.is_finite() && radius > 0.0 && sound(&pose);
            sound.then(|| one("ball", SharedShape::compound(vec![(pose, SharedShape::ball(radius))])))?
        }
        Shape::Capsule { a, b, radius } => {
            let (a, b, radius) = (unit(*a), unit(*b), length(*radius));
            let sound = a.is_finite() && b.is_finite() && radius.is_finite() && radius > 0.0;
            sound.then(|| one("capsule", SharedShape::capsule(a, b, radius)))?
        }
        Shape::Hull(points) => {
            let points: Vec<Vec3> = points.iter().map(|&p| unit(p)).collect();
            one("hull", hull(&thin(points, 2 * POINTS))?)
        }
        Shape::Decomposition(mesh) => decomposition(mesh, metres_per_unit),
        Shape::Voxels { origin, voxel, cells } => {
            let size = length(*voxel);
            if cells.is_empty() || !(size.is_finite() && size > 0.0) {
                return None;
            }
            let origin = unit(*origin);
            let boxes: Vec<(Pose, SharedShape)> = merged(cells)
                .into_iter()
                .map(|(low, high)| {
                    let half = 0.5 * size * (high - low).as_vec3();
                    let middle = origin + size * low.as_vec3() + half;
                    let cuboid = SharedShape::cuboid(half.x, half.y, half.z);
                    (Pose::from_parts(middle, Quat::IDENTITY), cuboid)
                })
                .collect();
            let pieces = boxes.len();
            origin.is_finite().then(|| Fitted { collider: SharedShape::compound(boxes).into(), name: "voxels", pieces })
        }
    }
}

/// Boxes that hold the same cells, each once: runs along x, then rows of equal runs along y, then layers of those along z. Parry's
/// own voxels have no contacts with other compounds.
fn merged(cells: &[UVec3]) -> Vec<(UVec3, UVec3)> {
    let mut boxes: Vec<(UVec3, UVec3)> = cells.iter().map(|&cell| (cell, cell + 1)).collect();
    for axis in 0..3 {
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        // Boxes that can be joined are neighbours in this order.
        boxes.sort_unstable_by_key(|(low, high)| (others.map(|k| low[k]), others.map(|k| high[k]), low[axis]));
        let mut joined: Vec<(UVec3, UVec3)> = Vec::with_capacity(boxes.len());
        for (low, high) in boxes {
            match joined.last_mut() {
                Some((first, last))
                    if last[axis] == low[axis] && others.iter().all(|&k| first[k] == low[k] && last[k] == high[k]) =>
                {
                    last[axis] = high[axis];
                }
                _ => joined.push((low, high)),
            }
        }
        boxes = joined;
    }
    boxes
}

fn sound(pose: &Pose) -> bool {
    pose.translation.is_finite() && pose.rotation.is_finite()
}

/// The hull of points, unless it is flat.
fn hull(points: &[Vec3]) -> Option<SharedShape> {
    if points.len() < 4 || points.iter().any(|p| !p.is_finite()) {
        return None;
    }
    let (low, high) = points.iter().fold((points[0], points[0]), |(l, h), p| (l.min(*p), h.max(*p)));
    let size = (high - low).max_element();
    // A hull in units of its size: parry's tolerances are lengths.
    let middle = 0.5 * (low + high);
    let small: Vec<Vec3> = points.iter().map(|&p| (p - middle) / size).collect();
    let small = SharedShape::convex_hull(&small)?;
    let volume = small.mass_properties(1.0).mass();
    if !(volume > FLAT) {
        return None;
    }
    let polyhedron = small.as_convex_polyhedron()?;
    let back: Vec<Vec3> = polyhedron.points().iter().map(|p| *p * size + middle).collect();
    SharedShape::convex_hull(&back)
}

/// The points that are farthest in some of `most` directions, which are all corners of their hull.
fn thin(points: Vec<Vec3>, most: usize) -> Vec<Vec3> {
    if points.len() <= most {
        return points;
    }
    let mut kept: Vec<usize> = (0..most)
        .filter_map(|k| {
            let along = direction(k, most);
            (0..points.len()).max_by(|&a, &b| points[a].dot(along).total_cmp(&points[b].dot(along)))
        })
        .collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|k| points[k]).collect()
}

/// The k-th of `count` directions that are spread evenly, along a spiral from pole to pole.
fn direction(k: usize, count: usize) -> Vec3 {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let height = 1.0 - (2 * k + 1) as f64 / count as f64;
    let (sin, cos) = (golden * k as f64).sin_cos();
    let radius = (1.0 - height * height).sqrt();
    Vec3::new((radius * cos) as f32, height as f32, (radius * sin) as f32)
}

/// Cuts a closed mesh into convex pieces.
fn decomposition(mesh: &SurfaceMesh, metres_per_unit: f64) -> Option<Fitted> {
    let first = *mesh.vertices.first()?;
    let (low, high) = mesh.vertices.iter().fold((first, first), |(l, h), p| (l.min(*p), h.max(*p)));
    let size = (high - low).max_element();
    if !(size.is_finite() && size > 0.0) {
        return None;
    }
    // In units of its size, about its middle: parry's tolerances are lengths.
    let middle = 0.5 * (low + high);
    let vertices: Vec<Vector> = mesh.vertices.iter().map(|p| ((*p - middle) / size).as_vec3()).collect();
    let parameters = VHACDParameters {
        concavity: CONCAVITY,
        resolution: RESOLUTION,
        max_convex_hulls: PIECES,
        ..VHACDParameters::default()
    };
    // It unwraps errors of hulls that it makes of its own voxels.
    let cut = || {
        let cut = VHACD::decompose(&parameters, &vertices, &mesh.triangles, true);
        cut.compute_exact_convex_hulls(&vertices, &mesh.triangles)
    };
    let pieces = catch_unwind(AssertUnwindSafe(cut)).ok()?;
    let back = |p: Vec3| ((p.as_dvec3() * size + middle) / metres_per_unit).as_vec3();
    let hulls: Vec<(Pose, SharedShape)> = pieces
        .into_iter()
        .filter_map(|(points, _)| {
            let points = thin(points, POINTS).into_iter().map(back).collect::<Vec<_>>();
            Some((Pose::IDENTITY, hull(&points)?))
        })
        .collect();
    if hulls.is_empty() {
        return None;
    }
    let pieces = hulls.len();
    Some(Fitted { collider: SharedShape::compound(hulls).into(), name: "decomposition", pieces })
}

#[cfg(test)]
mod tests;
