//! [`SplatSelection`]: which Gaussians of an entity are selected.

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_core::{SelectMode, Selection};

/// The selected Gaussians of a [`Splats`](crate::Splats) entity: one bit for each of its cloud.
///
/// Without it, and with an empty `Selection`, nothing is selected. Drawn as [`SplatHighlight`](crate::SplatHighlight) says.
#[derive(Component, Clone, Debug, Default, Deref, DerefMut, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplatSelection(pub Selection);

impl SplatSelection {
    /// Combines with `set`, which has a bit for each Gaussian of the cloud. A selection of another length counts as nothing
    /// selected.
    pub fn apply(&mut self, mode: SelectMode, set: &Selection) {
        apply(&mut self.0, mode, set);
    }
}

/// Combines bits, of which empty ones, or those of another cloud, mean none.
pub(super) fn apply(bits: &mut Selection, mode: SelectMode, set: &Selection) {
    if bits.len() != set.len() {
        *bits = Selection::none(set.len());
    }
    bits.apply(mode, set);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selecting_starts_from_nothing() {
        let set = Selection::from_ids(9, [2, 3]);
        for (mode, count) in
            [(SelectMode::New, 2), (SelectMode::Add, 2), (SelectMode::Subtract, 0), (SelectMode::Intersect, 0)]
        {
            let mut selection = SplatSelection::default();
            selection.apply(mode, &set);
            assert_eq!((selection.len(), selection.count()), (9, count));
        }
        let mut selection = SplatSelection(Selection::from_ids(9, [3, 4]));
        selection.apply(SelectMode::Intersect, &set);
        assert_eq!(selection.ids(), [3]);
    }
}
