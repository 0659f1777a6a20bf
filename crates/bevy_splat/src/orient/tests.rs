use bevy::prelude::*;
use splat_core::orient::{AxisSign, AxisTarget, PointsError};
use splat_core::{Cloud, CloudArrays, Selection};

use super::*;
use crate::testing::{self, update_until};
use crate::{PartOf, SplatCloud, SplatSelection, Splats};

fn app() -> App {
    let mut app = testing::app();
    app.add_plugins(SplatOrientPlugin);
    #[cfg(feature = "physics")]
    app.add_plugins(crate::physics::SplatPhysicsPlugin);
    app
}

/// A tilted slab of 6 x 0.2 x 3 units, and a thin mast of 2 units in its middle; the tilt's y points out of the slab along the mast.
fn slab(tilt: Quat) -> SplatCloud {
    let mut state = 1u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32 - 0.5
    };
    let mut means: Vec<Vec3> = (0..4000).map(|_| tilt * Vec3::new(6.0 * unit(), 0.01 * unit(), 3.0 * unit())).collect();
    means.extend((0..400).map(|_| tilt * Vec3::new(0.1 * unit(), 1.0 + 2.0 * unit(), 0.1 * unit())));
    let n = means.len();
    let arrays = CloudArrays {
        means,
        log_scales: vec![Vec3::new(-4.0, -4.0, -7.0); n],
        rotations: vec![tilt * Quat::from_rotation_x(std::f32::consts::FRAC_PI_2); n],
        opacity_logits: vec![3.0; n],
        sh: vec![0.0; 3 * n],
        ..CloudArrays::default()
    };
    SplatCloud::new(Cloud::new(arrays).unwrap())
}

const TILT: Quat = Quat::from_xyzw(0.182_574_18, 0.365_148_37, 0.547_722_6, 0.730_296_7);

fn spawn(app: &mut App, at: Transform) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<SplatCloud>>().add(slab(TILT));
    app.world_mut().spawn((Splats(handle), at)).id()
}

fn send<M: Message>(app: &mut App, message: M) {
    app.world_mut().write_message(message);
}

/// Takes them: without a fixed step Bevy keeps messages.
fn all<M: Message>(app: &mut App) -> Vec<M> {
    app.world_mut().resource_mut::<Messages<M>>().drain().collect()
}

/// Runs until there is an answer.
fn answer(app: &mut App) -> Result<Oriented, OrientError> {
    let mut found = None;
    update_until(app, |app| {
        let done: Vec<Oriented> = all(app);
        let failed: Vec<OrientFailed> = all(app);
        found = done.into_iter().next().map(Ok).or(failed.into_iter().next().map(|f| Err(f.error)));
        found.is_some()
    });
    found.unwrap()
}

fn transform(app: &App, entity: Entity) -> Transform {
    *app.world().get(entity).unwrap()
}

/// Where a capture stands in these tests: turned, scaled, moved; the mast points within 60 degrees of up.
fn standing() -> Transform {
    let lean = Quat::from_rotation_z(0.6) * Quat::from_rotation_y(0.7);
    Transform { translation: Vec3::new(3.0, -2.0, 5.0), rotation: lean * TILT.conjugate(), scale: Vec3::splat(2.0) }
}

