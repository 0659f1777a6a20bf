//! Pointers and selections on a bent capture: what is meant is what is seen.

use std::sync::Arc;

use bevy::picking::backend::PointerHits;
use bevy::prelude::*;
use bevy_splat::prelude::*;
use splat_core::deform::{Cage, Deformation};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Frame, Instance, Rasterizer, Scene};
use splat_segment::project::{Lift, lift};

use crate::harness::{BEAR, ROOM, SIZE, Stage, instance};

/// The room, twisted about its upright axis and bent a little.
fn bent(stage: &mut Stage) -> Scene {
    let (low, high) =
        ROOM.cloud.means().iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let cell = (high - low).max_element() / 12.0;
    let cells = ((high - low) / cell).ceil().as_uvec3().max(UVec3::ONE);
    let cage = Cage { origin: low, cell, cells };
    let middle = 0.5 * (low + high);
    let twist = |p: Vec3| Quat::from_rotation_y(0.15 * (p.y - middle.y) / cell) * (p - middle) * 1.05 + middle;
    let deformation = Arc::new(Deformation::from_fn(cage, twist).unwrap());
    let capture = stage.capture;
    stage.app.world_mut().entity_mut(capture).insert(SplatDeformation(deformation.clone()));
    stage.app.update();
    Scene { instances: vec![Instance { deformation: Some(deformation), ..instance(UPRIGHT) }] }
}

#[test]
fn pointers_hit_what_the_bent_picture_shows_with_an_index_and_without() {
    let mut stage = Stage::new();
    let scene = bent(&mut stage);
    let view = stage.view();
    let hits = CpuRasterizer::new().first_hits(&scene, &view, 0.5).unwrap();
    let straight = CpuRasterizer::new().first_hits(&stage.scene(), &view, 0.5).unwrap();
    let mut others = 0;
    for _ in 0..2 {
        for k in 0..8u32 {
            let at = Vec2::new(((37 + 79 * k) % SIZE.x) as f32, ((29 + 53 * k) % SIZE.y) as f32);
            stage.forget::<PointerHits>();
            stage.point(at);
            let pixel = at.y as usize * SIZE.x as usize + at.x as usize;
            let found = stage.hit().map_or(Frame::NO_ID, |(_, hit, _)| hit.gaussian);
            assert_eq!(found, hits[pixel], "{at}");
            others += usize::from(found != straight[pixel]);
        }
        stage.until_indexed();
    }
    assert!(others > 4, "the bend moves what is under a pixel: {others}");
}

#[test]
fn selections_in_a_view_are_those_of_the_bent_state() {
    let mut stage = Stage::new();
    let scene = bent(&mut stage);
    let (camera, view) = (stage.camera, stage.view());
    let shape = Shape2d::Stroke { points: vec![BEAR], radius: 20.0 };
    let mask = shape.mask(SIZE.x, SIZE.y);
    let (footprint, tolerance) = (Footprint::Ellipse, DepthTolerance::default());
    for (by, how) in [
        (SelectBy::Frustum { camera, shape: shape.clone(), footprint }, Lift::Frustum(footprint)),
        (SelectBy::Depth { camera, shape: shape.clone(), footprint, tolerance }, Lift::Depth(footprint, tolerance)),
        (SelectBy::Surface { camera, shape: shape.clone() }, Lift::Surface(0.5)),
    ] {
        stage.select(SelectMode::New, by);
        let expected = lift(&mut CpuRasterizer::new(), &scene, &view, &mask, how).unwrap();
        assert_eq!(stage.selection(), expected, "{how:?}");
        let straight = lift(&mut CpuRasterizer::new(), &stage.scene(), &view, &mask, how).unwrap();
        assert!(expected.count() > 10 && expected != straight, "{how:?}");
    }
}
