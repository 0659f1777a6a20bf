//! One story after the other.

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::system::RunSystemOnce;

use super::*;
use crate::components::SplatHighlight;

fn extract(app: &mut App, capture: Entity, part: PartId) -> Entity {
    extract_part(app.world_mut(), capture, part).unwrap()
}

fn restore(app: &mut App, part: Entity) -> Entity {
    restore_part(app.world_mut(), part).unwrap()
}

#[test]
fn a_part_leaves_with_its_bits_and_comes_back_with_them() {
    let (mut app, capture) = scene();
    let world = app.world_mut();
    world.entity_mut(capture).insert((
        SplatSelection(Selection::from_fn(LEN, |i| i % 3 == 0)),
        SplatFlags { hidden: Selection::from_ids(LEN, [25, 26, 150]), locked: Selection::default() },
        RenderLayers::layer(3),
        SplatHighlight::OFF,
        Transform::from_xyz(1.0, 2.0, 3.0).with_scale(Vec3::splat(2.0)),
    ));
    let before = state(world, capture);
    let chair = extract(&mut app, capture, CHAIR);
    let world = app.world();

    assert_eq!(members(world, chair), (20..120).collect::<Vec<u32>>());
    assert_eq!(members(world, capture), (0..20).chain(120..300).collect::<Vec<u32>>());
    assert_eq!(world.get::<Splats>(chair), world.get::<Splats>(capture), "one cloud");
    assert_eq!(world.get::<Transform>(chair), world.get::<Transform>(capture), "nothing moves");
    assert_eq!(world.get::<PartOf>(chair), Some(&PartOf(capture)));
    assert_eq!(world.get::<SplatPart>(chair), Some(&SplatPart(CHAIR)));
    assert_eq!(world.get::<Name>(chair).unwrap().as_str(), "chair");
    assert_eq!(world.get::<RenderLayers>(chair), Some(&RenderLayers::layer(3)));
    assert_eq!(world.get::<SplatHighlight>(chair), Some(&SplatHighlight::OFF));
    assert_eq!(world.get::<ChildOf>(chair), None);
    let bits = |entity| world.get::<SplatSelection>(entity).unwrap().0.clone();
    assert_eq!(bits(chair), Selection::from_fn(LEN, |i| i % 3 == 0 && (20..120).contains(&i)));
    assert_eq!(bits(capture), Selection::from_fn(LEN, |i| i % 3 == 0 && !(20..120).contains(&i)));
    assert_eq!(world.get::<SplatFlags>(chair).unwrap().hidden.ids(), [25, 26]);
    assert_eq!(world.get::<SplatFlags>(capture).unwrap().hidden.ids(), [150]);
    assert_eq!(world.get::<SplatParts>(capture), before.3.as_ref());

    // Where the part was moved to does not matter.
    app.world_mut().entity_mut(chair).insert(Transform::from_xyz(9.0, 9.0, 9.0));
    assert_eq!(restore(&mut app, chair), capture);
    assert_eq!(state(app.world(), capture), before);
    assert!(app.world().get_entity(chair).is_err());
    assert_eq!(restore_part(app.world_mut(), chair), Err(PartError::NotAPart(chair)));
}

#[test]
fn commands_and_messages_tell_the_same_story() {
    let (mut app, capture) = scene();
    let extracting = move |mut commands: Commands| {
        let seat = commands.extract_part(capture, SEAT);
        commands.entity(seat).insert(Name::new("cushion"));
        seat
    };
    let seat = app.world_mut().run_system_once(extracting).unwrap();
    assert_eq!(app.world().get::<Name>(seat).unwrap().as_str(), "cushion");
    assert_eq!(members(app.world(), seat).len(), 30);
    app.world_mut().run_system_once(move |mut commands: Commands| commands.restore_part(seat)).unwrap();
    assert_eq!(state(app.world(), capture).0, None);
    // What cannot be leaves no entity behind, and only a warning.
    let count = app.world().entities().count_spawned();
    let nothing = app.world_mut().run_system_once(move |mut commands: Commands| {
        commands.restore_part(seat);
        commands.extract_part(capture, PartId(77))
    });
    assert!(app.world().get_entity(nothing.unwrap()).is_err());
    assert_eq!(app.world().entities().count_spawned(), count);
    let world = app.world_mut();
    let extracted: Vec<_> = world.resource_mut::<Messages<PartExtracted>>().drain().collect();
    assert_eq!(extracted, [PartExtracted { capture, part: SEAT, entity: seat }]);
    let restored: Vec<_> = world.resource_mut::<Messages<PartRestored>>().drain().collect();
    assert_eq!(restored, [PartRestored { capture, part: Some(SEAT), entity: seat }]);
}

