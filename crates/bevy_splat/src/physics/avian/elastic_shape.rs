//! [`ColliderShape`]: a collider of avian3d as a surface with an inside, for points.

use std::fmt;

use avian3d::parry::math::{Pose, Vector};
use avian3d::parry::query::{PointQuery, Ray, RayCast};
use avian3d::parry::shape::{Compound, Shape, SharedShape, TypedShape, Voxels};
use bevy::math::{DVec3, IVec3};

use crate::physics::elastic::ObstacleShape;

/// Pieces of a compound that lie one behind the other, at most.
const MOST_PIECES: usize = 8;
/// What lies between pieces of a compound and is not empty, in metres.
const BEYOND: f32 = 1e-4;
/// Voxels that a point is looked for around.
const VOXEL_REACH: i32 = 2;

/// A collider where it is.
pub(super) struct ColliderShape {
    pub(super) shape: SharedShape,
    pub(super) pose: Pose,
}

impl fmt::Debug for ColliderShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ColliderShape").field("kind", &self.shape.shape_type()).field("pose", &self.pose).finish()
    }
}

impl ObstacleShape for ColliderShape {
    fn nearest(&self, point: DVec3, inside: DVec3, reach: f64) -> Option<(f64, DVec3)> {
        let (point, inside) =
            (self.pose.inverse_transform_point(point.as_vec3()), self.pose.inverse_transform_point(inside.as_vec3()));
        let (gap, normal) = nearest(&*self.shape, point, inside, reach as f32)?;
        let normal = (self.pose.rotation * normal).as_dvec3().normalize_or_zero();
        (f64::from(gap) < reach && normal != DVec3::ZERO).then_some((f64::from(gap), normal))
    }
}

/// Distance and normal in the shape's own space.
fn nearest(shape: &dyn Shape, point: Vector, inside: Vector, reach: f32) -> Option<(f32, Vector)> {
    match shape.as_typed_shape() {
        TypedShape::HalfSpace(half) => Some((half.normal.dot(point), half.normal)),
        TypedShape::Compound(compound) => of_compound(compound, point, inside, reach),
        TypedShape::Voxels(voxels) => of_voxels(voxels, point, reach),
        TypedShape::TriMesh(mesh) => {
            let oriented = mesh.pseudo_normals_if_oriented().is_some();
            let deepest = reach.max(point.distance(inside));
            let found = mesh.project_local_point_with_max_dist(point, false, deepest)?;
            let behind = if oriented { found.is_inside } else { crosses(mesh, inside, point) };
            signed(point, found.point, behind, inside)
        }
        TypedShape::HeightField(field) => {
            let deepest = reach.max(point.distance(inside));
            let found = field.project_local_point_with_max_dist(point, false, deepest)?;
            signed(point, found.point, crosses(field, inside, point), inside)
        }
        // Without an inside.
        TypedShape::Triangle(_) | TypedShape::Segment(_) | TypedShape::Polyline(_) => {
            let found = shape.project_local_point(point, false);
            signed(point, found.point, crosses(shape, inside, point), inside)
        }
        _ => {
            let found = shape.project_local_point(point, false);
            signed(point, found.point, found.is_inside, inside)
        }
    }
}

/// Whether there is a surface between two points.
fn crosses(shape: &(impl RayCast + ?Sized), from: Vector, to: Vector) -> bool {
    let way = to - from;
    way != Vector::ZERO && shape.cast_local_ray(&Ray::new(from, way), 1.0, false).is_some()
}

/// `surface`: the point of the surface that is nearest to `point`.
fn signed(point: Vector, surface: Vector, behind: bool, inside: Vector) -> Option<(f32, Vector)> {
    let way = if behind { surface - point } else { point - surface };
    let distance = way.length();
    if !distance.is_finite() {
        return None;
    }
    // On the surface: away from it is where the rest of what touches is.
    let normal = if distance > 1e-7 { way / distance } else { (inside - surface).normalize_or_zero() };
    Some((if behind { -distance } else { distance }, normal))
}

