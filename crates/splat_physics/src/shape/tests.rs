use super::*;
use crate::VoxelGrid;

/// The voxels of a cube of `size` metres about the origin that are inside a thing.
fn carved(size: f64, voxels: u32, inside: impl Fn(DVec3) -> bool) -> Solid {
    let voxel = size / f64::from(voxels);
    let grid = VoxelGrid { origin: DVec3::splat(-0.5 * size), voxel, dims: UVec3::splat(voxels) };
    let mut solid = Solid::cuboid(grid.origin, -grid.origin, voxel);
    for v in 0..grid.len() {
        solid.weights[v] = if inside(grid.center(v)) { 1.0 } else { 0.0 };
    }
    solid
}

fn segment_distance(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a + t * (b - a))
}

#[test]
fn a_box_fits_within_half_a_voxel() {
    let (min, max) = (DVec3::new(-0.3, 0.1, 0.2), DVec3::new(0.5, 0.7, 0.6));
    let solid = Solid::cuboid(min, max, 0.02);
    let Ok(Shape::Box { center, rotation, half }) = Shape::fit(&solid, ShapeChoice::Box) else { panic!() };
    assert!(rotation.angle_between(DQuat::IDENTITY) < 1e-6);
    assert!(
        center.abs_diff_eq(0.5 * (min + max), 0.01) && half.abs_diff_eq(0.5 * (max - min), 0.01),
        "{center} {half}"
    );
    assert!(matches!(Shape::fit(&solid, ShapeChoice::Auto), Ok(Shape::Box { .. })));
}

#[test]
fn a_turned_box_is_found_turned() {
    let turn = DQuat::from_rotation_y(0.6) * DQuat::from_rotation_x(0.3);
    let half = DVec3::new(0.4, 0.25, 0.15);
    let solid = carved(1.2, 60, |p| (turn.conjugate() * p).abs().cmple(half).all());
    let shape = Shape::fit(&solid, ShapeChoice::Box).unwrap();
    let Shape::Box { center, rotation, half: found } = shape else { panic!() };
    let voxel = solid.grid.voxel;
    let mut sides = found.to_array();
    sides.sort_by(|a, b| b.total_cmp(a));
    assert!(center.length() < 0.5 * voxel, "{center}");
    assert!(DVec3::from_array(sides).abs_diff_eq(half, 0.75 * voxel), "{found}");
    // Its longest axis is the box's, one way or the other.
    let longest = rotation * DVec3::AXES[found.max_position()];
    assert!(longest.dot(turn * DVec3::X).abs() > 0.995);
}

#[test]
fn a_ball_has_the_radius_of_its_volume() {
    let middle = DVec3::new(0.05, -0.02, 0.03);
    let solid = carved(1.2, 48, |p| p.distance(middle) < 0.45);
    let Ok(Shape::Ball { center, radius }) = Shape::fit(&solid, ShapeChoice::Ball) else { panic!() };
    assert!(center.distance(middle) < 0.2 * solid.grid.voxel && (radius - 0.45).abs() < 0.1 * solid.grid.voxel);
    assert!(matches!(Shape::fit(&solid, ShapeChoice::Auto), Ok(Shape::Ball { .. })));
}

#[test]
fn a_capsule_finds_axis_ends_and_radius() {
    let (from, to) = (DVec3::new(-0.4, -0.2, 0.1), DVec3::new(0.4, 0.3, 0.0));
    let solid = carved(1.4, 70, |p| segment_distance(p, from, to) < 0.15);
    let Ok(Shape::Capsule { a, b, radius }) = Shape::fit(&solid, ShapeChoice::Capsule) else { panic!() };
    let (a, b) = if a.distance(from) < b.distance(from) { (a, b) } else { (b, a) };
    let voxel = solid.grid.voxel;
    assert!(a.distance(from) < voxel && b.distance(to) < voxel, "{a} {b}");
    assert!((radius - 0.15).abs() < 0.5 * voxel, "{radius}");
    assert!(matches!(Shape::fit(&solid, ShapeChoice::Auto), Ok(Shape::Capsule { .. })));
}

