//! [`SplatSubset`]: which Gaussians of a cloud an entity has.

use std::sync::Arc;

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use splat_core::Selection;

/// The Gaussians of the cloud that belong to this [`Splats`](crate::Splats) entity: their ids, rising, none twice. Without
/// it, all do.
///
/// Extracting a part gives the part's entity the ids of the part, and the capture those of the rest. What it costs to draw
/// and to pick an entity follows the length of this list, not that of the cloud.
#[derive(Component, Clone, Debug, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplatSubset(pub Arc<[u32]>);

impl Default for SplatSubset {
    /// No Gaussian at all.
    fn default() -> Self {
        Self(Arc::from([]))
    }
}

impl SplatSubset {
    /// The selected Gaussians.
    pub fn of(selection: &Selection) -> Self {
        Self(selection.ids().into())
    }

    /// The same as a bit for each of the `len` Gaussians of the cloud.
    pub fn to_selection(&self, len: usize) -> Selection {
        Selection::from_ids(len, self.0.iter().copied())
    }

    /// Whether the Gaussian belongs to the entity.
    pub fn contains(&self, id: u32) -> bool {
        self.0.binary_search(&id).is_ok()
    }
}

impl Serialize for SplatSubset {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // Bits are stored as runs: far shorter than the ids.
        let len = self.0.last().map_or(0, |&id| id as usize + 1);
        self.to_selection(len).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for SplatSubset {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let selection = Selection::deserialize(deserializer)?;
        if u32::try_from(selection.len()).is_err() {
            return Err(D::Error::custom("more Gaussians than 32-bit ids can name"));
        }
        Ok(Self::of(&selection))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subset_is_the_selection_it_was_made_of() {
        let selection = Selection::from_ids(200, [0, 3, 64, 199]);
        let subset = SplatSubset::of(&selection);
        assert_eq!(subset.to_selection(200), selection);
        assert!(subset.contains(64) && !subset.contains(65));
        assert_eq!(SplatSubset::default().to_selection(9), Selection::none(9));
    }
}
