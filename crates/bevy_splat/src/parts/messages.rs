//! What happened to parts.

use bevy::prelude::*;
use splat_core::PartId;

/// A part has become an entity of its own.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartExtracted {
    /// What it was taken out of: a capture, or the entity of another part.
    pub capture: Entity,
    /// Its label.
    pub part: PartId,
    /// Its entity.
    pub entity: Entity,
}

/// The Gaussians of a part are back where they came from.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartRestored {
    /// The entity that has them now.
    pub capture: Entity,
    /// The part's label, if its entity had a [`SplatPart`](super::SplatPart).
    pub part: Option<PartId>,
    /// The part's entity; it is no more.
    pub entity: Entity,
}

/// Sends a message if the plugin is there to hear of it.
pub(super) fn tell<M: Message>(world: &mut World, message: M) {
    if let Some(mut messages) = world.get_resource_mut::<Messages<M>>() {
        messages.write(message);
    }
}
