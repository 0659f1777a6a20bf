//! [`SplatFlags`]: which Gaussians of an entity are hidden or locked.

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_core::{SelectMode, Selection};

use super::selection::apply;

/// Hidden and locked Gaussians of a [`Splats`](crate::Splats) entity. An empty `Selection`, the default, means none.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplatFlags {
    /// Not drawn, not picked, not selected by tools.
    pub hidden: Selection,
    /// Drawn and hit by pointers, which can tell; not selected by tools.
    pub locked: Selection,
}

impl SplatFlags {
    /// Hides these Gaussians; `set` has a bit for each of the cloud.
    pub fn hide(&mut self, set: &Selection) {
        apply(&mut self.hidden, SelectMode::Add, set);
    }

    /// Shows these Gaussians again.
    pub fn show(&mut self, set: &Selection) {
        apply(&mut self.hidden, SelectMode::Subtract, set);
    }

    /// Locks these Gaussians.
    pub fn lock(&mut self, set: &Selection) {
        apply(&mut self.locked, SelectMode::Add, set);
    }

    /// Unlocks these Gaussians.
    pub fn unlock(&mut self, set: &Selection) {
        apply(&mut self.locked, SelectMode::Subtract, set);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_are_hidden_and_locked_apart_from_each_other() {
        let set = |ids: &[u32]| Selection::from_ids(9, ids.iter().copied());
        let mut flags = SplatFlags::default();
        flags.hide(&set(&[1, 2]));
        flags.lock(&set(&[2, 3]));
        flags.hide(&set(&[5]));
        flags.show(&set(&[2, 8]));
        flags.unlock(&set(&[3]));
        assert_eq!((flags.hidden.ids(), flags.locked.ids()), (vec![1, 5], vec![2]));
    }
}
