//! Captures bent by a cage.

use std::sync::Arc;

use bevy::camera::primitives::Aabb;
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;
use bevy_splat::prelude::*;
use splat_core::deform::{Cage, Deformation};
use splat_raster::{Instance, Scene};

use crate::harness::*;

/// A ball of radius 1.5 bent to an arc, `by` times.
fn pose(by: f32) -> Arc<Deformation> {
    let cage = Cage { origin: Vec3::splat(-1.6), cell: 0.2, cells: UVec3::splat(16) };
    let bend = |p: Vec3| Quat::from_rotation_z(by * p.x) * (p * Vec3::new(1.0, 1.0 - 0.3 * by, 1.0 + 0.2 * by));
    Arc::new(Deformation::from_fn(cage, bend).unwrap())
}

#[test]
fn bent_captures_are_drawn_in_every_pose_and_straight_again_without() {
    if !device() {
        return;
    }
    let cloud = ball(300, 1.5, [0.8, 0.4, 0.2]);
    for backend in backends() {
        let mut stage = Stage::new(backend);
        let splats = stage.splats(&cloud, ());
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        let camera = stage.camera(&canvas, ());
        let straight = stage.picture(&canvas, "straight");
        let mut gone = Vec::new();
        for by in [0.2, 0.5, 0.9] {
            let deformation = pose(by);
            gone.push(Arc::downgrade(&deformation));
            stage.app.world_mut().entity_mut(splats).insert(SplatDeformation(deformation.clone()));
            stage.frame();
            let got = stage.read(&canvas, &format!("bent_{by}_{backend:?}"));
            let instance = Instance { deformation: Some(deformation), ..Instance::new(cloud.clone()) };
            let scene = Scene { instances: vec![instance] };
            let expected = over(&stage.expected(camera, &scene, None), |_| CLEAR);
            assert_near(&format!("bent_{by}_{backend:?}"), &got, &expected, 2.0, 0);
            let moved = got.iter().zip(&straight).filter(|(a, b)| (a[0] - b[0]).abs() > 20.0).count();
            assert!(moved > 50, "{moved} pixels show the bend");
        }
        // Standing still, the picture is taken again.
        stage.frame();
        stage.frame();
        let stats = stage.app.world().resource::<SplatRenderStats>();
        assert!(backend == SplatBackend::Gpu || stats.views[0].reused, "{stats:?}");
        stage.app.world_mut().entity_mut(splats).remove::<SplatDeformation>();
        for _ in 0..3 {
            stage.frame();
        }
        assert_eq!(stage.read(&canvas, "straight_again"), straight);
        assert!(gone.iter().all(|pose| pose.upgrade().is_none()), "poses of the past are freed");
        stage.app.world_mut().entity_mut(splats).insert(SplatDeformation(pose(0.3)));
        let last = Arc::downgrade(&stage.app.world().get::<SplatDeformation>(splats).unwrap().0);
        stage.frame();
        stage.app.world_mut().despawn(splats);
        for _ in 0..4 {
            stage.frame();
        }
        assert!(last.upgrade().is_none(), "and with the entity the last");
        assert_eq!(stage.app.world().resource::<SplatRenderStats>().gpu_clouds, 0);
    }
}

#[test]
fn boxes_follow_the_pose_so_that_what_is_bent_into_view_is_drawn() {
    if !device() {
        return;
    }
    let cloud = ball(100, 1.0, [0.8, 0.4, 0.2]);
    let mut stage = Stage::new(SplatBackend::Cpu);
    // Far to the side of what the camera sees.
    let splats = stage.splats(&cloud, Transform::from_xyz(50.0, 0.0, 0.0));
    let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
    stage.camera(&canvas, ());
    let nothing = stage.picture(&canvas, "beside");
    let straight = *stage.app.world().get::<Aabb>(splats).unwrap();
    let cage = Cage { origin: Vec3::splat(-1.2), cell: 0.3, cells: UVec3::splat(8) };
    let shifted = Arc::new(Deformation::from_fn(cage, |p| p - Vec3::X * 50.0).unwrap());
    stage.app.world_mut().entity_mut(splats).insert(SplatDeformation(shifted));
    for _ in 0..2 {
        stage.frame();
    }
    let bent = *stage.app.world().get::<Aabb>(splats).unwrap();
    assert!((bent.center.x + 50.0).abs() < 1.0 && bent.half_extents.max_element() < 3.0, "{bent:?}");
    assert_ne!(stage.read(&canvas, "shifted"), nothing);
    stage.app.world_mut().entity_mut(splats).remove::<SplatDeformation>();
    stage.frame();
    assert_eq!(*stage.app.world().get::<Aabb>(splats).unwrap(), straight);
}
