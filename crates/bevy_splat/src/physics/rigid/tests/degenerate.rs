//! Parts that are none: a sentence or something sound, and never NaN in the scene.

use bevy::math::Vec3;

use super::*;

/// Gaussians one by one.
fn of(points: impl IntoIterator<Item = Vec3>) -> Shells {
    let mut shells = Shells::default();
    points.into_iter().for_each(|point| shells.push(point, Vec3::Y, 0.02));
    shells
}

fn cube() -> Shells {
    Shells::default().cuboid(Vec3::ZERO, Vec3::splat(0.2), 0.02)
}

/// Sets a part up, runs half a second on a floor, and gives its status.
fn outcome(shells: &Shells, at: Transform, part: RigidPart, material: PhysicsMaterial) -> PartPhysicsStatus {
    let mut app = app();
    floor(&mut app, dull(0.5, 0.4));
    let entity = spawn(&mut app, shells, at);
    app.world_mut().entity_mut(entity).insert((part, PartMaterial::from(material)));
    settle(&mut app);
    run(&mut app, 0.5);
    let before = at.is_finite();
    let mut all = app.world_mut().query::<(&Transform, &GlobalTransform)>();
    for (transform, global) in all.iter(app.world()) {
        assert!(transform.is_finite() && global.affine().is_finite() || !before, "{transform:?}");
    }
    let status = app.world().get::<PartPhysicsStatus>(entity).unwrap().clone();
    match &status {
        PartPhysicsStatus::Failed(error) => {
            assert!(error.to_string().len() > 20, "{error}");
            assert!(!app.world().entity(entity).contains::<RigidBody>());
            assert_eq!(place(&app, entity).scale, at.scale);
        }
        PartPhysicsStatus::Ready(report) => {
            let mass = report.mass.unwrap();
            assert!(mass.mass > 0.0 && mass.mass.is_finite() && mass.center.is_finite(), "{mass:?}");
        }
        PartPhysicsStatus::Pending(_) => panic!("it never came"),
    }
    status
}

#[test]
fn parts_that_are_no_solid_end_with_a_sentence_or_something_sound() {
    let at = Transform::from_xyz(0.0, 1.0, 0.0);
    let wood = dull(0.5, 0.4);
    let one = of([Vec3::ZERO]);
    assert!(outcome(&one, at, RigidPart::default(), wood).error().is_some());
    assert!(outcome(&Shells::default(), at, RigidPart::default(), wood).error().is_some());
    let nan = of((0..500).map(|_| Vec3::NAN));
    assert!(outcome(&nan, at, RigidPart::default(), wood).error().is_some());
    // Some NaN among what is sound changes nothing.
    let mut some = cube();
    (0..40).for_each(|_| some.push(Vec3::NAN, Vec3::Y, 0.02));
    assert!(outcome(&some, at, RigidPart::default(), wood).report().is_some());
    // Sound or told, whichever: a sheet, two islands, a line, all in one place.
    let plane = Shells::default().plate(Vec3::ZERO, Vec3::X * 0.3, Vec3::Z * 0.3, 0.02);
    outcome(&plane, at, RigidPart::default(), wood);
    let islands = cube().cuboid(Vec3::X * 50.0, Vec3::splat(0.2), 0.02);
    outcome(&islands, at, RigidPart::default(), wood);
    outcome(&of((0..500).map(|k| Vec3::X * k as f32 * 0.002)), at, RigidPart::default(), wood);
    outcome(&of((0..500).map(|_| Vec3::ONE)), at, RigidPart::default(), wood);
    for shape in [RigidShape::Box, RigidShape::Ball, RigidShape::Capsule, RigidShape::Hull, RigidShape::Voxels] {
        outcome(&plane, at, RigidPart { shape, ..default() }, wood);
    }
}

