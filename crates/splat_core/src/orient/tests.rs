use super::floor::Random;
use super::*;
use crate::CloudArrays;

/// Gaussians at `means`, flat along their own z, turned by `rotation`.
fn sheet_grains(means: &[Vec3], rotation: Quat) -> Cloud {
    let n = means.len();
    Cloud::new(CloudArrays {
        means: means.to_vec(),
        log_scales: vec![Vec3::new(-3.0, -3.0, -6.0); n],
        rotations: vec![rotation; n],
        opacity_logits: vec![3.0; n],
        sh: vec![0.0; 3 * n],
        ..CloudArrays::default()
    })
    .unwrap()
}

fn join(a: Cloud, b: Cloud) -> Cloud {
    let (mut a, b) = (a.into_arrays(), b.into_arrays());
    a.means.extend(b.means);
    a.log_scales.extend(b.log_scales);
    a.rotations.extend(b.rotations);
    a.opacity_logits.extend(b.opacity_logits);
    a.sh.extend(b.sh);
    Cloud::new(a).unwrap()
}

/// Random points in a box of these half sides about the origin.
fn box_points(seed: u64, count: usize, half: Vec3) -> Vec<Vec3> {
    let mut random = Random(seed);
    let mut unit = || random.below(1 << 24) as f32 / (1 << 23) as f32 - 1.0;
    (0..count).map(|_| half * Vec3::new(unit(), unit(), unit())).collect()
}

#[test]
fn the_axes_of_a_turned_box_are_its_sides() {
    let turn = Quat::from_euler(glam::EulerRot::YXZ, 0.4, -0.3, 0.2);
    let shift = Vec3::new(5.0, -2.0, 1.0);
    let means: Vec<Vec3> =
        box_points(7, 20_000, Vec3::new(3.0, 1.0, 0.3)).into_iter().map(|p| turn * p + shift).collect();
    let axes = principal_axes(&sheet_grains(&means, Quat::IDENTITY), None).unwrap();
    assert!(axes.center.distance(shift) < 0.05, "{axes:?}");
    for (axis, side) in axes.axes.into_iter().zip(Vec3::AXES) {
        assert!(axis.dot(turn * side).abs() > 0.999, "{axis} {side}");
    }
    // A uniform box has the variance half^2 / 3.
    for (variance, half) in axes.variances.into_iter().zip([3.0f32, 1.0, 0.3]) {
        assert!((variance / (half * half / 3.0) - 1.0).abs() < 0.05, "{axes:?}");
    }
    assert!(!axes.first_two_ambiguous() && !axes.last_two_ambiguous() && axes.flatness() < 0.2);
    let m = Mat3::from_cols(axes.axes[0], axes.axes[1], axes.axes[2]);
    assert!((m.determinant() - 1.0).abs() < 1e-5);

    let back = align(&axes, None);
    for (from, to) in means.iter().zip(box_points(7, 20_000, Vec3::new(3.0, 1.0, 0.3))).step_by(997) {
        assert!((back.apply(*from) - axes.center).distance(to) < 0.06, "{from} {to}");
    }
}

#[test]
fn chosen_axes_are_reached_by_a_proper_rotation() {
    let means = box_points(3, 5_000, Vec3::new(3.0, 1.0, 0.3));
    let axes = principal_axes(&sheet_grains(&means, Quat::IDENTITY), None).unwrap();
    for targets in [[0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 2, 1]] {
        let s = align(&axes, Some(targets));
        assert!((s.rotation_matrix().determinant() - 1.0).abs() < 1e-4);
        for k in 0..3 {
            assert!((s.rotation * axes.axes[k]).dot(Vec3::AXES[targets[k]]).abs() > 0.9999, "{targets:?}");
        }
        assert!(s.apply(axes.center).distance(axes.center) < 1e-4);
    }
}