#[test]
fn what_is_hollowed_out_like_an_l_is_cut_and_what_bulges_gets_a_hull() {
    let l = carved(1.0, 40, |p| p.z.abs() < 0.2 && (p.x < -0.2 || p.y < -0.2));
    let Ok(Shape::Decomposition(mesh)) = Shape::fit(&l, ShapeChoice::Auto) else { panic!() };
    assert!(mesh.closed() && (mesh.volume() / l.volume() - 1.0).abs() < 0.02);
    // A cone is convex, and neither ball, box nor capsule.
    let cone = carved(1.2, 48, |p| p.y.abs() < 0.5 && p.x.hypot(p.z) < 0.5 * (0.5 - p.y));
    let Ok(Shape::Hull(points)) = Shape::fit(&cone, ShapeChoice::Auto) else { panic!() };
    assert!((4..=64).contains(&points.len()));
    let volume = convex_hull(&points).unwrap().volume;
    assert!((volume / cone.volume() - 1.0).abs() < 0.1, "{}", volume / cone.volume());
}

#[test]
fn hulls_of_boxes_are_exact_and_flat_ones_are_none() {
    let corner = |k: usize| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2 & 1) as f64);
    let mut points: Vec<DVec3> = (0..8).map(corner).collect();
    points.extend([DVec3::splat(0.5), DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.25, 0.5, 1.0)]);
    let hull = convex_hull(&points).unwrap();
    assert!((hull.volume - 1.0).abs() < 1e-12 && hull.points.len() == 8, "{hull:?}");
    let flat: Vec<DVec3> = points.iter().map(|p| DVec3::new(p.x, p.y, 0.25 * p.x)).collect();
    for bad in [&flat[..], &points[..3], &[], &[DVec3::NAN; 5], &[DVec3::ONE; 9]] {
        assert!(convex_hull(bad).is_none(), "{bad:?}");
    }
}

#[test]
fn voxels_are_those_of_the_solid() {
    let solid = Solid::cuboid(DVec3::ONE, DVec3::splat(1.4), 0.1);
    let Ok(Shape::Voxels { origin, voxel, cells }) = Shape::fit(&solid, ShapeChoice::Voxels) else { panic!() };
    assert_eq!((origin, voxel, cells.len()), (DVec3::ONE, 0.1, 64));
    assert_eq!(cells[63], UVec3::splat(3));
}

#[test]
fn empty_and_broken_solids_are_told_and_thin_ones_get_a_shape() {
    let mut empty = Solid::cuboid(DVec3::ZERO, DVec3::ONE, 0.5);
    empty.weights.fill(0.0);
    let mut broken = Solid::cuboid(DVec3::ZERO, DVec3::ONE, 0.5);
    broken.grid.origin.x = f64::NAN;
    let mut heavy = Solid::cuboid(DVec3::ZERO, DVec3::ONE, 0.5);
    heavy.weights[0] = f32::NAN;
    let all = [
        ShapeChoice::Auto,
        ShapeChoice::Box,
        ShapeChoice::Ball,
        ShapeChoice::Capsule,
        ShapeChoice::Hull,
        ShapeChoice::Decomposition,
        ShapeChoice::Voxels,
    ];
    for choice in all {
        assert_eq!(Shape::fit(&empty, choice), Err(ShapeError::Empty));
        assert_eq!(Shape::fit(&broken, choice), Err(ShapeError::NotFinite));
        assert_eq!(Shape::fit(&heavy, choice), Err(ShapeError::NotFinite));
        let sheet = Solid::cuboid(DVec3::ZERO, DVec3::new(1.0, 0.02, 1.0), 0.02);
        assert!(Shape::fit(&sheet, choice).is_ok(), "{choice:?}");
        let one = Solid::cuboid(DVec3::ZERO, DVec3::splat(0.02), 0.02);
        assert!(Shape::fit(&one, choice).is_ok(), "{choice:?}");
    }
}
