//! [`SplatTint`]: the colours that selection and parts lay over Gaussians, computed anew only where something changed.

use std::ops::Range;
use std::sync::Arc;

use bevy::prelude::*;
use rayon::prelude::*;
use splat_core::{Parts, Selection};

use super::{DefaultSplatHighlight, SplatHighlight, SplatParts, SplatSelection};
use crate::asset::{SplatCloud, SplatFitSystems};
use crate::splats::Splats;

/// For each Gaussian of the cloud: sRGB red, green, blue, and with what strength (0 to 255) they are mixed over its own colour.
///
/// Made by [`SplatHighlightPlugin`] from selection, parts and [`SplatHighlight`]; absent where nothing is to be shown.
#[derive(Component, Clone, Debug, PartialEq, Eq)]
#[require(SplatTintChange)]
pub struct SplatTint(pub Arc<[[u8; 4]]>);

/// What the last change of a [`SplatTint`] changed, so that only that need be uploaded.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq)]
pub struct SplatTintChange {
    /// Rises by one with each change.
    pub version: u64,
    /// Ids that may differ from the version before, rising, apart from each other. Who has an older version needs all.
    pub ranges: Vec<Range<u32>>,
}

/// When [`SplatTint`] is brought up to date: in `PostUpdate`.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SplatTintSystems;

/// Shows selections and parts: keeps [`SplatTint`] as [`SplatHighlight`] and [`DefaultSplatHighlight`] say. Needs
/// [`SplatAssetPlugin`](crate::asset::SplatAssetPlugin).
///
/// A frame in which nothing changed costs nothing; one in which some Gaussians were selected costs these, and a copy of the
/// tint while the renderer still has the former one.
pub struct SplatHighlightPlugin;

impl Plugin for SplatHighlightPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<DefaultSplatHighlight>()
            .register_type::<(SplatHighlight, DefaultSplatHighlight)>()
            .add_systems(PostUpdate, update_tints.in_set(SplatTintSystems).after(SplatFitSystems));
    }
}

/// What a [`SplatTint`] was made of.
#[derive(Component, Default)]
struct TintedBy {
    len: usize,
    selection: Selection,
    selected: [u8; 4],
    /// By label; empty where parts are not shown.
    parts: Vec<[u8; 4]>,
}

type Tinted<'a> = (
    Entity,
    &'a Splats,
    Option<Ref<'a, SplatSelection>>,
    Option<Ref<'a, SplatParts>>,
    Option<&'a SplatHighlight>,
    Option<&'a mut TintedBy>,
    Option<&'a mut SplatTint>,
    Option<&'a mut SplatTintChange>,
);

fn update_tints(
    mut commands: Commands,
    clouds: Res<Assets<SplatCloud>>,
    default: Res<DefaultSplatHighlight>,
    mut splats: Query<Tinted>,
) {
    for (entity, handle, selection, parts, highlight, by, tint, change) in &mut splats {
        let Some(len) = clouds.get(&handle.0).map(|asset| asset.cloud.len()) else { continue };
        let highlight = highlight.unwrap_or(&default);
        let selected = mixed(highlight.selection_color.to_u8_array_no_alpha(), highlight.selection_strength);
        let selection = selection.as_ref().filter(|bits| selected[3] > 0 && bits.len() == len);
        let parts = parts.as_ref().filter(|parts| parts.len() == len);
        let colors = parts.map_or_else(Vec::new, |parts| part_colors(parts, highlight.part_strength));
        let nothing = Selection::default();
        let bits = selection.map_or(&nothing, |bits| &bits.0);
        let labels: &[u16] = parts.filter(|_| !colors.is_empty()).map_or(&[], |parts| parts.labels());

        let labels_changed = !labels.is_empty() && parts.is_some_and(|parts| parts.is_changed());
        let bits_changed = selection.is_some_and(|bits| bits.is_changed());
        let mut whole = true;
        if let Some(by) = &by
            && by.len == len
        {
            whole = labels_changed || by.parts != colors || by.selected != selected;
            // A selection that came or went has another length than none.
            if !whole && !bits_changed && by.selection.len() == bits.len() {
                continue;
            }
        }
        let shown = bits.count() > 0 || !labels.is_empty();
        let version = change.as_ref().map_or(0, |change| change.version) + 1;
        match (tint, &by, change) {
            (None, ..) if !shown => {}
            (Some(_), ..) if !shown => {
                commands.entity(entity).try_remove::<SplatTint>();
            }
            (Some(mut tint), Some(by), Some(mut change)) if by.len == len => {
                let ranges = if whole {
                    recolor(&mut tint, tint_of(len, bits, selected, labels, &colors))
                } else {
                    retint(&mut tint, &by.selection, bits, |i| color_of(i, bits, selected, labels, &colors))
                };
                if !ranges.is_empty() {
                    *change = SplatTintChange { version, ranges };
                }
            }
            _ => {
                let tint = SplatTint(tint_of(len, bits, selected, labels, &colors));
                // A cloud has at most u32::MAX Gaussians.
                let ranges = std::iter::once(0..len as u32).collect();
                commands.entity(entity).try_insert((tint, SplatTintChange { version, ranges }));
            }
        }
        let new = TintedBy { len, selection: bits.clone(), selected, parts: colors };
        match by {
            Some(mut by) => *by = new,
            None => {
                commands.entity(entity).try_insert(new);
            }
        }
    }
}

