//! Does [`SelectRequest`]s, in the order they came.

use bevy::prelude::*;
use splat_core::{Selection, SelectionDelta};
use splat_raster::cpu::CpuRasterizer;

use super::by::Chooser;
use super::{SelectError, SelectFailed, SelectRequest, SelectionChanged};
use crate::SplatSelection;

pub(super) fn apply(
    mut commands: Commands,
    mut requests: MessageReader<SelectRequest>,
    chooser: Chooser,
    mut selections: Query<&mut SplatSelection>,
    mut changed: MessageWriter<SelectionChanged>,
    mut failed: MessageWriter<SelectFailed>,
    mut raster: Local<CpuRasterizer>,
) {
    // Selections of entities that have none yet: the component comes when commands are applied.
    let mut fresh: Vec<(Entity, Selection)> = Vec::new();
    for request in requests.read() {
        let entity = request.entity;
        let place = fresh.iter().position(|(e, _)| *e == entity);
        let current = match (place, selections.get(entity)) {
            (Some(k), _) => Some(&fresh[k].1),
            (None, Ok(selection)) => Some(&selection.0),
            (None, Err(_)) => None,
        };
        let change = match change(&chooser, request, current, &mut raster) {
            Ok(Some(change)) => change,
            Ok(None) => continue,
            Err(reason) => {
                failed.write(SelectFailed { entity, reason });
                continue;
            }
        };
        let (before, after) = change;
        let delta = SelectionDelta::between(&before, &after);
        changed.write(SelectionChanged { entity, before: before.count(), after: after.count(), delta });
        match (place, selections.get_mut(entity)) {
            (Some(k), _) => fresh[k].1 = after,
            (None, Ok(mut selection)) => selection.0 = after,
            (None, Err(_)) => fresh.push((entity, after)),
        }
    }
    for (entity, selection) in fresh {
        commands.entity(entity).try_insert(SplatSelection(selection));
    }
}

/// What is selected before and after; `None` if that is the same.
fn change(
    chooser: &Chooser,
    request: &SelectRequest,
    current: Option<&Selection>,
    raster: &mut CpuRasterizer,
) -> Result<Option<(Selection, Selection)>, SelectError> {
    let len = chooser.len(request.entity)?;
    // Bits of another length, such as none at all, mean nothing selected.
    let before = current.filter(|s| s.len() == len).cloned().unwrap_or_else(|| Selection::none(len));
    let set = chooser.set(request.entity, &before, &request.by, raster)?;
    let mut after = before.clone();
    after.apply(request.mode, &set);
    Ok((before != after).then_some((before, after)))
}
