//! Pins and pulls.

use bevy::camera::{NormalizedRenderTarget, RenderTarget};
use bevy::picking::backend::HitData;
use bevy::picking::events::{DragEnd, DragStart, Pointer};
use bevy::picking::pointer::{Location, PointerButton, PointerId};

use super::*;
use crate::SplatSubset;

fn beam(app: &mut App) -> Entity {
    let part = spawn(app, block(Vec3::new(0.3, 0.1, 0.1), 24), Transform::from_xyz(0.0, 2.0, 0.0), coarse(), foam());
    ready_in_place(app, part);
    part
}

fn left_end() -> PinRegion {
    PinRegion::Box { center: Vec3::NEG_X * 0.3, half_size: Vec3::new(0.06, 0.2, 0.2), rotation: Quat::IDENTITY }
}

#[test]
fn what_is_pinned_stays_and_the_rest_hangs_from_it() {
    let mut app = app();
    let part = beam(&mut app);
    app.world_mut().entity_mut(part).insert(Pin { region: left_end(), target: None });
    for _ in 0..120 {
        app.update();
    }
    let body = state(&app, part).body();
    let held = body.point_position(DVec3::NEG_X * 0.29);
    let free = body.point_position(DVec3::X * 0.29);
    assert!(held.distance(DVec3::new(-0.29, 2.0, 0.0)) < 0.003, "{held}");
    assert!(free.y < held.y - 1e-4 && free.y > 1.9, "{free}");
    app.world_mut().entity_mut(part).remove::<Pin>();
    for _ in 0..30 {
        app.update();
    }
    assert!(center(&app, part).y < 1.5);
}

#[test]
fn a_pin_follows_its_target_and_lets_go_when_that_is_gone() {
    let mut app = app();
    let part = beam(&mut app);
    let hand = app.world_mut().spawn(Transform::from_xyz(-0.3, 2.0, 0.0)).id();
    // On a child, so that there could be several; by Gaussians.
    let cloud =
        &app.world().resource::<Assets<SplatCloud>>().get(&app.world().get::<Splats>(part).unwrap().0).unwrap().cloud;
    let ids: Vec<u32> = (0..cloud.len() as u32).filter(|&id| cloud.means()[id as usize].x < -0.25).collect();
    let region = PinRegion::Selection(SplatSubset(ids.into()));
    app.world_mut().spawn((Pin { region, target: Some(hand) }, ChildOf(part)));
    for k in 0..64 {
        let at = Transform::from_xyz(-0.3 + k as f32 / 64.0, 2.0 + k as f32 / 64.0, 0.0);
        *app.world_mut().get_mut::<Transform>(hand).unwrap() = at;
        app.update();
    }
    for _ in 0..64 {
        app.update();
    }
    let moved = 63.0 / 64.0;
    let held = state(&app, part).body().point_position(DVec3::NEG_X * 0.29);
    assert!(held.distance(DVec3::new(-0.29 + moved, 2.0 + moved, 0.0)) < 0.01, "{held}");
    app.world_mut().despawn(hand);
    for _ in 0..30 {
        app.update();
    }
    assert!(center(&app, part).y < 2.5);
}

#[test]
fn a_pointer_takes_hold_of_a_part_and_lets_it_go() {
    let mut app = app();
    let part = beam(&mut app);
    app.world_mut().entity_mut(part).insert(ElasticDrag::default());
    let camera = app.world_mut().spawn((Camera3d::default(), Transform::default())).id();
    let target = RenderTarget::None { size: UVec2::ONE }.normalize(None).unwrap();
    let here = |target: &NormalizedRenderTarget| Location { target: target.clone(), position: Vec2::ZERO };
    let grabbed = Vec3::new(0.3, 2.0, 0.0);
    let hit = HitData::new(camera, 1.0, Some(grabbed), Some(Vec3::X));
    let start = DragStart { button: PointerButton::Primary, hit };
    app.world_mut().trigger(Pointer::new(PointerId::Mouse, here(&target), start, part));
    app.world_mut().flush();
    let grab = *app.world().get::<ElasticGrab>(part).unwrap();
    assert!(grab.point.distance(Vec3::X * 0.3) < 1e-4 && grab.target.distance(grabbed) < 1e-4, "{grab:?}");
    app.world_mut().get_mut::<ElasticGrab>(part).unwrap().target = Vec3::new(0.5, 3.0, 0.2);
    for _ in 0..200 {
        app.update();
    }
    // It hangs from the pointer: 28 mm below at 3 Hz, and less than its own length.
    let held = state(&app, part).body().point_position(grab.point.as_dvec3());
    assert!(held.distance(DVec3::new(0.5, 2.97, 0.2)) < 0.03, "{held}");
    assert!(center(&app, part).y < 2.9 && center(&app, part).y > 2.4);
    let end = DragEnd { button: PointerButton::Primary, distance: Vec2::ZERO };
    app.world_mut().trigger(Pointer::new(PointerId::Mouse, here(&target), end, part));
    app.world_mut().flush();
    assert!(app.world().get::<ElasticGrab>(part).is_none());
    for _ in 0..30 {
        app.update();
    }
    assert!(center(&app, part).y < 2.0);
}
