//! [`DespawnedParts`]: the Gaussians of parts whose entities were despawned.

use bevy::prelude::*;
use splat_core::PartId;

use super::bits::Bits;
use super::{PartOf, SplatPart};
use crate::components::{SplatFlags, SplatSelection, SplatSubset};
use crate::splats::Splats;

/// Parts of a capture whose entities were despawned: their Gaussians are shown by nobody, until
/// [`restore_part`](super::SplatPartCommands::restore_part) brings them back.
///
/// Not written into scene files: the names of entities that are no more mean nothing there.
#[derive(Component, Clone, Debug, Default)]
pub struct DespawnedParts(pub(super) Vec<DespawnedPart>);

/// A part at the moment its entity was despawned.
#[derive(Clone, Debug)]
pub(super) struct DespawnedPart {
    pub(super) entity: Entity,
    pub(super) part: Option<PartId>,
    pub(super) subset: SplatSubset,
    pub(super) bits: Bits,
}

impl DespawnedParts {
    /// The despawned entities with the labels of their parts, in the order in which they were despawned.
    pub fn iter(&self) -> impl Iterator<Item = (Entity, Option<PartId>)> {
        self.0.iter().map(|part| (part.entity, part.part))
    }
}

type Leaving<'a> = (
    &'a PartOf,
    Option<&'a SplatPart>,
    Option<&'a SplatSubset>,
    Option<&'a SplatFlags>,
    Option<&'a SplatSelection>,
    Option<&'a DespawnedParts>,
);

/// Keeps what is needed to restore a part when its entity is despawned. Parts that were taken out of it then belong to what it
/// belonged to.
pub(super) fn remember(despawned: On<Despawn, PartOf>, parts: Query<Leaving>, mut commands: Commands) {
    let entity = despawned.event().entity;
    let Ok((link, part, subset, flags, selection, list)) = parts.get(entity) else { return };
    let capture = link.0;
    let bits = Bits { flags: flags.cloned().unwrap_or_default(), selection: selection.cloned() };
    let part = DespawnedPart { entity, part: part.map(|p| p.0), subset: subset.cloned().unwrap_or_default(), bits };
    let mut list = list.cloned().unwrap_or_default().0;
    list.push(part);
    // The capture may be on its way out as well: whether it is there shows when commands are applied.
    commands.queue(move |world: &mut World| {
        let Some(owner) = owner_of(world, capture) else { return };
        adopt(world, entity, owner);
        keep(world, owner, list);
    });
}

/// The entity itself while it lives; once it was despawned, the one that keeps its Gaussians.
pub(super) fn owner_of(world: &mut World, entity: Entity) -> Option<Entity> {
    if world.get::<Splats>(entity).is_some() {
        return Some(entity);
    }
    let mut lists = world.query::<(Entity, &DespawnedParts)>();
    let keeps = |list: &DespawnedParts| list.0.iter().any(|part| part.entity == entity);
    lists.iter(world).find(|(_, list)| keeps(list)).map(|(owner, _)| owner)
}

/// What was taken out of `entity` belongs to `owner` from now on.
pub(super) fn adopt(world: &mut World, entity: Entity, owner: Entity) {
    let mut links = world.query::<&mut PartOf>();
    for mut link in links.iter_mut(world).filter(|link| link.0 == entity) {
        link.0 = owner;
    }
}

/// Adds to what `owner` keeps.
pub(super) fn keep(world: &mut World, owner: Entity, parts: Vec<DespawnedPart>) {
    if parts.is_empty() {
        return;
    }
    let mut owner = world.entity_mut(owner);
    match owner.get_mut::<DespawnedParts>() {
        Some(mut list) => list.0.extend(parts),
        None => {
            owner.insert(DespawnedParts(parts));
        }
    }
}
