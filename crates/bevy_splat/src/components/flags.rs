//! [`SplatFlags`]: which Gaussians of an entity are hidden or locked.

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_core::Selection;

/// Hidden and locked Gaussians of a [`Splats`](crate::Splats) entity. An empty `Selection`, the default, means none.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplatFlags {
    /// Not drawn, not picked, not selected by tools.
    pub hidden: Selection,
    /// Drawn, but neither picked nor selected by tools.
    pub locked: Selection,
}
