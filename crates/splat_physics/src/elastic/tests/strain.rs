use faer::Mat;
use glam::DVec3;

use super::{affine_cube, beam, clamp, cuboid, elastic, model};
use crate::elastic::{ElasticBody, ElasticSettings, Frame, Loads, Spring};

/// Springs that pull two opposite faces apart with `force` in all, without holding them sideways.
fn pulled_apart(body: &ElasticBody, half: f64, force: f64) -> Vec<Spring> {
    // A soft spring with a far target is a constant force.
    let stiffness = 1e-3;
    let mut springs = Vec::new();
    for side in [-1.0, 1.0] {
        for k in 0..16 {
            let at = |k: i32| (f64::from(k) + 0.5) / 4.0 * 2.0 * half - half;
            let point = DVec3::new(side * half, at(k % 4), at(k / 4));
            let pull = side * force / 16.0 / stiffness;
            springs.push(Spring { point, target: body.point_position(point) + DVec3::X * pull, stiffness });
        }
    }
    springs
}

#[test]
fn small_strains_have_the_youngs_modulus_and_poissons_ratio_asked_for() {
    for poisson in [0.0, 0.2, 0.3, 0.45] {
        let youngs = 1e6;
        let mut body = ElasticBody::new(affine_cube(elastic(youngs as f32, poisson, 1000.0)), Frame::IDENTITY);
        let strain = 1e-4;
        let springs = pulled_apart(&body, 0.1, youngs * strain * 0.04);
        assert!(body.settle(&Loads { gravity: DVec3::ZERO, springs: &springs }));
        let f = body.deformation_gradients()[0];
        assert!(((f.x_axis.x - 1.0) / strain - 1.0).abs() < 0.01, "nu {poisson}: strain {}", f.x_axis.x - 1.0);
        let sideways = -(f.y_axis.y - 1.0) / (f.x_axis.x - 1.0);
        assert!((sideways - f64::from(poisson)).abs() < 0.01, "nu {poisson}: {sideways}");
    }
}

#[test]
fn half_of_a_rod_that_is_a_hundred_times_softer_stretches_a_hundred_times_more() {
    let material = [elastic(1e8, 0.3, 1000.0), elastic(1e6, 0.3, 1000.0)];
    let model = model(&beam(), &material, &ElasticSettings::default());
    let mut body = ElasticBody::new(model, Frame::IDENTITY);
    let mut springs = clamp(1e9);
    let stiffness = 1e-3;
    for k in 0..25 {
        let point = DVec3::new(1.0, f64::from(k % 5) * 0.05 - 0.1, f64::from(k / 5) * 0.05 - 0.1);
        springs.push(Spring { point, target: point + DVec3::X * (400.0 / 25.0 / stiffness), stiffness });
    }
    assert!(body.settle(&Loads { gravity: DVec3::ZERO, springs: &springs }));
    let strain = |from: f64, to: f64| {
        // Mean over the section: the ends are not pulled evenly.
        let at = |x: f64| {
            let place = |k: i32| f64::from(k) * 0.04 - 0.08;
            (0..25).map(|k| body.point_position(DVec3::new(x, place(k % 5), place(k / 5))).x).sum::<f64>() / 25.0
        };
        (at(to) - at(from)) / (to - from) - 1.0
    };
    // Away from the ends and from where the materials meet.
    let (stiff, soft) = (strain(0.1, 0.4), strain(0.6, 0.9));
    let exact = 400.0 / (0.04 * 1e6);
    assert!((soft / exact - 1.0).abs() < 0.03, "{soft}");
    assert!(stiff / soft < 0.02, "{stiff} {soft}");
}

#[test]
fn rigid_motions_cost_nothing_and_strain_nothing() {
    let model =
        model(&cuboid(DVec3::new(0.3, 0.2, 0.1), 0.02), &[elastic(1e7, 0.3, 1000.0)], &ElasticSettings::default());
    let frame = Frame {
        rotation: glam::DQuat::from_axis_angle(DVec3::new(2.0, -1.0, 0.5).normalize(), 2.3),
        translation: DVec3::new(3.0, -40.0, 5.0),
    };
    let body = ElasticBody::new(model.clone(), frame);
    let turn = glam::DMat3::from_quat(frame.rotation);
    for f in body.deformation_gradients() {
        assert!(f.abs_diff_eq(turn, 1e-9));
    }
    // Against the energy of a strain of one percent.
    let scale = 1e7 * 1e-4 * 0.006;
    let energy: f64 = body
        .deformation_gradients()
        .iter()
        .zip(model.samples())
        .zip(&model.moduli)
        .map(|((f, s), &m)| s.volume * model.settings().energy.density(f, &turn, m))
        .sum();
    assert!(energy.abs() < 1e-9 * scale, "{energy}");
    for &point in model.contact_points() {
        assert!(body.point_position(point).distance(frame.apply(point)) < 1e-9);
    }
    let found = body.frame();
    assert!(
        found.translation.distance(frame.translation) < 1e-9 && found.rotation.dot(frame.rotation).abs() > 1.0 - 1e-12
    );
}

#[test]
fn functions_are_orthonormal_in_mass_and_rest_is_told_by_four_of_them() {
    let model = model(&beam(), &[elastic(1e7, 0.3, 1000.0), elastic(1e6, 0.3, 100.0)], &ElasticSettings::default());
    let rank = model.rank();
    assert!(rank > 100, "{rank}");
    let mut gram = Mat::<f64>::zeros(rank, rank);
    for sample in model.samples() {
        let m = sample.volume * f64::from(model.materials()[usize::from(sample.region)].density);
        let row = model.row(sample.position);
        for r in 0..rank {
            for c in 0..rank {
                gram[(r, c)] += m * row[r] * row[c];
            }
        }
    }
    for r in 0..rank {
        for c in 0..rank {
            assert!((gram[(r, c)] - f64::from(u8::from(r == c))).abs() < 1e-8, "{r} {c} {}", gram[(r, c)]);
        }
    }
    for k in 4..rank {
        assert!((0..3).all(|a| model.rest[(k, a)].abs() < 1e-8));
    }
}

#[test]
fn splats_that_follow_the_cage_go_where_the_handles_take_them() {
    let mut body = ElasticBody::new(
        model(&beam(), &[elastic(1e6, 0.3, 1000.0), elastic(1e6, 0.3, 1000.0)], &ElasticSettings::default()),
        Frame::IDENTITY,
    );
    assert!(body.settle(&Loads { gravity: DVec3::new(0.0, 0.0, -9.81), springs: &clamp(1e7) }));
    let tip = body.point_position(DVec3::new(1.0, 0.0, 0.0));
    assert!(tip.z < -0.2, "{tip}");
    let mut nodes = Vec::new();
    body.node_positions(&mut nodes);
    let cage = body.model().cage().cage;
    let frame = body.frame();
    for k in 0..500u32 {
        let at = |s: f64| (f64::from(k) * s).sin().abs();
        let point = DVec3::new(at(1.3), at(2.7) * 0.2 - 0.1, at(3.9) * 0.2 - 0.1);
        let place = cage.locate(point.as_vec3());
        let weights = place.weights();
        let corners = cage.corners(place.node);
        let by_cage: glam::Vec3 = corners.iter().zip(weights).map(|(&c, w)| nodes[c] * w).sum();
        let off = frame.apply(by_cage.as_dvec3()).distance(body.point_position(point));
        assert!(off < 1e-3 * 1.04, "{point}: {off}");
    }
}
