//! [`RigidPart`]: a part as a rigid body of avian3d.

mod body;
mod collider;
mod raise;
mod setup;

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_physics::ShapeChoice;

pub(super) use setup::{finish, forget, start};

/// Makes an entity with [`Splats`](crate::Splats), as a rule a part that was taken out of a capture, a rigid body.
///
/// In the background its Gaussians become a filled solid, which gives it mass, centre and inertia (after its
/// [`PartMaterial`](super::PartMaterial)), and a collider. Then it gets avian's `RigidBody::Dynamic`, `Collider`, `Mass`,
/// `CenterOfMass`, `AngularInertia`, `Friction`, `Restitution` and damping; those of these that it had before stay as they are,
/// and the others go when this component is removed. Until then, and while the capture it was taken out of sets up its
/// [`StaticCapture`](super::StaticCapture), it stands still. [`PartPhysicsStatus`](super::PartPhysicsStatus) tells how far it is.
///
/// Its `Transform` keeps the capture's scale, metres per unit; it must be the same along all axes.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::prelude::*;
/// fn drop_the_chair(mut commands: Commands, captures: Query<(Entity, &SplatParts)>) {
///     for (capture, parts) in &captures {
///         commands.entity(capture).insert(StaticCapture::default());
///         for (id, _) in parts.iter().filter(|(_, part)| part.name == "chair") {
///             let chair = commands.extract_part(capture, id);
///             commands.entity(chair).insert((RigidPart::default(), PartMaterial::preset("wood_hard")));
///         }
///     }
/// }
/// # bevy::ecs::system::assert_is_system(drop_the_chair);
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[require(setup::RigidSetup)]
pub struct RigidPart {
    /// What it collides as.
    pub shape: RigidShape,
    /// Thickness of its wall in metres, where it is hollow: bottles, boxes, lamps. `None`, the default: it is solid. Changes its
    /// mass, not its shape.
    pub hollow: Option<f32>,
    /// Whether a missing underside is closed, as of what was captured standing on a table; on by default.
    pub close_bottom: bool,
    /// Voxels along the diagonal of the part's box; 64 by default. More is slower and finer.
    pub voxels: u32,
    /// How opaque a voxel of its surface is at least, 0 to 1; 0.35 by default. Lower keeps more of what is faint.
    pub cut: f32,
    /// Share of its speed that it loses per second, as `LinearDamping`; 0 by default.
    pub linear_damping: f32,
    /// Share of its spin that it loses per second, as `AngularDamping`; 0.1 by default, so that what rolls comes to rest.
    pub angular_damping: f32,
}

impl Default for RigidPart {
    fn default() -> Self {
        Self {
            shape: RigidShape::Auto,
            hollow: None,
            close_bottom: true,
            voxels: 64,
            cut: 0.35,
            linear_damping: 0.0,
            angular_damping: 0.1,
        }
    }
}

/// What a rigid part collides as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum RigidShape {
    /// A hull if the part is nearly convex, else a decomposition.
    #[default]
    Auto,
    /// The box of its principal axes: the cheapest, and for what is thinner than two voxels.
    Box,
    /// A ball.
    Ball,
    /// A rod with round ends.
    Capsule,
    /// Its convex hull.
    Hull,
    /// At most 32 convex pieces.
    Decomposition,
    /// Its voxels.
    Voxels,
}

impl From<RigidShape> for ShapeChoice {
    fn from(shape: RigidShape) -> Self {
        match shape {
            RigidShape::Auto => Self::Auto,
            RigidShape::Box => Self::Box,
            RigidShape::Ball => Self::Ball,
            RigidShape::Capsule => Self::Capsule,
            RigidShape::Hull => Self::Hull,
            RigidShape::Decomposition => Self::Decomposition,
            RigidShape::Voxels => Self::Voxels,
        }
    }
}

impl RigidShape {
    /// In a word.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Auto => "automatic",
            Self::Box => "box",
            Self::Ball => "ball",
            Self::Capsule => "capsule",
            Self::Hull => "hull",
            Self::Decomposition => "decomposition",
            Self::Voxels => "voxels",
        }
    }
}

#[cfg(test)]
mod tests;
