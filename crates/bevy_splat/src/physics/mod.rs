//! Parts as bodies, in SI units: one unit of Bevy's world is a metre.
//!
//! A component on the entity of a part, or on a capture, is a wish; the body is set up in the background, and
//! [`PartPhysicsStatus`] tells how far it is, what it was made of, or in a sentence why there is none.
//!
//! | component | on | what it makes of it |
//! |---|---|---|
//! | [`CaptureScale`] | a capture | metres: its scale, and that of its parts |
//! | [`StaticCapture`] | a capture | what is left of it stands still, and is bumped into |
//! | `RigidPart` (feature `avian`) | a part | a rigid body of avian3d |
//! | [`ElasticPart`] | a part | a soft body; see [`elastic`] |
//! | [`PartMaterial`], [`PartMaterials`] | parts, captures | what they are made of: presets, assets, numbers |
//!
//! The Gaussians are never touched: [`restore_part`](crate::SplatPartCommands::restore_part) gives the capture back bit for bit.

#[cfg(feature = "avian")]
mod avian;
pub mod elastic;
mod ground;
mod jobs;
mod material;
mod part;
#[cfg(feature = "avian")]
mod rigid;
mod scale;
mod status;

use bevy::prelude::*;

#[cfg(feature = "avian")]
pub use avian::SplatAvianPlugin;
pub use elastic::{ElasticPart, Pin, PinRegion};
pub use ground::{CaptureGround, GroundFill, GroundKind, StaticCapture, StaticCaptureCache};
pub use material::{PartMaterial, PartMaterials, PhysicsMaterial, PhysicsMaterialError, PhysicsMaterialLoader};
#[cfg(feature = "avian")]
pub use rigid::{RigidPart, RigidShape};
pub use scale::{CaptureScale, ScaleSource};
pub use status::{
    PartBody, PartPhysicsError, PartPhysicsFailed, PartPhysicsReady, PartPhysicsReport, PartPhysicsStatus,
    PartPhysicsWarning,
};

/// When bodies are set up and moved.
///
/// `Setup` is in `Update`. The others follow each other in `FixedPostUpdate`, before transforms are propagated. Beside
/// avian3d they are a part of its tick: after its `Prepare`, before and after its `StepSimulation`, within its `Writeback`.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SplatPhysicsSystems {
    /// Work is begun, ended, and its results are given to entities; in `Update`.
    Setup,
    /// What bodies touch is read.
    Prepare,
    /// Elastic bodies are moved, and push what they touch.
    Step,
    /// What has moved is told to `Transform`s and to what draws.
    Writeback,
}

/// Within [`SplatPhysicsSystems::Setup`]: parts wait for what they may stand on.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum SetupSystems {
    Scale,
    Ground,
    Parts,
}

/// Bodies of parts: materials, scale, the ground that is left of a capture, and elastic parts; rigid parts with avian3d.
///
/// Needs [`SplatAssetPlugin`](crate::asset::SplatAssetPlugin) and [`SplatPartsPlugin`](crate::parts::SplatPartsPlugin). Nothing
/// runs for entities that ask for no body. Where avian's `PhysicsPlugins` are added it adds `SplatAvianPlugin`.
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatPhysicsPlugin;

impl Plugin for SplatPhysicsPlugin {
    fn build(&self, app: &mut App) {
        use SplatPhysicsSystems::{Prepare, Setup, Step, Writeback};
        material::plugin(app);
        elastic::plugin(app);
        app.init_resource::<StaticCaptureCache>()
            .register_type::<(CaptureScale, StaticCapture)>()
            .add_message::<PartPhysicsReady>()
            .add_message::<PartPhysicsFailed>()
            .configure_sets(
                Update,
                (SetupSystems::Scale, SetupSystems::Ground, SetupSystems::Parts).chain().in_set(Setup),
            )
            .configure_sets(FixedPostUpdate, (Prepare, Step, Writeback).chain().before(TransformSystems::Propagate))
            .add_observer(ground::forget)
            .add_systems(
                Update,
                (
                    scale::apply.in_set(SetupSystems::Scale),
                    (ground::start, ground::finish).chain().in_set(SetupSystems::Ground),
                ),
            );
    }

    #[cfg(feature = "avian")]
    fn finish(&self, app: &mut App) {
        avian::bridge_to_avian(app);
    }
}
