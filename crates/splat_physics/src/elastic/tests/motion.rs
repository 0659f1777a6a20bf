use glam::{DMat3, DQuat, DVec3};

use super::{affine_cube, beam, clamp, cuboid, elastic, model};
use crate::elastic::{ElasticBody, ElasticSettings, Frame, Integrator, Loads};
use crate::world::EmptyWorld;

const DT: f64 = 1.0 / 60.0;

fn bar() -> std::sync::Arc<crate::elastic::ElasticModel> {
    let settings = ElasticSettings { handles: 12, ..ElasticSettings::default() };
    model(&cuboid(DVec3::new(0.4, 0.2, 0.1), 0.02), &[elastic(2e5, 0.3, 1000.0)], &settings)
}

#[test]
fn a_part_falls_as_a_stone_does() {
    for integrator in [Integrator::ImplicitEuler, Integrator::Bdf2] {
        let settings = ElasticSettings { handles: 8, integrator, ..ElasticSettings::default() };
        let model = model(&cuboid(DVec3::splat(0.2), 0.02), &[elastic(1e5, 0.3, 500.0)], &settings);
        let mut body = ElasticBody::new(model, Frame::IDENTITY);
        let begin = body.center();
        for _ in 0..60 {
            body.step(DT, &Loads::default(), &mut EmptyWorld);
        }
        let fallen = body.center() - begin;
        let exact = -0.5 * 9.81;
        // First order falls too far by g t dt / 2.
        let error = 0.5 * 9.81 * DT;
        assert!((fallen.y - exact).abs() < 1.05 * error, "{integrator:?} {fallen}");
        assert!(fallen.x.abs() < 1e-9 && fallen.z.abs() < 1e-9);
        assert!(body.frame().rotation.angle_between(DQuat::IDENTITY) < 1e-6);
        assert!(body.angular_momentum().length() < 1e-9);
        assert!((body.momentum().y / (-9.81 * body.model().mass().mass) - 1.0).abs() < 1e-6);
    }
}

#[test]
fn momenta_are_kept_while_a_part_spins_and_swings() {
    let mut body = ElasticBody::new(bar(), Frame::IDENTITY);
    body.kick(DVec3::new(0.3, 0.1, -0.2), DVec3::new(0.4, 2.0, 1.0));
    body.push(DVec3::new(0.2, 0.1, 0.05), DVec3::new(0.0, 0.3, 0.0));
    let (linear, angular) = (body.momentum(), body.angular_momentum());
    for _ in 0..60 {
        body.step(1.0 / 240.0, &Loads { gravity: DVec3::ZERO, springs: &[] }, &mut EmptyWorld);
    }
    assert!(body.momentum().distance(linear) < 1e-6 * linear.length());
    assert!(
        body.angular_momentum().distance(angular) < 0.02 * angular.length(),
        "{} {angular}",
        body.angular_momentum()
    );
}

#[test]
fn energy_never_rises_without_load() {
    for integrator in [Integrator::ImplicitEuler, Integrator::Bdf2] {
        let settings = ElasticSettings { handles: 6, integrator, cage_cells: 8, ..ElasticSettings::default() };
        let model = model(&cuboid(DVec3::new(0.4, 0.1, 0.1), 0.025), &[elastic(1e5, 0.3, 1000.0)], &settings);
        let mut body = ElasticBody::new(model, Frame::IDENTITY);
        body.push(DVec3::new(0.2, 0.05, 0.05), DVec3::new(0.0, 1.0, 0.2));
        body.push(DVec3::new(-0.2, -0.05, 0.05), DVec3::new(0.0, -1.0, 0.0));
        let loads = Loads { gravity: DVec3::ZERO, springs: &[] };
        let first = body.kinetic_energy();
        // First order: from each step to the next. Second order exchanges energy with what it extrapolates from (it is stable in a
        // norm of two steps): from each stretch of a few swings to the next, and never past the beginning.
        let stretch = if integrator == Integrator::Bdf2 { 100 } else { 1 };
        let mut last = f64::INFINITY;
        let mut most: f64 = 0.0;
        for step in 1..=10_000 {
            let report = body.step(1.0 / 120.0, &loads, &mut EmptyWorld);
            assert!(!report.diverged, "{integrator:?} {step}");
            let energy = body.kinetic_energy() + body.elastic_energy();
            assert!(energy <= first * (1.0 + 1e-9));
            most = most.max(energy);
            if step % stretch == 0 {
                assert!(
                    most <= last * (1.0 + 1e-9) + 1e-9 * first,
                    "{integrator:?} {step}: {last} -> {most} of {first}"
                );
                (last, most) = (most, 0.0);
            }
        }
        assert!(last < 0.9 * first);
    }
}

