//! [`SplatTint`]: the colours that selection and parts lay over Gaussians.

use std::ops::Range;
use std::sync::Arc;

use bevy::prelude::*;

/// For each Gaussian of the cloud: sRGB red, green, blue, and with what strength (0 to 255) they are mixed over its own colour.
///
/// Made by [`SplatTintPlugin`] from selection, parts and [`SplatHighlight`](crate::SplatHighlight); absent where nothing is to be
/// shown.
#[derive(Component, Clone, Debug, PartialEq, Eq)]
#[require(SplatTintChange)]
pub struct SplatTint(pub Arc<[[u8; 4]]>);

/// What the last change of a [`SplatTint`] changed, so that only that need be uploaded.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq)]
pub struct SplatTintChange {
    /// Rises by one with each change.
    pub version: u64,
    /// Ids that differ from the version before, rising, apart from each other. Who has an older version needs all.
    pub ranges: Vec<Range<u32>>,
}

/// Keeps [`SplatTint`] up to date.
pub struct SplatTintPlugin;

impl Plugin for SplatTintPlugin {
    fn build(&self, _app: &mut App) {}
}