/// Pieces overlap or share faces: the surface of one is not always that of all.
fn of_compound(compound: &Compound, point: Vector, inside: Vector, reach: f32) -> Option<(f32, Vector)> {
    let mut best: Option<(f32, Vector)> = None;
    for (pose, piece) in compound.shapes() {
        let near = piece.compute_aabb(pose);
        if (near.mins - reach).cmpgt(point).any() || (near.maxs + reach).cmplt(point).any() {
            continue;
        }
        let (own, center) = (pose.inverse_transform_point(point), pose.inverse_transform_point(inside));
        if let Some((gap, normal)) = nearest(&**piece, own, center, reach)
            && best.is_none_or(|(least, _)| gap < least)
        {
            best = Some((gap, pose.rotation * normal));
        }
    }
    let (gap, normal) = best?;
    if gap >= 0.0 || compound.shapes().len() == 1 {
        return Some((gap, normal));
    }
    way_out(compound, point, inside).or(Some((gap, normal)))
}

/// From a point inside of pieces towards the rest of what touches: depth and normal where that leaves the last of them.
fn way_out(compound: &Compound, point: Vector, inside: Vector) -> Option<(f32, Vector)> {
    let way = (inside - point).try_normalize()?;
    let mut at = point;
    let mut normal = None;
    for _ in 0..MOST_PIECES {
        // A little further, so that a face between two pieces belongs to the next.
        let ahead = at + way * BEYOND;
        let holds =
            |(pose, piece): &&(Pose, SharedShape)| piece.contains_local_point(pose.inverse_transform_point(ahead));
        let Some((pose, piece)) = compound.shapes().iter().find(holds) else { break };
        let (from, along) = (pose.inverse_transform_point(ahead), pose.rotation.inverse() * way);
        let hit = piece.cast_local_ray_and_get_normal(&Ray::new(from, along), f32::MAX, false)?;
        at = ahead + way * hit.time_of_impact;
        let outward = pose.rotation * hit.normal;
        normal = Some(if outward.dot(way) < 0.0 { -outward } else { outward });
    }
    let normal = normal?;
    Some((-(at - point).dot(normal), normal))
}

/// By how full the surroundings of the point are: the surface of voxels without their steps.
fn of_voxels(voxels: &Voxels, point: Vector, reach: f32) -> Option<(f32, Vector)> {
    let size = voxels.voxel_size();
    let key = voxels.voxel_at_point(point);
    let radius = VOXEL_REACH as f32 + 0.5;
    let (mut all, mut full, mut slope) = (0.0, 0.0, Vector::ZERO);
    for z in -VOXEL_REACH - 1..=VOXEL_REACH + 1 {
        for y in -VOXEL_REACH - 1..=VOXEL_REACH + 1 {
            for x in -VOXEL_REACH - 1..=VOXEL_REACH + 1 {
                let at = key + IVec3::new(x, y, z);
                let away = (voxels.voxel_center(at) - point) / size;
                let near = 1.0 - away.length_squared() / (radius * radius);
                if near <= 0.0 {
                    continue;
                }
                let filled = voxels.voxel_state(at).is_some_and(|state| !state.is_empty());
                let weight = near * near;
                all += weight;
                if filled {
                    full += weight;
                    // Of the weight by the point.
                    slope += away * (4.0 * near / (radius * radius));
                }
            }
        }
    }
    if full == 0.0 {
        return None;
    }
    let share = full / all;
    let normal = -slope.normalize_or_zero();
    // A plane through the middle of the ball is its half; the share of a ball's kernel rises about linearly from there.
    let gap = (0.5 - share) * 1.1 * radius * size.min_element();
    (normal != Vector::ZERO && gap < reach).then_some((gap, normal))
}

#[cfg(test)]
mod tests {
    use avian3d::parry::shape::TriMesh;
    use avian3d::prelude::Collider;
    use bevy::math::Quat;

    use super::*;

    fn ask(collider: &Collider, point: [f64; 3], inside: [f64; 3]) -> (f64, DVec3) {
        let pose = Pose::from_parts(Vector::new(1.0, 2.0, 3.0), Quat::from_rotation_x(0.4));
        let shape = ColliderShape { shape: collider.shape().clone(), pose };
        let world = |p: [f64; 3]| pose.transform_point(DVec3::from(p).as_vec3()).as_dvec3();
        let (gap, normal) = shape.nearest(world(point), world(inside), 10.0).unwrap();
        (gap, (pose.rotation.inverse() * normal.as_vec3()).as_dvec3())
    }

    fn close((gap, normal): (f64, DVec3), (wanted, along): (f64, DVec3)) {
        assert!((gap - wanted).abs() < 1e-5 && normal.distance(along) < 1e-4, "{gap} {normal} is not {wanted} {along}");
    }

    const HIGH: [f64; 3] = [0.0, 5.0, 0.0];

