//! What is selected becomes a named part.

use bevy::prelude::*;
use splat_core::{PartId, Parts, PartsError, SelectMode, Selection, part_color};

use crate::parts::SplatPart;
use crate::{PartOf, SplatCloud, SplatParts, SplatSelection, Splats};

/// Makes what is selected of an entity a part.
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct MakePart {
    /// A capture, or the entity of a part: its selection then becomes a part below that one, in the capture's table.
    pub entity: Entity,
    /// The part's name.
    pub name: String,
}

/// What became of a [`MakePart`].
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct PartMade {
    /// The entity named in the request.
    pub entity: Entity,
    /// The new part, or why there is none; nothing has changed then.
    pub part: Result<PartId, MakePartError>,
}

/// Why what is selected could not become a part; nothing has changed then.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MakePartError {
    /// The entity is no capture, is no more, or its cloud is not loaded.
    #[error("{0} has no loaded Splats; name the entity of a capture, or of a part of one")]
    NotSplats(Entity),
    /// Nothing is selected.
    #[error("nothing of {0} is selected; select what the part shall have")]
    NothingSelected(Entity),
    /// All that is selected belongs to parts that are locked.
    #[error("all that is selected of {0} belongs to locked parts; unlock them first")]
    AllLocked(Entity),
    /// The table of parts refuses.
    #[error(transparent)]
    Parts(#[from] PartsError),
}

/// Adds a command for parts to [`Commands`].
pub trait SplatMakePartCommands {
    /// As the message [`MakePart`]; where it is impossible a warning says why.
    fn make_part(&mut self, entity: Entity, name: impl Into<String>);
}

impl SplatMakePartCommands for Commands<'_, '_> {
    fn make_part(&mut self, entity: Entity, name: impl Into<String>) {
        let name = name.into();
        self.queue(move |world: &mut World| {
            if let Err(error) = make_part(world, entity, &name) {
                warn!("{error}");
            }
        });
    }
}

/// Makes what is selected of `entity` a part named `name`, in a colour of its own.
///
/// Its Gaussians leave the parts they were in, except locked ones. What is selected stays selected. A capture without
/// [`SplatParts`] gets them.
///
/// # Errors
/// [`MakePartError`]; nothing has changed then.
pub fn make_part(world: &mut World, entity: Entity, name: &str) -> Result<PartId, MakePartError> {
    let missing = MakePartError::NotSplats(entity);
    let handle = world.get::<Splats>(entity).map(|splats| splats.0.clone()).ok_or(missing.clone())?;
    let clouds = world.get_resource::<Assets<SplatCloud>>();
    let len = clouds.and_then(|clouds| clouds.get(&handle)).map(|asset| asset.cloud.len()).ok_or(missing)?;
    let selection = world.get::<SplatSelection>(entity).map(|s| &s.0).filter(|s| s.len() == len && s.count() > 0);
    let selection: Selection = selection.cloned().ok_or(MakePartError::NothingSelected(entity))?;
    let (table, label) = table_of(world, entity);
    let mut parts = world.get::<SplatParts>(table).map_or_else(Parts::default, |parts| parts.0.clone());
    if parts.is_empty() {
        parts = Parts::new(len);
    }
    // Parts nest one level deep: what is taken from a part below another stays beside it.
    let up = label.and_then(|label| Some(parts.get(label)?.parent().unwrap_or(label)));
    let added = parts.add(name, [0; 3], up)?;
    parts.recolor(added, part_color(added.0))?;
    parts.assign(added, &selection, SelectMode::New)?;
    if !parts.labels().contains(&added.0) {
        return Err(MakePartError::AllLocked(entity));
    }
    // The table's entity was just read from.
    world.entity_mut(table).insert(SplatParts(parts));
    Ok(added)
}

/// The entity that has, or shall have, the table of parts, and the label of `entity` in it.
fn table_of(world: &World, entity: Entity) -> (Entity, Option<PartId>) {
    let label = world.get::<SplatPart>(entity).map(|part| part.0);
    let mut at = entity;
    // Deeper than parts can be taken out of each other by hand; ends a circle of links that somebody made.
    for _ in 0..64 {
        if world.get::<SplatParts>(at).is_some() {
            return (at, label.filter(|_| at != entity));
        }
        match world.get::<PartOf>(at) {
            Some(of) if world.get_entity(of.0).is_ok() => at = of.0,
            _ => break,
        }
    }
    (entity, None)
}

pub(super) fn answer(world: &mut World, mut reader: Local<bevy::ecs::message::MessageCursor<MakePart>>) {
    let wishes: Vec<MakePart> = reader.read(world.resource::<Messages<MakePart>>()).cloned().collect();
    for MakePart { entity, name } in wishes {
        let part = make_part(world, entity, &name);
        world.write_message(PartMade { entity, part });
    }
}
