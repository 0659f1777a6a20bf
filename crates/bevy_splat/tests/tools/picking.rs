//! What pointers hit.

use std::sync::Arc;

use bevy::camera::Viewport;
use bevy::camera::visibility::RenderLayers;
use bevy::picking::Pickable;
use bevy::picking::backend::PointerHits;
use bevy::prelude::*;
use bevy_splat::prelude::*;
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Frame, Rasterizer, Scene};

use crate::harness::{BEAR, ROOM, SIZE, Stage, instance};

fn pixels() -> Vec<Vec2> {
    let at = |k: u32| Vec2::new(((37 + 79 * k) % SIZE.x) as f32, ((29 + 53 * k) % SIZE.y) as f32);
    (0..9).map(at).chain([BEAR]).collect()
}

/// Who is hit at a pixel by the whole picture: instance and Gaussian.
fn drawn(stage: &Stage, scene: &Scene, at: Vec2) -> Option<(usize, u32)> {
    let hits = CpuRasterizer::new().first_hits(scene, &stage.view(), 0.5).unwrap();
    let id = hits[at.y as usize * SIZE.x as usize + at.x as usize];
    (id != Frame::NO_ID).then(|| scene.locate(id).unwrap())
}

#[test]
fn a_pointer_hits_the_gaussian_that_the_picture_names_with_an_index_and_without() {
    let mut stage = Stage::new();
    let hits = CpuRasterizer::new().first_hits(&stage.scene(), &stage.view(), 0.5).unwrap();
    let view = stage.view();
    for round in 0..2 {
        for at in pixels() {
            stage.forget::<PointerHits>();
            stage.point(at);
            let expected = hits[at.y as usize * SIZE.x as usize + at.x as usize];
            let Some((entity, hit, data)) = stage.hit() else {
                assert_eq!(expected, Frame::NO_ID, "round {round}, {at}");
                continue;
            };
            assert_eq!(
                (entity, hit.splats, hit.gaussian),
                (stage.capture, stage.capture, expected),
                "round {round}, {at}"
            );
            assert!(!hit.locked && hit.weight > 0.0 && hit.view_depth > 0.0);
            let (position, normal) = (data.position.unwrap(), data.normal.unwrap());
            let (pixel, z) = view.project(position).unwrap();
            assert!(pixel.distance(at + 0.5) < 1.0, "{pixel} for {at}");
            assert!(normal.is_normalized() && normal.dot(view.forward()) < 0.1, "{normal}");
            // From the near plane along the ray, as meshes are measured.
            let ray = (position - view.pose.position).length();
            assert!((data.depth - ray * (1.0 - view.near / z)).abs() < 1e-2 * ray, "{} of {ray}", data.depth);
        }
        stage.until_indexed();
    }
}

#[test]
fn two_captures_in_each_other_are_hit_in_one_order() {
    let mut stage = Stage::new();
    let beside = UPRIGHT.with_translation(Vec3::new(0.21, -0.1, 0.13));
    let other = stage.splats(beside);
    stage.app.update();
    let mut both = [(stage.capture, instance(UPRIGHT)), (other, instance(beside))];
    both.sort_by_key(|(entity, _)| *entity);
    let scene = Scene { instances: both.iter().map(|(_, instance)| instance.clone()).collect() };
    let mut seen = std::collections::HashSet::new();
    for at in pixels() {
        stage.forget::<PointerHits>();
        stage.point(at);
        let found = stage.hit().map(|(entity, hit, _)| (entity, hit.gaussian));
        let expected = drawn(&stage, &scene, at).map(|(k, gaussian)| (both[k].0, gaussian));
        assert_eq!(found, expected, "{at}");
        seen.extend(found.map(|f| f.0));
    }
    assert_eq!(seen.len(), 2, "the pixels show both captures");
}

#[test]
fn hidden_gaussians_are_not_hit_and_locked_ones_can_be_told_apart() {
    let mut stage = Stage::new();
    stage.point(BEAR);
    let (_, first, _) = stage.hit().unwrap();
    let bear = ROOM.labels[first.gaussian as usize];
    let set = Selection::from_fn(ROOM.cloud.len(), |i| ROOM.labels[i] == bear);
    let capture = stage.capture;
    stage.app.world_mut().get_mut::<SplatFlags>(capture).unwrap().lock(&set);
    stage.point(BEAR);
    let (_, locked, _) = stage.hit().unwrap();
    assert_eq!(SplatHit { locked: false, ..locked }, first);
    assert!(locked.locked);
    stage.app.world_mut().get_mut::<SplatFlags>(capture).unwrap().hide(&set);
    stage.forget::<PointerHits>();
    stage.point(BEAR);
    let (_, behind, _) = stage.hit().unwrap();
    assert_ne!(ROOM.labels[behind.gaussian as usize], bear);
    let mut scene = stage.scene();
    scene.instances[0].hidden = Some(Arc::new(set));
    assert_eq!(Some((0, behind.gaussian)), drawn(&stage, &scene, BEAR));
}

