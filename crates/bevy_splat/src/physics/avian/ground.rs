//! Colliders of what is left of a capture.

use std::hash::{DefaultHasher, Hasher};
use std::sync::Arc;

use avian3d::parry::shape::{SharedShape, TriMeshFlags, Voxels};
use avian3d::parry::utils::Array2;
use avian3d::prelude::*;
use bevy::ecs::lifecycle::Remove;
use bevy::math::{DVec3, IVec3, Quat, Vec3};
use bevy::prelude::*;
use splat_physics::{Ground, GroundSurface};

use super::super::ground::CaptureGround;
use super::super::jobs::Watch;

/// A collider of a piece of ground, in units of the cloud.
#[derive(Clone, Debug)]
pub(in super::super) struct Piece {
    /// Of what it was made from: pieces with equal keys are equal.
    key: u64,
    collider: Collider,
    /// Where the collider lies in the capture: parry has no contacts for such shapes within compounds.
    at: Transform,
}

/// A child of a capture that carries a piece of its ground.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GroundChild(u64);

/// The capture's `RigidBody` is this crate's.
#[derive(Component, Clone, Copy, Debug)]
pub(super) struct GivenBody;

/// The collider of each piece; those that are empty have none.
pub(in super::super) fn pieces(ground: &Ground, metres_per_unit: f64, watch: &Watch) -> Arc<[Piece]> {
    let piece = |chunk: &splat_physics::GroundChunk| {
        if watch.cancelled() {
            return None;
        }
        let mut hasher = DefaultHasher::new();
        let (at, shape) = shape(&chunk.surface, metres_per_unit, &mut hasher)?;
        Some(Piece { key: hasher.finish(), collider: shape.into(), at })
    };
    ground.chunks().iter().filter_map(piece).collect()
}

/// The shape of a piece in units of the cloud, `None` for one that is empty; what it is made of goes into `hasher`.
fn shape(
    surface: &GroundSurface,
    metres_per_unit: f64,
    hasher: &mut DefaultHasher,
) -> Option<(Transform, SharedShape)> {
    fn mix(hasher: &mut DefaultHasher, p: Vec3) -> Vec3 {
        p.to_array().into_iter().for_each(|x| hasher.write_u32(x.to_bits()));
        p
    }
    let mut unit = |p: DVec3| mix(hasher, (p / metres_per_unit).as_vec3());
    let placed = |at: Vec3, rotation: Quat, shape: SharedShape| {
        Some((Transform::from_translation(at).with_rotation(rotation.normalize()), shape))
    };
    match surface {
        GroundSurface::Plane { normal, offset } => {
            let (at, normal) = (unit(*normal * *offset), unit(*normal * metres_per_unit));
            placed(at, Quat::from_rotation_arc(Vec3::Y, normal.normalize()), SharedShape::halfspace(Vec3::Y))
        }
        GroundSurface::Heights { origin, rotation, spacing, dims: [columns, rows], heights } => {
            let (columns, rows) = (*columns as usize, *rows as usize);
            let side = DVec3::new((columns.max(2) - 1) as f64, 0.0, (rows.max(2) - 1) as f64) * *spacing;
            // Parry's are about their middle.
            let at = unit(*origin + *rotation * (0.5 * side));
            let scale = unit(side + DVec3::Y * metres_per_unit);
            let turn = rotation.as_quat();
            if columns < 2 || rows < 2 || heights.len() != columns * rows {
                return None;
            }
            // Parry has z fastest.
            let sample = |k: usize| unit(DVec3::Y * f64::from(heights[k / rows + columns * (k % rows)])).y;
            let heights = Array2::new(rows, columns, (0..rows * columns).map(sample).collect());
            placed(at, turn, SharedShape::heightfield(heights, scale))
        }
        GroundSurface::Mesh(mesh) => {
            let vertices: Vec<Vec3> = mesh.vertices.iter().map(|&p| unit(p)).collect();
            mesh.triangles.as_flattened().iter().for_each(|&k| hasher.write_u32(k));
            // Feet and wheels catch on edges between triangles of one plane otherwise.
            let flags = TriMeshFlags::FIX_INTERNAL_EDGES;
            let shape = SharedShape::trimesh_with_flags(vertices, mesh.triangles.clone(), flags).ok()?;
            placed(Vec3::ZERO, Quat::IDENTITY, shape)
        }
        GroundSurface::Voxels { origin, rotation, voxel, cells } => {
            let (at, size) = (unit(*origin), unit(DVec3::splat(*voxel)));
            cells.iter().for_each(|cell| cell.to_array().into_iter().for_each(|k| hasher.write_u32(k)));
            let cells: Vec<IVec3> = cells.iter().map(|cell| cell.as_ivec3()).collect();
            let sound = !cells.is_empty() && size.is_finite() && size.x > 0.0;
            sound.then(|| placed(at, rotation.as_quat(), SharedShape::new(Voxels::new(size, &cells))))?
        }
        _ => None,
    }
}

type Grounds<'a> = (Entity, &'a CaptureGround, Option<&'a Children>, Has<RigidBody>);

/// Gives captures whose ground has changed the colliders of it, those that are the same excepted.
pub(super) fn give(
    mut commands: Commands,
    grounds: Query<Grounds, Changed<CaptureGround>>,
    pieces: Query<&GroundChild>,
) {
    for (entity, ground, children, has_body) in &grounds {
        if !has_body {
            commands.entity(entity).insert((RigidBody::Static, GivenBody));
        }
        // On each child: avian asks a collider's body for its friction, but not for its restitution.
        let surface = (
            Friction::new(ground.friction[0] as f32).with_static_coefficient(ground.friction[1] as f32),
            Restitution::new(ground.restitution as f32),
        );
        let mut wanted: Vec<&Piece> = ground.colliders.iter().collect();
        for child in children.into_iter().flatten() {
            let Ok(piece) = pieces.get(*child) else { continue };
            match wanted.iter().position(|wanted| wanted.key == piece.0) {
                Some(same) => {
                    wanted.swap_remove(same);
                    commands.entity(*child).insert(surface);
                }
                None => commands.entity(*child).despawn(),
            }
        }
        for piece in wanted {
            let name = Name::new("ground");
            commands.spawn((piece.collider.clone(), GroundChild(piece.key), piece.at, name, ChildOf(entity)));
        }
    }
}

/// Takes colliders away with the ground they are of.
pub(super) fn forget(
    removed: On<Remove, CaptureGround>,
    mut commands: Commands,
    captures: Query<(Option<&Children>, Has<GivenBody>)>,
    pieces: Query<(), With<GroundChild>>,
) {
    let entity = removed.event().entity;
    let Ok((children, given)) = captures.get(entity) else { return };
    for child in children.into_iter().flatten().filter(|child| pieces.contains(**child)) {
        commands.entity(*child).try_despawn();
    }
    if given && let Ok(mut capture) = commands.get_entity(entity) {
        capture.try_remove::<(RigidBody, GivenBody)>();
    }
}
