//! Bits and labels at the length of their cloud.

use bevy::asset::AssetPath;
use bevy::prelude::*;
use splat_core::{Parts, Selection};

use super::SplatCloud;
use crate::Splats;
use crate::components::{SplatFlags, SplatParts, SplatSelection, SplatSubset};
use crate::parts::{DespawnedParts, PartOf};

/// Resets what no longer fits the cloud, in `PreUpdate` after assets came in and again in `PostUpdate`.
///
/// Selections, flags, parts and subsets name Gaussians by their position in the file. When a file is loaded again with another
/// number of Gaussians, or the handle is exchanged, nobody can say which is which: they are reset, and a warning says what
/// was lost. A capture then shows all of its new Gaussians; an entity that was a part of it shows none.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SplatFitSystems;

/// The number of Gaussians that an entity's ids count through.
#[derive(Component)]
pub(crate) struct CloudLength(usize);

type Counted<'a> = (
    Entity,
    &'a Splats,
    Option<&'a mut CloudLength>,
    Mut<'a, SplatFlags>,
    Option<Mut<'a, SplatSelection>>,
    Option<Mut<'a, SplatParts>>,
    Option<Mut<'a, SplatSubset>>,
    (Has<PartOf>, Has<DespawnedParts>, Option<&'a Name>),
);

pub(super) fn fit(mut commands: Commands, clouds: Res<Assets<SplatCloud>>, mut splats: Query<Counted>) {
    for (entity, handle, known, mut flags, selection, parts, subset, (part, despawned, name)) in &mut splats {
        let Some(asset) = clouds.get(&handle.0) else { continue };
        let len = asset.cloud.len();
        let before = known.as_ref().map(|known| known.0);
        match known {
            Some(known) if known.0 == len => {}
            Some(mut known) => known.0 = len,
            None => {
                commands.entity(entity).try_insert(CloudLength(len));
            }
        }
        let mut lost = Vec::new();
        for (what, hidden) in [("hidden", true), ("locked", false)] {
            let bits = if hidden { &flags.hidden } else { &flags.locked };
            if let Some(count) = misfit(bits, len) {
                note(&mut lost, count, what);
                let bits = if hidden { &mut flags.hidden } else { &mut flags.locked };
                *bits = Selection::default();
            }
        }
        if let Some(mut selection) = selection
            && let Some(count) = misfit(&selection, len)
        {
            note(&mut lost, count, "selected");
            selection.0 = Selection::default();
        }
        if let Some(mut parts) = parts
            && parts.len() != len
            && **parts != Parts::default()
        {
            let count = parts.iter().count();
            if count > 0 {
                lost.push(format!("{count} parts"));
            }
            parts.0 = Parts::default();
        }
        if let Some(mut subset) = subset {
            let beyond = subset.0.last().is_some_and(|&id| id as usize >= len);
            // A longer file does not show in the ids themselves.
            if beyond || before.is_some_and(|before| before != len && !subset.0.is_empty()) {
                lost.push("which Gaussians belong to it".to_owned());
                if part {
                    *subset = SplatSubset::default();
                } else {
                    commands.entity(entity).try_remove::<SplatSubset>();
                }
            }
        }
        if despawned && before.is_some_and(|before| before != len) {
            lost.push("the parts that were despawned".to_owned());
            commands.entity(entity).try_remove::<DespawnedParts>();
        }
        if !lost.is_empty() {
            let named = name.map_or_else(|| entity.to_string(), |name| format!("`{name}`"));
            let path = handle.0.path().map_or_else(|| "a cloud made in code".to_owned(), AssetPath::to_string);
            let lost = lost.join(", ");
            warn!(
                "the cloud of {named} now has {len} Gaussians; what was kept for another number was reset ({lost}): {path}"
            );
        }
    }
}

/// How many bits are lost, if the bits do not fit.
fn misfit(bits: &Selection, len: usize) -> Option<usize> {
    (!bits.is_empty() && bits.len() != len).then(|| bits.count())
}

fn note(lost: &mut Vec<String>, count: usize, what: &str) {
    if count > 0 {
        lost.push(format!("{count} {what} Gaussians"));
    }
}
