//! Falling, resting, sliding, bouncing.

use super::*;

fn cube(half: f32) -> Shells {
    Shells::default().cuboid(Vec3::ZERO, Vec3::splat(half), half / 12.0)
}

#[test]
fn a_cube_dropped_from_a_metre_comes_to_rest_on_the_floor_and_sleeps() {
    let mut app = app();
    floor(&mut app, dull(0.5, 0.4));
    let part = spawn(&mut app, &cube(0.2), Transform::from_xyz(0.0, 1.2, 0.0));
    let wood = PartMaterial::from(dull(0.5, 0.4));
    app.world_mut().entity_mut(part).insert((RigidPart::default(), wood));
    settle(&mut app);
    assert!((bottom(&app, part) - 1.0).abs() < 0.01, "{}", bottom(&app, part));
    run(&mut app, 3.0);
    // Asleep, avian keeps the velocity that a body had last: what counts is that it does not move.
    let before = place(&app, part);
    run(&mut app, 0.5);
    let after = place(&app, part);
    assert!(after.translation.distance(before.translation) < 0.5e-3, "{before:?} {after:?}");
    assert!(after.rotation.angle_between(before.rotation) < 1e-3, "{before:?} {after:?}");
    let entity = app.world().entity(part);
    assert!(entity.contains::<Sleeping>());
    assert!(bottom(&app, part).abs() < 2e-3, "{}", bottom(&app, part));
    // What is seen rests as well: its sides are where the floor is.
    assert!((place(&app, part).translation.y - 0.2).abs() < 0.01, "{}", place(&app, part).translation);
}

#[test]
fn mass_centre_and_inertia_are_those_of_a_filled_cube() {
    let mut app = app();
    let part = spawn(&mut app, &cube(0.2).moved(Quat::IDENTITY, 1.0, Vec3::X * 3.0), Transform::IDENTITY);
    app.world_mut().entity_mut(part).insert((RigidPart::default(), PartMaterial::preset("wood_soft")));
    settle(&mut app);
    run(&mut app, 0.05);
    let entity = app.world().entity(part);
    let mass = entity.get::<ComputedMass>().unwrap().value();
    let exact = 525.0 * 0.4 * 0.4 * 0.4;
    assert!((mass / exact - 1.0).abs() < 0.03, "{mass} {exact}");
    let center = entity.get::<ComputedCenterOfMass>().unwrap().0;
    assert!(center.distance(Vec3::X * 3.0) < 2e-3, "{center}");
    let inertia = entity.get::<ComputedAngularInertia>().unwrap().principal_angular_inertia_with_local_frame().0;
    let exact = exact * 0.4 * 0.4 / 6.0;
    assert!((inertia / exact - 1.0).abs().max_element() < 0.05, "{inertia} {exact}");
}

#[test]
fn the_unit_of_a_capture_changes_nothing_once_its_scale_is_told() {
    let mut results = Vec::new();
    for unit in [1.0_f32, 40.0, 0.02] {
        let mut app = app();
        floor(&mut app, dull(0.5, 0.4));
        // As captured: in another unit, with y down.
        let shells = cube(0.2).moved(Quat::IDENTITY, unit, Vec3::new(0.1, -0.7, 0.0) * unit);
        let part = spawn(&mut app, &shells, crate::UPRIGHT);
        let scale = CaptureScale::measured(unit, 1.0);
        app.world_mut().entity_mut(part).insert((scale, RigidPart::default(), PartMaterial::from(dull(0.5, 0.4))));
        settle(&mut app);
        assert!(!report(&app, part).warnings.contains(&PartPhysicsWarning::ScaleUnknown));
        run(&mut app, 1.5);
        let mass = app.world().get::<ComputedMass>(part).unwrap().value();
        assert!(bottom(&app, part).abs() < 2e-3, "{unit}: {}", bottom(&app, part));
        results.push((mass, place(&app, part).translation));
    }
    for (mass, at) in &results[1..] {
        assert!((mass / results[0].0 - 1.0).abs() < 1e-3, "{results:?}");
        assert!(at.distance(results[0].1) < 2e-3, "{results:?}");
    }
}

