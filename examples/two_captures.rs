//! Two captures through each other: all splats of a scene share one depth order, whichever entity they belong to.

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::prelude::*;
use bevy_splat::prelude::*;

mod common;

fn main() -> AppExit {
    common::app().add_systems(Startup, setup).run()
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, args: Res<common::Args>) {
    // The same file twice is stored once.
    let capture = assets.load(args.scene.clone());
    commands.spawn(Splats(capture.clone()));
    commands.spawn((
        Splats(capture),
        Transform::from_xyz(0.25, 0.0, 0.1).with_rotation(Quat::from_rotation_y(0.35)) * UPRIGHT,
    ));
    commands.spawn((
        Camera3d::default(),
        FreeCamera::default(),
        Transform::from_xyz(0.92, 0.65, 3.66).looking_at(Vec3::new(0.2, 0.0, 0.5), Vec3::Y),
    ));
}
