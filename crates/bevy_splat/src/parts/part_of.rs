//! [`PartOf`] and [`SplatPart`]: where the Gaussians of a part's entity came from.

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_core::PartId;

/// The entity that a part was taken out of: a capture, or, for a part out of a part, that part's entity.
///
/// It is a link only: the part's entity is no child, has its own `Transform` and lives on when the capture is despawned.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct PartOf(#[entities] pub Entity);

/// Which part an entity is, by the label in the capture's [`SplatParts`](crate::SplatParts).
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplatPart(pub PartId);