#[test]
fn a_part_slides_down_an_incline_if_and_only_if_it_is_steeper_than_its_friction() {
    for (friction, tangent, slides) in [(0.5, 0.45, false), (0.5, 0.55, true), (0.3, 0.27, false), (0.3, 0.33, true)] {
        let mut app = app();
        let material = dull(friction, 0.6 * friction);
        let tilt = Quat::from_rotation_z(-f32::atan(tangent));
        let ground = floor(&mut app, material);
        app.world_mut()
            .entity_mut(ground)
            .insert(Transform::from_translation(tilt * Vec3::NEG_Y * 0.5).with_rotation(tilt));
        let at = Transform::from_translation(tilt * Vec3::Y * 0.1).with_rotation(tilt);
        let shells = Shells::default().cuboid(Vec3::ZERO, Vec3::new(0.2, 0.1, 0.2), 0.02);
        let part = spawn(&mut app, &shells, at);
        let part_of_it = (RigidPart { shape: RigidShape::Box, ..default() }, PartMaterial::from(material));
        app.world_mut().entity_mut(part).insert(part_of_it);
        settle(&mut app);
        run(&mut app, 2.0);
        let went = place(&app, part).translation.distance(at.translation);
        // What slides with the lower coefficient goes at least a metre.
        let least = if slides { 1.0 } else { 0.0 };
        let most = if slides { 100.0 } else { 0.02 };
        assert!((least..=most).contains(&went), "friction {friction}, tangent {tangent}: {went} m");
    }
}

#[test]
fn a_ball_bounces_to_the_square_of_its_restitution() {
    for restitution in [0.5_f32, 0.8] {
        let mut app = app();
        let material = PhysicsMaterial { restitution, ..dull(0.5, 0.4) };
        floor(&mut app, material);
        let shells = Shells::default().ball(Vec3::ZERO, 0.2, 2000);
        let part = spawn(&mut app, &shells, Transform::from_xyz(0.0, 1.2, 0.0));
        let rigid = RigidPart { shape: RigidShape::Ball, ..default() };
        app.world_mut().entity_mut(part).insert((rigid, PartMaterial::from(material)));
        settle(&mut app);
        let from = bottom(&app, part);
        let (mut bounced, mut highest) = (false, 0.0_f32);
        for _ in 0..(2.0 * RATE) as usize {
            app.update();
            let rises = app.world().get::<LinearVelocity>(part).unwrap().y > 0.0;
            if bounced && !rises {
                break;
            }
            bounced |= rises;
            highest = if bounced { highest.max(bottom(&app, part)) } else { 0.0 };
        }
        let expected = restitution * restitution * from;
        assert!((highest / expected - 1.0).abs() < 0.1, "{restitution}: {highest} instead of {expected}");
    }
}

#[test]
fn a_ball_in_the_notch_of_an_l_touches_nothing() {
    let mut app = app();
    // Two arms, each 0.6 long and 0.2 thick; the notch is above one and beside the other.
    let shells = Shells::default().cuboid(Vec3::new(0.3, 0.1, 0.1), Vec3::new(0.3, 0.1, 0.1), 0.015).cuboid(
        Vec3::new(0.1, 0.4, 0.1),
        Vec3::new(0.1, 0.2, 0.1),
        0.015,
    );
    let auto = spawn(&mut app, &shells, Transform::IDENTITY);
    let hull = spawn(&mut app, &shells, Transform::IDENTITY);
    app.world_mut().entity_mut(auto).insert(RigidPart::default());
    app.world_mut().entity_mut(hull).insert(RigidPart { shape: RigidShape::Hull, ..default() });
    settle(&mut app);
    let PartBody::Rigid { shape: "decomposition", pieces } = report(&app, auto).body else {
        panic!("{:?}", report(&app, auto))
    };
    assert!((2..=8).contains(&pieces), "{pieces}");
    let ball = Collider::sphere(0.06);
    let touches = |entity: Entity, at: Vec3| {
        let collider = app.world().get::<Collider>(entity).unwrap();
        let still = Quat::IDENTITY;
        contact_query::intersection_test(collider, Vec3::ZERO, still, &ball, at, still).unwrap()
    };
    let notch = Vec3::new(0.3, 0.3, 0.1);
    assert!(!touches(auto, notch) && touches(hull, notch));
    // It is there where the arms are.
    assert!(touches(auto, Vec3::new(0.5, 0.1, 0.1)) && touches(auto, Vec3::new(0.1, 0.5, 0.1)));
}