#[test]
fn parts_come_back_in_any_order() {
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for nested in [false, true] {
            let (mut app, capture) = scene();
            let before = state(app.world(), capture);
            let (chair, seat);
            if nested {
                chair = extract(&mut app, capture, CHAIR);
                seat = extract(&mut app, chair, SEAT);
                assert_eq!(app.world().get::<PartOf>(seat), Some(&PartOf(chair)));
            } else {
                seat = extract(&mut app, capture, SEAT);
                chair = extract(&mut app, capture, CHAIR);
            }
            let lamp = extract(&mut app, capture, LAMP);
            assert_eq!((members(app.world(), chair).len(), members(app.world(), seat).len()), (70, 30));
            for k in order {
                restore(&mut app, [chair, seat, lamp][k]);
            }
            assert_eq!(state(app.world(), capture), before, "{order:?} {nested}");
        }
    }
}

#[test]
fn despawned_parts_come_back_too() {
    let (mut app, capture) = scene();
    let before = state(app.world(), capture);
    let chair = extract(&mut app, capture, CHAIR);
    let seat = extract(&mut app, chair, SEAT);
    app.world_mut().despawn(chair);
    // The chair's Gaussians are shown by nobody; the seat belongs to the capture now.
    assert_eq!(members(app.world(), capture).len(), 200);
    assert_eq!(app.world().get::<PartOf>(seat), Some(&PartOf(capture)));
    let listed: Vec<_> = app.world().get::<DespawnedParts>(capture).unwrap().iter().collect();
    assert_eq!(listed, [(chair, Some(CHAIR))]);
    app.world_mut().despawn(seat);
    assert_eq!(restore(&mut app, chair), capture);
    assert_eq!(restore(&mut app, seat), capture);
    assert_eq!(state(app.world(), capture), before);
    assert!(app.world().get::<DespawnedParts>(capture).is_none());
}

#[test]
fn parts_despawned_together_come_back_one_by_one() {
    let (mut app, capture) = scene();
    let before = state(app.world(), capture);
    let chair = extract(&mut app, capture, CHAIR);
    let seat = extract(&mut app, chair, SEAT);
    app.world_mut().entity_mut(chair).add_child(seat);
    app.world_mut().despawn(chair);
    assert!(app.world().get_entity(seat).is_err());
    assert_eq!(restore(&mut app, seat), capture);
    assert_eq!(restore(&mut app, chair), capture);
    assert_eq!(state(app.world(), capture), before);
    // A part that remembers a despawned one hands it on when it is restored itself.
    let chair = extract(&mut app, capture, CHAIR);
    let seat = extract(&mut app, chair, SEAT);
    app.world_mut().despawn(seat);
    restore(&mut app, chair);
    assert_eq!(restore(&mut app, seat), capture);
    assert_eq!(state(app.world(), capture), before);
}

#[test]
fn a_link_to_a_despawned_part_leads_to_who_keeps_its_gaussians() {
    let (mut app, capture) = scene();
    let before = state(app.world(), capture);
    let chair = extract(&mut app, capture, CHAIR);
    let seat = extract(&mut app, chair, SEAT);
    app.world_mut().despawn(chair);
    // As somebody would write who still has the former link.
    app.world_mut().entity_mut(seat).insert(PartOf(chair));
    assert_eq!(restore(&mut app, seat), capture);
    assert_eq!(restore(&mut app, chair), capture);
    assert_eq!(state(app.world(), capture), before);
}

#[test]
fn a_part_outlives_its_capture() {
    let (mut app, capture) = scene();
    let chair = extract(&mut app, capture, CHAIR);
    let seat = extract(&mut app, chair, SEAT);
    app.world_mut().despawn(capture);
    let gone = PartError::CaptureGone { part: chair, capture };
    assert_eq!(restore_part(app.world_mut(), chair), Err(gone));
    assert_eq!(members(app.world(), chair).len(), 70);
    // What can still be put together is.
    assert_eq!(restore(&mut app, seat), chair);
    assert_eq!(members(app.world(), chair).len(), 100);
    app.world_mut().despawn(chair);
    assert_eq!(restore_part(app.world_mut(), chair), Err(PartError::NotAPart(chair)));
}