#[test]
fn a_floor_becomes_level_at_height_zero_and_parts_come_along() {
    let mut app = app();
    let capture = spawn(&mut app, standing());
    let elsewhere = Transform::from_xyz(1.0, 4.0, 2.0).with_rotation(Quat::from_rotation_x(1.0));
    let part = testing::spawn(&mut app, 3);
    app.world_mut().entity_mut(part).insert((PartOf(capture), elsewhere));
    let stranger = testing::spawn(&mut app, 3);
    let left = transform(&app, stranger);
    app.update();

    send(&mut app, OrientRequest { capture, by: OrientBy::Floor });
    let done = answer(&mut app).unwrap();
    let now = transform(&app, capture);
    assert!((now.rotation * (TILT * Vec3::Y)).dot(Vec3::Y) > 0.9999);
    let Splats(handle) = app.world().get(capture).unwrap();
    let cloud = app.world().resource::<Assets<SplatCloud>>().get(handle).unwrap().cloud.clone();
    for &mean in cloud.means()[..4000].iter().step_by(97) {
        assert!(now.transform_point(mean).y.abs() < 0.03, "{}", now.transform_point(mean));
    }
    assert_eq!(now.scale, Vec3::splat(2.0));
    // Nothing moved, as seen from the capture; nothing else moved at all.
    let seen = |a: Transform, b: Transform| a.compute_affine().inverse() * b.compute_affine();
    let (before, after) = (seen(standing(), elsewhere), seen(now, transform(&app, part)));
    assert!(before.abs_diff_eq(after, 1e-4), "{before:?} {after:?}");
    assert_eq!(transform(&app, stranger), left);

    // What the message says undoes it.
    for (entity, transform) in done.before {
        app.world_mut().entity_mut(entity).insert(transform);
    }
    assert_eq!((transform(&app, capture), transform(&app, part)), (standing(), elsewhere));
}

#[test]
fn a_selection_is_laid_along_the_axes_and_ends_that_are_named() {
    let mut app = app();
    let capture = spawn(&mut app, standing());
    let surface = Selection::from_fn(4400, |i| i < 4000);
    app.world_mut().entity_mut(capture).insert(SplatSelection(surface));
    let end = |axis, sign| AxisTarget { axis, sign };
    // Long along z, its second direction along x, thin along -y.
    let axes = Some([end(2, None), end(0, None), end(1, Some(AxisSign::Negative))]);
    send(&mut app, OrientRequest { capture, by: OrientBy::Selection { axes } });
    let done = answer(&mut app).unwrap();
    assert!(done.ambiguities.is_empty(), "{:?}", done.ambiguities);
    let turn = transform(&app, capture).rotation;
    assert!((turn * (TILT * Vec3::X)).z.abs() > 0.999 && (turn * (TILT * Vec3::Z)).x.abs() > 0.999);

    // Three named ends that are a mirror.
    let (plus, minus) = (Some(AxisSign::Positive), Some(AxisSign::Negative));
    let mirror = [end(0, plus), end(1, plus), end(2, minus)];
    let before = transform(&app, capture);
    app.update();
    app.update();
    send(&mut app, OrientRequest { capture, by: OrientBy::Selection { axes: Some(mirror) } });
    assert!(matches!(answer(&mut app), Err(OrientError::Axes(_))));
    assert_eq!(transform(&app, capture), before);
}

#[test]
fn three_points_of_the_world_are_level_even_below_a_parent() {
    let mut app = app();
    let capture = spawn(&mut app, standing());
    let parent = app.world_mut().spawn(Transform::from_xyz(9.0, 1.0, 0.0).with_scale(Vec3::splat(0.5))).id();
    app.world_mut().entity_mut(capture).insert(ChildOf(parent));
    let placed = transform(&app, parent).compute_affine() * standing().compute_affine();
    let own = [Vec3::new(-2.0, 0.0, 1.0), Vec3::new(2.0, 0.0, 1.0), Vec3::new(0.0, 0.0, -1.0)].map(|p| TILT * p);
    let points = own.map(|p| placed.transform_point3(p));
    send(&mut app, OrientRequest { capture, by: OrientBy::Points(points) });
    answer(&mut app).unwrap();
    let now = transform(&app, parent).compute_affine() * transform(&app, capture).compute_affine();
    let [a, b, c] = own.map(|p| now.transform_point3(p));
    assert!(a.y.abs() < 1e-4 && b.y.abs() < 1e-4 && c.y.abs() < 1e-4, "{a} {b} {c}");
    assert!((b - a).distance(Vec3::X * 4.0) < 1e-4, "{a} {b}");

    app.update();
    app.update();
    send(&mut app, OrientRequest { capture, by: OrientBy::Points([a, b, 2.0 * b - a]) });
    assert_eq!(answer(&mut app), Err(OrientError::Points(PointsError::Collinear)));
}

