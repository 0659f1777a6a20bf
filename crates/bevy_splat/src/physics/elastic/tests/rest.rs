//! Falling, resting, sleeping, waking, being put elsewhere.

use super::*;

fn fall(app: &mut App) -> Entity {
    app.insert_resource(ElasticGround::plane(Dir3::Y, 0.0));
    let part = spawn(app, ball(0.15, 3000), Transform::from_xyz(0.0, 0.25, 0.0), coarse(), foam());
    ready_in_place(app, part);
    part
}

/// Runs until the part sleeps; the messages that it slept.
fn until_asleep(app: &mut App, part: Entity) -> Vec<ElasticSlept> {
    for _ in 0..1500 {
        app.update();
        assert!(sound(app, part));
        if state(app, part).is_asleep() {
            return messages(app);
        }
    }
    panic!("it never rested: {} J", state(app, part).body().kinetic_energy());
}

#[test]
fn a_soft_ball_falls_rests_on_the_ground_and_sleeps() {
    let mut app = app();
    let part = fall(&mut app);
    let mut touched = false;
    for _ in 0..40 {
        app.update();
        for contact in messages::<ElasticContact>(&app) {
            assert_eq!((contact.part, contact.other), (part, None));
            assert!(
                contact.impulse.y > 0.0 && contact.normal == Vec3::Y && contact.point.y.abs() < 0.05,
                "{contact:?}"
            );
            touched = true;
        }
    }
    assert!(touched);
    assert_eq!(until_asleep(&mut app, part), [ElasticSlept { part }]);
    let height = center(&app, part).y;
    assert!((0.11..0.155).contains(&height), "{height}");
    // Asleep, nothing changes.
    app.update();
    app.update();
    let before = shown(&app, part);
    app.update();
    assert_eq!(shown(&app, part), before);
}

#[test]
fn gravity_and_pushes_wake_what_sleeps() {
    let mut app = app();
    let part = fall(&mut app);
    until_asleep(&mut app, part);
    app.insert_resource(ElasticGravity(Vec3::new(1.0, -9.81, 0.0)));
    app.update();
    assert!(!state(&app, part).is_asleep());
    assert_eq!(messages::<ElasticWoke>(&app), [ElasticWoke { part }]);
    app.insert_resource(ElasticGravity::default());
    until_asleep(&mut app, part);
    let at = center(&app, part);
    let mass = state(&app, part).body().model().mass().mass as f32;
    let impulse = Vec3::new(0.0, 3.0, 0.0) * mass;
    app.world_mut().write_message(ElasticPush { part, point: at.as_vec3(), impulse });
    app.update();
    let speed = state(&app, part).body().momentum().y / f64::from(mass);
    assert!((2.0..3.0).contains(&speed), "{speed}");
    for _ in 0..10 {
        app.update();
    }
    assert!(center(&app, part).y > at.y + 0.2, "{}", center(&app, part).y - at.y);
}

#[test]
fn a_transform_that_was_written_is_where_the_part_is() {
    let mut app = app();
    app.insert_resource(ElasticGravity(Vec3::ZERO));
    let part = spawn(&mut app, block(Vec3::new(0.2, 0.1, 0.1), 20), Transform::default(), coarse(), foam());
    ready(&mut app, part);
    let mass = state(&app, part).body().model().mass().mass as f32;
    app.world_mut().write_message(ElasticPush { part, point: Vec3::ZERO, impulse: Vec3::X * mass });
    for _ in 0..5 {
        app.update();
    }
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let there = Transform::from_xyz(5.0, 6.0, 7.0).with_rotation(turn);
    *app.world_mut().get_mut::<Transform>(part).unwrap() = there;
    app.update();
    // It goes on as it moved, turned along, and is nowhere in between.
    let step = STEP.as_secs_f32();
    let at = *app.world().get::<Transform>(part).unwrap();
    assert!(at.translation.distance(there.translation) < 2.0 * step, "{at:?}");
    assert!(at.rotation.angle_between(turn) < 0.05, "{at:?}");
    let velocity = state(&app, part).body().momentum() / f64::from(mass);
    assert!(velocity.distance(DVec3::Y) < 0.05, "{velocity}");
}

#[test]
fn what_is_drawn_lies_between_two_steps() {
    let mut app = app();
    let part = spawn(&mut app, ball(0.15, 2000), Transform::from_xyz(0.0, 9.0, 0.0), coarse(), foam());
    ready_in_place(&mut app, part);
    for _ in 0..16 {
        app.update();
    }
    // A third of a step each: most updates make none.
    app.insert_resource(TimeUpdateStrategy::ManualDuration(STEP / 3));
    let mut heights = Vec::new();
    // The first of them finish the full steps.
    app.update();
    app.update();
    for _ in 0..12 {
        app.update();
        heights.push(app.world().get::<Transform>(part).unwrap().translation.y);
    }
    // Even steps down, and no jump where a fixed step was made.
    let falls: Vec<f32> = heights.windows(2).map(|pair| pair[0] - pair[1]).collect();
    let (least, most) = falls.iter().fold((f32::MAX, 0.0_f32), |(l, m), f| (l.min(*f), m.max(*f)));
    assert!(least > 0.0 && most < 1.6 * least, "{falls:?}");
}

#[test]
fn two_runs_have_the_same_bits() {
    let run = || {
        let mut app = app();
        app.insert_resource(ElasticGround::plane(Dir3::Y, 0.0));
        let parts = [0.0, 0.05, 0.3].map(|x| {
            let at = Transform::from_xyz(x, 0.2 + 5.0 * x, 0.0).with_rotation(Quat::from_rotation_z(x));
            spawn(&mut app, block(Vec3::splat(0.1), 20), at, coarse(), foam())
        });
        parts.iter().for_each(|&part| ready_in_place(&mut app, part));
        for _ in 0..60 {
            app.update();
        }
        parts.map(|part| shown(&app, part))
    };
    assert_eq!(run(), run());
}
