//! What the tests of this crate start from: an app without a device, and clouds.

use bevy::prelude::*;
use splat_core::{Cloud, CloudArrays};

use crate::{SplatCloud, Splats};

/// An app without window, device and files, with the assets of this crate.
pub(crate) fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), crate::asset::SplatAssetPlugin));
    app
}

/// A row of grey Gaussians along x, one unit apart.
pub(crate) fn cloud(len: usize) -> SplatCloud {
    let arrays = CloudArrays {
        means: (0..len).map(|i| Vec3::X * i as f32).collect(),
        log_scales: vec![Vec3::splat(-1.0); len],
        rotations: vec![Quat::IDENTITY; len],
        opacity_logits: vec![2.0; len],
        sh: vec![0.0; 3 * len],
        ..CloudArrays::default()
    };
    SplatCloud::new(Cloud::new(arrays).unwrap())
}

/// A capture of [`cloud`].
pub(crate) fn spawn(app: &mut App, len: usize) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(cloud(len));
    app.world_mut().spawn(Splats(handle)).id()
}