fn mixed([r, g, b]: [u8; 3], strength: f32) -> [u8; 4] {
    // NaN becomes 0.
    [r, g, b, (strength * 255.0).round() as u8]
}

/// Colour and strength by label, the rest first; empty where nothing would show.
fn part_colors(parts: &Parts, strength: f32) -> Vec<[u8; 4]> {
    let Some((last, _)) = parts.iter().last() else { return Vec::new() };
    if mixed([0; 3], strength)[3] == 0 {
        return Vec::new();
    }
    let mut colors = vec![[0; 4]; usize::from(last.0) + 1];
    for (id, part) in parts.iter() {
        colors[usize::from(id.0)] = mixed(part.color, strength);
    }
    colors
}

fn color_of(i: usize, bits: &Selection, selected: [u8; 4], labels: &[u16], parts: &[[u8; 4]]) -> [u8; 4] {
    if bits.contains(i) {
        return selected;
    }
    labels.get(i).and_then(|&label| parts.get(usize::from(label))).copied().unwrap_or_default()
}

fn tint_of(len: usize, bits: &Selection, selected: [u8; 4], labels: &[u16], parts: &[[u8; 4]]) -> Arc<[[u8; 4]]> {
    let color = |i| color_of(i, bits, selected, labels, parts);
    (0..len).into_par_iter().with_min_len(1 << 14).map(color).collect::<Vec<_>>().into()
}

/// Colours the Gaussians anew whose bit changed.
fn retint(
    tint: &mut Mut<SplatTint>,
    before: &Selection,
    after: &Selection,
    color: impl Fn(usize) -> [u8; 4],
) -> Vec<Range<u32>> {
    let words = before.words().len().max(after.words().len());
    let word = |bits: &Selection, k: usize| bits.words().get(k).copied().unwrap_or(0);
    let changed = |k: usize| word(before, k) ^ word(after, k);
    let ranges = ranges((0..words).filter(|&k| changed(k) != 0), 64, tint.0.len());
    if ranges.is_empty() {
        return ranges;
    }
    let tint = Arc::make_mut(&mut tint.0);
    for k in 0..words {
        let mut bits = changed(k);
        while bits != 0 {
            let i = 64 * k + bits.trailing_zeros() as usize;
            tint[i] = color(i);
            bits &= bits - 1;
        }
    }
    ranges
}

/// Puts a tint of the same length in place; returns where it differs.
fn recolor(tint: &mut Mut<SplatTint>, new: Arc<[[u8; 4]]>) -> Vec<Range<u32>> {
    let blocks = tint.0.chunks(64).zip(new.chunks(64)).enumerate();
    let ranges = ranges(blocks.filter(|(_, (a, b))| a != b).map(|(k, _)| k), 64, new.len());
    if !ranges.is_empty() {
        tint.0 = new;
    }
    ranges
}

/// Blocks of `size` ids as ranges; what lies near each other is one range, because each upload has a cost of its own.
fn ranges(blocks: impl Iterator<Item = usize>, size: usize, len: usize) -> Vec<Range<u32>> {
    const NEAR: usize = 4096;
    let mut ranges: Vec<Range<u32>> = Vec::new();
    for block in blocks {
        // Ids are 32 bits wide.
        let (start, end) = ((block * size) as u32, ((block + 1) * size).min(len) as u32);
        match ranges.last_mut() {
            Some(last) if start - last.end <= NEAR as u32 => last.end = end,
            _ => ranges.push(start..end),
        }
    }
    ranges
}

#[cfg(test)]
mod tests;
