//! Rigid parts against numbers: every test runs an app with avian3d, without a window.

use std::time::Duration;

use avian3d::collision::collider::contact_query;
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use splat_core::{PartId, Parts, SelectMode, Selection};

use super::super::*;
use super::*;
use crate::parts::{SplatPartCommands, SplatPartsPlugin, restore_part};
use crate::{SplatCloud, SplatFlags, SplatParts, SplatSelection, SplatSubset, Splats, testing};

mod degenerate;
mod drop;
mod ground;
mod pairs;
mod shells;

use shells::Shells;

/// Steps a second.
const RATE: f64 = 64.0;

/// An app with avian whose every update is one step.
fn app() -> App {
    let mut app = testing::app();
    app.add_plugins((TransformPlugin, SplatPartsPlugin, PhysicsPlugins::default(), SplatPhysicsPlugin));
    let step = Duration::from_secs_f64(1.0 / RATE);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    app.insert_resource(Time::<Fixed>::from_duration(step));
    app.finish();
    app.cleanup();
    app
}

/// An entity that shows these Gaussians, upright as they are.
fn spawn(app: &mut App, shells: &Shells, at: Transform) -> Entity {
    let cloud = SplatCloud::new(shells.cloud());
    let handle = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(cloud);
    app.world_mut().spawn((Splats(handle), at)).id()
}

/// Runs frames, without time, until nothing is set up any more.
fn settle(app: &mut App) {
    let paused = TimeUpdateStrategy::ManualDuration(Duration::ZERO);
    let running = std::mem::replace(&mut *app.world_mut().resource_mut::<TimeUpdateStrategy>(), paused);
    app.update();
    testing::update_until(app, |app| {
        let mut statuses = app.world_mut().query::<&PartPhysicsStatus>();
        statuses.iter(app.world()).all(|status| !status.is_pending())
    });
    *app.world_mut().resource_mut::<TimeUpdateStrategy>() = running;
}

fn run(app: &mut App, seconds: f64) {
    for _ in 0..(seconds * RATE).round() as usize {
        app.update();
    }
}

fn report(app: &App, entity: Entity) -> PartPhysicsReport {
    match app.world().get::<PartPhysicsStatus>(entity) {
        Some(PartPhysicsStatus::Ready(report)) => report.clone(),
        other => panic!("{other:?}"),
    }
}

fn place(app: &App, entity: Entity) -> Transform {
    *app.world().get::<Transform>(entity).unwrap()
}

/// Lowest point of an entity's collider.
fn bottom(app: &App, entity: Entity) -> f32 {
    let entity = app.world().entity(entity);
    let (position, rotation) = (entity.get::<Position>().unwrap(), entity.get::<Rotation>().unwrap());
    let pose = avian3d::parry::math::Pose::from_parts(position.0, rotation.0);
    entity.get::<Collider>().unwrap().shape_scaled().compute_aabb(&pose).mins.y
}

/// A floor of avian's own, its top at y = 0.
fn floor(app: &mut App, material: PhysicsMaterial) -> Entity {
    let friction = Friction::new(material.friction_dynamic).with_static_coefficient(material.friction_static);
    let surface = (friction, Restitution::new(material.restitution));
    let at = Transform::from_xyz(0.0, -0.5, 0.0);
    app.world_mut().spawn((RigidBody::Static, Collider::cuboid(40.0, 1.0, 40.0), surface, at)).id()
}

/// A material that neither bounces nor bends.
fn dull(friction_static: f32, friction_dynamic: f32) -> PhysicsMaterial {
    let wood = PhysicsMaterial::preset("wood_soft").unwrap();
    PhysicsMaterial { friction_static, friction_dynamic, restitution: 0.0, ..wood }
}
