//! A capture in a Bevy scene: load a file, spawn it, look at it.
//!
//! ```sh
//! cargo run --release --example view                      # the built-in room; fly with W A S D and the mouse
//! cargo run --release --example view -- my_scan.ply
//! ```

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::prelude::*;
use bevy_splat::prelude::*;

mod common;

fn main() -> AppExit {
    common::app().add_systems(Startup, setup).run()
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, args: Res<common::Args>) {
    // Captures are y-down; `Splats` turns itself upright unless it is given a `Transform`.
    commands.spawn(Splats(assets.load(args.scene.clone())));
    commands.spawn((
        Camera3d::default(),
        FreeCamera::default(),
        Transform::from_xyz(0.92, 0.65, 3.66).looking_at(Vec3::new(0.2, 0.0, 0.5), Vec3::Y),
    ));
}
