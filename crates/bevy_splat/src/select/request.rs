//! What can be asked for, and what comes back.

use bevy::prelude::*;
use splat_core::{Criterion, Likeness, PartId, SelectMode, Selection, SelectionDelta};
use splat_segment::SegmentError;
use splat_segment::project::{DepthTolerance, Footprint};

use super::Shape2d;

/// Changes what is selected of a [`Splats`](crate::Splats) entity.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct SelectRequest {
    /// The capture, or the entity of a part.
    pub entity: Entity,
    /// How the set combines with what is selected.
    pub mode: SelectMode,
    /// Which Gaussians are meant.
    pub by: SelectBy,
}

/// Which Gaussians are meant. Hidden and locked ones never are.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SelectBy {
    /// These: a bit for each Gaussian of the cloud.
    Set(Selection),
    /// All.
    All,
    /// None; with [`SelectMode::New`] nothing is selected any more.
    Nothing,
    /// Those that are not selected.
    Inverse,
    /// Those of a part, parts below it included.
    Part(PartId),
    /// Those that are like one of the selected ones.
    Similar(Likeness),
    /// By place, in the capture's own space, or by another of their values.
    Criterion(Criterion),
    /// What a shape on a camera's picture sweeps through the scene, front to back.
    Frustum {
        /// A camera.
        camera: Entity,
        /// On its picture.
        shape: Shape2d,
        /// When a Gaussian is inside.
        footprint: Footprint,
    },
    /// Of that what lies at the depth that is seen: not what is behind a wall, nor behind another capture.
    ///
    /// Costs a frame on the CPU, of a megapixel at most: a larger picture is drawn smaller.
    Depth {
        /// A camera.
        camera: Entity,
        /// On its picture.
        shape: Shape2d,
        /// When a Gaussian is inside.
        footprint: Footprint,
        /// How near to the seen depth.
        tolerance: DepthTolerance,
    },
    /// Exactly the Gaussians that a pointer would hit in the shape's pixels. Costs as [`SelectBy::Depth`].
    Surface {
        /// A camera.
        camera: Entity,
        /// On its picture.
        shape: Shape2d,
    },
}

/// What is selected of an entity has changed.
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct SelectionChanged {
    /// The entity.
    pub entity: Entity,
    /// Gaussians that were selected.
    pub before: usize,
    /// Gaussians that are now.
    pub after: usize,
    /// The Gaussians that changed sides: from before to after and, as it is its own inverse, back.
    pub delta: SelectionDelta,
}

/// A [`SelectRequest`] could not be done; what is selected is as it was.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct SelectFailed {
    /// The entity named in the request.
    pub entity: Entity,
    /// Why.
    pub reason: SelectError,
}

/// Why a [`SelectRequest`] could not be done.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SelectError {
    /// The entity is no capture, or is no more.
    #[error("{0} has no Splats; name the entity of a capture, or of a part of one")]
    NotSplats(Entity),
    /// Its cloud is not there yet.
    #[error("the cloud of {0} is not loaded yet; ask again when it is")]
    NotLoaded(Entity),
    /// The set belongs to another cloud.
    #[error("the set is of {found} Gaussians, the cloud has {expected}: two clouds were mixed")]
    Length {
        /// Gaussians of the cloud.
        expected: usize,
        /// Gaussians of the set.
        found: usize,
    },
    /// There is no such part.
    #[error("there is no part {} of {entity}", .part.0)]
    UnknownPart {
        /// The capture.
        entity: Entity,
        /// What was asked for.
        part: PartId,
    },
    /// The camera's picture has no size yet, or splats cannot be drawn for it.
    #[error("{0} is no camera that splats are drawn for, or the size of its target is not known yet")]
    NoView(Entity),
    /// The entity's transform cannot be applied to Gaussians.
    #[error("the Transform of {0} flattens or mirrors; Gaussians can be moved, turned and scaled evenly")]
    Transform(Entity),
    /// The shape could not be projected.
    #[error(transparent)]
    Project(#[from] SegmentError),
}
