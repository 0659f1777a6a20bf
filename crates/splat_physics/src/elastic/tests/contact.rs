use glam::{DQuat, DVec3};

use super::{affine_cube, cuboid, elastic, model};
use crate::elastic::{ElasticBody, ElasticSettings, Frame, Loads};
use crate::world::PlaneWorld;

const DT: f64 = 1.0 / 60.0;

pub(super) fn floor(height: f64, friction: f64) -> PlaneWorld {
    PlaneWorld { normal: DVec3::Y, offset: height, friction: [friction; 2], restitution: 0.0 }
}

fn at(height: f64) -> Frame {
    Frame { rotation: DQuat::IDENTITY, translation: DVec3::Y * height }
}

#[test]
fn a_soft_cube_falls_comes_to_rest_on_the_floor_and_sleeps() {
    let settings = ElasticSettings { handles: 8, ..ElasticSettings::default() };
    let mut material = elastic(1e5, 0.3, 500.0);
    material.damping_ratio = 0.2;
    let mut body = ElasticBody::new(model(&cuboid(DVec3::splat(0.2), 0.02), &[material], &settings), at(0.6));
    let mut slept = false;
    for _ in 0..300 {
        let report = body.step(DT, &Loads::default(), &mut floor(0.0, 0.5));
        assert!(!report.diverged);
        slept |= report.slept;
    }
    assert!(slept && body.asleep());
    let lowest = body.contact_positions().iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    assert!((-2e-3..5e-3).contains(&lowest), "{lowest}");
    assert!((body.center().y - 0.1).abs() < 0.01, "{}", body.center());
    // What rests stays, and what is pushed wakes.
    let before = body.contact_positions();
    body.step(DT, &Loads::default(), &mut floor(0.0, 0.5));
    assert_eq!(before, body.contact_positions());
    body.push(DVec3::ZERO, DVec3::Y * 8.0);
    assert!(!body.asleep());
    body.step(DT, &Loads::default(), &mut floor(0.0, 0.5));
    assert!(body.momentum().y > 4.0);
}

#[test]
fn a_sleeping_part_wakes_when_the_floor_goes() {
    let mut material = elastic(1e9, 0.3, 500.0);
    material.damping_ratio = 0.2;
    let mut body = ElasticBody::new(affine_cube(material), at(0.11));
    for _ in 0..120 {
        body.step(DT, &Loads::default(), &mut floor(0.0, 0.5));
    }
    assert!(body.asleep());
    let report = body.step(DT, &Loads::default(), &mut floor(-1.0, 0.5));
    assert!(report.woke && !body.asleep());
}

/// A block on a slope of `degrees` with friction `coefficient`: how far it slid in a second.
fn slid(degrees: f64, coefficient: f64) -> f64 {
    let turn = DQuat::from_rotation_z(degrees.to_radians());
    let normal = turn * DVec3::Y;
    let mut plane = PlaneWorld { normal, offset: 0.0, friction: [coefficient; 2], restitution: 0.0 };
    let mut body =
        ElasticBody::new(affine_cube(elastic(1e8, 0.3, 800.0)), Frame { rotation: turn, translation: normal * 0.1 });
    for _ in 0..30 {
        body.step(DT, &Loads::default(), &mut plane);
    }
    let begin = body.center();
    for _ in 0..60 {
        body.step(DT, &Loads::default(), &mut plane);
    }
    body.center().distance(begin)
}

#[test]
fn a_block_slides_down_a_slope_that_is_steeper_than_its_friction() {
    assert!(slid(20.0, 0.4) < 0.01, "{}", slid(20.0, 0.4));
    assert!(slid(25.0, 0.4) > 0.1, "{}", slid(25.0, 0.4));
    // a = g (sin - mu cos)
    let accelerated: f64 = 9.81 * (30.0_f64.to_radians().sin() - 0.3 * 30.0_f64.to_radians().cos());
    let expected = accelerated * (0.5 * 1.0 + 0.5);
    let found = slid(30.0, 0.3);
    assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
}

#[test]
fn a_stiff_part_bounces_as_high_as_its_restitution_says() {
    for restitution in [0.3, 0.6, 0.8] {
        let mut body = ElasticBody::new(affine_cube(elastic(1e9, 0.3, 800.0)), at(1.1));
        let mut plane = PlaneWorld { restitution, ..floor(0.0, 0.5) };
        let mut highest: f64 = 0.0;
        let mut met = false;
        for _ in 0..600 {
            let report = body.step(1.0 / 240.0, &Loads::default(), &mut plane);
            assert!(!report.diverged);
            if met && !report.contacts.is_empty() && highest > 0.02 {
                break;
            }
            met |= !report.contacts.is_empty();
            if met {
                highest = highest.max(body.center().y - 0.1);
            }
        }
        let expected = restitution * restitution;
        assert!((highest / expected - 1.0).abs() < 0.1, "{restitution}: {highest} {expected}");
    }
}

#[test]
fn contact_forces_carry_the_weight() {
    let mut body = ElasticBody::new(affine_cube(elastic(1e8, 0.3, 1000.0)), at(0.1));
    let mut carried = 0.0;
    for step in 0..25 {
        let report = body.step(DT, &Loads::default(), &mut floor(0.0, 0.5));
        if step >= 15 {
            carried += report.contacts.iter().map(|c| c.impulse.y).sum::<f64>() / (10.0 * DT);
        }
    }
    let weight = 9.81 * body.model().mass().mass;
    assert!((carried / weight - 1.0).abs() < 0.02, "{carried} {weight}");
}
