//! Elastic parts that meet each other, and obstacles that move.

use std::sync::Arc;

use splat_physics::world::RigidState;

use super::*;

fn momentum(app: &App, parts: &[Entity]) -> DVec3 {
    parts.iter().map(|&part| state(app, part).body().momentum()).sum()
}

#[test]
fn two_parts_that_meet_keep_their_momentum_and_do_not_pass_through_each_other() {
    let mut app = app();
    app.insert_resource(ElasticGravity(Vec3::ZERO));
    let left = spawn(&mut app, ball(0.1, 2000), Transform::from_xyz(-0.16, 0.0, 0.0), coarse(), foam());
    let heavy = PhysicsMaterial { density: 180.0, ..foam() };
    let right = spawn(&mut app, ball(0.1, 2000), Transform::from_xyz(0.16, 0.01, 0.0), coarse(), heavy);
    ready(&mut app, left);
    ready(&mut app, right);
    let mass = state(&app, left).body().model().mass().mass as f32;
    app.world_mut().write_message(ElasticPush { part: left, point: Vec3::NEG_X * 0.16, impulse: Vec3::X * 2.0 * mass });
    app.update();
    let before = momentum(&app, &[left, right]);
    let mut touched = false;
    for _ in 0..64 {
        app.update();
        touched |= messages::<ElasticContact>(&app).iter().any(|c| c.other == Some(left) || c.other == Some(right));
        let apart = center(&app, left).distance(center(&app, right));
        assert!(apart > 0.13, "{apart}");
    }
    let after = momentum(&app, &[left, right]);
    assert!(touched);
    assert!(after.distance(before) < 0.01 * before.length(), "{before} {after}");
    let speed = |part| (state(&app, part).body().momentum() / state(&app, part).body().model().mass().mass).x;
    // Between inelastic and elastic, with masses 1 and 3.
    assert!((0.45..1.05).contains(&speed(right)), "{}", speed(right));
    assert!(speed(left) < speed(right), "{}", speed(left));
}

#[test]
fn parts_of_layers_that_do_not_touch_pass_through_each_other() {
    let mut app = app();
    app.insert_resource(ElasticGravity(Vec3::ZERO));
    let left = spawn(&mut app, ball(0.1, 1000), Transform::from_xyz(-0.15, 0.0, 0.0), coarse(), foam());
    let right = spawn(&mut app, ball(0.1, 1000), Transform::from_xyz(0.15, 0.0, 0.0), coarse(), foam());
    ready(&mut app, left);
    ready(&mut app, right);
    let apart = move |mut states: Query<(Entity, &mut ElasticState)>| {
        for (entity, mut state) in &mut states {
            state.layers.filters = if entity == left { 2 } else { u32::MAX };
        }
    };
    app.add_systems(FixedPostUpdate, apart.in_set(ElasticPrepareSystems::Gather));
    let mass = state(&app, left).body().model().mass().mass as f32;
    let stood = center(&app, right);
    app.world_mut().write_message(ElasticPush { part: left, point: Vec3::NEG_X * 0.15, impulse: Vec3::X * 2.0 * mass });
    for _ in 0..20 {
        app.update();
        assert!(messages::<ElasticContact>(&app).is_empty());
    }
    assert!(center(&app, left).x > 0.3);
    assert!(center(&app, right).distance(stood) < 1e-9);
}

#[test]
fn a_part_that_lies_on_another_rests_there() {
    let mut app = app();
    app.insert_resource(ElasticGround::plane(Dir3::Y, 0.0));
    let slab = Vec3::new(0.2, 0.1, 0.2);
    let low = spawn(&mut app, block(slab, 20), Transform::from_xyz(0.0, 0.105, 0.0), coarse(), foam());
    let high = spawn(&mut app, block(slab, 20), Transform::from_xyz(0.0, 0.315, 0.0), coarse(), foam());
    ready_in_place(&mut app, low);
    ready_in_place(&mut app, high);
    for _ in 0..500 {
        app.update();
    }
    let (a, b) = (center(&app, low), center(&app, high));
    for part in [low, high] {
        let body = state(&app, part).body();
        let speed = body.momentum().length() / body.model().mass().mass;
        assert!(speed < 0.2, "{a} {b} {speed}");
    }
    assert!((a.y - 0.1).abs() < 0.015 && (b.y - 0.3).abs() < 0.03, "{a} {b}");
    assert!(b.xz().length() < 0.03, "{b}");
}

/// A ball that an engine of its own moves.
#[derive(Debug)]
struct Sphere {
    center: DVec3,
    radius: f64,
}

impl ObstacleShape for Sphere {
    fn nearest(&self, point: DVec3, _inside: DVec3, reach: f64) -> Option<(f64, DVec3)> {
        let away = point - self.center;
        let gap = away.length() - self.radius;
        (gap < reach).then(|| (gap, away.normalize_or(DVec3::Y)))
    }
}

#[test]
fn another_engine_can_put_its_bodies_among_the_obstacles() {
    #[derive(Resource)]
    struct Engine {
        center: DVec3,
        velocity: DVec3,
        mass: f64,
    }
    let mut app = app();
    app.insert_resource(ElasticGravity(Vec3::ZERO));
    let part = spawn(&mut app, ball(0.1, 2000), Transform::default(), coarse(), foam());
    ready(&mut app, part);
    let mass = state(&app, part).body().model().mass().mass;
    app.insert_resource(Engine { center: DVec3::X * 0.35, velocity: DVec3::NEG_X * 2.0, mass });
    let put = |engine: Res<Engine>, mut obstacles: ResMut<ElasticObstacles>| {
        let state = RigidState {
            mass: engine.mass,
            inertia: bevy::math::DMat3::IDENTITY * 0.4 * engine.mass * 0.01,
            center: engine.center,
            linear_velocity: engine.velocity,
            angular_velocity: DVec3::ZERO,
        };
        obstacles.push(ElasticObstacle {
            motion: ObstacleMotion::Free { state, asleep: false },
            shape: Arc::new(Sphere { center: engine.center, radius: 0.1 }),
            ..ElasticObstacle::still(PlaneShape { normal: DVec3::Y, offset: 0.0 })
        });
    };
    let take = |mut engine: ResMut<Engine>, shoves: Res<ElasticShoves>, tick: Res<step::ElasticTick>| {
        for shove in shoves.iter() {
            assert_eq!(shove.obstacle, 0);
            engine.velocity += shove.linear;
        }
        let velocity = engine.velocity;
        engine.center += velocity * tick.0;
    };
    app.add_systems(
        FixedPostUpdate,
        (put.in_set(ElasticPrepareSystems::Obstacles), take.after(crate::physics::SplatPhysicsSystems::Step)),
    );
    for _ in 0..64 {
        app.update();
    }
    let engine = app.world().resource::<Engine>();
    let total = engine.velocity * engine.mass + state(&app, part).body().momentum();
    assert!(total.distance(DVec3::NEG_X * 2.0 * mass) < 0.01 * 2.0 * mass, "{total}");
    let speed = -(state(&app, part).body().momentum() / mass).x;
    assert!((0.95..2.05).contains(&speed), "{speed}");
}
