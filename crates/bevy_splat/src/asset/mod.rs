//! Captures as assets: [`SplatCloud`], its loader and its saver.

use std::sync::Arc;

use bevy::prelude::*;
use splat_core::Cloud;

/// The Gaussians of one capture.
///
/// Cheap to clone. Made from a file by `asset_server.load("room.ply")`, or in code by
/// `clouds.add(SplatCloud::new(cloud))`.
#[derive(Asset, TypePath, Clone, Debug, Default)]
pub struct SplatCloud {
    /// The Gaussians, as in the file.
    pub cloud: Arc<Cloud>,
}

impl SplatCloud {
    /// A capture of these Gaussians.
    pub fn new(cloud: impl Into<Arc<Cloud>>) -> Self {
        Self { cloud: cloud.into() }
    }
}