#[test]
fn what_is_round_is_not_turned_about_its_axis() {
    let half = |k: f32| Vec3::new(1.0, 1.0, k);
    let tilt = Quat::from_rotation_x(0.3);
    let means: Vec<Vec3> = box_points(5, 20_000, half(0.1)).into_iter().map(|p| tilt * p).collect();
    let axes = principal_axes(&sheet_grains(&means, Quat::IDENTITY), None).unwrap();
    assert!(axes.first_two_ambiguous() && !axes.last_two_ambiguous());
    let s = align(&axes, None);
    assert!(s.rotation.angle_between(tilt.conjugate()) < 0.02, "{:?}", s.rotation);

    let ball: Vec<Vec3> = box_points(5, 20_000, Vec3::ONE);
    let axes = principal_axes(&sheet_grains(&ball, Quat::IDENTITY), None).unwrap();
    assert!(axes.first_two_ambiguous() && axes.last_two_ambiguous() && axes.flatness() > 0.5);
    assert!(align(&axes, None).rotation.angle_between(Quat::IDENTITY) < 1e-3);
}

#[test]
fn outliers_and_what_cannot_be_drawn_do_not_turn_the_axes() {
    let mut means = box_points(9, 5_000, Vec3::new(3.0, 1.0, 0.3));
    let clean = principal_axes(&sheet_grains(&means, Quat::IDENTITY), None).unwrap();
    means.extend([Vec3::new(80.0, 90.0, 70.0), Vec3::new(60.0, -90.0, 70.0), Vec3::NAN, Vec3::INFINITY]);
    let noisy = principal_axes(&sheet_grains(&means, Quat::IDENTITY), None).unwrap();
    for k in 0..3 {
        assert!(clean.axes[k].dot(noisy.axes[k]).abs() > 0.999);
    }
    assert!(principal_axes(&sheet_grains(&[Vec3::NAN], Quat::IDENTITY), None).is_none());
    assert!(principal_axes(&Cloud::default(), None).is_none());
    let one = principal_axes(&sheet_grains(&[Vec3::ONE], Quat::IDENTITY), None).unwrap();
    assert!(one.center == Vec3::ONE && one.axes[2].abs().z > 0.999, "{one:?}");
}

#[test]
fn a_selection_alone_decides() {
    let mut means = box_points(1, 2_000, Vec3::new(0.2, 2.0, 0.2));
    means.extend(box_points(2, 2_000, Vec3::new(9.0, 0.1, 0.1)).into_iter().map(|p| p + Vec3::splat(20.0)));
    let cloud = sheet_grains(&means, Quat::IDENTITY);
    let first = Selection::from_fn(4_000, |i| i < 2_000);
    let axes = principal_axes(&cloud, Some(&first)).unwrap();
    assert!(axes.center.length() < 0.2 && axes.axes[0].y > 0.99 && axes.last_two_ambiguous());
}

/// A floor, tilted, with a box standing on it; up is the second axis of the tilt.
fn floor_with_box(tilt: Quat) -> Cloud {
    let ground: Vec<Vec3> = box_points(11, 6_000, Vec3::new(4.0, 0.01, 4.0)).into_iter().map(|p| tilt * p).collect();
    let thing: Vec<Vec3> = box_points(12, 3_000, Vec3::new(0.5, 1.0, 0.5))
        .into_iter()
        .map(|p| tilt * (p + Vec3::new(1.0, 1.05, 0.0)))
        .collect();
    // Turned about x by a right angle, a Gaussian that is flat along z is flat along y.
    let lying = tilt * Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    join(sheet_grains(&ground, lying), sheet_grains(&thing, tilt))
}

#[test]
fn the_floor_is_found_whatever_its_tilt_and_made_level() {
    for tilt in [Quat::IDENTITY, Quat::from_euler(glam::EulerRot::YXZ, 0.3, 0.8, -0.4), Quat::from_rotation_x(3.0)] {
        let cloud = floor_with_box(tilt);
        let floor = floor_plane(&cloud, None, Vec3::Y, &FloorSettings::default()).unwrap();
        assert!(floor.normal.dot(tilt * Vec3::Y) > 0.9999, "{floor:?}");
        assert!(floor.offset.abs() < 0.01 && floor.share > 0.5 && floor.below < 0.01, "{floor:?}");
        let s = upright(&floor, Vec3::NEG_Y, Vec3::new(0.3, 0.2, 0.1));
        for &mean in cloud.means()[..6_000].iter().step_by(501) {
            assert!(s.apply(mean).y.abs() < 0.05, "{}", s.apply(mean));
        }
        assert!(cloud.means()[6_000..].iter().all(|&m| s.apply(m).y < 0.0));
    }
}

