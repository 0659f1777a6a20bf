//! What is gone is freed.

use std::sync::Arc;

use bevy::prelude::*;
use bevy::render::error_handler::{ErrorType, RenderErrorHandler, RenderErrorPolicy};
use bevy::render::render_resource::{PollType, TextureFormat};
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::RenderCreation;
use bevy_splat::prelude::*;

use crate::harness::*;

#[test]
fn clouds_and_cameras_that_are_gone_are_freed() {
    if !device() {
        return;
    }
    for backend in backends() {
        let mut stage = Stage::new(backend);
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        let cloud = ball(100, 1.0, [0.9, 0.3, 0.1]);
        let gone = Arc::downgrade(&cloud);
        let splats = [stage.splats(&cloud, ()), stage.splats(&cloud, Transform::from_xyz(1.0, 0.0, 0.0))];
        let camera = stage.camera(&canvas, ());
        stage.picture(&canvas, "kept");
        stage.frame();
        let stats = stage.app.world().resource::<SplatRenderStats>();
        assert_eq!((stats.kept_views, stats.views.len(), stats.views[0].instances), (1, 1, 2));
        for entity in splats {
            stage.app.world_mut().despawn(entity);
        }
        drop(cloud);
        for _ in 0..4 {
            stage.frame();
        }
        let stats = stage.app.world().resource::<SplatRenderStats>().clone();
        assert_eq!((stats.gpu_clouds, stats.kept_views, stats.views.len()), (0, 0, 0));
        assert!(gone.upgrade().is_none(), "nothing holds the Gaussians any more");
        stage.app.world_mut().despawn(camera);
    }
}

#[test]
fn a_reloaded_capture_replaces_the_old_one() {
    if !device() {
        return;
    }
    for backend in backends() {
        let mut stage = Stage::new(backend);
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        let (red, blue) = (ball(100, 1.0, [0.9, 0.1, 0.1]), ball(300, 1.0, [0.1, 0.1, 0.9]));
        let gone = Arc::downgrade(&red);
        let splats = stage.splats(&red, ());
        stage.camera(&canvas, ());
        let middle = (SIZE.x * 32 + 48) as usize;
        assert!(stage.picture(&canvas, "red")[middle][0] > 150.0);
        drop(red);
        let handle = stage.app.world().get::<Splats>(splats).unwrap().0.clone();
        stage.app.world_mut().resource_mut::<Assets<SplatCloud>>().get_mut(&handle).unwrap().cloud = blue;
        let after = stage.picture(&canvas, "blue")[middle];
        assert!(after[2] > 150.0 && after[0] < 140.0, "{after:?}");
        assert!(gone.upgrade().is_none());
    }
}

#[test]
fn a_thousand_captures_come_and_go_without_a_trace() {
    if !device() {
        return;
    }
    for backend in backends() {
        let mut stage = Stage::new(backend);
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        let viewport = bevy::camera::Viewport { physical_size: UVec2::new(16, 16), ..default() };
        stage.camera(&canvas, Camera { viewport: Some(viewport), ..default() });
        let cloud = ball(20, 1.0, [0.9, 0.3, 0.1]);
        let mut entities = 0;
        for cycle in 0..1000 {
            let splats = stage.splats(&Arc::new((*cloud).clone()), ());
            stage.app.update();
            stage.app.world_mut().despawn(splats);
            if cycle == 10 {
                stage.app.update();
                entities = stage.app.world().entities().count_spawned();
            }
        }
        for _ in 0..3 {
            stage.frame();
        }
        assert_eq!(stage.app.world().entities().count_spawned(), entities);
        assert_eq!(stage.app.world().resource::<Assets<SplatCloud>>().len(), 0);
        let stats = stage.app.world().resource::<SplatRenderStats>();
        assert_eq!((stats.gpu_clouds, stats.kept_views), (0, 0));
    }
}

#[test]
fn a_lost_device_is_replaced() {
    if !device() {
        return;
    }
    for backend in backends() {
        let mut stage = Stage::new(backend);
        stage.app.insert_resource(RenderErrorHandler(|error, _, _| match error.ty {
            ErrorType::DeviceLost => RenderErrorPolicy::Recover(RenderCreation::default()),
            _ => panic!("wgpu: {}", error.description),
        }));
        let cloud = ball(200, 1.2, [0.9, 0.3, 0.1]);
        stage.splats(&cloud, ());
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        stage.camera(&canvas, SplatCamera { background: SplatBackground::Read, ..default() });
        let before = stage.picture(&canvas, "before_loss");
        let device = stage.app.world().resource::<RenderDevice>();
        device.wgpu_device().destroy();
        // The loss is told while the device is polled.
        let _ = device.poll(PollType::wait_indefinitely());
        for _ in 0..20 {
            stage.app.update();
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let after = stage.picture(&canvas, &format!("after_loss_{backend:?}"));
        assert_near("after_loss", &after, &before, 0.0, 0);
    }
}
