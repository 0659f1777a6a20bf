//! [`SplatParts`]: the named parts of a capture.

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_core::Parts;

/// Named, coloured, disjoint parts of a [`Splats`](crate::Splats) entity: one label for each Gaussian of its cloud.
///
/// A part becomes an entity of its own by [`extract_part`](crate::parts::SplatPartCommands::extract_part); its label stays here.
#[derive(Component, Clone, Debug, Default, Deref, DerefMut, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplatParts(pub Parts);
