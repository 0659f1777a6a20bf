//! The bridge to avian3d: [`SplatAvianPlugin`].

mod elastic;
mod elastic_shape;
mod friction;
pub(super) mod ground;

use avian3d::prelude::{PhysicsSchedule, PhysicsStepSystems, PhysicsSystems};
use avian3d::schedule::PhysicsSchedulePlugin;
use bevy::prelude::*;

use super::{SetupSystems, SplatPhysicsSystems, rigid};

/// Rigid parts and collision with avian3d: [`RigidPart`](super::RigidPart), colliders of
/// [`StaticCapture`](super::StaticCapture), elastic parts that meet rigid bodies.
///
/// [`SplatPhysicsPlugin`](super::SplatPhysicsPlugin) adds it by itself where avian's `PhysicsPlugins` are there when the app
/// begins to run; to add it is needed only in apps that are never run, such as tests. It needs `PhysicsPlugins` in
/// `FixedPostUpdate`, their default, and changes none of avian's settings.
///
/// avian3d 0.7 only uses the coefficient of friction of what slides; contacts of rigid parts hold with the one at rest.
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatAvianPlugin;

/// The bridge is there.
#[derive(Resource)]
struct Bridged;

impl Plugin for SplatAvianPlugin {
    fn build(&self, app: &mut App) {
        bridge(app);
    }
}

/// Adds the bridge if avian is there and the bridge is not.
pub(super) fn bridge_to_avian(app: &mut App) {
    if app.is_plugin_added::<PhysicsSchedulePlugin>() {
        bridge(app);
    }
}

fn bridge(app: &mut App) {
    if app.world().contains_resource::<Bridged>() {
        return;
    }
    use SplatPhysicsSystems::{Prepare, Step, Writeback};
    app.insert_resource(Bridged)
        .register_type::<(rigid::RigidPart, rigid::RigidShape)>()
        .configure_sets(
            FixedPostUpdate,
            (
                (Prepare, Step).after(PhysicsSystems::Prepare).before(PhysicsSystems::StepSimulation),
                Writeback.after(PhysicsSystems::StepSimulation).in_set(PhysicsSystems::Writeback),
            ),
        )
        .add_observer(rigid::forget)
        .add_observer(ground::forget)
        .add_systems(
            PhysicsSchedule,
            friction::hold.after(PhysicsStepSystems::NarrowPhase).before(PhysicsStepSystems::Solver),
        )
        .add_systems(
            Update,
            (
                ground::give.in_set(SetupSystems::Ground).after(super::ground::finish),
                (rigid::start, rigid::finish).chain().in_set(SetupSystems::Parts),
            ),
        );
    elastic::plugin(app);
}
