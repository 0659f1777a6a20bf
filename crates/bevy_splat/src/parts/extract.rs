//! Taking a part out.

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use splat_core::{Children, PartId, PartsError, SelectMode, Selection};

use super::bits::Bits;
use super::lookup::table_of;
use super::messages::{PartExtracted, tell};
use super::{PartOf, SplatPart};
use crate::asset::SplatCloud;
use crate::components::{SplatHighlight, SplatParts, SplatSubset};
use crate::splats::Splats;

/// Why a part could not be taken out or put back; nothing has changed then.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PartError {
    /// The entity is no capture.
    #[error("{0} has no Splats; name the entity of a capture, or of a part of one")]
    NotSplats(Entity),
    /// There is no table of parts.
    #[error("neither {0} nor what it was taken out of has SplatParts; name its parts first")]
    NoParts(Entity),
    /// The table cannot be used.
    #[error("the part of {entity} cannot be taken out: {source}")]
    Parts {
        /// The capture.
        entity: Entity,
        /// What is wrong.
        source: PartsError,
    },
    /// The part has no Gaussians in that entity.
    #[error("{entity} has no Gaussian of part {}; it is empty, or out already", .part.0)]
    Empty {
        /// The capture.
        entity: Entity,
        /// The part.
        part: PartId,
    },
    /// The entity that would get the part is no more.
    #[error("{0} was despawned before the part was taken out")]
    Despawned(Entity),
    /// The entity was not taken out of anything.
    #[error("{0} is no part that was taken out of a capture, or was restored already")]
    NotAPart(Entity),
    /// There is nothing to put the part back into.
    #[error(
        "{capture}, which {part} was taken out of, is no more or shows another cloud; the part stays an entity of its own"
    )]
    CaptureGone {
        /// The part's entity.
        part: Entity,
        /// What it was taken out of.
        capture: Entity,
    },
}

/// The capture had no [`SplatSubset`] before parts were taken out, and will have none when all are back.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub(super) struct WasWhole {
    /// Gaussians of the cloud.
    pub(super) len: u32,
}

/// Makes a part of `capture` an entity of its own; see [`SplatPartCommands::extract_part`](super::SplatPartCommands::extract_part).
///
/// # Errors
/// [`PartError`]; nothing has changed then.
///
/// Cost: the Gaussians of the capture, once. Drawing afterwards costs each entity its own.
pub fn extract_part(world: &mut World, capture: Entity, part: PartId) -> Result<Entity, PartError> {
    let entity = world.spawn_empty().id();
    let taken = take_out(world, capture, part, entity);
    if taken.is_err() {
        world.despawn(entity);
    }
    taken.map(|()| entity)
}

/// Takes a part of `capture` out into `entity`, which is empty.
pub(super) fn take_out(world: &mut World, capture: Entity, part: PartId, entity: Entity) -> Result<(), PartError> {
    if world.get_entity(entity).is_err() {
        return Err(PartError::Despawned(entity));
    }
    let handle = world.get::<Splats>(capture).cloned().ok_or(PartError::NotSplats(capture))?;
    let table = table_of(world, capture).and_then(|table| world.get::<SplatParts>(table));
    let parts = table.ok_or(PartError::NoParts(capture))?;
    let wrong = |source| PartError::Parts { entity: capture, source };
    let name = parts.get(part).ok_or(wrong(PartsError::Unknown(part)))?.name.clone();
    let len = parts.len();
    let cloud = world.get_resource::<Assets<SplatCloud>>().and_then(|clouds| clouds.get(&handle.0));
    if let Some(cloud) = cloud
        && cloud.cloud.len() != len
    {
        return Err(wrong(PartsError::Length { expected: cloud.cloud.len(), found: len }));
    }

    let mut taken = parts.selection_of(part, Children::With);
    let members = match world.get::<SplatSubset>(capture) {
        Some(subset) => subset.to_selection(len),
        None => Selection::all(len),
    };
    taken.apply(SelectMode::Intersect, &members);
    let mut rest = members;
    rest.apply(SelectMode::Subtract, &taken);
    let ids = SplatSubset::of(&taken);
    if ids.0.is_empty() {
        return Err(PartError::Empty { entity: capture, part });
    }

    let place = place(world, capture);
    let visibility = visibility(world, capture);
    let mut from = world.entity_mut(capture);
    let bits = Bits::take(&mut from, &taken);
    if !from.contains::<SplatSubset>() {
        // Ids are 32 bits wide, so a length is too.
        from.insert(WasWhole { len: len as u32 });
    }
    from.insert(SplatSubset::of(&rest));
    let (layers, highlight) = (from.get::<RenderLayers>().cloned(), from.get::<SplatHighlight>().copied());

    let mut to = world.entity_mut(entity);
    to.insert((handle, ids, place, visibility, PartOf(capture), SplatPart(part), Name::new(name), bits.flags));
    if let Some(selection) = bits.selection {
        to.insert(selection);
    }
    if let Some(layers) = layers {
        to.insert(layers);
    }
    if let Some(highlight) = highlight {
        to.insert(highlight);
    }
    tell(world, PartExtracted { capture, part, entity });
    Ok(())
}

/// Where an entity stands in the world, from its own `Transform` and those above: `GlobalTransform` is a frame old.
fn place(world: &World, entity: Entity) -> Transform {
    let own = world.get::<Transform>(entity).copied().unwrap_or_default();
    let mut above = world.get::<ChildOf>(entity).map(ChildOf::parent);
    if above.is_none() {
        return own;
    }
    let mut place = GlobalTransform::from(own);
    while let Some(parent) = above {
        place = world.get::<Transform>(parent).copied().unwrap_or_default() * place;
        above = world.get::<ChildOf>(parent).map(ChildOf::parent);
    }
    place.compute_transform()
}

/// Whether an entity is shown, from its own `Visibility` and those above.
fn visibility(world: &World, entity: Entity) -> Visibility {
    let mut at = Some(entity);
    while let Some(entity) = at {
        match world.get::<Visibility>(entity) {
            Some(Visibility::Hidden) => return Visibility::Hidden,
            Some(Visibility::Visible) => return Visibility::Visible,
            _ => at = world.get::<ChildOf>(entity).map(ChildOf::parent),
        }
    }
    Visibility::Inherited
}
