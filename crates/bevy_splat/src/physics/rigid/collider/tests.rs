use bevy::math::DQuat;

use super::*;

/// The eight corners of a box.
fn corners(center: DVec3, half: DVec3) -> Vec<DVec3> {
    let sign = |k: usize, bit: usize| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
    (0..8).map(|k| center + half * DVec3::new(sign(k, 0), sign(k, 1), sign(k, 2))).collect()
}

fn volume(fitted: &Fitted) -> f32 {
    fitted.collider.shape().mass_properties(1.0).mass()
}

#[test]
fn a_collider_is_in_units_of_the_cloud() {
    let half = DVec3::new(0.3, 0.2, 0.1);
    for unit in [1e-3, 1.0, 1e4] {
        let exact = (8.0 * 0.3 * 0.2 * 0.1 / unit / unit / unit) as f32;
        let center = DVec3::new(1.0, 2.0, 3.0);
        let box_ = Shape::Box { center, rotation: DQuat::from_rotation_y(0.4), half };
        let hull = Shape::Hull(corners(center, half));
        for shape in [box_, hull] {
            let fitted = collider(&shape, unit).unwrap();
            assert!((volume(&fitted) / exact - 1.0).abs() < 1e-3, "{unit}: {shape:?}");
            let middle = fitted.collider.shape().mass_properties(1.0).local_com;
            assert!((middle.as_dvec3() * unit).distance(center) < 1e-3, "{unit}: {middle}");
        }
    }
}

#[test]
fn flat_empty_and_broken_shapes_have_no_collider() {
    let flat = corners(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0));
    let mut broken = corners(DVec3::ZERO, DVec3::ONE);
    broken[3].y = f64::NAN;
    let none = SurfaceMesh { vertices: Vec::new(), triangles: Vec::new() };
    let bad = [
        Shape::Hull(flat),
        Shape::Hull(broken),
        Shape::Hull(vec![DVec3::ZERO; 3]),
        Shape::Box { center: DVec3::ZERO, rotation: DQuat::IDENTITY, half: DVec3::X },
        Shape::Ball { center: DVec3::NAN, radius: 1.0 },
        Shape::Ball { center: DVec3::ZERO, radius: 0.0 },
        Shape::Capsule { a: DVec3::ZERO, b: DVec3::X, radius: f64::NAN },
        Shape::Decomposition(none),
        Shape::Voxels { origin: DVec3::ZERO, voxel: 0.1, cells: Vec::new() },
    ];
    for shape in bad {
        assert!(collider(&shape, 1.0).is_none(), "{shape:?}");
    }
}

#[test]
fn thinning_keeps_points_that_span_nearly_the_same_hull() {
    let ball: Vec<Vec3> = (0..4000).map(|k| direction(k, 4000)).collect();
    let thinned = thin(ball.clone(), 64);
    assert!(thinned.len() <= 64 && thinned.len() > 50, "{}", thinned.len());
    assert!(thinned.iter().all(|p| ball.contains(p)));
    let volume = hull(&thinned).unwrap().mass_properties(1.0).mass();
    assert!(volume > 0.8 * 4.18879, "{volume}");
    assert_eq!(thin(ball[..64].to_vec(), 64), ball[..64]);
}

#[test]
fn directions_are_units_and_cover_all_sides() {
    for axis in Vec3::AXES {
        for sign in [-1.0, 1.0] {
            let nearest = (0..64).map(|k| direction(k, 64).dot(sign * axis)).fold(-1.0, f32::max);
            assert!(nearest > 0.97, "{nearest}");
        }
    }
    assert!((0..64).all(|k| (direction(k, 64).length() - 1.0).abs() < 1e-6));
}