#[test]
fn in_a_room_the_up_direction_decides_between_floor_walls_and_ceiling() {
    let side = |seed, turn: Quat| {
        let means: Vec<Vec3> = box_points(seed, 4_000, Vec3::new(2.0, 2.0, 0.005))
            .into_iter()
            .map(|p| turn * (p + Vec3::new(0.0, 0.0, 2.0)))
            .collect();
        sheet_grains(&means, turn)
    };
    use std::f32::consts::{FRAC_PI_2, PI};
    let turns = [0.0, FRAC_PI_2, PI, -FRAC_PI_2];
    let sides = turns.map(Quat::from_rotation_x).into_iter().enumerate();
    let room = sides.map(|(k, turn)| side(20 + k as u64, turn)).reduce(join).unwrap();
    let named = |x: f32, y: f32, z: f32| Vec3::new(x, y, z).normalize();
    for (up, nearest) in
        [(named(0.1, 1.0, 0.3), Vec3::Y), (Vec3::NEG_Y, Vec3::NEG_Y), (named(0.5, 0.0, -0.6), Vec3::NEG_Z)]
    {
        let floor = floor_plane(&room, None, up, &FloorSettings::default()).unwrap();
        assert!(floor.rival.is_some(), "{floor:?}");
        assert!(floor.normal.dot(nearest) > 0.999, "{up} {floor:?}");
    }
}

#[test]
fn a_ball_has_no_floor_and_nothing_has_none() {
    let ball: Vec<Vec3> =
        box_points(31, 4_000, Vec3::ONE).into_iter().filter(|p| p.length() > 0.9).map(Vec3::normalize).collect();
    let none = floor_plane(&sheet_grains(&ball, Quat::IDENTITY), None, Vec3::Y, &FloorSettings::default());
    assert!(none.is_none_or(|f| f.share < 0.05), "{none:?}");
    assert!(floor_plane(&Cloud::default(), None, Vec3::Y, &FloorSettings::default()).is_none());
    let bad = sheet_grains(&[Vec3::NAN; 10], Quat::IDENTITY);
    assert!(floor_plane(&bad, None, Vec3::Y, &FloorSettings::default()).is_none());
}

#[test]
fn results_are_the_same_bits_on_any_number_of_threads() {
    let cloud = floor_with_box(Quat::from_rotation_z(0.3));
    let settings = FloorSettings::default();
    let all = || (principal_axes(&cloud, None), floor_plane(&cloud, None, Vec3::Y, &settings));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(all);
    let three = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap().install(all);
    assert_eq!(one, three);
}

fn target(axis: usize, sign: Option<AxisSign>) -> AxisTarget {
    AxisTarget { axis, sign }
}

