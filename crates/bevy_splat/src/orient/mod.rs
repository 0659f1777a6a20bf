//! Captures upright, and in metres, by messages.
//!
//! An [`OrientRequest`] turns a capture: the object that is selected along the axes, a floor or three points level at height 0. A
//! [`ScaleRequest`] (with feature `physics`) tells how large it is. What takes time is found in the background; then the capture's
//! `Transform` changes, and that of the parts that were taken out of it alike, so that nothing moves against anything else. [`Oriented`]
//! and [`Scaled`] tell what was there before, which undoes it, and what was left open; [`OrientFailed`] why nothing changed.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_splat::prelude::*;
//! fn upright(capture: Single<Entity, With<Splats>>, mut requests: MessageWriter<OrientRequest>) {
//!     requests.write(OrientRequest { capture: *capture, by: OrientBy::Floor });
//! }
//! ```

mod find;
mod place;
mod queue;
#[cfg(feature = "physics")]
mod scale;
#[cfg(test)]
mod tests;

use bevy::prelude::*;
use splat_core::orient::{AlignError, AxisTarget, PointsError};

pub use queue::OrientQueue;
#[cfg(feature = "physics")]
pub use scale::{ScaleBy, ScaleRequest, Scaled};

/// Asks to turn a capture.
#[derive(Message, Clone, Copy, Debug, PartialEq)]
pub struct OrientRequest {
    /// The [`Splats`](crate::Splats) entity.
    pub capture: Entity,
    /// By what.
    pub by: OrientBy,
}

/// What says how a capture is to lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OrientBy {
    /// What is selected (everything where nothing is) along the world's axes.
    Selection {
        /// The axes that the longest, the middle and the shortest direction are laid along; `None`: the nearest.
        axes: Option<[AxisTarget; 3]>,
    },
    /// The selected surface, where something is selected, else the plane that everything stands on: level, at height 0.
    Floor,
    /// Three points in world space: the first two along x, all of them level, at height 0.
    Points([Vec3; 3]),
}

/// A capture was turned.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct Oriented {
    /// The entity of the request.
    pub capture: Entity,
    /// The `Transform`s of the capture and of its parts as they were: to write them back undoes the request.
    pub before: Vec<(Entity, Transform)>,
    /// Sentences about what the Gaussians leave open.
    pub ambiguities: Vec<String>,
}

/// Nothing was turned or scaled; the `Display` of `error` is a sentence.
#[derive(Message, Clone, Copy, Debug, PartialEq)]
pub struct OrientFailed {
    /// The entity of the request.
    pub capture: Entity,
    /// Why.
    pub error: OrientError,
}

/// Why a capture was not turned or scaled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OrientError {
    /// No `Splats` there, or they went away meanwhile.
    #[error("the entity has no Splats; name a capture, or a part of one")]
    NoCapture,
    /// Not there yet.
    #[error("the capture is still being loaded; ask again when it is there")]
    Loading,
    /// It has a scale that Gaussians cannot have, or one of what it is a child of has.
    #[error("the capture's Transform is not finite, or scales unevenly; give it an even scale first")]
    Transform,
    /// No Gaussian of it has a finite place, size and opacity.
    #[error("no Gaussian of it can be drawn, so it has no directions; select more of it")]
    NothingDrawn,
    /// No plane has the capture on one side.
    #[error("no plane has the capture on one side; select the floor first")]
    NoFloor,
    /// The selected Gaussians lie on no plane.
    #[error("the selected Gaussians lie on no plane; select more of the surface that shall be level")]
    NoPlane,
    /// The three points say nothing.
    #[error(transparent)]
    Points(#[from] PointsError),
    /// The axes cannot be reached.
    #[error(transparent)]
    Axes(#[from] AlignError),
    /// A length that is none, or places that do not lie apart.
    #[error("{metres} m over {units} units of the capture is no scale; take places that lie further apart")]
    Length {
        /// What was measured, in units of the cloud.
        units: f32,
        /// What it should be.
        metres: f32,
    },
}

/// Answers [`OrientRequest`]s and, with feature `physics`, [`ScaleRequest`]s, in `Update`. Needs
/// [`SplatAssetPlugin`](crate::asset::SplatAssetPlugin); scales are applied by
/// [`SplatPhysicsPlugin`](crate::physics::SplatPhysicsPlugin).
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatOrientPlugin;

impl Plugin for SplatOrientPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<OrientQueue>()
            .add_message::<OrientRequest>()
            .add_message::<Oriented>()
            .add_message::<OrientFailed>()
            .add_systems(Update, (queue::enqueue, queue::finish).chain());
        #[cfg(feature = "physics")]
        app.add_message::<ScaleRequest>()
            .add_message::<Scaled>()
            .add_systems(Update, scale::answer.after(queue::finish));
    }
}
