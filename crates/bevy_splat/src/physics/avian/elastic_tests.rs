//! Elastic parts among avian3d's bodies.

use avian3d::prelude::*;
use bevy::math::DVec3;
use bevy::prelude::*;

use crate::physics::elastic::tests::{app, ball, block, center, coarse, foam, messages, ready, sound, spawn, state};
use crate::physics::elastic::{ElasticContact, ElasticPush};
use crate::physics::{PhysicsMaterial, SplatAvianPlugin};

fn world() -> App {
    let mut app = app();
    app.add_plugins((PhysicsPlugins::default(), SplatAvianPlugin));
    app.finish();
    app.cleanup();
    app
}

fn weightless() -> App {
    let mut app = world();
    app.insert_resource(Gravity(Vec3::ZERO));
    app
}

/// Sets a part up while nothing moves.
fn paused_until_ready(app: &mut App, parts: &[Entity]) {
    app.world_mut().resource_mut::<Time<Physics>>().pause();
    parts.iter().for_each(|&part| ready(app, part));
    app.world_mut().resource_mut::<Time<Physics>>().unpause();
}

fn cube(app: &mut App, side: f32, mass: f32, at: Vec3) -> Entity {
    let body = (RigidBody::Dynamic, Collider::cuboid(side, side, side), Transform::from_translation(at));
    let inertia = mass * side * side / 6.0;
    let mass = (Mass(mass), AngularInertia::new(Vec3::splat(inertia)), CenterOfMass::default());
    let plain = (NoAutoMass, NoAutoAngularInertia, NoAutoCenterOfMass, Friction::new(0.0), Restitution::new(0.0));
    app.world_mut().spawn((body, mass, plain)).id()
}

fn slow(app: &App, part: Entity) -> bool {
    let body = state(app, part).body();
    body.momentum().length() < 0.05 * body.model().mass().mass
}

#[test]
fn a_part_that_hits_a_free_cube_shares_its_momentum() {
    for ratio in [10.0, 1.0, 0.1, 0.03] {
        let mut app = weightless();
        let part = spawn(&mut app, block(Vec3::splat(0.1), 24), Transform::default(), coarse(), foam());
        paused_until_ready(&mut app, &[part]);
        let mass = state(&app, part).body().model().mass().mass;
        let cube = cube(&mut app, 0.2, (ratio * mass) as f32, Vec3::X * 0.22);
        // Avian puts slow bodies to sleep in flight.
        app.world_mut().entity_mut(cube).insert(SleepingDisabled);
        app.update();
        app.world_mut().write_message(ElasticPush { part, point: Vec3::ZERO, impulse: Vec3::X * mass as f32 });
        for _ in 0..64 {
            app.update();
        }
        let own = state(&app, part).body().momentum();
        let speed = app.world().get::<LinearVelocity>(cube).unwrap().0.as_dvec3();
        let total = own + speed * (ratio * mass);
        assert!(total.distance(DVec3::X * mass) < 0.01 * mass, "{ratio}: {total}, not {mass}");
        let (least, most) = (1.0 / (1.0 + ratio), 2.0 / (1.0 + ratio));
        assert!(speed.x > 0.98 * least && speed.x < 1.02 * most, "{ratio}: {least} {} {most}", speed.x);
        assert!(own.x / mass < speed.x + 0.02, "{ratio}: it went through");
    }
}

#[test]
fn a_part_falls_on_a_collider_and_tells_whom_it_touches() {
    let mut app = world();
    let shapes = [
        Collider::cuboid(2.0, 0.2, 2.0),
        Collider::half_space(Vec3::Y),
        Collider::trimesh(
            [[-1.0, 0.1, -1.0], [1.0, 0.1, -1.0], [1.0, 0.1, 1.0], [-1.0, 0.1, 1.0]].map(Vec3::from).to_vec(),
            vec![[0, 1, 2], [0, 2, 3]],
        ),
        Collider::voxels(Vec3::splat(0.1), &all_voxels()),
    ];
    let heights = [0.1, 0.0, 0.1, 0.1];
    let mut pairs = Vec::new();
    for (k, shape) in shapes.into_iter().enumerate() {
        let at = Vec3::X * 3.0 * k as f32;
        // A half space would be under all of them.
        if k == 1 {
            continue;
        }
        let floor = app.world_mut().spawn((RigidBody::Static, shape, Transform::from_translation(at))).id();
        let above = Transform::from_translation(at + Vec3::Y * (heights[k] + 0.2));
        pairs.push((spawn(&mut app, ball(0.15, 2000), above, coarse(), foam()), floor, heights[k]));
    }
    let parts: Vec<Entity> = pairs.iter().map(|pair| pair.0).collect();
    paused_until_ready(&mut app, &parts);
    let mut told = Vec::new();
    for _ in 0..600 {
        app.update();
        told.extend(messages::<ElasticContact>(&app));
    }
    for (part, floor, height) in pairs {
        assert!(told.iter().any(|contact| (contact.part, contact.other) == (part, Some(floor))));
        assert!(told.iter().all(|contact| contact.part != part || contact.other == Some(floor)));
        let rests = center(&app, part).y - f64::from(height);
        assert!((0.10..0.17).contains(&rests), "{rests}");
        assert!(slow(&app, part) && sound(&app, part));
    }
}

fn all_voxels() -> Vec<IVec3> {
    (-10..10).flat_map(|x| (-2..1).flat_map(move |y| (-10..10).map(move |z| IVec3::new(x, y, z)))).collect()
}

