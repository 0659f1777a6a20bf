//! Settings of drawing: two cameras side by side, one with HDR and bloom and exact splat colours, one orthographic, the
//! left with parts in colours of their own.

use bevy::camera::{Hdr, ScalingMode, Viewport};
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy_splat::prelude::*;

mod common;

fn main() -> AppExit {
    common::app()
        // The back end can be chosen by hand; `Auto` is the default.
        .insert_resource(SplatBackend::Auto)
        .add_systems(Startup, setup)
        .run()
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, args: Res<common::Args>) {
    commands.spawn(Splats(assets.load(args.scene.clone())));
    let half = args.size / UVec2::new(2, 1);
    let viewport =
        |k: u32| Some(Viewport { physical_position: UVec2::new(k * half.x, 0), physical_size: half, ..default() });
    commands.spawn((
        Camera3d::default(),
        Camera { viewport: viewport(0), ..default() },
        Hdr,
        Bloom::NATURAL,
        Msaa::Off,
        // Splat colours are those of a screen: drawn after tone mapping they come out as trained.
        SplatCamera { order: SplatOrder::AfterTonemapping, ..default() },
        Transform::from_xyz(0.92, 0.65, 3.66).looking_at(Vec3::new(0.2, 0.0, 0.5), Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Camera { viewport: viewport(1), order: 1, clear_color: ClearColorConfig::Custom(Color::BLACK), ..default() },
        Projection::Orthographic(OrthographicProjection {
            scaling_mode: ScalingMode::FixedVertical { viewport_height: 4.0 },
            ..OrthographicProjection::default_3d()
        }),
        SplatCamera { depth: SplatDepth::Never, ..default() },
        Transform::from_xyz(2.0, 2.5, 4.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}