#[test]
fn scales_from_a_thousandth_to_ten_thousand_are_sound_or_told() {
    for scale in [1e-3, 1e4] {
        let at = Transform::from_xyz(0.0, 1.0, 0.0).with_scale(Vec3::splat(scale));
        outcome(&cube(), at, RigidPart::default(), dull(0.5, 0.4));
        // The same size again, of a capture in another unit.
        let shells = cube().moved(Quat::IDENTITY, 1.0 / scale, Vec3::ZERO);
        let status = outcome(&shells, at, RigidPart::default(), dull(0.5, 0.4));
        let mass = status.report().unwrap().mass.unwrap().mass;
        assert!((mass / (525.0 * 0.064) - 1.0).abs() < 0.03, "{scale}: {mass}");
    }
}

#[test]
fn uneven_mirrored_and_broken_transforms_are_refused() {
    let part = RigidPart::default();
    let wood = dull(0.5, 0.4);
    let uneven = Transform::from_scale(Vec3::new(1.0, 2.0, 1.0));
    let status = outcome(&cube(), uneven, part, wood);
    assert!(matches!(status.error(), Some(PartPhysicsError::NonUniformScale(_))), "{status:?}");
    for scale in [Vec3::new(-1.0, 1.0, 1.0), Vec3::ZERO] {
        let status = outcome(&cube(), Transform::from_scale(scale), part, wood);
        assert!(matches!(status.error(), Some(PartPhysicsError::BadTransform)), "{status:?}");
    }
}

#[test]
fn materials_without_meaning_are_refused_and_right_ones_heal() {
    let wood = dull(0.5, 0.4);
    for density in [0.0, -1.0, f32::NAN] {
        let none = PhysicsMaterial { density, ..wood };
        let status = outcome(&cube(), Transform::IDENTITY, RigidPart::default(), none);
        assert!(matches!(status.error(), Some(PartPhysicsError::Material(_))), "{status:?}");
    }
    let mut app = app();
    let part = spawn(&mut app, &cube(), Transform::IDENTITY);
    app.world_mut().entity_mut(part).insert((RigidPart::default(), PartMaterial::preset("unobtainium")));
    settle(&mut app);
    let status = app.world().get::<PartPhysicsStatus>(part).unwrap();
    let sentence = status.error().unwrap().to_string();
    assert!(sentence.starts_with("there is no material `unobtainium`; known are steel"), "{sentence}");
    let failures = |app: &mut App| app.world_mut().resource_mut::<Messages<PartPhysicsFailed>>().drain().count();
    assert_eq!(failures(&mut app), 1);
    run(&mut app, 0.1);
    assert_eq!(failures(&mut app), 0, "it is told once");
    app.world_mut().entity_mut(part).insert(PartMaterial::preset("steel"));
    settle(&mut app);
    assert!(report(&app, part).mass.unwrap().mass > 100.0);
}

#[test]
fn a_part_without_a_capture_or_with_one_that_is_loading_waits_or_is_told() {
    let mut app = app();
    let nothing = app.world_mut().spawn((RigidPart::default(), Transform::IDENTITY)).id();
    let loading = app.world_mut().spawn((RigidPart::default(), Splats::default())).id();
    app.update();
    app.update();
    let status = |entity| app.world().get::<PartPhysicsStatus>(entity).unwrap();
    assert!(matches!(status(nothing).error(), Some(PartPhysicsError::NoSplats)));
    assert!(status(loading).is_pending());
}

#[test]
fn work_ends_with_the_entity_and_with_the_wish() {
    let mut app = app();
    let part = spawn(&mut app, &cube(), Transform::IDENTITY);
    app.world_mut().entity_mut(part).insert(RigidPart::default());
    app.update();
    app.world_mut().entity_mut(part).remove::<RigidPart>();
    app.update();
    let other = spawn(&mut app, &cube(), Transform::IDENTITY);
    app.world_mut().entity_mut(other).insert(RigidPart::default());
    app.update();
    app.world_mut().despawn(other);
    settle(&mut app);
    run(&mut app, 0.1);
    assert!(!app.world().entity(part).contains::<RigidBody>());
    let mut ready = app.world_mut().resource_mut::<Messages<PartPhysicsReady>>();
    assert_eq!(ready.drain().count(), 0);
}
