use splat_core::{SelectMode, glam};

use super::*;
use crate::testing;

/// The definition, one Gaussian at a time.
fn slow(world: &World, entity: Entity, len: usize) -> Option<Vec<[u8; 4]>> {
    let highlight = world.get::<SplatHighlight>(entity).copied().unwrap_or(**world.resource::<DefaultSplatHighlight>());
    let strength = |s: f32| (s * 255.0).round() as u8;
    let color = highlight.selection_color;
    let byte = |c: f32| (c * 255.0).round() as u8;
    let tint: Vec<[u8; 4]> = (0..len)
        .map(|i| {
            let selected = world.get::<SplatSelection>(entity).is_some_and(|s| s.contains(i));
            if selected && strength(highlight.selection_strength) > 0 {
                return [byte(color.red), byte(color.green), byte(color.blue), strength(highlight.selection_strength)];
            }
            let parts = world.get::<SplatParts>(entity);
            let part = parts.and_then(|parts| parts.get(parts.part_of(i)?));
            match part {
                Some(part) if strength(highlight.part_strength) > 0 => {
                    [part.color[0], part.color[1], part.color[2], strength(highlight.part_strength)]
                }
                _ => [0; 4],
            }
        })
        .collect();
    tint.iter().any(|t| t[3] > 0).then_some(tint)
}

fn app() -> (App, Entity) {
    let mut app = testing::app();
    app.add_plugins(SplatHighlightPlugin);
    let entity = testing::spawn(&mut app, 10_000);
    (app, entity)
}

/// Runs a frame and checks the tint, and that what changed lies in the ranges told.
fn check(app: &mut App, entity: Entity) -> Vec<(u32, u32)> {
    let of = |world: &World| world.get::<SplatTint>(entity).map(|tint| tint.0.to_vec());
    let version = |world: &World| world.get::<SplatTintChange>(entity).map_or(0, |change| change.version);
    let (before, old) = (of(app.world()), version(app.world()));
    app.update();
    let (after, wanted) = (of(app.world()), slow(app.world(), entity, 10_000));
    assert_eq!(after.clone().filter(|t| t.iter().any(|t| t[3] > 0)), wanted);
    let Some(after) = after else { return Vec::new() };
    let new = version(app.world());
    if new == old {
        assert_eq!(before.as_ref(), Some(&after), "nothing was told");
        return Vec::new();
    }
    let ranges = app.world().get::<SplatTintChange>(entity).unwrap().ranges.clone();
    assert_eq!(new, old + 1);
    assert!(
        ranges.windows(2).all(|w| w[0].end < w[1].start) && ranges.iter().all(|r| r.start < r.end && r.end <= 10_000)
    );
    if let Some(before) = before {
        let told = |i: u32| ranges.iter().any(|r| r.contains(&i));
        assert!((0..10_000).all(|i| told(i) || before[i as usize] == after[i as usize]));
    }
    ranges.iter().map(|range| (range.start, range.end)).collect()
}

fn select(app: &mut App, entity: Entity, ids: impl IntoIterator<Item = u32>) {
    app.world_mut().entity_mut(entity).insert(SplatSelection(Selection::from_ids(10_000, ids)));
}

#[test]
fn the_tint_follows_selection_parts_and_settings() {
    let (mut app, entity) = app();
    assert_eq!(check(&mut app, entity), []);
    assert_eq!(app.world().get::<SplatTint>(entity), None);

    select(&mut app, entity, [3, 700, 9999]);
    assert_eq!(check(&mut app, entity), [(0, 10_000)]);
    // One more Gaussian is one block.
    select(&mut app, entity, [3, 130, 700, 9999]);
    assert_eq!(check(&mut app, entity), [(128, 192)]);
    // Two far apart are two.
    select(&mut app, entity, [700]);
    assert_eq!(check(&mut app, entity), [(0, 192), (9984, 10_000)]);
    // The same again is nothing.
    select(&mut app, entity, [700]);
    assert_eq!(check(&mut app, entity), []);
    assert_eq!(check(&mut app, entity), []);

    let mut parts = Parts::new(10_000);
    let chair = parts.add("chair", [9, 200, 30], None).unwrap();
    parts.assign(chair, &Selection::from_fn(10_000, |i| (600..800).contains(&i)), SelectMode::New).unwrap();
    app.world_mut().entity_mut(entity).insert(SplatParts(parts));
    assert_eq!(check(&mut app, entity), [], "parts are not shown");
    app.world_mut().entity_mut(entity).insert(SplatHighlight { part_strength: 0.5, ..default() });
    assert_eq!(check(&mut app, entity), [(576, 832)]);
    app.world_mut().get_mut::<SplatParts>(entity).unwrap().recolor(chair, [1, 2, 3]).unwrap();
    assert_eq!(check(&mut app, entity), [(576, 832)]);
    // Selected Gaussians of a part get the part's colour back.
    select(&mut app, entity, []);
    assert_eq!(check(&mut app, entity), [(640, 704)]);

    app.world_mut().entity_mut(entity).remove::<SplatParts>();
    check(&mut app, entity);
    assert_eq!(app.world().get::<SplatTint>(entity), None);
    select(&mut app, entity, [5]);
    assert_eq!(check(&mut app, entity), [(0, 10_000)]);
    app.world_mut().entity_mut(entity).remove::<SplatHighlight>();
    app.world_mut().resource_mut::<DefaultSplatHighlight>().selection_color = Srgba::rgb_u8(10, 20, 30);
    check(&mut app, entity);
    app.world_mut().resource_mut::<DefaultSplatHighlight>().selection_strength = f32::NAN;
    check(&mut app, entity);
    assert_eq!(app.world().get::<SplatTint>(entity), None);
}

#[test]
fn a_selection_of_another_length_tints_nothing() {
    let (mut app, entity) = app();
    app.world_mut().entity_mut(entity).insert(SplatSelection(Selection::all(7)));
    app.update();
    assert_eq!(app.world().get::<SplatTint>(entity), None);
}

#[test]
fn another_cloud_gets_a_tint_of_its_own_length() {
    let (mut app, entity) = app();
    select(&mut app, entity, [5]);
    app.update();
    let other = testing::cloud(20);
    let other = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(other);
    app.world_mut().entity_mut(entity).insert((Splats(other), SplatSelection(Selection::all(20))));
    app.update();
    assert_eq!(app.world().get::<SplatTint>(entity).unwrap().0.len(), 20);
    assert_eq!(app.world().get::<SplatTintChange>(entity).unwrap().ranges, std::slice::from_ref(&(0..20)));
    assert_eq!(testing::cloud(1).cloud.means()[0], glam::Vec3::ZERO);
}
