//! Putting a part back.

use bevy::prelude::*;
use splat_core::PartId;

use super::bits::Bits;
use super::despawned::{DespawnedParts, adopt, keep, owner_of};
use super::extract::{PartError, WasWhole};
use super::messages::{PartRestored, tell};
use super::{PartOf, SplatPart};
use crate::components::SplatSubset;
use crate::splats::Splats;

/// Gives the Gaussians of a part's entity back and despawns it; see
/// [`SplatPartCommands::restore_part`](super::SplatPartCommands::restore_part). Returns the entity that has them now.
///
/// # Errors
/// [`PartError::NotAPart`] or [`PartError::CaptureGone`]; nothing has changed then.
pub fn restore_part(world: &mut World, entity: Entity) -> Result<Entity, PartError> {
    let (capture, part, subset, bits) = match world.get::<PartOf>(entity) {
        Some(link) => leave(world, entity, link.0)?,
        None => forget(world, entity).ok_or(PartError::NotAPart(entity))?,
    };
    let mut to = world.entity_mut(capture);
    bits.put(&mut to, &subset.0);
    // Without a subset it has all Gaussians anyhow.
    if let Some(own) = to.get::<SplatSubset>() {
        let all = merged(&own.0, &subset.0);
        if to.get::<WasWhole>().is_some_and(|whole| whole.len as usize == all.len()) {
            to.remove::<(SplatSubset, WasWhole)>();
        } else {
            to.insert(SplatSubset(all.into()));
        }
    }
    tell(world, PartRestored { capture, part, entity });
    Ok(capture)
}

type Back = (Entity, Option<PartId>, SplatSubset, Bits);

/// Ends a living part's entity.
fn leave(world: &mut World, entity: Entity, link: Entity) -> Result<Back, PartError> {
    let gone = PartError::CaptureGone { part: entity, capture: link };
    let capture = owner_of(world, link).filter(|&capture| capture != entity).ok_or(gone.clone())?;
    if world.get::<Splats>(capture) != world.get::<Splats>(entity) {
        return Err(gone);
    }
    let part = world.get::<SplatPart>(entity).map(|part| part.0);
    let subset = world.get::<SplatSubset>(entity).cloned().unwrap_or_default();
    let bits = Bits::of(world.entity(entity));
    adopt(world, entity, capture);
    let mut leaving = world.entity_mut(entity);
    let list = leaving.take::<DespawnedParts>().unwrap_or_default();
    // Without the link it is despawned as any other entity, and not remembered.
    leaving.remove::<PartOf>();
    leaving.despawn();
    keep(world, capture, list.0);
    Ok((capture, part, subset, bits))
}

/// What a capture keeps of a part whose entity was despawned; afterwards it keeps it no more.
fn forget(world: &mut World, entity: Entity) -> Option<Back> {
    let mut lists = world.query::<(Entity, &mut DespawnedParts)>();
    let (capture, part, empty) = lists.iter_mut(world).find_map(|(capture, mut list)| {
        let at = list.0.iter().position(|part| part.entity == entity)?;
        let part = list.0.remove(at);
        Some((capture, part, list.0.is_empty()))
    })?;
    if empty {
        world.entity_mut(capture).remove::<DespawnedParts>();
    }
    Some((capture, part.part, part.subset, part.bits))
}

/// The ids of two rising lists that have none in common, rising.
fn merged(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut all = Vec::with_capacity(a.len() + b.len());
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    while let (Some(&&x), Some(&&y)) = (a.peek(), b.peek()) {
        // An id in both, which nobody should make, stays one.
        if x == y {
            a.next();
        }
        all.push(x.min(y));
        if x < y {
            a.next()
        } else {
            b.next()
        };
    }
    all.extend(a.chain(b));
    all
}

#[cfg(test)]
mod tests {
    use super::merged;

    #[test]
    fn merged_lists_rise_and_hold_each_id_once() {
        assert_eq!(merged(&[1, 4, 9], &[0, 5, 6, 12]), [0, 1, 4, 5, 6, 9, 12]);
        assert_eq!(merged(&[], &[3]), [3]);
        assert_eq!(merged(&[3], &[]), [3]);
        assert_eq!(merged(&[1, 2, 3], &[2, 3, 4]), [1, 2, 3, 4]);
    }
}
