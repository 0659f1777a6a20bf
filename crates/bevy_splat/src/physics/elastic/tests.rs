//! Elastic parts in an app without window, device and engine.

use std::time::Duration;

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use splat_core::{Cloud, CloudArrays};

use super::*;
use crate::components::SplatDeformation;
use crate::parts::SplatPartsPlugin;
use crate::physics::{PartMaterial, PartPhysicsStatus, PhysicsMaterial, SplatPhysicsPlugin};
use crate::{SplatCloud, Splats, testing};

mod guards;
mod hold;
mod meet;
mod rest;
mod road;

/// Of Bevy's fixed step: each update makes one.
const STEP: Duration = Duration::from_micros(15_625);

/// An app whose every update is one fixed step.
pub(crate) fn app() -> App {
    let mut app = testing::app();
    app.add_plugins((TransformPlugin, SplatPartsPlugin, SplatPhysicsPlugin));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(STEP));
    app
}

/// The surface of a ball, as a capture has it.
pub(crate) fn ball(radius: f32, count: usize) -> Cloud {
    let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let point = |k: usize| {
        let y = 1.0 - (2 * k + 1) as f32 / count as f32;
        let (sin, cos) = (golden * k as f32).sin_cos();
        Vec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin)
    };
    shell((0..count).map(|k| (point(k) * radius, point(k))).collect(), radius * (8.0 / count as f32).sqrt())
}

/// The surface of a box about the origin.
pub(crate) fn block(half: Vec3, across: usize) -> Cloud {
    let mut points = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            for i in 0..across {
                for j in 0..across {
                    let at = |k: usize| (2 * k + 1) as f32 / across as f32 - 1.0;
                    let mut p = Vec3::ZERO;
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, at(i), at(j));
                    let mut normal = Vec3::ZERO;
                    normal[axis] = side;
                    points.push((p * half, normal));
                }
            }
        }
    }
    shell(points, 1.2 * half.max_element() / across as f32)
}

/// Discs of a size at points with normals.
fn shell(points: Vec<(Vec3, Vec3)>, size: f32) -> Cloud {
    let len = points.len();
    let flat = Vec3::new(size, size, 0.1 * size).map(f32::ln);
    Cloud::new(CloudArrays {
        means: points.iter().map(|p| p.0).collect(),
        log_scales: vec![flat; len],
        rotations: points.iter().map(|p| Quat::from_rotation_arc(Vec3::Z, p.1)).collect(),
        opacity_logits: vec![3.0; len],
        sh: vec![0.0; 3 * len],
        ..CloudArrays::default()
    })
    .unwrap()
}

/// Few handles and points: steps of tests are short.
pub(crate) fn coarse() -> ElasticPart {
    ElasticPart { handles: 6, cage_cells: 6, contact_points: 128, ..default() }
}

/// Firm foam that does not bounce.
pub(crate) fn foam() -> PhysicsMaterial {
    PhysicsMaterial { restitution: 0.0, ..PhysicsMaterial::preset("foam_firm").unwrap() }
}

/// An elastic part of a cloud.
pub(crate) fn spawn(
    app: &mut App,
    cloud: Cloud,
    at: Transform,
    part: ElasticPart,
    material: PhysicsMaterial,
) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(SplatCloud::new(cloud));
    app.world_mut().spawn((Splats(handle), at, part, PartMaterial::from(material))).id()
}

/// Runs until a part is set up.
pub(crate) fn ready(app: &mut App, part: Entity) {
    testing::update_until(app, |app| match app.world().get::<PartPhysicsStatus>(part) {
        Some(PartPhysicsStatus::Failed(error)) => panic!("{error}"),
        status => status.is_some_and(|status| !status.is_pending()),
    });
}

/// As [`ready`], while time stands still: the part is where it was put.
pub(crate) fn ready_in_place(app: &mut App, part: Entity) {
    let still = TimeUpdateStrategy::ManualDuration(Duration::ZERO);
    let running = std::mem::replace(&mut *app.world_mut().resource_mut::<TimeUpdateStrategy>(), still);
    // What time is left from before passes.
    app.update();
    ready(app, part);
    *app.world_mut().resource_mut::<TimeUpdateStrategy>() = running;
}

pub(crate) fn state(app: &App, part: Entity) -> &ElasticState {
    app.world().get::<ElasticState>(part).unwrap()
}

pub(crate) fn center(app: &App, part: Entity) -> DVec3 {
    state(app, part).body().center()
}

/// All that a part shows, to compare to the bit.
pub(crate) fn shown(app: &App, part: Entity) -> (Transform, Vec<u32>) {
    let nodes = state(app, part).nodes().iter().flat_map(|node| node.to_array().map(f32::to_bits)).collect();
    (*app.world().get::<Transform>(part).unwrap(), nodes)
}

/// Whether nothing that is drawn is NaN or infinite.
pub(crate) fn sound(app: &App, part: Entity) -> bool {
    let place = app.world().get::<Transform>(part).unwrap();
    let nodes = app.world().get::<SplatDeformation>(part);
    place.is_finite() && nodes.is_none_or(|deformed| deformed.0.positions().iter().all(|node| node.is_finite()))
}

/// Messages of a kind that are still to be read.
pub(crate) fn messages<M: Message + Clone>(app: &App) -> Vec<M> {
    let messages = app.world().resource::<Messages<M>>();
    messages.iter_current_update_messages().cloned().collect()
}
