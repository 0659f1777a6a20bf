//! A capture and meshes hide each other, pixel by pixel: a ball in the room, a glass pane before it, a pillar half in the wall.

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::prelude::*;
use bevy_splat::prelude::*;

mod common;

fn main() -> AppExit {
    common::app().add_systems(Startup, setup).add_systems(Update, roll).run()
}

/// What rolls to and fro.
#[derive(Component)]
struct Ball;

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    args: Res<common::Args>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn(Splats(assets.load(args.scene.clone())));
    commands.spawn((
        Ball,
        Mesh3d(meshes.add(Sphere::new(0.35))),
        MeshMaterial3d(materials.add(Color::srgb(0.9, 0.35, 0.1))),
        Transform::from_xyz(0.0, 0.0, 1.0),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Cylinder::new(0.15, 3.0))),
        MeshMaterial3d(materials.add(Color::srgb(0.2, 0.5, 0.9))),
        Transform::from_xyz(-1.2, 0.0, 0.2),
    ));
    // Glass is drawn after the splats and tested against the depth that they write.
    commands.spawn((
        Mesh3d(meshes.add(Rectangle::new(0.8, 0.8))),
        MeshMaterial3d(materials.add(StandardMaterial {
            base_color: Color::srgba(0.3, 0.9, 0.6, 0.4),
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            ..default()
        })),
        Transform::from_xyz(0.9, 0.3, 2.0),
    ));
    commands.spawn((DirectionalLight::default(), Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn((
        Camera3d::default(),
        FreeCamera::default(),
        Transform::from_xyz(0.92, 0.65, 3.66).looking_at(Vec3::new(0.2, 0.0, 0.5), Vec3::Y),
    ));
}

fn roll(time: Res<Time>, args: Res<common::Args>, mut balls: Query<&mut Transform, With<Ball>>) {
    if args.shot.is_some() {
        return;
    }
    for mut transform in &mut balls {
        transform.translation.x = 1.5 * (0.7 * time.elapsed_secs()).sin();
    }
}
