//! Several cameras, parts of pictures, layers, projections.

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{ClearColorConfig, ScalingMode, Viewport};
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;
use bevy_splat::prelude::*;
use splat_raster::Scene;

use crate::harness::*;

/// The pixels of `part`, from a picture of the whole target.
fn cut(picture: &[[f32; 4]], part: URect) -> Vec<[f32; 4]> {
    let at = |y: u32| (y * SIZE.x + part.min.x) as usize;
    (part.min.y..part.max.y).flat_map(|y| picture[at(y)..at(y) + part.width() as usize].to_vec()).collect()
}

#[test]
fn viewports_show_their_own_camera_and_leave_the_rest() {
    if !device() {
        return;
    }
    let cloud = ball(300, 1.5, [0.9, 0.3, 0.1]);
    for backend in backends() {
        for msaa in [Msaa::Off, Msaa::Sample4] {
            let mut stage = Stage::new(backend);
            stage.splats(&cloud, ());
            let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
            let parts = [URect::new(0, 0, 40, 64), URect::new(47, 11, 90, 50)];
            let cameras: Vec<Entity> = (0..2)
                .map(|k| {
                    let viewport =
                        Viewport { physical_position: parts[k].min, physical_size: parts[k].size(), ..default() };
                    let camera = Camera { order: k as isize, viewport: Some(viewport), ..default() };
                    let place = Transform::from_xyz(5.0 * k as f32, 1.0, 5.0).looking_at(Vec3::ZERO, Vec3::Y);
                    stage.camera(&canvas, (camera, place, msaa))
                })
                .collect();
            let name = format!("viewports_{msaa:?}_{backend:?}");
            let got = stage.picture(&canvas, &name);
            for (k, &camera) in cameras.iter().enumerate() {
                let expected = over(&stage.expected(camera, &Scene::of(cloud.clone()), None), |_| CLEAR);
                let got = cut(&got, parts[k]);
                let far = got.iter().zip(&expected).filter(|(a, b)| (0..3).any(|i| (a[i] - b[i]).abs() > 2.0)).count();
                assert_eq!(far, 0, "{name}: viewport {k}");
            }
        }
    }
}

#[test]
fn a_second_camera_draws_over_the_first() {
    if !device() {
        return;
    }
    let (near, far) = (ball(200, 0.8, [0.9, 0.2, 0.1]), ball(200, 1.6, [0.1, 0.3, 0.9]));
    for backend in backends() {
        for msaa in [Msaa::Off, Msaa::Sample4] {
            let mut stage = Stage::new(backend);
            stage.splats(&near, RenderLayers::layer(1));
            // Nearer to the camera, but in the picture of the first.
            stage.splats(&far, (RenderLayers::layer(2), Transform::from_xyz(0.3, 0.2, 2.0)));
            let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
            let first = stage.camera(&canvas, (RenderLayers::layer(2), msaa));
            let camera = Camera { order: 1, clear_color: ClearColorConfig::None, ..default() };
            let second = stage.camera(&canvas, (camera, RenderLayers::layer(1), msaa));
            let name = format!("second_{msaa:?}_{backend:?}");
            let got = stage.picture(&canvas, &name);
            let moved = splat_raster::Instance {
                transform: splat_core::Similarity {
                    translation: Vec3::new(0.3, 0.2, 2.0),
                    ..splat_core::Similarity::IDENTITY
                },
                ..splat_raster::Instance::new(far.clone())
            };
            let behind = over(&stage.expected(first, &Scene { instances: vec![moved] }, None), |_| CLEAR);
            let scene = Scene::of(near.clone());
            let expected = over(&stage.expected(second, &scene, None), |i| [0, 1, 2].map(|k| behind[i][k] / 255.0));
            assert_near(&name, &got, &expected, 3.0, 0);
        }
    }
}

#[test]
fn orthographic_cameras_see_plans() {
    if !device() {
        return;
    }
    let cloud = ball(300, 1.5, [0.9, 0.3, 0.1]);
    for backend in backends() {
        let mut stage = Stage::new(backend);
        stage.splats(&cloud, ());
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        for near in [0.0, -50.0] {
            let projection = OrthographicProjection {
                near,
                scaling_mode: ScalingMode::FixedVertical { viewport_height: 4.0 },
                ..OrthographicProjection::default_3d()
            };
            let place = Transform::from_xyz(0.4, 3.0, 0.2).looking_at(Vec3::ZERO, Vec3::NEG_Z);
            let camera = stage.camera(&canvas, (Projection::from(projection), place));
            let got = stage.picture(&canvas, &format!("orthographic_{near}_{backend:?}"));
            let expected = over(&stage.expected(camera, &Scene::of(cloud.clone()), None), |_| CLEAR);
            assert!(expected[(SIZE.x * 33 + 48) as usize][0] > 150.0, "something is in the middle");
            assert_near("orthographic", &got, &expected, 2.0, 0);
            stage.app.world_mut().despawn(camera);
        }
    }
}

#[test]
fn over_nothing_colours_are_straight_and_alpha_is_what_the_splats_cover() {
    if !device() {
        return;
    }
    let cloud = ball(300, 1.5, [0.9, 0.3, 0.1]);
    for backend in backends() {
        for msaa in [Msaa::Off, Msaa::Sample4] {
            let mut stage = Stage::new(backend);
            stage.splats(&cloud, ());
            let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
            let clear = Camera { clear_color: ClearColorConfig::Custom(Color::NONE), ..default() };
            let camera = stage.camera(&canvas, (clear, msaa));
            let name = format!("over_nothing_{msaa:?}_{backend:?}");
            let got = stage.picture(&canvas, &name);
            let frame = stage.expected(camera, &Scene::of(cloud.clone()), None);
            for (got, color) in got.iter().zip(&frame.color) {
                assert!((got[3] - 255.0 * color[3]).abs() <= 1.0, "{name}: alpha {} for {}", got[3], 255.0 * color[3]);
                // Eight bits of a dark premultiplied colour say little of its straight one.
                if color[3] > 0.5 {
                    let straight = [0, 1, 2].map(|k| (255.0 * color[k] / color[3]).min(255.0));
                    assert!((0..3).all(|k| (got[k] - straight[k]).abs() <= 3.0), "{name}: {got:?} for {straight:?}");
                }
            }
        }
    }
}