    #[test]
    fn solid_shapes_have_negative_gaps_inside_and_normals_outward() {
        let cube = Collider::cuboid(2.0, 2.0, 2.0);
        close(ask(&cube, [0.2, 1.5, 0.0], HIGH), (0.5, DVec3::Y));
        close(ask(&cube, [0.2, 0.7, 0.0], HIGH), (-0.3, DVec3::Y));
        let (gap, normal) = ask(&cube, [0.2, 1.0, 0.0], HIGH);
        assert!(gap.abs() < 1e-5 && normal.y > 0.99, "{gap} {normal}");
        let ball = Collider::sphere(1.0);
        close(ask(&ball, [0.0, 0.9, 0.0], HIGH), (-0.1, DVec3::Y));
        let half = Collider::half_space(Vector::Y);
        close(ask(&half, [3.0, -0.25, 0.0], HIGH), (-0.25, DVec3::Y));
        let hull = Collider::convex_hull(vec![Vector::ZERO, Vector::X, Vector::Y, Vector::Z]).unwrap();
        close(ask(&hull, [0.2, -0.1, 0.2], HIGH), (0.1, DVec3::NEG_Y));
        close(ask(&hull, [0.2, 0.1, 0.2], HIGH), (-0.1, DVec3::NEG_Y));
    }

    #[test]
    fn faces_between_the_pieces_of_a_compound_are_no_surface() {
        let cube = Collider::cuboid(1.0, 2.0, 1.0);
        let left = (Vector::new(-0.5, 0.0, 0.0), Quat::IDENTITY, cube.clone());
        let right = (Vector::new(0.5, 0.0, 0.0), Quat::IDENTITY, cube);
        let both = Collider::compound(vec![left, right]);
        // The nearest face is the one between them.
        close(ask(&both, [0.05, 0.6, 0.0], HIGH), (-0.4, DVec3::Y));
        close(ask(&both, [0.5, 1.1, 0.0], HIGH), (0.1, DVec3::Y));
    }

    #[test]
    fn a_sheet_is_solid_on_the_side_where_the_rest_is_not() {
        let corners = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]].map(Vector::from);
        for faces in [vec![[0, 1, 2], [0, 2, 3]], vec![[2, 1, 0], [3, 2, 0]]] {
            let sheet = Collider::trimesh(corners.to_vec(), faces);
            close(ask(&sheet, [0.3, 0.1, 0.2], HIGH), (0.1, DVec3::Y));
            close(ask(&sheet, [0.3, -0.1, 0.2], HIGH), (-0.1, DVec3::Y));
            close(ask(&sheet, [0.3, -0.1, 0.2], [0.0, -5.0, 0.0]), (0.1, DVec3::NEG_Y));
            // Beside its edge is outside.
            close(ask(&sheet, [1.5, 0.0, 0.0], [5.0, 1.0, 0.0]), (0.5, DVec3::X));
        }
        let hills = Collider::heightfield(vec![vec![0.0; 4]; 4], Vector::new(2.0, 1.0, 2.0));
        close(ask(&hills, [0.3, -0.1, 0.2], HIGH), (-0.1, DVec3::Y));
        close(ask(&hills, [0.3, 0.1, 0.2], HIGH), (0.1, DVec3::Y));
    }

    #[test]
    fn voxels_are_a_surface_without_steps() {
        let cells: Vec<IVec3> =
            (-8..8).flat_map(|x| (-8..0).flat_map(move |y| (-8..8).map(move |z| IVec3::new(x, y, z)))).collect();
        let floor = Collider::voxels(Vector::splat(0.1), &cells);
        for height in [-0.08, -0.03, 0.0, 0.04, 0.1] {
            let (gap, normal) = ask(&floor, [0.013, height, 0.027], HIGH);
            assert!((gap - height).abs() < 0.02 && normal.y > 0.99, "at {height}: {gap} {normal}");
        }
    }

    #[test]
    fn a_closed_mesh_has_an_inside() {
        let cube = Collider::cuboid(2.0, 2.0, 2.0);
        let (vertices, faces) = cube.shape().as_cuboid().unwrap().to_trimesh();
        let flags = avian3d::parry::shape::TriMeshFlags::ORIENTED;
        let mesh = SharedShape::new(TriMesh::with_flags(vertices, faces, flags).unwrap());
        close(ask(&mesh.clone().into(), [0.2, 0.7, 0.0], HIGH), (-0.3, DVec3::Y));
        close(ask(&mesh.into(), [0.2, 1.5, 0.0], HIGH), (0.5, DVec3::Y));
    }
}
