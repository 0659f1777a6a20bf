//! Parts that are taken out of a capture and stand on what is left of it.

use super::*;

const THING: PartId = PartId(1);

/// A floor of 4 m by 4 m at y = 0 with a box of 0.4 m standing on it (its underside was never seen), which is part 1; and a
/// wall far from it.
fn room() -> (App, Entity) {
    let mut app = app();
    let spacing = 0.04;
    let floor = Shells::default().plate(Vec3::ZERO, Vec3::Z * 2.0, Vec3::X * 2.0, spacing).plate(
        Vec3::new(-2.0, 0.5, 0.0),
        Vec3::Y * 0.5,
        Vec3::Z * 2.0,
        spacing,
    );
    // What is under the box was never seen.
    let covered = |p: &Vec3| p.x.abs() < 0.2 && p.z.abs() < 0.2 && p.y < 0.01;
    let mut seen = Shells::default();
    for k in 0..floor.len() {
        if !covered(&floor.means[k]) {
            let normal = if floor.means[k].y > 0.01 { Vec3::X } else { Vec3::Y };
            seen.push(floor.means[k], normal, 0.6 * spacing);
        }
    }
    let rest = seen.len();
    let all = seen.cuboid(Vec3::new(0.0, 0.2, 0.0), Vec3::splat(0.2), 0.02);
    let capture = spawn(&mut app, &all, Transform::IDENTITY);
    let mut parts = Parts::new(all.len());
    assert_eq!(parts.add("box", [1; 3], None), Ok(THING));
    // The box has no bottom face.
    let of = Selection::from_fn(all.len(), |k| k >= rest && all.means[k].y > 1e-3);
    parts.assign(THING, &of, SelectMode::New).unwrap();
    let hidden = Selection::from_fn(all.len(), |k| k >= rest && all.means[k].y <= 1e-3);
    let flags = SplatFlags { hidden, ..default() };
    app.world_mut().entity_mut(capture).insert((SplatParts(parts), flags, CaptureScale::measured(1.0, 1.0)));
    app.update();
    (app, capture)
}

fn take(app: &mut App, capture: Entity) -> Entity {
    let mut commands = app.world_mut().commands();
    let part = commands.extract_part(capture, THING);
    commands.entity(part).insert((RigidPart::default(), PartMaterial::from(dull(0.5, 0.4))));
    app.world_mut().flush();
    part
}

#[test]
fn a_part_stands_where_it_was_captured_on_the_closed_hole_under_it() {
    for source in [GroundKind::Plane, GroundKind::Heightfield, GroundKind::Mesh, GroundKind::Voxels] {
        let (mut app, capture) = room();
        app.world_mut()
            .entity_mut(capture)
            .insert((StaticCapture { source, ..default() }, PartMaterial::from(dull(0.5, 0.4))));
        let part = take(&mut app, capture);
        settle(&mut app);
        let PartBody::Static { chunks, .. } = report(&app, capture).body else { panic!() };
        assert!(chunks > 0);
        run(&mut app, 1.5);
        let at = place(&app, part);
        assert!(at.translation.length() < 0.06, "{source:?}: {at:?}");
        assert!(at.rotation.angle_between(Quat::IDENTITY) < 0.03, "{source:?}: {at:?}");
        assert!(app.world().get::<LinearVelocity>(part).unwrap().length() < 0.02, "{source:?}");
        // Lifted and dropped it falls on the same place.
        let lifted = at.translation + Vec3::Y * 0.5;
        app.world_mut().get_mut::<Transform>(part).unwrap().translation = lifted;
        run(&mut app, 2.0);
        assert!(place(&app, part).translation.distance(at.translation) < 0.05, "{source:?}: {:?}", place(&app, part));
    }
}

