//! What elastic parts tell, and [`ElasticPush`].

use bevy::prelude::*;

/// A part touches something: once for each pair and fixed step while the part is awake.
#[derive(Message, Clone, Copy, Debug, PartialEq)]
pub struct ElasticContact {
    /// The elastic part.
    pub part: Entity,
    /// What it touches: the entity of a collider or of another elastic part; `None` for an
    /// [`ElasticGround`](super::ElasticGround).
    pub other: Option<Entity>,
    /// What the part got in this step from all points that touch, in N s, world space.
    pub impulse: Vec3,
    /// Where, in world space: the mean of the points, weighted by what each got.
    pub point: Vec3,
    /// Of the other surface, away from it; a unit vector.
    pub normal: Vec3,
}

/// A part rests and is not stepped any more.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ElasticSlept {
    /// The elastic part.
    pub part: Entity,
}

/// A part that rested moves again.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ElasticWoke {
    /// The elastic part.
    pub part: Entity,
}

/// A step of a part came to no sound state, or something that is not finite was asked of it. The part is back in its last sound
/// state and frozen: it moves again after its `Transform` was written.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ElasticExploded {
    /// The elastic part.
    pub part: Entity,
}

/// Asks that a point of an elastic part be pushed in the next fixed step; wakes it. To poke from code.
#[derive(Message, Clone, Copy, Debug, PartialEq)]
pub struct ElasticPush {
    /// The elastic part; others are left alone.
    pub part: Entity,
    /// Where, in world space; a point beside the part counts as fixed to what of the part is nearest.
    pub point: Vec3,
    /// In N s, world space.
    pub impulse: Vec3,
}