#[test]
fn layers_and_pause_are_avians() {
    let mut app = world();
    app.world_mut().spawn((RigidBody::Static, Collider::cuboid(4.0, 0.2, 4.0), CollisionLayers::from_bits(2, 2)));
    let part = spawn(&mut app, ball(0.15, 1500), Transform::from_xyz(0.0, 0.4, 0.0), coarse(), foam());
    app.world_mut().entity_mut(part).insert(CollisionLayers::from_bits(1, u32::MAX));
    paused_until_ready(&mut app, &[part]);
    assert!((center(&app, part).y - 0.4).abs() < 1e-3);
    for _ in 0..64 {
        app.update();
    }
    assert!(center(&app, part).y < -1.0);
}

#[test]
fn a_cube_rests_on_a_part() {
    let mut app = world();
    app.world_mut().spawn((RigidBody::Static, Collider::cuboid(4.0, 0.2, 4.0), Transform::from_xyz(0.0, -0.1, 0.0)));
    let firm = PhysicsMaterial { youngs_modulus: 3e5, density: 200.0, ..foam() };
    let slab = block(Vec3::new(0.3, 0.1, 0.3), 24);
    let part = spawn(&mut app, slab, Transform::from_xyz(0.0, 0.105, 0.0), coarse(), firm);
    paused_until_ready(&mut app, &[part]);
    let cube = cube(&mut app, 0.2, 4.0, Vec3::Y * 0.32);
    for _ in 0..640 {
        app.update();
    }
    let at = app.world().get::<Transform>(cube).unwrap().translation;
    let speed = app.world().get::<LinearVelocity>(cube).unwrap().0;
    assert!((at.y - 0.3).abs() < 0.03 && at.xz().length() < 0.05, "{at} {speed}");
    // Avian's velocity holds what gravity adds before the part takes it away.
    assert!(speed.length() < 0.2 && slow(&app, part), "{at} {speed}");
    // Taken away from under it, the cube falls.
    app.world_mut().get_mut::<Transform>(part).unwrap().translation.x += 3.0;
    for _ in 0..64 {
        app.update();
    }
    let at = app.world().get::<Transform>(cube).unwrap().translation;
    assert!((at.y - 0.1).abs() < 0.02, "{at}");
}

#[test]
fn a_heavy_part_does_not_shoot_a_light_box_through_the_floor() {
    let mut app = world();
    app.world_mut().spawn((RigidBody::Static, Collider::cuboid(4.0, 0.2, 4.0), Transform::from_xyz(0.0, -0.1, 0.0)));
    let heavy = PhysicsMaterial { youngs_modulus: 1e6, density: 2000.0, ..foam() };
    let slab = block(Vec3::new(0.2, 0.1, 0.2), 24);
    let part = spawn(&mut app, slab, Transform::from_xyz(0.0, 0.42, 0.0), coarse(), heavy);
    paused_until_ready(&mut app, &[part]);
    // 32 kg on 1 kg.
    let cube = cube(&mut app, 0.3, 1.0, Vec3::Y * 0.15);
    for _ in 0..300 {
        app.update();
    }
    let (at, lies) = (app.world().get::<Transform>(cube).unwrap().translation, center(&app, part));
    assert!((at.y - 0.15).abs() < 0.02, "{at} {lies}");
    assert!(lies.length() < 2.0 && lies.y > 0.05, "{at} {lies}");
}

#[test]
fn a_kinematic_body_pushes_a_part() {
    let mut app = weightless();
    let part = spawn(&mut app, ball(0.1, 1500), Transform::default(), coarse(), foam());
    paused_until_ready(&mut app, &[part]);
    let plate = (RigidBody::Kinematic, Collider::cuboid(0.1, 1.0, 1.0), LinearVelocity(Vec3::X));
    app.world_mut().spawn((plate, Transform::from_xyz(-0.3, 0.0, 0.0)));
    for _ in 0..64 {
        app.update();
    }
    let speed = state(&app, part).body().momentum().x / state(&app, part).body().model().mass().mass;
    assert!((0.95..2.05).contains(&speed), "{speed}");
    assert!(center(&app, part).x > 0.5);
}

#[test]
fn runs_with_avian_have_the_same_bits() {
    let run = || {
        let mut app = weightless();
        let part = spawn(&mut app, block(Vec3::splat(0.1), 20), Transform::default(), coarse(), foam());
        let other = spawn(&mut app, ball(0.1, 1500), Transform::from_xyz(0.0, 0.25, 0.0), coarse(), foam());
        paused_until_ready(&mut app, &[part, other]);
        let cube = cube(&mut app, 0.2, 0.2, Vec3::new(0.05, 0.5, 0.0));
        app.world_mut().spawn((
            RigidBody::Static,
            Collider::cuboid(4.0, 0.2, 4.0),
            Transform::from_xyz(0.0, -0.25, 0.0),
        ));
        app.insert_resource(Gravity::default());
        for _ in 0..90 {
            app.update();
        }
        let shown = |part| crate::physics::elastic::tests::shown(&app, part);
        (shown(part), shown(other), *app.world().get::<Transform>(cube).unwrap())
    };
    assert_eq!(run(), run());
}

#[test]
fn a_relative_speed_of_avians_clock_is_the_parts() {
    let mut app = world();
    let part = spawn(&mut app, ball(0.1, 1000), Transform::from_xyz(0.0, 5.0, 0.0), coarse(), foam());
    paused_until_ready(&mut app, &[part]);
    app.world_mut().resource_mut::<Time<Physics>>().set_relative_speed(0.5);
    let before = center(&app, part).y;
    for _ in 0..64 {
        app.update();
    }
    let fell = before - center(&app, part).y;
    // Half of a second.
    assert!((fell - 0.5 * 9.81 * 0.25).abs() < 0.06, "{fell}");
}
