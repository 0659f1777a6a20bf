//! Splats and meshes, opaque and transparent, in front of and behind each other.

use bevy::camera::Hdr;
use bevy::math::primitives::Rectangle;
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;
use bevy_splat::prelude::*;
use splat_raster::Scene;

use crate::harness::*;

/// A pane of one colour, at `z`, that covers the picture left of x = 0.
fn pane(stage: &mut Stage, z: f32, color: Color) -> Entity {
    let world = stage.app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(20.0, 20.0));
    let alpha_mode = if color.alpha() < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
    let material = StandardMaterial { base_color: color, unlit: true, alpha_mode, ..default() };
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_xyz(-10.0, 0.0, z))).id()
}

/// Camera z of a pane at `z` from the test camera, where it is; nothing elsewhere.
fn limit(z: f32) -> Vec<f32> {
    let covered = |i: u32| i % SIZE.x < SIZE.x / 2;
    (0..SIZE.x * SIZE.y).map(|i| if covered(i) { 6.0 - z } else { f32::INFINITY }).collect()
}

const ORANGE: [f32; 3] = [0.9, 0.6, 0.1];

#[test]
fn meshes_hide_splats_behind_them_gaussian_by_gaussian() {
    if !device() {
        return;
    }
    let cloud = ball(400, 1.5, [0.1, 0.4, 0.9]);
    for backend in backends() {
        let mut stage = Stage::new(backend);
        stage.splats(&cloud, ());
        for z in [3.0, 0.2, -3.0] {
            let mesh = pane(&mut stage, z, Color::srgb_from_array(ORANGE));
            for (name, msaa, hdr) in [
                ("plain", Msaa::Off, false),
                ("hdr", Msaa::Off, true),
                ("msaa", Msaa::Sample4, false),
                ("msaa_hdr", Msaa::Sample4, true),
            ] {
                let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
                let camera = stage.camera(&canvas, msaa);
                if hdr {
                    stage.app.world_mut().entity_mut(camera).insert(Hdr);
                }
                let name = format!("pane_at_{z}_{name}_{backend:?}");
                let got = stage.picture(&canvas, &name);
                let frame = stage.expected(camera, &Scene::of(cloud.clone()), Some(&limit(z)));
                let expected = over(&frame, |i| if i % 96 < 48 { ORANGE } else { CLEAR });
                // The pane's edge runs between two columns: no pixel is part of both.
                assert_near(&name, &got, &expected, 2.0, 0);
                stage.app.world_mut().despawn(camera);
            }
            stage.app.world_mut().despawn(mesh);
        }
    }
}

#[test]
fn transparent_meshes_stand_before_and_behind_splats() {
    if !device() {
        return;
    }
    let cloud = ball(400, 1.5, [0.1, 0.4, 0.9]);
    for backend in backends() {
        for msaa in [Msaa::Off, Msaa::Sample4] {
            let mut stage = Stage::new(backend);
            stage.splats(&cloud, ());
            let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
            let camera = stage.camera(&canvas, msaa);
            let middle = |picture: &[[f32; 4]]| picture[(SIZE.x * 32 + 40) as usize];
            let alone = middle(&stage.picture(&canvas, "alone"));
            assert!(alone[2] > 180.0, "the ball is blue and dense: {alone:?}");

            let behind = pane(&mut stage, -3.0, Color::srgba(1.0, 0.0, 0.0, 0.5));
            let got = stage.picture(&canvas, &format!("glass_behind_{msaa:?}_{backend:?}"));
            let seen = middle(&got);
            assert!((0..3).all(|k| (seen[k] - alone[k]).abs() <= 2.0), "hidden by the splats: {seen:?} for {alone:?}");
            // Beside the ball it is over the background.
            assert!(got[(SIZE.x * 32 + 2) as usize][0] > 120.0);
            stage.app.world_mut().despawn(behind);

            pane(&mut stage, 3.0, Color::srgba(1.0, 0.0, 0.0, 0.5));
            let seen = middle(&stage.picture(&canvas, &format!("glass_before_{msaa:?}_{backend:?}")));
            assert!(
                seen[0] > alone[0] + 50.0 && seen[2] < alone[2] - 20.0,
                "before the splats: {seen:?} for {alone:?}"
            );

            let settings = SplatCamera { depth: SplatDepth::Never, ..default() };
            stage.app.world_mut().entity_mut(camera).insert(settings);
            pane(&mut stage, -3.0, Color::srgba(0.0, 1.0, 0.0, 0.5));
            let over = middle(&stage.picture(&canvas, &format!("glass_no_depth_{msaa:?}_{backend:?}")));
            assert!(over[1] > seen[1] + 20.0, "without depth glass behind is drawn over: {over:?} for {seen:?}");
        }
    }
}

#[test]
fn edges_of_meshes_before_splats_stay_smooth_with_msaa() {
    if !device() {
        return;
    }
    // A tilted pane in front of a dense ball: along its edge pixels are mixtures of pane and ball.
    let cloud = ball(600, 2.5, [0.1, 0.4, 0.9]);
    for backend in backends() {
        let mut stage = Stage::new(backend);
        stage.splats(&cloud, ());
        let mesh = pane(&mut stage, 3.5, Color::srgb_from_array(ORANGE));
        let tilt = Transform::from_xyz(-10.0, 0.0, 3.5).with_rotation(Quat::from_rotation_z(0.1));
        stage.app.world_mut().entity_mut(mesh).insert(tilt);
        let mut mixed = [0; 2];
        for (k, msaa) in [Msaa::Off, Msaa::Sample4].into_iter().enumerate() {
            let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
            let camera = stage.camera(&canvas, msaa);
            let got = stage.picture(&canvas, &format!("edge_{msaa:?}_{backend:?}"));
            // Rows through the middle of the ball; orange has little blue, the ball little red.
            mixed[k] = (24..40)
                .flat_map(|y| (20..76).map(move |x| y * 96 + x))
                .filter(|&i: &usize| got[i][0] > 110.0 && got[i][0] < 200.0 && got[i][2] > 80.0)
                .count();
            stage.app.world_mut().despawn(camera);
        }
        assert!(mixed[1] >= mixed[0] + 6, "mixed pixels without and with MSAA: {mixed:?}");
    }
}
