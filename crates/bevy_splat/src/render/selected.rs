//! One number per Gaussian of a scene: 1 where it is selected. Drawn like a colour, it gives the outline its shape.

use std::sync::Arc;

use bevy::ecs::entity::{Entity, EntityHashMap};
use splat_core::Selection;

use super::extract::ExtractedEntity;

/// What an entity's numbers depend on.
type Of = (usize, Option<Arc<Selection>>, Option<Arc<[u32]>>);

/// The numbers, and what they were made of.
#[derive(Default)]
pub(super) struct Selected {
    pub(super) values: Vec<f32>,
    of: Vec<Of>,
}

/// Whether both are the same `Arc`, or none.
pub(super) fn same_arc<T: ?Sized>(a: &Option<Arc<T>>, b: &Option<Arc<T>>) -> bool {
    match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        _ => false,
    }
}

impl Selected {
    /// Makes the numbers of a scene of these entities, unless they are what is there. Whether they were made anew; `None`
    /// where nothing is selected.
    pub(super) fn update(&mut self, scene: &[Entity], entities: &EntityHashMap<ExtractedEntity>) -> Option<bool> {
        let of = || scene.iter().filter_map(|entity| entities.get(entity));
        if of().all(|e| e.selected.is_none()) {
            self.forget();
            return None;
        }
        let same = |(old, e): (&Of, &ExtractedEntity)| {
            old.0 == e.len() && same_arc(&old.1, &e.selected) && same_arc(&old.2, &e.subset)
        };
        if self.of.len() == scene.len() && self.of.iter().zip(of()).all(same) {
            return Some(false);
        }
        self.of = of().map(|e| (e.len(), e.selected.clone(), e.subset.clone())).collect();
        self.values.clear();
        for (len, bits, subset) in &self.of {
            let inside = |i: usize| bits.as_ref().is_some_and(|bits| bits.contains(i));
            let value = |i: usize| f32::from(u8::from(inside(i)));
            match subset {
                Some(ids) => self.values.extend(ids.iter().map(|&id| value(id as usize))),
                None => self.values.extend((0..*len).map(value)),
            }
        }
        Some(true)
    }

    /// Lets go of what belongs to the main world.
    pub(super) fn forget(&mut self) {
        self.of.clear();
        self.values.clear();
    }
}
