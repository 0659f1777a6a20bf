//! From the wish to the body and back.

use splat_core::{PartId, Parts, SelectMode, Selection};

use super::*;
use crate::SplatPartCommands;
use crate::components::{SplatParts, SplatSubset};
use crate::physics::{PartBody, PartPhysicsReady};

#[test]
fn two_lines_make_a_part_fall() {
    let mut app = app();
    let handle = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(SplatCloud::new(ball(0.2, 4000)));
    let part = app.world_mut().spawn(Splats(handle)).id();
    app.update();
    app.world_mut().entity_mut(part).insert((ElasticPart::default(), PartMaterial::preset("rubber")));
    app.update();
    assert!(app.world().get::<PartPhysicsStatus>(part).unwrap().is_pending());
    let before = *app.world().get::<Transform>(part).unwrap();
    let mut told = Vec::new();
    testing::update_until(&mut app, |app| {
        told.extend(messages::<PartPhysicsReady>(app));
        app.world().get::<PartPhysicsStatus>(part).unwrap().report().is_some()
    });
    let report = app.world().get::<PartPhysicsStatus>(part).unwrap().report().unwrap().clone();
    assert!(matches!(report.body, PartBody::Elastic { handles: 32.., samples: 512.. }), "{:?}", report.body);
    let mass = report.mass.unwrap().mass;
    let wanted = 1100.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.2_f64.powi(3);
    assert!((mass / wanted - 1.0).abs() < 0.1, "{mass} kg, not {wanted}");
    for _ in 0..20 {
        app.update();
    }
    let after = *app.world().get::<Transform>(part).unwrap();
    assert!(after.translation.y < before.translation.y - 0.1, "{after:?}");
    assert!(after.scale == before.scale && (after.translation.x - before.translation.x).abs() < 1e-6);
    assert!(app.world().get::<SplatDeformation>(part).is_some());
    // And back: its own shape, where it is.
    app.world_mut().entity_mut(part).remove::<ElasticPart>();
    app.update();
    let entity = app.world().entity(part);
    assert!(!entity.contains::<ElasticState>() && !entity.contains::<SplatDeformation>());
    assert!(!entity.contains::<PartPhysicsStatus>());
    let stays = *entity.get::<Transform>().unwrap();
    app.update();
    assert_eq!(app.world().get::<Transform>(part), Some(&stays));
}

#[test]
fn a_part_that_was_simulated_and_restored_leaves_the_captures_bits() {
    let mut app = app();
    let cloud = ball(0.2, 3000);
    let bits = |cloud: &Cloud| -> Vec<u32> {
        cloud.means().iter().flat_map(|mean| mean.to_array().map(f32::to_bits)).collect()
    };
    let before = bits(&cloud);
    let handle = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(SplatCloud::new(cloud));
    let mut parts = Parts::new(3000);
    let top = parts.add("top", [0; 3], None).unwrap();
    parts.assign(top, &Selection::from_fn(3000, |i| i < 1500), SelectMode::New).unwrap();
    let parts = SplatParts(parts);
    let at = Transform::from_xyz(0.5, 1.0, 0.0);
    let capture = app.world_mut().spawn((Splats(handle.clone()), parts.clone(), at)).id();
    app.update();
    let part = app.world_mut().commands().extract_part(capture, PartId(1));
    app.world_mut().commands().entity(part).insert((coarse(), PartMaterial::from(foam())));
    app.update();
    ready(&mut app, part);
    for _ in 0..10 {
        app.update();
    }
    assert!(app.world().get::<Transform>(part).unwrap().translation.y < 0.99);
    app.world_mut().commands().restore_part(part);
    app.update();
    assert!(app.world().get_entity(part).is_err());
    let entity = app.world().entity(capture);
    assert_eq!((entity.get::<SplatParts>(), entity.get::<Transform>()), (Some(&parts), Some(&at)));
    assert!(!entity.contains::<SplatSubset>());
    assert_eq!(bits(&app.world().resource::<Assets<SplatCloud>>().get(&handle).unwrap().cloud), before);
}

