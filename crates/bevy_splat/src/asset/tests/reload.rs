use std::path::Path;

use bevy::asset::io::memory::Dir;
use bevy::prelude::*;
use splat_core::{PartId, Parts, SelectMode, Selection};
use splat_io::{WriteOptions, format_named, write_as};

use crate::Splats;
use crate::asset::SplatCloud;
use crate::components::{SplatFlags, SplatHighlightPlugin, SplatParts, SplatSelection, SplatSubset, SplatTint};
use crate::parts::{DespawnedParts, SplatPartsPlugin, extract_part, restore_part};
use crate::testing::{app, app_with_files, cloud, finished, spawn, update_until};

fn put(files: &Dir, len: usize) {
    let mut bytes = Vec::new();
    write_as(format_named("ply").unwrap(), &cloud(len).cloud, &WriteOptions::default(), &mut bytes).unwrap();
    files.insert_asset(Path::new("room.ply"), bytes);
}

fn len(app: &App, entity: Entity) -> usize {
    let handle = &app.world().get::<Splats>(entity).unwrap().0;
    app.world().resource::<Assets<SplatCloud>>().get(handle).unwrap().cloud.len()
}

/// A capture from a file of 100 Gaussians, all of whose components say something.
fn scene() -> (App, Dir, Entity) {
    let (mut app, files) = app_with_files();
    app.add_plugins((SplatHighlightPlugin, SplatPartsPlugin));
    put(&files, 100);
    let handle = app.world().resource::<AssetServer>().load::<SplatCloud>("room.ply");
    finished(&mut app, &handle).unwrap();
    let mut parts = Parts::new(100);
    let part = parts.add("chair", [1, 2, 3], None).unwrap();
    parts.assign(part, &Selection::from_fn(100, |i| i >= 60), SelectMode::New).unwrap();
    let flags = SplatFlags { hidden: Selection::from_ids(100, [1, 99]), locked: Selection::none(100) };
    let selection = SplatSelection(Selection::from_ids(100, [2, 98]));
    let capture = app.world_mut().spawn((Splats(handle), flags, selection, SplatParts(parts))).id();
    app.update();
    (app, files, capture)
}

fn reload(app: &mut App, capture: Entity, new: usize) {
    app.world().resource::<AssetServer>().reload("room.ply");
    update_until(app, |app| len(app, capture) == new);
    app.update();
}

#[test]
fn a_file_of_another_length_replaces_the_cloud_and_resets_what_no_longer_fits() {
    for new in [7, 250] {
        let (mut app, files, capture) = scene();
        let chair = extract_part(app.world_mut(), capture, PartId(1)).unwrap();
        app.update();
        put(&files, new);
        reload(&mut app, capture, new);
        let entity = app.world().entity(capture);
        assert_eq!(entity.get::<SplatFlags>(), Some(&SplatFlags::default()));
        assert_eq!(entity.get::<SplatSelection>(), Some(&SplatSelection::default()));
        assert_eq!(entity.get::<SplatParts>(), Some(&SplatParts::default()));
        assert_eq!(entity.get::<SplatSubset>(), None, "the capture shows all there is now");
        assert_eq!(entity.get::<SplatTint>(), None);
        assert_eq!(app.world().get::<SplatSubset>(chair), Some(&SplatSubset::default()), "the part has none of them");
        // Nothing is left of the part that could come back.
        restore_part(app.world_mut(), chair).unwrap();
        assert_eq!(app.world().get::<SplatSubset>(capture), None);
        app.update();
    }
}

#[test]
fn a_file_of_the_same_length_keeps_everything() {
    let (mut app, files, capture) = scene();
    let of = |app: &App| {
        let entity = app.world().entity(capture);
        let kept = (entity.get::<SplatFlags>(), entity.get::<SplatSelection>(), entity.get::<SplatParts>());
        (kept.0.cloned(), kept.1.cloned(), kept.2.cloned())
    };
    let before = of(&app);
    put(&files, 100);
    let handle = app.world().get::<Splats>(capture).unwrap().0.clone();
    let former = app.world().resource::<Assets<SplatCloud>>().get(&handle).unwrap().cloud.clone();
    app.world().resource::<AssetServer>().reload("room.ply");
    let now = |app: &App| app.world().resource::<Assets<SplatCloud>>().get(&handle).unwrap().cloud.clone();
    update_until(&mut app, |app| !std::sync::Arc::ptr_eq(&now(app), &former));
    app.update();
    assert_eq!(of(&app), before);
}

