//! [`SplatSelection`]: which Gaussians of an entity are selected.

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_core::Selection;

/// The selected Gaussians of a [`Splats`](crate::Splats) entity: one bit for each of its cloud.
///
/// Without it, and with an empty `Selection`, nothing is selected. Drawn as [`SplatHighlight`](crate::SplatHighlight) says.
#[derive(Component, Clone, Debug, Default, Deref, DerefMut, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplatSelection(pub Selection);