#[test]
fn to_take_a_part_out_to_simulate_it_and_to_put_it_back_leaves_the_captures_bits() {
    let (mut app, capture) = room();
    let len = app.world().get::<SplatParts>(capture).unwrap().len();
    app.world_mut().entity_mut(capture).insert(SplatSelection(Selection::from_fn(len, |k| k % 7 == 0)));
    type Bits = (Option<SplatSubset>, SplatFlags, SplatSelection, SplatParts, Splats, Transform);
    let bits = |app: &App| -> Bits {
        let entity = app.world().entity(capture);
        let whole = (entity.get().cloned(), entity.get().cloned().unwrap(), entity.get().cloned().unwrap());
        let rest = (entity.get().cloned().unwrap(), entity.get().cloned().unwrap(), *entity.get().unwrap());
        (whole.0, whole.1, whole.2, rest.0, rest.1, rest.2)
    };
    let before = bits(&app);
    let cloud = app.world().resource::<Assets<SplatCloud>>().get(&before.4.0).unwrap().cloud.clone();
    let copy = (*cloud).clone();
    app.world_mut().entity_mut(capture).insert(StaticCapture::default());
    let part = take(&mut app, capture);
    settle(&mut app);
    app.world_mut().get_mut::<Transform>(part).unwrap().translation += Vec3::new(0.2, 0.8, 0.1);
    run(&mut app, 1.0);
    restore_part(app.world_mut(), part).unwrap();
    settle(&mut app);
    run(&mut app, 0.2);
    assert!(app.world().get_entity(part).is_err());
    assert_eq!(bits(&app), before);
    assert!(*cloud == copy, "the Gaussians are the same");
    app.world_mut().entity_mut(capture).remove::<StaticCapture>();
    app.update();
    let entity = app.world().entity(capture);
    assert!(!entity.contains::<RigidBody>() && !entity.contains::<CaptureGround>());
    assert!(entity.get::<Children>().is_none_or(|children| children.is_empty()));
    assert_eq!(bits(&app), before);
}

#[test]
fn only_pieces_of_ground_that_changed_are_replaced_and_what_was_made_is_kept() {
    let (mut app, capture) = room();
    let ground = StaticCapture { source: GroundKind::Mesh, chunk: 1.0, ..default() };
    app.world_mut().entity_mut(capture).insert(ground);
    settle(&mut app);
    let children = |app: &App| -> Vec<Entity> { app.world().get::<Children>(capture).unwrap().iter().collect() };
    let whole = children(&app);
    assert!(whole.len() > 4, "{}", whole.len());
    let part = take(&mut app, capture);
    settle(&mut app);
    let open = children(&app);
    let kept = open.iter().filter(|child| whole.contains(child)).count();
    assert!(kept > 0 && kept < whole.len(), "{kept} of {} are the same", whole.len());
    restore_part(app.world_mut(), part).unwrap();
    settle(&mut app);
    let back = children(&app);
    assert_eq!(back.len(), whole.len());
    assert_eq!(back.iter().filter(|child| open.contains(child)).count(), kept);
}

#[test]
fn a_part_that_stands_in_something_is_raised_or_that_is_told() {
    let (mut app, capture) = room();
    app.world_mut().entity_mut(capture).insert(StaticCapture { source: GroundKind::Plane, ..default() });
    settle(&mut app);
    let part = take(&mut app, capture);
    let sunk = Vec3::NEG_Y * 0.2;
    app.world_mut().get_mut::<Transform>(part).unwrap().translation = sunk;
    settle(&mut app);
    let report = report(&app, part);
    let depth = |warning: &PartPhysicsWarning| match warning {
        PartPhysicsWarning::Overlaps(depth) => Some(*depth),
        _ => None,
    };
    let depth = report.warnings.iter().find_map(depth).unwrap();
    let raised = f64::from(place(&app, part).translation.y - sunk.y);
    let voxel = 0.4 * 3.0_f64.sqrt() / 64.0;
    assert!(raised > 0.0 && raised <= 2.2 * voxel, "{raised} {voxel}");
    assert!((depth + raised - 0.2).abs() < 0.04, "{depth} {raised}");
}
