//! What goes with a Gaussian from one entity to another: whether it is selected, hidden, locked.

use bevy::prelude::*;
use splat_core::{SelectMode, Selection};

use crate::components::{SplatFlags, SplatSelection};

/// The bits of some Gaussians, by cloud id; an empty `Selection` means none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Bits {
    pub(super) flags: SplatFlags,
    /// `None`: the entity had no `SplatSelection`.
    pub(super) selection: Option<SplatSelection>,
}

impl Bits {
    /// Takes the bits of `ids` out of an entity.
    pub(super) fn take(entity: &mut EntityWorldMut, ids: &Selection) -> Self {
        let mut bits = Self::default();
        if let Some(mut flags) = entity.get_mut::<SplatFlags>() {
            bits.flags.hidden = take(&mut flags.reborrow().map_unchanged(|f| &mut f.hidden), ids);
            bits.flags.locked = take(&mut flags.map_unchanged(|f| &mut f.locked), ids);
        }
        if let Some(selection) = entity.get_mut::<SplatSelection>() {
            bits.selection = Some(SplatSelection(take(&mut selection.map_unchanged(|s| &mut s.0), ids)));
        }
        bits
    }

    /// The bits that an entity has.
    pub(super) fn of(entity: EntityRef) -> Self {
        Self {
            flags: entity.get::<SplatFlags>().cloned().unwrap_or_default(),
            selection: entity.get::<SplatSelection>().cloned(),
        }
    }

    /// Gives the bits of `ids` to an entity; its others stay.
    pub(super) fn put(&self, entity: &mut EntityWorldMut, ids: &[u32]) {
        let nothing = Selection::default();
        let own = self.selection.as_ref().map_or(&nothing, |selection| &selection.0);
        // What an entity's bits say about Gaussians that are not its own means nothing, so that they are never taken as a whole.
        if !entity.contains::<SplatFlags>() {
            entity.insert(SplatFlags::default());
        }
        if !entity.contains::<SplatSelection>() && ids.iter().any(|&id| own.contains(id as usize)) {
            entity.insert(SplatSelection::default());
        }
        if let Some(mut flags) = entity.get_mut::<SplatFlags>() {
            put(&mut flags.reborrow().map_unchanged(|f| &mut f.hidden), &self.flags.hidden, ids);
            put(&mut flags.map_unchanged(|f| &mut f.locked), &self.flags.locked, ids);
        }
        if let Some(selection) = entity.get_mut::<SplatSelection>() {
            put(&mut selection.map_unchanged(|s| &mut s.0), own, ids);
        }
    }
}

/// Changes nothing, change detection included, where no bit is set.
fn take(from: &mut Mut<Selection>, ids: &Selection) -> Selection {
    let mut taken = Selection::default();
    if from.len() == ids.len() {
        taken = ids.clone();
        taken.apply(SelectMode::Intersect, from);
    }
    if taken.count() == 0 {
        return Selection::default();
    }
    from.apply(SelectMode::Subtract, ids);
    taken
}

/// Changes nothing, change detection included, where the bits are as they should be.
fn put(to: &mut Mut<Selection>, bits: &Selection, ids: &[u32]) {
    let differs = |&&id: &&u32| to.contains(id as usize) != bits.contains(id as usize);
    let differing: Vec<u32> = ids.iter().filter(differs).copied().collect();
    if differing.is_empty() {
        return;
    }
    if to.is_empty() {
        **to = Selection::none(bits.len());
    }
    let len = to.len();
    for id in differing.into_iter().map(|id| id as usize).filter(|&id| id < len) {
        to.toggle(id..id + 1);
    }
}
