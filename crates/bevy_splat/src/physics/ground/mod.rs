//! [`StaticCapture`]: what is left of a capture as something to stand on and to bump into.

mod cache;
mod setup;

use std::sync::Arc;

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_physics::{DistanceField, Fill, Ground, GroundSource};

pub use cache::StaticCaptureCache;
pub(super) use setup::{finish, forget, start};

/// Makes what is left of a capture solid: it stands still, and bodies collide with it. On the capture's entity.
///
/// In the background its Gaussians, without hidden ones and without parts that were taken out, become a surface, with the
/// holes under those parts closed. [`PartPhysicsStatus`](super::PartPhysicsStatus) on the capture tells how far it is. When a part is
/// taken out or put back it is made again (what stood on it stands on the former one meanwhile), and only pieces that
/// changed are replaced.
///
/// With avian3d the entity gets `RigidBody::Static` unless it has a `RigidBody`, and children with the colliders; friction and
/// restitution are those of its [`PartMaterial`](super::PartMaterial), `concrete` without one. Elastic parts touch it with
/// or without avian.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[require(setup::GroundSetup)]
pub struct StaticCapture {
    /// What kind of surface.
    pub source: GroundKind,
    /// Edge of a voxel in metres; 0.05 by default. Smaller is slower and finer, and needs more memory.
    pub voxel: f32,
    /// How opaque a voxel of the surface is at least, 0 to 1; 0.1 by default.
    pub cut: f32,
    /// What is filled, so that nothing falls in.
    pub fill: GroundFill,
    /// Edge of a piece in metres; 16 by default.
    pub chunk: f32,
}

impl Default for StaticCapture {
    fn default() -> Self {
        Self { source: GroundKind::Auto, voxel: 0.05, cut: 0.1, fill: GroundFill::None, chunk: 16.0 }
    }
}

/// A kind of surface that stands still.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum GroundKind {
    /// A plane if the capture is little more than that, else a mesh.
    #[default]
    Auto,
    /// The plane of the floor.
    Plane,
    /// A height above each place: terrain. Nothing is under anything.
    Heightfield,
    /// Triangles.
    Mesh,
    /// Voxels: more memory, no inner edges to catch on.
    Voxels,
}

/// What of a capture is filled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum GroundFill {
    /// Nothing: the surface is as thin as it was captured.
    #[default]
    None,
    /// What is below the lowest surface: open scenes.
    Floor,
    /// What cannot be reached from inside: rooms.
    Exterior,
}

impl From<GroundKind> for GroundSource {
    fn from(kind: GroundKind) -> Self {
        match kind {
            GroundKind::Auto => Self::Auto,
            GroundKind::Plane => Self::Plane,
            GroundKind::Heightfield => Self::Heightfield,
            GroundKind::Mesh => Self::Mesh,
            GroundKind::Voxels => Self::Voxels,
        }
    }
}

impl From<GroundFill> for Fill {
    fn from(fill: GroundFill) -> Self {
        match fill {
            GroundFill::None => Self::None,
            GroundFill::Floor => Self::Floor,
            GroundFill::Exterior => Self::Exterior,
        }
    }
}

/// The surface of a [`StaticCapture`] that is ready; written by this crate.
#[derive(Component, Clone, Debug)]
pub struct CaptureGround {
    /// Its pieces; axes and origin of the cloud, lengths in metres.
    pub ground: Arc<Ground>,
    /// How far points are from it, in the same space.
    pub field: Arc<DistanceField>,
    /// Metres per unit that it was made with.
    pub metres_per_unit: f64,
    /// Its material's coefficients of friction, dynamic and static.
    pub friction: [f64; 2],
    /// Its material's restitution, 0 to 1.
    pub restitution: f64,
    /// A collider for each piece, in units of the cloud.
    #[cfg(feature = "avian")]
    pub(super) colliders: Arc<[super::avian::ground::Piece]>,
}
