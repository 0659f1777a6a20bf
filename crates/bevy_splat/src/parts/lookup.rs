//! Whose table of parts an entity's Gaussians are named by.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use splat_core::{Part, PartId};

use super::PartOf;
use crate::components::SplatParts;

/// Deeper than parts can be taken out of each other by hand; ends a circle of [`PartOf`] that somebody made.
const DEEPEST: usize = 64;

/// Finds the table of parts for captures and for parts that were taken out of them.
#[derive(SystemParam)]
pub struct PartsLookup<'w, 's> {
    tables: Query<'w, 's, &'static SplatParts>,
    links: Query<'w, 's, &'static PartOf>,
}

impl PartsLookup<'_, '_> {
    /// The table of an entity, with the entity that has it: its own, else that of what it was taken out of.
    pub fn table(&self, entity: Entity) -> Option<(Entity, &SplatParts)> {
        let mut entity = entity;
        for _ in 0..DEEPEST {
            if let Ok(parts) = self.tables.get(entity) {
                return Some((entity, parts));
            }
            entity = self.links.get(entity).ok()?.0;
        }
        None
    }

    /// The part of a Gaussian of an entity.
    pub fn part_of(&self, entity: Entity, gaussian: u32) -> Option<(PartId, &Part)> {
        let (_, parts) = self.table(entity)?;
        let id = parts.part_of(gaussian as usize)?;
        Some((id, parts.get(id)?))
    }
}

/// The entity that has the table of parts of `entity`; see [`PartsLookup::table`].
pub(super) fn table_of(world: &World, mut entity: Entity) -> Option<Entity> {
    for _ in 0..DEEPEST {
        if world.get::<SplatParts>(entity).is_some() {
            return Some(entity);
        }
        entity = world.get::<PartOf>(entity)?.0;
    }
    None
}