#[test]
fn what_cannot_be_taken_out_says_why_and_changes_nothing() {
    let (mut app, capture) = scene();
    let before = state(app.world(), capture);
    let bare = app.world_mut().spawn(Splats(default())).id();
    let stranger = app.world_mut().spawn_empty().id();
    let chair = extract(&mut app, capture, CHAIR);
    let world = app.world_mut();
    let mut error = |entity, part| extract_part(world, entity, part).unwrap_err();
    assert_eq!(error(stranger, CHAIR), PartError::NotSplats(stranger));
    assert_eq!(error(bare, CHAIR), PartError::NoParts(bare));
    assert_eq!(error(capture, CHAIR), PartError::Empty { entity: capture, part: CHAIR });
    assert_eq!(error(chair, LAMP), PartError::Empty { entity: chair, part: LAMP });
    let unknown = error(capture, PartId(9));
    assert_eq!(
        unknown.to_string(),
        format!("the part of {capture} cannot be taken out: there is no part 9; it may have been removed")
    );
    assert_eq!(restore_part(world, bare), Err(PartError::NotAPart(bare)));
    // A table of another cloud.
    let count = world.entities().count_spawned();
    world.entity_mut(capture).insert(SplatParts(Parts::from_labels(vec![1; 7])));
    assert!(matches!(extract_part(world, capture, PartId(1)), Err(PartError::Parts { .. })));
    assert_eq!(world.entities().count_spawned(), count);
    world.entity_mut(capture).insert(before.3.clone().unwrap());
    restore(&mut app, chair);
    assert_eq!(state(app.world(), capture), before);
}

#[test]
fn a_capture_that_shows_another_cloud_takes_no_part_back() {
    let (mut app, capture) = scene();
    let chair = extract(&mut app, capture, CHAIR);
    let other = app.world_mut().resource_mut::<Assets<crate::SplatCloud>>().add(testing::cloud(LEN));
    app.world_mut().entity_mut(capture).insert(Splats(other));
    assert!(matches!(restore_part(app.world_mut(), chair), Err(PartError::CaptureGone { .. })));
    assert_eq!(members(app.world(), chair).len(), 100);
}

#[test]
fn a_part_of_a_capture_on_a_moving_platform_stands_where_it_was() {
    let (mut app, capture) = scene();
    let platform = Transform::from_xyz(5.0, 0.0, 1.0).with_rotation(Quat::from_rotation_y(0.7));
    let platform = app.world_mut().spawn((platform, Visibility::Hidden)).id();
    app.world_mut().entity_mut(platform).add_child(capture);
    let chair = extract(&mut app, capture, CHAIR);
    let world = app.world();
    let there = *world.get::<Transform>(platform).unwrap() * *world.get::<Transform>(capture).unwrap();
    let here = *world.get::<Transform>(chair).unwrap();
    for p in [Vec3::ZERO, Vec3::X, Vec3::new(3.0, -2.0, 7.0)] {
        assert!(here.transform_point(p).distance(there.transform_point(p)) < 1e-5);
    }
    assert_eq!(world.get::<Visibility>(chair), Some(&Visibility::Hidden));
}

#[test]
fn names_are_found_for_parts_that_are_out() {
    let (mut app, capture) = scene();
    let chair = extract(&mut app, capture, CHAIR);
    let seat = extract(&mut app, chair, SEAT);
    let look = move |lookup: PartsLookup| {
        let name = |entity, id| lookup.part_of(entity, id).map(|(id, part)| (id, part.name.clone()));
        assert_eq!(name(seat, 70), Some((SEAT, "seat".to_owned())));
        assert_eq!(name(chair, 30), Some((CHAIR, "chair".to_owned())));
        assert_eq!(name(capture, 0), None);
        assert_eq!(lookup.table(seat).map(|(owner, _)| owner), Some(capture));
    };
    app.world_mut().run_system_once(look).unwrap();
    // A circle, which nobody should make, ends.
    app.world_mut().entity_mut(capture).remove::<SplatParts>().insert(PartOf(seat));
    app.world_mut().run_system_once(move |lookup: PartsLookup| assert!(lookup.table(seat).is_none())).unwrap();
}

#[test]
fn a_thousand_parts_out_and_back_leave_nothing_behind() {
    let (mut app, capture) = scene();
    let before = state(app.world(), capture);
    let count = app.world().entities().count_spawned();
    for k in 0..1000 {
        let chair = extract(&mut app, capture, CHAIR);
        let seat = extract(&mut app, chair, SEAT);
        if k % 2 == 0 {
            app.world_mut().despawn(chair);
        }
        restore(&mut app, chair);
        restore(&mut app, seat);
    }
    app.update();
    assert_eq!(state(app.world(), capture), before);
    assert_eq!(app.world().entities().count_spawned(), count);
    assert!(app.world().get::<DespawnedParts>(capture).is_none());
}