#[test]
fn a_file_that_is_damaged_leaves_the_former_cloud() {
    let (mut app, files, capture) = scene();
    let before = app.world().get::<SplatSelection>(capture).cloned();
    files.insert_asset(Path::new("room.ply"), b"ply\n".to_vec());
    let handle = app.world().get::<Splats>(capture).unwrap().0.clone();
    app.world().resource::<AssetServer>().reload("room.ply");
    update_until(&mut app, |app| app.world().resource::<AssetServer>().load_state(&handle).is_failed());
    app.update();
    assert_eq!(len(&app, capture), 100);
    assert_eq!(app.world().get::<SplatSelection>(capture).cloned(), before);
    put(&files, 30);
    reload(&mut app, capture, 30);
    assert_eq!(app.world().get::<SplatSelection>(capture), Some(&SplatSelection::default()));
}

#[test]
fn a_cloud_replaced_in_code_resets_too() {
    let mut app = app();
    app.add_plugins(SplatPartsPlugin);
    let capture = spawn(&mut app, 50);
    app.world_mut().entity_mut(capture).insert(SplatParts(Parts::from_labels((0..50).map(|i| i / 40).collect())));
    app.update();
    let part = extract_part(app.world_mut(), capture, PartId(1)).unwrap();
    app.world_mut().despawn(part);
    assert!(app.world().get::<DespawnedParts>(capture).is_some());
    let handle = app.world().get::<Splats>(capture).unwrap().0.clone();
    app.world_mut().resource_mut::<Assets<SplatCloud>>().get_mut(&handle).unwrap().cloud = cloud(60).cloud;
    app.update();
    let entity = app.world().entity(capture);
    assert!(entity.get::<SplatSubset>().is_none() && entity.get::<DespawnedParts>().is_none());
    assert_eq!(entity.get::<SplatParts>(), Some(&SplatParts::default()));
}

#[test]
fn bits_that_never_fitted_are_reset_when_the_cloud_is_there() {
    let mut app = app();
    let capture = spawn(&mut app, 10);
    let flags = SplatFlags { hidden: Selection::all(9), locked: Selection::all(10) };
    app.world_mut().entity_mut(capture).insert((flags, SplatSubset(vec![1, 10].into())));
    app.update();
    let entity = app.world().entity(capture);
    let wanted = SplatFlags { hidden: Selection::default(), locked: Selection::all(10) };
    assert_eq!((entity.get::<SplatFlags>(), entity.get::<SplatSubset>()), (Some(&wanted), None));
}

#[test]
fn a_thousand_captures_come_and_go_without_a_trace() {
    let mut app = app();
    app.add_plugins((SplatHighlightPlugin, SplatPartsPlugin));
    app.update();
    let (entities, clouds) =
        (app.world().entities().count_spawned(), app.world().resource::<Assets<SplatCloud>>().len());
    for k in 0..1000 {
        let capture = spawn(&mut app, 64);
        app.world_mut()
            .entity_mut(capture)
            .insert((SplatSelection(Selection::all(64)), SplatParts(Parts::from_labels(vec![1; 64]))));
        app.update();
        let part = extract_part(app.world_mut(), capture, PartId(1)).unwrap();
        if k % 3 == 0 {
            app.update();
        }
        app.world_mut().despawn(part);
        app.world_mut().despawn(capture);
    }
    app.update();
    app.update();
    assert_eq!(app.world().entities().count_spawned(), entities);
    assert_eq!(app.world().resource::<Assets<SplatCloud>>().len(), clouds);
}