#[test]
fn every_permutation_and_sign_is_reached_or_told_to_mirror() {
    let turn = Quat::from_euler(glam::EulerRot::YXZ, 0.4, -0.3, 0.2);
    let means: Vec<Vec3> =
        box_points(3, 5_000, Vec3::new(3.0, 1.0, 0.3)).into_iter().map(|p| turn * p + Vec3::ONE).collect();
    let axes = principal_axes(&sheet_grains(&means, Quat::IDENTITY), None).unwrap();
    let ends = [None, Some(AxisSign::Positive), Some(AxisSign::Negative)];
    let (mut reached, mut mirrored) = (0, 0);
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for code in 0..27 {
            let signs = [ends[code % 3], ends[code / 3 % 3], ends[code / 9]];
            let targets = std::array::from_fn(|k| target(order[k], signs[k]));
            match align_to(&axes, targets) {
                Ok(found) => {
                    reached += 1;
                    assert!((found.transform.rotation_matrix().determinant() - 1.0).abs() < 1e-4);
                    assert!(found.transform.apply(axes.center).distance(axes.center) < 1e-4);
                    for k in 0..3 {
                        let along = (found.transform.rotation * axes.axes[k]).dot(Vec3::AXES[order[k]]);
                        match signs[k] {
                            None => assert!(along.abs() > 0.9999),
                            Some(AxisSign::Positive) => assert!(along > 0.9999, "{targets:?}"),
                            Some(AxisSign::Negative) => assert!(along < -0.9999, "{targets:?}"),
                        }
                    }
                    let turned = found.transform.rotation.angle_between(Quat::IDENTITY);
                    assert!((turned - found.angle).abs() < 2e-3, "{turned} {}", found.angle);
                }
                Err(error) => {
                    mirrored += 1;
                    assert!(error == AlignError::Mirrors && signs.iter().all(Option::is_some));
                }
            }
        }
    }
    // Of the eight choices of three signs four are turns.
    assert_eq!((reached, mirrored), (6 * 23, 6 * 4));
    let twice = [target(0, None), target(0, None), target(1, None)];
    assert_eq!(align_to(&axes, twice), Err(AlignError::NotEachOnce));
    let open = align_to(&axes, [target(0, None), target(1, None), target(2, None)]).unwrap();
    assert!(open.transform.rotation.angle_between(align(&axes, Some([0, 1, 2])).rotation) < 1e-3);
    assert!(open.rival.is_none(), "the nearest turn is much nearer than the others");
}

#[test]
fn a_turn_that_could_as_well_go_the_other_way_is_told() {
    let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 - 0.03);
    let means: Vec<Vec3> = box_points(3, 5_000, Vec3::new(3.0, 1.0, 0.3)).into_iter().map(|p| turn * p).collect();
    let axes = principal_axes(&sheet_grains(&means, Quat::IDENTITY), None).unwrap();
    let found = align_to(&axes, [target(0, None), target(1, None), target(2, None)]).unwrap();
    assert!(found.rival.is_some_and(|other| (other - found.angle - 0.06).abs() < 0.03), "{found:?}");
}

#[test]
fn a_selected_surface_is_made_level_whatever_else_was_selected() {
    for tilt in [Quat::from_euler(glam::EulerRot::YXZ, 0.3, 0.8, -0.4), Quat::from_rotation_x(3.0)] {
        let cloud = floor_with_box(tilt);
        // The floor, and a third of what stands on it.
        let selection = Selection::from_fn(cloud.len(), |i| i < 7_000);
        let settings = FloorSettings::default();
        // Nobody says which side is up: the box stands on it.
        let beside = tilt * Vec3::X;
        let found = surface_plane(&cloud, &selection, beside, &settings).unwrap();
        assert!(found.plane.normal.dot(tilt * Vec3::Y) > 0.9999 && !found.side_ambiguous, "{found:?}");
        assert!(found.plane.offset.abs() < 0.01 && found.rest.0 > 0.9, "{found:?}");
        // Somebody does.
        let found = surface_plane(&cloud, &selection, tilt * Vec3::NEG_Y, &settings).unwrap();
        assert!(found.plane.normal.dot(tilt * Vec3::Y) < -0.9999 && found.rest.1 > 0.9, "{found:?}");
        // Nothing does.
        let all = Selection::all(cloud.len());
        assert!(surface_plane(&cloud, &all, beside, &settings).unwrap().side_ambiguous);
    }
    let line: Vec<Vec3> = (0..200).map(|i| Vec3::X * i as f32).collect();
    let cloud = sheet_grains(&line, Quat::IDENTITY);
    for selection in [Selection::all(200), Selection::from_ids(200, [3, 4]), Selection::none(200)] {
        assert!(surface_plane(&cloud, &selection, Vec3::Y, &FloorSettings::default()).is_none());
    }
}