#[test]
fn what_does_not_change_the_basis_keeps_it() {
    let mut app = app();
    app.insert_resource(ElasticGravity(Vec3::ZERO));
    let part = spawn(&mut app, block(Vec3::splat(0.1), 24), Transform::default(), coarse(), foam());
    ready(&mut app, part);
    let model = |app: &App| state(app, part).body().model().clone();
    let first = model(&app);
    let change = |app: &mut App, material: PhysicsMaterial| {
        app.world_mut().entity_mut(part).insert(PartMaterial::from(material));
        app.update();
        ready(app, part);
    };
    // Friction is nothing of the body.
    change(&mut app, PhysicsMaterial { friction_dynamic: 0.1, friction_static: 0.1, ..foam() });
    assert!(std::sync::Arc::ptr_eq(&model(&app), &first));
    assert_eq!(state(&app, part).made.skin[0].friction, [f64::from(0.1_f32); 2]);
    // Twice as stiff and heavy: the same weights, another mass.
    let stiffer = PhysicsMaterial { density: 120.0, youngs_modulus: 2e5, ..foam() };
    change(&mut app, stiffer);
    assert!((model(&app).mass().mass / first.mass().mass - 2.0).abs() < 1e-6);
    assert_eq!(model(&app).weights().nodes, first.weights().nodes);
    assert!((model(&app).frequency() / first.frequency() - 1.0).abs() < 1e-3);
    // More handles: others.
    app.world_mut().get_mut::<ElasticPart>(part).unwrap().handles = 9;
    app.update();
    ready(&mut app, part);
    assert_ne!(model(&app).weights().nodes.len(), first.weights().nodes.len());
}

#[test]
fn a_body_that_cannot_be_says_why() {
    let mut app = app();
    let few = spawn(&mut app, ball(0.1, 20), Transform::default(), coarse(), foam());
    let stretched = Transform::from_scale(Vec3::new(1.0, 2.0, 1.0));
    let uneven = spawn(&mut app, ball(0.1, 500), stretched, coarse(), foam());
    let child = spawn(&mut app, ball(0.1, 500), Transform::default(), coarse(), foam());
    let many = spawn(&mut app, ball(0.1, 2000), Transform::default(), ElasticPart { handles: 999, ..coarse() }, foam());
    let weightless = PhysicsMaterial { density: 0.0, ..foam() };
    let light = spawn(&mut app, ball(0.1, 500), Transform::default(), coarse(), weightless);
    let parent = app.world_mut().spawn(Transform::default()).id();
    app.world_mut().entity_mut(child).insert(ChildOf(parent));
    let reason = |app: &App, part| app.world().get::<PartPhysicsStatus>(part)?.error().map(ToString::to_string);
    let all = [few, uneven, child, many, light];
    testing::update_until(&mut app, |app| all.iter().all(|&part| reason(app, part).is_some()));
    let words = ["50", "scale", "child", "999 handles", "density"];
    for (part, word) in all.into_iter().zip(words) {
        let sentence = reason(&app, part).unwrap();
        assert!(sentence.contains(word), "{sentence}");
        assert!(app.world().get::<ElasticState>(part).is_none());
        assert!(sound(&app, part));
    }
    // What is mended is tried again.
    app.world_mut().get_mut::<ElasticPart>(many).unwrap().handles = 5;
    app.update();
    ready(&mut app, many);
    assert!(app.world().get::<ElasticState>(many).is_some());
}

#[test]
fn a_thousand_parts_that_come_and_go_leave_nothing() {
    let mut app = app();
    let handle = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(SplatCloud::new(ball(0.1, 500)));
    app.update();
    let entities = app.world().entities().count_spawned();
    for round in 0..100 {
        let spawned: Vec<Entity> = (0..10)
            .map(|_| app.world_mut().spawn((Splats(handle.clone()), coarse(), PartMaterial::from(foam()))).id())
            .collect();
        app.update();
        if round % 25 == 0 {
            // Some are there for a while.
            ready(&mut app, spawned[0]);
            app.update();
        }
        spawned.into_iter().for_each(|part| assert!(app.world_mut().despawn(part)));
    }
    app.update();
    app.update();
    assert_eq!(app.world().entities().count_spawned(), entities);
    assert!(app.world().resource::<ElasticObstacles>().is_empty());
    assert!(app.world().resource::<step::ElasticReports>().0.is_empty());
}