#[test]
fn a_beam_keeps_as_much_of_its_swing_as_its_integrator_lets_it() {
    let kept = |integrator, rate: f64| {
        let settings = ElasticSettings { integrator, handles: 24, ..ElasticSettings::default() };
        let mut body = ElasticBody::new(model(&beam(), &[elastic(1e7, 0.3, 1000.0); 2], &settings), Frame::IDENTITY);
        let springs = clamp(1e9);
        assert!(body.settle(&Loads { gravity: DVec3::new(0.0, 0.0, -9.81), springs: &springs }));
        let loads = Loads { gravity: DVec3::ZERO, springs: &springs };
        let begin = body.elastic_energy();
        for _ in 0..rate as usize {
            body.step(1.0 / rate, &loads, &mut EmptyWorld);
        }
        (body.kinetic_energy() + body.elastic_energy()) / begin
    };
    let euler = kept(Integrator::ImplicitEuler, 60.0);
    let second = kept(Integrator::Bdf2, 60.0);
    let fine = kept(Integrator::Bdf2, 240.0);
    assert!(euler < 0.01, "{euler}");
    assert!((second - 0.599).abs() < 0.06, "{second}");
    assert!((fine - 0.969).abs() < 0.03, "{fine}");
}

#[test]
fn equilibrium_does_not_depend_on_the_step() {
    let settings = ElasticSettings { handles: 16, ..ElasticSettings::default() };
    let mut heavy = elastic(2e6, 0.3, 1000.0);
    heavy.damping_ratio = 1.0;
    let model = model(&beam(), &[heavy; 2], &settings);
    let springs = clamp(1e8);
    let loads = Loads { gravity: DVec3::new(0.0, 0.0, -9.81), springs: &springs };
    let tip = |dt: f64| {
        let mut body = ElasticBody::new(model.clone(), Frame::IDENTITY);
        for _ in 0..(12.0 / dt) as usize {
            assert!(!body.step(dt, &loads, &mut EmptyWorld).diverged);
            if body.asleep() {
                break;
            }
        }
        body.point_position(DVec3::X).z
    };
    let mut settled = ElasticBody::new(model.clone(), Frame::IDENTITY);
    assert!(settled.settle(&loads));
    let exact = settled.point_position(DVec3::X).z;
    for dt in [1.0 / 30.0, 1.0 / 60.0, 1.0 / 120.0] {
        assert!((tip(dt) / exact - 1.0).abs() < 0.01, "{dt}: {} {exact}", tip(dt));
    }
}

#[test]
fn a_turned_scene_moves_as_the_scene_does_turned() {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    let model = bar();
    let run = |frame: Frame, gravity: DVec3, impulse: DVec3| {
        let mut body = ElasticBody::new(model.clone(), frame);
        body.push(DVec3::new(0.2, 0.1, 0.0), impulse);
        for _ in 0..30 {
            body.step(DT, &Loads { gravity, springs: &[] }, &mut EmptyWorld);
        }
        body.contact_positions()
    };
    let (gravity, impulse) = (DVec3::new(0.0, -9.81, 0.0), DVec3::new(0.1, 0.2, 0.3));
    let plain = run(Frame::IDENTITY, gravity, impulse);
    let turned = run(Frame { rotation: turn, translation: DVec3::ZERO }, turn * gravity, turn * impulse);
    for (a, b) in plain.iter().zip(&turned) {
        assert!((turn * *a).distance(*b) < 1e-5, "{} {b}", turn * *a);
    }
}

#[test]
fn the_same_calls_give_the_same_bits() {
    let run = || {
        let mut body = ElasticBody::new(bar(), Frame::IDENTITY);
        body.push(DVec3::new(0.2, 0.1, 0.0), DVec3::new(1.0, 2.0, 3.0));
        let mut plane = super::contact::floor(-0.3, 0.5);
        for _ in 0..60 {
            body.step(DT, &Loads::default(), &mut plane);
        }
        body.contact_positions().into_iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
}

#[test]
fn the_rigid_motion_of_a_part_is_that_of_its_frame() {
    let mut body = ElasticBody::new(affine_cube(elastic(1e9, 0.3, 1000.0)), Frame::IDENTITY);
    let spin = DVec3::new(0.0, 3.0, 0.0);
    body.kick(DVec3::X, spin);
    let begin = body.center();
    let state = body.rigid_state();
    assert!(state.linear_velocity.distance(DVec3::X) < 1e-9 && state.angular_velocity.distance(spin) < 1e-9);
    for _ in 0..240 {
        body.step(1.0 / 240.0, &Loads { gravity: DVec3::ZERO, springs: &[] }, &mut EmptyWorld);
    }
    let frame = body.frame();
    let expected = DMat3::from_rotation_y(3.0);
    let off = DMat3::from_quat(frame.rotation) - expected;
    assert!(off.to_cols_array().iter().all(|e| e.abs() < 0.02), "{off}");
    assert!(body.center().distance(begin + DVec3::X) < 1e-6, "{}", body.center());
    let inertia = body.model().mass().inertia;
    assert!(body.rigid_state().inertia.abs_diff_eq(inertia, 1e-2 * inertia.x_axis.x));
}