#[test]
fn three_points_make_their_plane_level_with_the_first_two_along_x() {
    let tilt = Quat::from_euler(glam::EulerRot::YXZ, 1.3, 0.8, -0.4);
    let points = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 2.0, 3.0), Vec3::new(2.0, 2.0, 1.0)].map(|p| tilt * p);
    for (was_up, up) in [(tilt * Vec3::Y, Vec3::Y), (tilt * Vec3::Y, Vec3::NEG_Y), (tilt * Vec3::NEG_Y, Vec3::Z)] {
        let s = three_points(points, was_up, up).unwrap();
        let [a, b, c] = points.map(|p| s.apply(p));
        for p in [a, b, c] {
            assert!(p.dot(up).abs() < 1e-4, "{p}");
        }
        assert!((b - a).distance(Vec3::X * 3.0) < 1e-4, "{a} {b}");
        assert!((s.rotation * was_up).distance(up) < 1e-4);
        assert!((a - points[0]).reject_from(up).length() < 1e-4);
    }
    let sideways = three_points(points, tilt * Vec3::Y, Vec3::X).unwrap();
    assert!((sideways.rotation * (points[1] - points[0])).distance(Vec3::Y * 3.0) < 1e-4);

    let [a, b] = [Vec3::ONE, Vec3::new(3.0, 2.0, 1.0)];
    for (bad, error) in [
        ([a, b, a + 0.3 * (b - a)], PointsError::Collinear),
        ([a, b, a - 7.0 * (b - a) + 1e-4], PointsError::Collinear),
        ([a, a, b], PointsError::Same),
        ([a, b, b], PointsError::Same),
        ([a; 3], PointsError::Same),
        ([a, b, Vec3::NAN], PointsError::NotFinite),
    ] {
        assert_eq!(three_points(bad, Vec3::Y, Vec3::Y), Err(error), "{bad:?}");
    }
}

#[test]
fn an_extent_leaves_floaters_out_and_counts_what_gaussians_cover() {
    let mut means = box_points(4, 40_000, Vec3::new(3.0, 1.0, 0.3));
    means.extend([Vec3::splat(50.0), Vec3::splat(-70.0), Vec3::NAN]);
    let cloud = sheet_grains(&means, Quat::IDENTITY);
    // Uniform, so half a percent at each end is missing; a deviation is exp(-3).
    for (direction, half, deviation) in [(Vec3::X * 2.0, 3.0, (-3f32).exp()), (Vec3::NEG_Z, 0.3, (-6f32).exp())] {
        let (low, high) = extent_along(&cloud, None, direction).unwrap();
        let wanted = 0.99 * 2.0 * half + 2.0 * deviation;
        assert!(((high - low) / wanted - 1.0).abs() < 0.01, "{low} {high} {wanted}");
    }
    let one = Selection::from_ids(cloud.len(), [0]);
    let (low, high) = extent_along(&cloud, Some(&one), Vec3::X).unwrap();
    assert!((high - low - 2.0 * (-3f32).exp()).abs() < 1e-4);
    assert_eq!(extent_along(&cloud, Some(&Selection::none(cloud.len())), Vec3::X), None);
    assert_eq!(extent_along(&cloud, None, Vec3::ZERO), None);
    assert_eq!(extent_along(&Cloud::default(), None, Vec3::X), None);
}

#[test]
fn axes_and_planes_move_along_with_the_scene() {
    let by = Similarity { rotation: Quat::from_rotation_x(2.0), scale: 3.0, translation: Vec3::new(1.0, -2.0, 0.5) };
    let cloud = floor_with_box(Quat::from_rotation_z(0.4));
    let moved = cloud.transformed(&by);
    let (a, b) = (principal_axes(&cloud, None).unwrap().moved(&by), principal_axes(&moved, None).unwrap());
    for k in 0..3 {
        assert!(
            a.axes[k].dot(b.axes[k]) > 0.999 && (a.variances[k] / b.variances[k] - 1.0).abs() < 1e-3,
            "{a:?} {b:?}"
        );
    }
    assert!(a.center.distance(b.center) < 1e-3);
    let floor = floor_plane(&cloud, None, Vec3::Y, &FloorSettings::default()).unwrap();
    for &mean in cloud.means().iter().step_by(371) {
        let height = floor.normal.dot(mean) - floor.offset;
        let after = floor.moved(&by);
        assert!((after.normal.dot(by.apply(mean)) - after.offset - 3.0 * height).abs() < 1e-4);
    }
}
