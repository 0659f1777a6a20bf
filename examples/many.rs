//! Many captures: forty rooms from one file, each placed, turned and sized by its `Transform`; the data are stored once.

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::prelude::*;
use bevy_splat::prelude::*;

mod common;

fn main() -> AppExit {
    common::app().add_systems(Startup, setup).run()
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, args: Res<common::Args>) {
    let capture = assets.load(args.scene.clone());
    for i in 0..40 {
        let (row, column) = (i / 8, i % 8);
        commands.spawn((
            Splats(capture.clone()),
            Transform::from_xyz(5.0 * (column as f32 - 3.5), 0.0, -6.0 * row as f32)
                .with_rotation(Quat::from_rotation_y(0.3 * i as f32))
                .with_scale(Vec3::splat(0.6 + 0.05 * (i % 5) as f32))
                * UPRIGHT,
        ));
    }
    commands.spawn((
        Camera3d::default(),
        FreeCamera::default(),
        Transform::from_xyz(0.0, 9.0, 14.0).looking_at(Vec3::new(0.0, 0.0, -8.0), Vec3::Y),
    ));
}
