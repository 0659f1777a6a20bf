//! A cloud made in code: a spiral of Gaussians, coloured along its way.

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::prelude::*;
use bevy_splat::prelude::*;
use splat_core::{Cloud, CloudArrays};

mod common;

const COUNT: usize = 4000;

fn main() -> AppExit {
    common::app().add_systems(Startup, setup).run()
}

fn setup(mut commands: Commands, mut clouds: ResMut<Assets<SplatCloud>>) -> Result {
    // Scales are stored as logarithms, opacity before the sigmoid, colour as the constant harmonic.
    let along = |i: usize| i as f32 / COUNT as f32;
    let cloud = Cloud::new(CloudArrays {
        means: (0..COUNT)
            .map(|i| {
                let (t, turn) = (along(i), 40.0 * along(i));
                Vec3::new(t * turn.cos(), 1.5 * t - 0.75, t * turn.sin())
            })
            .collect(),
        log_scales: (0..COUNT).map(|i| Vec3::new(0.05, 0.01, 0.05).map(|s| (s * (0.2 + along(i))).ln())).collect(),
        rotations: (0..COUNT).map(|i| Quat::from_rotation_y(-40.0 * along(i))).collect(),
        opacity_logits: vec![3.0; COUNT],
        sh: (0..COUNT)
            .flat_map(|i| {
                let color = Color::hsl(360.0 * along(i), 0.8, 0.55).to_srgba();
                [color.red, color.green, color.blue].map(|c| (c - 0.5) / splat_core::sh::C0)
            })
            .collect(),
        ..default()
    })?;
    // Made here, so y is up already.
    commands.spawn((Splats(clouds.add(SplatCloud::new(cloud))), Transform::default()));
    commands.spawn((
        Camera3d::default(),
        FreeCamera::default(),
        Transform::from_xyz(0.0, 1.2, 2.6).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    Ok(())
}
