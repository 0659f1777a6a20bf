//! Elastic parts: soft bodies that fall, bend and touch, drawn bent.
//!
//! An [`ElasticPart`] asks for one; an [`ElasticState`] is one that is set up.
//!
//! | to | use |
//! |---|---|
//! | give it something to stand on | [`StaticCapture`](super::StaticCapture), avian3d's colliders, [`ElasticGround`], [`ElasticObstacles`] |
//! | hold it | [`Pin`] |
//! | pull it | [`ElasticDrag`] by pointer, [`ElasticGrab`] from code |
//! | poke it | [`ElasticPush`] |
//! | put it elsewhere | its `Transform` |
//! | hear of it | [`ElasticContact`], [`ElasticSlept`], [`ElasticWoke`], [`ElasticExploded`] |
//!
//! Bodies are moved in `FixedPostUpdate`, and drawn between the last two fixed steps. A part that moves by itself writes its
//! `Transform`; one that somebody else wrote is where the part is from then on, with how it is bent and how it moves turned
//! along. A part that rests falls asleep and costs next to nothing until something moves near it.
//!
//! Same scene, same steps, same machine: the same bits. Limits today: no part touches itself; what is thinner than the contact
//! points are apart (256 over the surface by default) can slip between them; a [`Pin`] does not pull at what it follows.

mod capture;
mod drag;
mod messages;
mod obstacle;
mod part;
mod pin;
mod prepare;
mod setup;
mod state;
mod step;
mod surface;
#[cfg(test)]
pub(super) mod tests;
mod world;
mod write;

use bevy::app::RunFixedMainLoopSystems;
use bevy::prelude::*;

pub use drag::{ElasticDrag, ElasticGrab};
pub use messages::{ElasticContact, ElasticExploded, ElasticPush, ElasticSlept, ElasticWoke};
pub use obstacle::{
    CombineRule, ContactSurface, ElasticGround, ElasticLayers, ElasticObstacle, ElasticObstacles, ObstacleMotion,
    ObstacleShape, PlaneShape,
};
pub use part::{ElasticEnergy, ElasticIntegrator, ElasticPart, SimplicitsBasis, SkinningBasis};
pub use pin::{Pin, PinRegion};
pub use prepare::ElasticGravity;
pub use setup::ElasticPartError;
pub use state::ElasticState;
#[cfg(feature = "avian")]
pub(super) use step::ElasticTick;
pub use step::{ElasticShove, ElasticShoves};

use super::SplatPhysicsSystems::{Prepare, Setup, Step, Writeback};

/// Within [`Prepare`]: first what holds for the step is reset, then it is gathered, then parts make ready.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ElasticPrepareSystems {
    /// Gravity, layers, obstacles are as if nothing told otherwise.
    Begin,
    /// Gravity and layers of parts may be changed, what holds them is found.
    Gather,
    /// Parts know where they may get in this step.
    Spread,
    /// [`ElasticObstacles`] are filled.
    Obstacles,
}

/// Adds elastic parts; a part of [`SplatPhysicsPlugin`](super::SplatPhysicsPlugin).
pub(super) fn plugin(app: &mut App) {
    use ElasticPrepareSystems::{Begin, Gather, Obstacles, Spread};
    app.init_resource::<ElasticGravity>()
        .init_resource::<ElasticObstacles>()
        .init_resource::<ElasticGround>()
        .init_resource::<step::ElasticTick>()
        .init_resource::<step::ElasticShoves>()
        .init_resource::<step::ElasticReports>()
        .register_type::<(ElasticPart, ElasticGravity, ElasticDrag, ElasticGrab, Pin)>()
        .register_required_components::<ElasticPart, setup::ElasticSetup>()
        .add_message::<ElasticContact>()
        .add_message::<ElasticSlept>()
        .add_message::<ElasticWoke>()
        .add_message::<ElasticExploded>()
        .add_message::<ElasticPush>()
        .add_observer(setup::forget)
        .add_observer(pin::let_go)
        .add_observer(drag::take_hold)
        .add_observer(drag::follow)
        .add_observer(drag::release)
        .configure_sets(FixedPostUpdate, (Begin, Gather, Spread, Obstacles).chain().in_set(Prepare))
        .add_systems(Update, (setup::start, setup::finish).chain().in_set(Setup))
        .add_systems(FixedFirst, (prepare::take_places, prepare::before_step).chain())
        .add_systems(
            FixedPostUpdate,
            (
                (prepare::begin, prepare::take_places).chain().in_set(Begin),
                (pin::hold, drag::pull, prepare::push).chain().in_set(Gather),
                prepare::spread.in_set(Spread),
                capture::find.in_set(Obstacles),
                step::step.in_set(Step),
                (write::place, write::tell).chain().in_set(Writeback),
            ),
        )
        .add_systems(
            RunFixedMainLoop,
            (prepare::take_places, write::ease).chain().in_set(RunFixedMainLoopSystems::AfterFixedMainLoop),
        );
}
