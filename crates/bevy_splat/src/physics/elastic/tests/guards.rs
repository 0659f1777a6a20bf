//! What is not sound is never drawn.

use super::*;

fn floating(app: &mut App) -> Entity {
    let part = spawn(app, ball(0.15, 2000), Transform::from_xyz(0.0, 1.0, 0.0), coarse(), foam());
    ready_in_place(app, part);
    app.update();
    part
}

/// Runs a while after something bad: the part is frozen, says so once, and moves again when it is placed.
fn frozen_and_mended(app: &mut App, part: Entity, at: Vec3) {
    let mut told = messages::<ElasticExploded>(app);
    for _ in 0..5 {
        app.update();
        told.extend(messages::<ElasticExploded>(app));
        assert!(sound(app, part));
    }
    assert_eq!(told, [ElasticExploded { part }]);
    assert!(state(app, part).is_frozen());
    assert!(app.world().get::<Transform>(part).unwrap().translation.distance(at) < 0.05);
    app.world_mut().entity_mut(part).remove::<(Pin, ElasticGrab)>();
    app.world_mut().get_mut::<Transform>(part).unwrap().translation = Vec3::Y * 5.0;
    for _ in 0..20 {
        app.update();
        assert!(sound(app, part));
    }
    assert!(!state(app, part).is_frozen());
    assert!(center(app, part).y < 4.9);
    assert!(messages::<ElasticExploded>(app).is_empty());
}

#[test]
fn an_absurd_impulse_freezes_the_part() {
    for impulse in [Vec3::X * 1e12, Vec3::NAN, Vec3::INFINITY] {
        let mut app = app();
        let part = floating(&mut app);
        let at = app.world().get::<Transform>(part).unwrap().translation;
        app.world_mut().write_message(ElasticPush { part, point: at + Vec3::Y * 0.1, impulse });
        app.update();
        frozen_and_mended(&mut app, part, at);
    }
}

#[test]
fn a_target_that_is_no_place_freezes_the_part() {
    let mut app = app();
    let part = floating(&mut app);
    let at = app.world().get::<Transform>(part).unwrap().translation;
    let hand = app.world_mut().spawn(Transform::default()).id();
    app.world_mut().entity_mut(part).insert(Pin { target: Some(hand), ..default() });
    app.update();
    app.world_mut().get_mut::<Transform>(hand).unwrap().translation = Vec3::splat(f32::NAN);
    app.update();
    frozen_and_mended(&mut app, part, at);

    let mut app = self::app();
    let part = floating(&mut app);
    let at = app.world().get::<Transform>(part).unwrap().translation;
    app.world_mut().entity_mut(part).insert(ElasticGrab::new(Vec3::ZERO, Vec3::NAN));
    app.update();
    frozen_and_mended(&mut app, part, at);
}

#[test]
fn a_transform_that_is_no_place_is_put_back() {
    let mut app = app();
    let part = floating(&mut app);
    let at = app.world().get::<Transform>(part).unwrap().translation;
    app.world_mut().get_mut::<Transform>(part).unwrap().translation.x = f32::NAN;
    app.update();
    assert!(sound(&app, part));
    frozen_and_mended(&mut app, part, at);
}
