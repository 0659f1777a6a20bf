//! Extracting and restoring parts by commands.

use bevy::prelude::*;
use splat_core::PartId;

use super::extract::take_out;
use super::restore::restore_part;

/// Adds commands for parts to [`Commands`].
pub trait SplatPartCommands {
    /// Makes a part of `capture` an entity of its own, and returns that entity; it is filled when commands are applied.
    ///
    /// `capture`: a [`Splats`](crate::Splats) entity whose [`SplatParts`](crate::SplatParts) name the part, or the entity of a part
    /// of one: parts can be taken out of parts. The new entity has the part's Gaussians, those of parts below it included,
    /// as far as `capture` still has them. It stands where the capture stands, so that nothing moves, is no child of anything, has
    /// the part's name, and shows, selects, hides and locks what was shown, selected, hidden and locked. See
    /// [`PartExtracted`](super::PartExtracted).
    ///
    /// Where that is impossible (see [`PartError`](super::PartError)) a warning says why, nothing changes, and the returned
    /// entity is despawned. [`extract_part`](super::extract_part) gives the error as a value.
    fn extract_part(&mut self, capture: Entity, part: PartId) -> Entity;

    /// Gives the Gaussians of a part's entity back to the entity they were taken out of, and despawns the part's entity.
    ///
    /// Afterwards all is as if the part had never been out: what was selected, hidden or locked meanwhile stays so, and
    /// where nothing was, every bit is as before. Parts may come back in any order; parts that were taken out of this one then
    /// belong to what this one belonged to. Works for entities that were despawned, too (with
    /// [`SplatPartsPlugin`](super::SplatPartsPlugin)); their state is the one in which they were despawned. See
    /// [`PartRestored`](super::PartRestored).
    ///
    /// Where that is impossible, because the capture is no more, a warning says so and nothing changes.
    fn restore_part(&mut self, part: Entity);
}

impl SplatPartCommands for Commands<'_, '_> {
    fn extract_part(&mut self, capture: Entity, part: PartId) -> Entity {
        let entity = self.spawn_empty().id();
        self.queue(move |world: &mut World| {
            if let Err(error) = take_out(world, capture, part, entity) {
                warn!("{error}");
                world.try_despawn(entity).ok();
            }
        });
        entity
    }

    fn restore_part(&mut self, part: Entity) {
        self.queue(move |world: &mut World| {
            if let Err(error) = restore_part(world, part) {
                warn!("{error}");
            }
        });
    }
}
