//! Where captures and their parts are, and how they are moved together.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use splat_core::Similarity;

use super::OrientError;
use crate::Splats;
use crate::parts::PartOf;

/// Parts out of parts out of parts: nobody goes deeper, and links may lead in a circle.
const DEEPEST: usize = 64;

/// Captures, their parts, and what they are children of.
#[derive(SystemParam)]
pub(super) struct Placed<'w, 's> {
    transforms: Query<'w, 's, &'static mut Transform>,
    above: Query<'w, 's, &'static ChildOf>,
    links: Query<'w, 's, (Entity, &'static PartOf), With<Splats>>,
}

impl Placed<'_, '_> {
    /// From an entity's own space to the world's, as its `Transform`s say now.
    pub(super) fn of(&self, entity: Entity) -> Result<Similarity, OrientError> {
        let own = self.transforms.get(entity).map_err(|_| OrientError::NoCapture)?;
        Ok(self.parent(entity)?.compose(&similarity(own)?))
    }

    /// From the space of what an entity is a child of to the world's.
    fn parent(&self, entity: Entity) -> Result<Similarity, OrientError> {
        let mut whole = Similarity::IDENTITY;
        for above in self.above.iter_ancestors(entity) {
            if let Ok(transform) = self.transforms.get(above) {
                whole = similarity(transform)?.compose(&whole);
            }
        }
        Ok(whole)
    }

    /// The capture and all that was taken out of it, with their transforms; without what moves along with another of them.
    pub(super) fn together(&self, capture: Entity) -> Vec<(Entity, Transform)> {
        let next = |&entity: &Entity| self.links.get(entity).ok().map(|(_, link)| link.0);
        let belongs =
            |entity: Entity| std::iter::successors(Some(entity), next).take(DEEPEST).any(|entity| entity == capture);
        let mut all: Vec<Entity> = self.links.iter().map(|(entity, _)| entity).filter(|&e| belongs(e)).collect();
        all.push(capture);
        all.sort_unstable();
        all.dedup();
        let alone = |&&entity: &&Entity| !self.above.iter_ancestors(entity).any(|above| all.contains(&above));
        all.iter().filter(alone).filter_map(|&e| Some((e, *self.transforms.get(e).ok()?))).collect()
    }

    /// Moves the world's `motion` on a capture and its parts; gives their transforms before.
    pub(super) fn carry(
        &mut self,
        capture: Entity,
        motion: &Similarity,
    ) -> Result<Vec<(Entity, Transform)>, OrientError> {
        let before = self.together(capture);
        let mut after = Vec::with_capacity(before.len());
        for (entity, transform) in &before {
            let parent = self.parent(*entity)?;
            let own = similarity(transform)?;
            let moved = parent.inverse().compose(motion).compose(&parent).compose(&own);
            let moved = Transform {
                translation: moved.translation,
                rotation: moved.rotation,
                // A turn leaves scales as they are, to the bit.
                scale: if motion.scale == 1.0 { transform.scale } else { Vec3::splat(moved.scale) },
            };
            if !moved.is_finite() {
                return Err(OrientError::Transform);
            }
            after.push((*entity, moved));
        }
        for (entity, moved) in after {
            if let Ok(mut transform) = self.transforms.get_mut(entity) {
                *transform = moved;
            }
        }
        Ok(before)
    }
}

fn similarity(transform: &Transform) -> Result<Similarity, OrientError> {
    let scale = transform.scale.x;
    let even = transform.scale.abs_diff_eq(Vec3::splat(scale), 1e-3 * scale.abs());
    if !(transform.is_finite() && scale > 0.0 && even && transform.rotation.length_squared() > 1e-6) {
        return Err(OrientError::Transform);
    }
    Ok(Similarity { rotation: transform.rotation.normalize(), scale, translation: transform.translation })
}
