//! One click to a whole object, in the background and without a network.
//!
//! A [`SegmentRequest`] points at something in a camera's picture. The capture is taken apart once (about a second for 500 k
//! Gaussians, then kept for as long as its asset lives), and each request answered from that in milliseconds, all on Bevy's
//! pool for long computations: [`SegmentProgress`] while it runs, then [`SegmentDone`] with the object and what else may be
//! meant, or [`SegmentFailed`] with a sentence. Only a finished request changes anything: the object becomes the entity's
//! selection through a [`SelectRequest`](crate::select::SelectRequest), so that hidden and locked Gaussians stay out.
//!
//! Requests wait for each other, in order. A request with [`SegmentStart::Continue`] corrects the last answer for its entity:
//! a click on what is missing, a negative one on what is too much, from any camera.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_splat::prelude::*;
//! fn segment_what_is_clicked(click: On<Pointer<Click>>, cameras: Query<&Camera>, mut requests: MessageWriter<SegmentRequest>) {
//!     let camera = click.hit.camera;
//!     let Some(pixel) = cameras.get(camera).ok().and_then(|c| view_pixel(c, click.pointer_location.position)) else { return };
//!     requests.write(SegmentRequest::click(click.entity, camera, pixel));
//! }
//! # let mut world = World::new();
//! # world.add_observer(segment_what_is_clicked);
//! ```
//!
//! [`MakePart`](crate::select::MakePart) turns a selection into a named part, which [`extract_part`](crate::SplatPartCommands::extract_part) makes an entity.

mod job;
mod queue;
mod solve;

use bevy::prelude::*;
use splat_core::{SelectMode, Selection, View};

pub use queue::SegmentQueue;

/// Something that is pointed at, in physical pixels of the camera's viewport.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SegmentPrompt {
    /// This belongs to it.
    Click(Vec2),
    /// This does not.
    Negative(Vec2),
    /// It is what this box is drawn around; two opposite corners. Only as the first prompt.
    Box(Vec2, Vec2),
}

/// What a request starts from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SegmentStart {
    /// The first prompt names a new object.
    #[default]
    Anew,
    /// All prompts correct the last answer for this entity; where there is none, as [`SegmentStart::Anew`].
    Continue,
}

/// Asks for the Gaussians of what is pointed at.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct SegmentRequest {
    /// The [`Splats`](crate::Splats) entity.
    pub entity: Entity,
    /// The camera whose picture the prompts are in, as it stands when the request is read.
    pub camera: Entity,
    /// In order; at least one.
    pub prompts: Vec<SegmentPrompt>,
    /// Whether this corrects an earlier answer.
    pub start: SegmentStart,
    /// How the object is combined with what was selected before (before the first of the requests that continue each other).
    pub mode: SelectMode,
}

impl SegmentRequest {
    /// The object under a pixel becomes the selection.
    pub fn click(entity: Entity, camera: Entity, pixel: Vec2) -> Self {
        Self {
            entity,
            camera,
            prompts: vec![SegmentPrompt::Click(pixel)],
            start: SegmentStart::Anew,
            mode: SelectMode::New,
        }
    }

    /// A correction of the last answer.
    pub fn correct(entity: Entity, camera: Entity, prompt: SegmentPrompt) -> Self {
        let start = SegmentStart::Continue;
        Self { entity, camera, prompts: vec![prompt], start, mode: SelectMode::New }
    }
}

/// Stops what runs and waits for an entity; each request ends with a [`SegmentFailed`].
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct SegmentCancel {
    /// The entity of the requests.
    pub entity: Entity,
}

/// How far a request is.
#[derive(Message, Clone, Copy, Debug, PartialEq)]
pub struct SegmentProgress {
    /// The entity of the request.
    pub entity: Entity,
    /// What is being done, in a word.
    pub stage: &'static str,
    /// How much of that is done, 0 to 1.
    pub fraction: f32,
}

/// A request was answered.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct SegmentDone {
    /// The entity of the request.
    pub entity: Entity,
    /// The object alone, without what was selected before; a bit for each Gaussian of the cloud.
    pub selection: Selection,
    /// Up to three things that the first prompt may mean, the likeliest first. Empty for corrections.
    pub proposals: Vec<Selection>,
    /// Up to twelve, from a small part to a group of things. Empty for corrections.
    pub steps: Vec<Selection>,
}

/// A request was not answered; nothing has changed.
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct SegmentFailed {
    /// The entity of the request.
    pub entity: Entity,
    /// Why, in a sentence.
    pub reason: String,
}

/// Where a capture can be seen from, in its own space: best its training cameras
/// ([`SplatCameras`](crate::asset::SplatCameras)). Without it the capture is looked at from around.
#[derive(Component, Clone, Debug, Default)]
pub struct SegmentViews(pub Vec<View>);

/// Answers [`SegmentRequest`]s, in `Update`. Needs [`SplatSelectPlugin`](crate::select::SplatSelectPlugin).
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatSegmentPlugin;

impl Plugin for SplatSegmentPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<SegmentQueue>()
            .add_message::<SegmentRequest>()
            .add_message::<SegmentCancel>()
            .add_message::<SegmentProgress>()
            .add_message::<SegmentDone>()
            .add_message::<SegmentFailed>()
            .add_systems(Update, (queue::enqueue, queue::cancel, queue::work).chain());
    }
}

#[cfg(test)]
mod tests;