#[test]
fn what_a_camera_does_not_draw_or_the_app_does_not_want_is_not_hit() {
    let mut stage = Stage::new();
    let capture = stage.capture;
    stage.point(BEAR);
    assert!(stage.hit().is_some());
    let silent = |stage: &mut Stage, what: &str| {
        stage.app.update();
        stage.forget::<PointerHits>();
        stage.point(BEAR);
        assert!(stage.hit().is_none(), "{what}");
    };
    stage.app.world_mut().entity_mut(capture).insert(RenderLayers::layer(3));
    silent(&mut stage, "another layer");
    stage.app.world_mut().entity_mut(capture).remove::<RenderLayers>().insert(InheritedVisibility::HIDDEN);
    silent(&mut stage, "hidden");
    stage.app.world_mut().entity_mut(capture).insert((InheritedVisibility::VISIBLE, Pickable::IGNORE));
    silent(&mut stage, "not pickable");
    stage.app.world_mut().entity_mut(capture).remove::<Pickable>();
    let camera = stage.camera;
    stage.app.world_mut().get_mut::<Camera>(camera).unwrap().is_active = false;
    silent(&mut stage, "no camera");
}

#[test]
fn what_does_not_block_is_hit_with_what_lies_behind() {
    let mut stage = Stage::new();
    let back = stage.splats(UPRIGHT.with_translation(Vec3::new(0.0, 0.0, -0.5)));
    let glass = Pickable { should_block_lower: false, is_hoverable: true };
    for entity in [stage.capture, back] {
        stage.app.world_mut().entity_mut(entity).insert(glass);
    }
    stage.app.update();
    stage.forget::<PointerHits>();
    stage.point(BEAR);
    let sent = stage.all::<PointerHits>();
    let entities: Vec<Entity> = sent[0].picks.iter().map(|pick| pick.0).collect();
    assert_eq!(entities.len(), 2);
    assert!(entities.contains(&back) && entities.contains(&stage.capture));
}

#[test]
fn viewports_move_and_scale_what_is_under_the_pointer() {
    let mut stage = Stage::new();
    stage.point(BEAR);
    let (_, plain, _) = stage.hit().unwrap();
    let camera = stage.camera;
    let mut eye = stage.app.world_mut().get_mut::<Camera>(camera).unwrap();
    let corner = UVec2::new(130, 40);
    eye.viewport = Some(Viewport { physical_position: corner, physical_size: SIZE, ..default() });
    let target = eye.computed.target_info.as_mut().unwrap();
    (target.physical_size, target.scale_factor) = (SIZE + corner, 2.0);
    stage.forget::<PointerHits>();
    stage.point((BEAR + corner.as_vec2() + 0.5) / 2.0);
    let (_, moved, _) = stage.hit().unwrap();
    assert_eq!(moved.gaussian, plain.gaussian);
    stage.forget::<PointerHits>();
    stage.point((corner.as_vec2() - 1.0) / 2.0);
    assert!(stage.hit().is_none());
}

#[derive(Resource, Default)]
struct Clicked(Vec<(&'static str, Entity, SplatHit)>);

fn listen(stage: &mut Stage, entity: Entity, name: &'static str) {
    stage.app.world_mut().entity_mut(entity).observe(move |click: On<Pointer<Click>>, mut clicked: ResMut<Clicked>| {
        clicked.0.push((name, click.original_event_target(), *click.hit.extra_as::<SplatHit>().unwrap()));
    });
}

#[test]
fn clicks_reach_the_part_that_is_hit_as_a_handle_and_as_an_entity_of_its_own() {
    let mut stage = Stage::new();
    stage.app.init_resource::<Clicked>();
    let capture = stage.capture;
    stage.point(BEAR);
    let bear = ROOM.labels[stage.hit().unwrap().1.gaussian as usize];
    let set = Selection::from_fn(ROOM.cloud.len(), |i| ROOM.labels[i] == bear);
    stage.select(SelectMode::New, SelectBy::Set(set.clone()));
    stage.app.world_mut().write_message(MakePart { entity: capture, name: "bear".into() });
    stage.app.update();
    let part = stage.all::<PartMade>()[0].part.clone().unwrap();
    let parts = stage.app.world().get::<SplatParts>(capture).unwrap();
    assert_eq!((parts.get(part).unwrap().name.as_str(), parts.part_of(0)), ("bear", None));
    assert_eq!(parts.selection_of(part, default()), set);

    let handle = stage.app.world_mut().spawn((SplatPartHandle(part), ChildOf(capture))).id();
    listen(&mut stage, handle, "handle");
    listen(&mut stage, capture, "capture");
    stage.click(BEAR);
    let clicked = std::mem::take(&mut stage.app.world_mut().resource_mut::<Clicked>().0);
    let names: Vec<_> = clicked.iter().map(|(name, target, hit)| (*name, *target, hit.splats, hit.part)).collect();
    assert_eq!(names, [("handle", handle, capture, Some(part)), ("capture", handle, capture, Some(part))]);

    let entity = bevy_splat::parts::extract_part(stage.app.world_mut(), capture, part).unwrap();
    stage.app.world_mut().entity_mut(entity).insert(InheritedVisibility::VISIBLE);
    listen(&mut stage, entity, "part");
    stage.app.update();
    stage.click(BEAR);
    let clicked = std::mem::take(&mut stage.app.world_mut().resource_mut::<Clicked>().0);
    assert_eq!(clicked.len(), 1);
    let (name, target, hit) = clicked[0];
    assert_eq!((name, target, hit.splats, hit.part), ("part", entity, entity, Some(part)));
    assert_eq!(ROOM.labels[hit.gaussian as usize], bear);
}
