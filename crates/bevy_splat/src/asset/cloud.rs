//! [`SplatCloud`]: the Gaussians of one capture.

use std::sync::Arc;

use bevy::asset::Asset;
use bevy::prelude::*;
use splat_core::Cloud;
use splat_io::ReadReport;

/// The Gaussians of one capture, shared by all [`Splats`](crate::Splats) entities that show it.
///
/// Cheap to clone. To change what is shown replace `cloud` by another: it is never written in place.
#[derive(Asset, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Default, Clone, Debug)]
pub struct SplatCloud {
    /// The Gaussians, as in the file.
    pub cloud: Arc<Cloud>,
    /// What was odd about the file; empty for a cloud made in code.
    pub report: Arc<ReadReport>,
}

impl SplatCloud {
    /// A capture of these Gaussians.
    pub fn new(cloud: impl Into<Arc<Cloud>>) -> Self {
        Self { cloud: cloud.into(), report: Arc::default() }
    }
}

impl From<Cloud> for SplatCloud {
    fn from(cloud: Cloud) -> Self {
        Self::new(cloud)
    }
}