#[test]
fn another_material_changes_the_mass_and_nothing_else() {
    let mut app = app();
    let part = spawn(&mut app, &cube(0.2), Transform::IDENTITY);
    app.world_mut().entity_mut(part).insert((RigidPart::default(), PartMaterial::preset("wood_soft")));
    settle(&mut app);
    run(&mut app, 0.05);
    let shape = |app: &App| app.world().get::<Collider>(part).unwrap().shape().clone();
    let mass = |app: &App| app.world().get::<ComputedMass>(part).unwrap().value();
    let (before, weighed) = (shape(&app), mass(&app));
    app.world_mut().entity_mut(part).insert(PartMaterial::preset("steel"));
    app.update();
    app.update();
    assert!(!app.world().get::<PartPhysicsStatus>(part).unwrap().is_pending());
    assert!((mass(&app) / weighed / (7850.0 / 525.0) - 1.0).abs() < 1e-4);
    assert_eq!(app.world().get::<Friction>(part).unwrap().static_coefficient, 0.6);
    assert!(std::ptr::addr_eq(&*before.0, &*shape(&app).0), "the collider is the same");
    // An asset that changes does the same.
    let steel = PhysicsMaterial::preset("steel").unwrap();
    let handle = app.world_mut().resource_mut::<Assets<PhysicsMaterial>>().add(steel);
    app.world_mut().entity_mut(part).insert(PartMaterial::from(handle.clone()));
    app.update();
    let mut materials = app.world_mut().resource_mut::<Assets<PhysicsMaterial>>();
    materials.get_mut(&handle).unwrap().density *= 2.0;
    app.update();
    app.update();
    assert!((mass(&app) / weighed / (2.0 * 7850.0 / 525.0) - 1.0).abs() < 1e-4);
    assert!(std::ptr::addr_eq(&*before.0, &*shape(&app).0), "the collider is the same");
}

#[test]
fn nested_parts_weigh_what_they_are_made_of() {
    let mut app = app();
    // A cube whose right half is steel.
    let shells = cube(0.2);
    let part = spawn(&mut app, &shells, Transform::IDENTITY);
    let mut parts = Parts::new(shells.len());
    let whole = parts.add("whole", [1; 3], None).unwrap();
    let right = parts.add("right", [2; 3], Some(whole)).unwrap();
    parts.assign(whole, &Selection::all(shells.len()), SelectMode::New).unwrap();
    let of = Selection::from_fn(shells.len(), |k| shells.means[k].x > 0.0);
    parts.assign(right, &of, SelectMode::New).unwrap();
    let materials = PartMaterials::default().with(right, PartMaterial::preset("steel"));
    let rigid = (RigidPart::default(), PartMaterial::preset("wood_soft"), materials, SplatParts(parts));
    app.world_mut().entity_mut(part).insert(rigid);
    settle(&mut app);
    let mass = report(&app, part).mass.unwrap();
    let volume = 0.4_f64.powi(3);
    let exact = 0.5 * volume * (7850.0 + 525.0);
    assert!((mass.mass / exact - 1.0).abs() < 0.06, "{mass:?} {exact}");
    let off = 0.1 * (7850.0 - 525.0) / (7850.0 + 525.0);
    assert!((mass.center.x - off).abs() < 0.01 && mass.center.y.abs() < 0.01, "{mass:?} {off}");
}

#[test]
fn what_the_user_gave_an_entity_stays_and_the_rest_goes_with_the_wish() {
    let mut app = app();
    let part = spawn(&mut app, &cube(0.2), Transform::IDENTITY);
    let own = (RigidBody::Kinematic, Collider::sphere(7.0), Friction::new(0.123));
    app.world_mut().entity_mut(part).insert((own, RigidPart::default()));
    settle(&mut app);
    let kept = |app: &App| {
        let entity = app.world().entity(part);
        assert_eq!(entity.get::<RigidBody>(), Some(&RigidBody::Kinematic));
        assert_eq!(entity.get::<Collider>().unwrap().shape().as_ball().unwrap().radius, 7.0);
        assert_eq!(entity.get::<Friction>().unwrap().dynamic_coefficient, 0.123);
    };
    kept(&app);
    assert!(app.world().get::<Mass>(part).unwrap().0 > 10.0);
    app.world_mut().entity_mut(part).remove::<RigidPart>();
    app.update();
    kept(&app);
    let entity = app.world().entity(part);
    assert!(!entity.contains::<Mass>() && !entity.contains::<NoAutoMass>() && !entity.contains::<Restitution>());
    assert!(!entity.contains::<PartPhysicsStatus>());

    let part = spawn(&mut app, &cube(0.2), Transform::IDENTITY);
    app.world_mut().entity_mut(part).insert(RigidPart::default());
    settle(&mut app);
    assert!(app.world().entity(part).contains::<RigidBody>());
    app.world_mut().entity_mut(part).remove::<RigidPart>();
    app.update();
    let entity = app.world().entity(part);
    assert!(!entity.contains::<RigidBody>() && !entity.contains::<Collider>() && !entity.contains::<Mass>());
    run(&mut app, 0.2);
    assert_eq!(place(&app, part).translation, Vec3::ZERO);
}
