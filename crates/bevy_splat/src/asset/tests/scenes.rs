use std::path::Path;

use bevy::camera::visibility::VisibilityClass;
use bevy::prelude::*;
use bevy::world_serialization::{DynamicWorld, DynamicWorldBuilder, DynamicWorldRoot, WorldSerializationPlugin};
use splat_core::{PartId, Parts, SelectMode, Selection};
use splat_io::{WriteOptions, format_named, write_as};

use crate::asset::SplatCloud;
use crate::components::{SplatFlags, SplatHighlight, SplatHighlightPlugin, SplatParts, SplatSelection, SplatSubset};
use crate::parts::{PartOf, SplatPart, SplatPartsPlugin, extract_part, restore_part};
use crate::testing::{app_with_files, cloud, finished, update_until};
use crate::{Splats, UPRIGHT};

type Kept = (
    Option<Splats>,
    Option<SplatFlags>,
    Option<SplatSelection>,
    Option<SplatSubset>,
    Option<SplatParts>,
    Option<SplatHighlight>,
    Option<Transform>,
    Option<SplatPart>,
);

fn kept(world: &World, entity: Entity) -> Kept {
    let e = world.entity(entity);
    (
        e.get().cloned(),
        e.get().cloned(),
        e.get().cloned(),
        e.get().cloned(),
        e.get().cloned(),
        e.get().cloned(),
        e.get().cloned(),
        e.get().cloned(),
    )
}

#[test]
fn a_scene_file_brings_captures_and_their_parts_back() {
    let (mut app, files) = app_with_files();
    app.add_plugins((WorldSerializationPlugin, SplatHighlightPlugin, SplatPartsPlugin));
    app.finish();
    let mut bytes = Vec::new();
    write_as(format_named("spz").unwrap(), &cloud(500).cloud, &WriteOptions::default(), &mut bytes).unwrap();
    files.insert_asset(Path::new("room.spz"), bytes);
    let handle = app.world().resource::<AssetServer>().load::<SplatCloud>("room.spz");
    finished(&mut app, &handle).unwrap();

    let mut parts = Parts::new(500);
    let chair = parts.add("chair", [200, 10, 30], None).unwrap();
    let seat = parts.add("seat", [20, 100, 30], Some(chair)).unwrap();
    parts.assign(chair, &Selection::from_fn(500, |i| (100..300).contains(&i)), SelectMode::New).unwrap();
    parts.assign(seat, &Selection::from_fn(500, |i| (150..200).contains(&i)), SelectMode::New).unwrap();
    parts.lock(chair).unwrap();
    let flags = SplatFlags {
        hidden: Selection::from_fn(500, |i| i % 7 == 0),
        locked: Selection::from_fn(500, |i| (i * i) % 11 < 5),
    };
    let selection = SplatSelection(Selection::from_fn(500, |i| i % 2 == 0));
    let highlight = SplatHighlight { part_strength: 0.25, ..default() };
    let moved = UPRIGHT.with_translation(Vec3::new(1.0, 2.0, 3.0));
    let capture =
        app.world_mut().spawn((Splats(handle.clone()), flags, selection, SplatParts(parts), highlight, moved)).id();
    app.update();
    let whole = kept(app.world(), capture);
    let chair = extract_part(app.world_mut(), capture, PartId(1)).unwrap();
    app.world_mut().get_mut::<Transform>(chair).unwrap().translation.x += 5.0;
    app.update();
    let before = [kept(app.world(), capture), kept(app.world(), chair)];

    let text = {
        let registry = app.world().resource::<AppTypeRegistry>().read();
        let scene = DynamicWorldBuilder::from_world(app.world(), &registry)
            // Bevy computes it again, and cannot write it.
            .deny_component::<VisibilityClass>()
            .extract_entities([capture, chair].into_iter());
        scene.build().serialize(&registry).unwrap()
    };
    // What 500 bits and labels take in the text, quite apart from what Bevy writes of its own components.
    assert!(text.len() < 12_000, "{} bytes: {text}", text.len());
    app.world_mut().despawn(chair);
    app.world_mut().despawn(capture);
    files.insert_asset(Path::new("room.scn.ron"), text.into_bytes());

    let scene = app.world().resource::<AssetServer>().load::<DynamicWorld>("room.scn.ron");
    let state = scene.clone();
    app.world_mut().spawn(DynamicWorldRoot(scene));
    let mut found = None;
    update_until(&mut app, |app| {
        let state = app.world().resource::<AssetServer>().load_state(&state);
        assert!(!state.is_failed(), "{state:?}");
        let mut links = app.world_mut().query::<(Entity, &PartOf)>();
        found = links.iter(app.world()).next().map(|(part, link)| (part, link.0));
        found.is_some()
    });
    for _ in 0..3 {
        app.update();
    }
    let (chair, capture) = found.unwrap();
    // A part may be named before its capture, so that only the end tells who is who.
    assert_eq!([kept(app.world(), capture), kept(app.world(), chair)], before);
    assert_eq!(app.world().get::<VisibilityClass>(capture).unwrap().len(), 1, "it is seen");
    assert_eq!(restore_part(app.world_mut(), chair), Ok(capture));
    app.update();
    assert_eq!(kept(app.world(), capture), whole);
}

#[test]
fn a_scene_file_with_damaged_bits_is_refused_in_a_sentence() {
    let (mut app, files) = app_with_files();
    app.add_plugins(WorldSerializationPlugin);
    app.finish();
    let text = r#"(resources: {}, entities: {4294967297: (components: {
        "bevy_splat::components::selection::SplatSelection": ((len: 8, bits: Runs("AAk"))),
    })})"#;
    files.insert_asset(Path::new("broken.scn.ron"), text.as_bytes().to_vec());
    let scene = app.world().resource::<AssetServer>().load::<DynamicWorld>("broken.scn.ron");
    update_until(&mut app, |app| app.world().resource::<AssetServer>().load_state(&scene).is_failed());
    let bevy::asset::LoadState::Failed(error) = app.world().resource::<AssetServer>().load_state(&scene) else {
        unreachable!("it has failed")
    };
    assert!(error.to_string().contains("the bits of a selection of 8 Gaussians are damaged"), "{error}");
}