#[test]
fn what_cannot_be_turned_is_told_and_stays() {
    let mut app = app();
    let nobody = app.world_mut().spawn_empty().id();
    let loading = app.world_mut().spawn(Splats::default()).id();
    let uneven = spawn(&mut app, Transform::from_scale(Vec3::new(1.0, 2.0, 1.0)));
    let point = testing::spawn(&mut app, 1);
    for (capture, by, error) in [
        (nobody, OrientBy::Floor, OrientError::NoCapture),
        (nobody, OrientBy::Points([Vec3::ZERO, Vec3::X, Vec3::Z]), OrientError::NoCapture),
        (loading, OrientBy::Floor, OrientError::Loading),
        (uneven, OrientBy::Selection { axes: None }, OrientError::Transform),
        (point, OrientBy::Floor, OrientError::NoFloor),
    ] {
        send(&mut app, OrientRequest { capture, by });
        assert_eq!(answer(&mut app), Err(error));
        assert!(error.to_string().contains(' '));
        app.update();
        app.update();
    }
    assert!(app.world().resource::<OrientQueue>().is_empty());
}

#[cfg(feature = "physics")]
mod scales {
    use super::*;
    use crate::physics::{CaptureScale, ScaleSource};

    fn scaled(app: &mut App) -> Result<Scaled, OrientError> {
        app.update();
        let failed: Vec<OrientFailed> = all(app);
        all::<Scaled>(app).into_iter().next().ok_or_else(|| failed[0].error)
    }

    #[test]
    fn a_known_length_gives_metres_and_parts_keep_their_place() {
        let mut app = app();
        let capture = spawn(&mut app, standing());
        let part = testing::spawn(&mut app, 3);
        app.world_mut().entity_mut(part).insert((PartOf(capture), Transform::from_xyz(5.0, 0.0, 5.0)));
        app.update();
        // Two places that are 4 units apart in the cloud, 8 in the world, shall be 1 m.
        let [a, b] = [TILT * Vec3::X * 2.0, TILT * Vec3::X * -2.0].map(|p| standing().transform_point(p));
        send(&mut app, ScaleRequest { capture, by: ScaleBy::Length { a, b, metres: 1.0 } });
        let done = scaled(&mut app).unwrap();
        assert!((done.metres_per_unit - 0.25).abs() < 1e-6 && done.scale_before.is_none(), "{done:?}");
        app.update();
        let scale = *app.world().get::<CaptureScale>(capture).unwrap();
        assert_eq!(scale, CaptureScale { metres_per_unit: Some(done.metres_per_unit), source: ScaleSource::Measured });
        let now = transform(&app, capture);
        assert!((now.scale - 0.25).length() < 1e-6);
        let seen = |a: Transform, b: Transform| a.compute_affine().inverse() * b.compute_affine();
        let (before, after) = (seen(standing(), Transform::from_xyz(5.0, 0.0, 5.0)), seen(now, transform(&app, part)));
        assert!(before.abs_diff_eq(after, 1e-4), "{before:?} {after:?}");
        assert_eq!(done.before.len(), 2);

        send(&mut app, ScaleRequest { capture, by: ScaleBy::Length { a, b: a, metres: 1.0 } });
        assert!(matches!(scaled(&mut app), Err(OrientError::Length { .. })));
    }

    #[test]
    fn a_known_height_of_what_is_selected_gives_metres() {
        let mut app = app();
        let capture = spawn(&mut app, Transform::from_rotation(TILT.conjugate()).with_scale(Vec3::splat(7.0)));
        app.world_mut().entity_mut(capture).insert(SplatSelection(Selection::from_fn(4400, |i| i >= 4000)));
        send(&mut app, ScaleRequest { capture, by: ScaleBy::Height { part: None, metres: 6.0 } });
        let done = scaled(&mut app).unwrap();
        // The mast is 2 units high, less a hundredth, and a little for what its Gaussians cover.
        assert!((done.metres_per_unit - 3.0).abs() < 0.06, "{done:?}");
        for metres in [0.0, -1.0, f32::NAN] {
            app.update();
            app.update();
            send(&mut app, ScaleRequest { capture, by: ScaleBy::Height { part: None, metres } });
            assert!(matches!(scaled(&mut app), Err(OrientError::Length { .. })), "{metres}");
        }
    }
}
