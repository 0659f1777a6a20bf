//! What the tests of this crate start from: an app without a device, and clouds.

use std::path::Path;
use std::time::{Duration, Instant};

use bevy::asset::LoadState;
use bevy::asset::io::memory::{Dir, MemoryAssetReader, MemoryAssetWriter};
use bevy::asset::io::{AssetSourceBuilder, AssetSourceId};
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

/// As [`app`], with the asset files of a folder.
pub(crate) fn app_in(folder: &Path) -> App {
    let mut app = App::new();
    let assets = AssetPlugin { file_path: folder.to_string_lossy().into_owned(), ..default() };
    app.add_plugins((MinimalPlugins, assets, crate::asset::SplatAssetPlugin));
    app
}

/// As [`app`], with asset files in memory.
pub(crate) fn app_with_files() -> (App, Dir) {
    let mut app = App::new();
    let files = Dir::default();
    let (read, write) = (files.clone(), files.clone());
    let source = AssetSourceBuilder::new(move || Box::new(MemoryAssetReader { root: read.clone() }))
        .with_writer(move |_| Some(Box::new(MemoryAssetWriter { root: write.clone() })));
    app.register_asset_source(AssetSourceId::Default, source);
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), crate::asset::SplatAssetPlugin));
    (app, files)
}

/// Runs frames until `done`; fails after a minute, which only a load that hangs takes.
pub(crate) fn update_until(app: &mut App, mut done: impl FnMut(&mut App) -> bool) {
    let start = Instant::now();
    while !done(app) {
        assert!(start.elapsed() < Duration::from_secs(60), "it never came");
        app.update();
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The asset once it is loaded, or the sentence that says why it was not.
pub(crate) fn finished<A: Asset + Clone>(app: &mut App, handle: &Handle<A>) -> Result<A, String> {
    let state = |app: &App| app.world().resource::<AssetServer>().load_state(handle);
    update_until(app, |app| matches!(state(app), LoadState::Loaded | LoadState::Failed(_)));
    match state(app) {
        // Where RUST_BACKTRACE is set, Bevy adds one in lines of their own.
        LoadState::Failed(error) => Err(error.to_string().lines().next().unwrap_or_default().to_owned()),
        _ => {
            app.update();
            Ok(app.world().resource::<Assets<A>>().get(handle).unwrap().clone())
        }
    }
}
