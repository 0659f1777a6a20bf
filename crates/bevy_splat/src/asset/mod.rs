//! Captures as assets: [`SplatCloud`], its loader and its saver; [`SplatCameras`], the cameras a capture was made from.
//!
//! To load is `asset_server.load("room.ply")`: the content decides on the format, not the name. To make one in code is
//! `clouds.add(SplatCloud::new(cloud))`. When a file changes and is loaded again (`file_watcher`, or
//! `AssetServer::reload`), the cloud is replaced; what no longer fits its length is reset with a warning, see
//! [`SplatFitSystems`].

mod beside;
mod cameras;
mod cloud;
mod fit;
mod loader;
mod saver;

use bevy::asset::AssetTrackingSystems;
use bevy::prelude::*;

pub use cameras::{SplatCameras, SplatCamerasLoader};
pub use cloud::SplatCloud;
pub use fit::SplatFitSystems;
pub use loader::{SplatCloudLoader, SplatCloudSettings, SplatLoadError};
pub use saver::{SplatCloudSaver, SplatSaveError, SplatSaveSettings};

use crate::Splats;
use crate::components::{SplatFlags, SplatParts, SplatSelection, SplatSubset};

/// Loads captures and keeps what belongs to their Gaussians at their length. Needs Bevy's `AssetPlugin`.
pub struct SplatAssetPlugin;

impl Plugin for SplatAssetPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<SplatCloud>()
            .register_asset_reflect::<SplatCloud>()
            .register_asset_loader(SplatCloudLoader)
            .init_asset::<SplatCameras>()
            .register_asset_loader(SplatCamerasLoader)
            .register_type::<(Splats, SplatFlags, SplatSelection, SplatSubset, SplatParts)>()
            .configure_sets(PreUpdate, SplatFitSystems.after(AssetTrackingSystems))
            // Once when assets come in, before anybody uses bits of a former length; once for what systems changed.
            .add_systems(PreUpdate, fit::fit.in_set(SplatFitSystems))
            .add_systems(PostUpdate, fit::fit.in_set(SplatFitSystems));
    }
}

#[cfg(test)]
mod tests;
