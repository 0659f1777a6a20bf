use glam::DVec3;

use super::{affine_cube, cuboid, elastic};
use crate::elastic::{ElasticBody, ElasticError, ElasticModel, ElasticSettings, Frame, Loads, Spring};
use crate::world::{Contact, ContactWorld, EmptyWorld};
use crate::{NoProgress, Solid};

const DT: f64 = 1.0 / 60.0;

fn finite(body: &ElasticBody) -> bool {
    body.contact_positions().iter().all(|p| p.is_finite()) && body.frame().translation.is_finite()
}

#[test]
fn a_load_that_is_no_number_freezes_the_part_where_it_is() {
    for (gravity, target) in [(DVec3::NAN, DVec3::ZERO), (DVec3::ZERO, DVec3::new(f64::INFINITY, 0.0, 0.0))] {
        let mut body = ElasticBody::new(affine_cube(elastic(1e6, 0.3, 1000.0)), Frame::IDENTITY);
        let before = body.contact_positions();
        let springs = [Spring { point: DVec3::ZERO, target, stiffness: 10.0 }];
        let report = body.step(DT, &Loads { gravity, springs: &springs }, &mut EmptyWorld);
        assert!(report.diverged && body.frozen());
        assert_eq!(before, body.contact_positions());
        // It stays until it is placed anew.
        assert!(!body.step(DT, &Loads::default(), &mut EmptyWorld).diverged);
        assert_eq!(before, body.contact_positions());
        body.place(Frame::IDENTITY);
        body.step(DT, &Loads::default(), &mut EmptyWorld);
        assert_ne!(before, body.contact_positions());
    }
}

#[test]
fn a_part_that_is_torn_apart_is_put_back() {
    let mut body = ElasticBody::new(affine_cube(elastic(1e4, 0.3, 1000.0)), Frame::IDENTITY);
    let before = body.contact_positions();
    let far = |x: f64| Spring { point: DVec3::new(x.signum() * 0.1, 0.0, 0.0), target: DVec3::X * x, stiffness: 1e9 };
    let report = body.step(DT, &Loads { gravity: DVec3::ZERO, springs: &[far(1e3), far(-1e3)] }, &mut EmptyWorld);
    assert!(report.diverged && body.frozen() && finite(&body));
    assert_eq!(before, body.contact_positions());
}

/// Says nothing that can be true.
struct Nonsense;

impl ContactWorld for Nonsense {
    fn contacts(&mut self, points: &[DVec3], _reach: f64, out: &mut Vec<Contact>) {
        let contact = |k: usize, normal, gap| Contact {
            point: k as u32,
            normal,
            gap,
            velocity: DVec3::ZERO,
            body: Some(3),
            friction: [0.5; 2],
            restitution: 0.0,
        };
        out.extend((0..points.len()).map(|k| contact(k, DVec3::NAN, -1.0)));
        out.push(contact(1_000_000, DVec3::Y, -1.0));
        out.push(contact(0, DVec3::Y, f64::NAN));
    }
}

#[test]
fn contacts_that_cannot_be_are_left_out() {
    let mut body = ElasticBody::new(affine_cube(elastic(1e6, 0.3, 1000.0)), Frame::IDENTITY);
    for _ in 0..10 {
        let report = body.step(DT, &Loads::default(), &mut Nonsense);
        assert!(!report.diverged && report.contacts.is_empty());
    }
    assert!(finite(&body) && body.center().y < -0.05);
}

#[test]
fn huge_and_tiny_parts_move() {
    for scale in [1e-3, 1e4] {
        let solid = cuboid(DVec3::splat(0.2 * scale), 0.02 * scale);
        let settings = ElasticSettings { handles: 6, ..ElasticSettings::default() };
        let model = super::model(&solid, &[elastic(1e5 * scale as f32, 0.3, 500.0)], &settings);
        let mut body = ElasticBody::new(model, Frame::IDENTITY);
        let mut floor = super::contact::floor(-0.15 * scale, 0.5);
        for _ in 0..120 {
            let report = body.step(DT, &Loads::default(), &mut floor);
            assert!(!report.diverged, "{scale}");
            assert!(finite(&body));
        }
    }
}

#[test]
fn what_cannot_be_set_up_says_why() {
    let solid = cuboid(DVec3::splat(0.2), 0.02);
    let material = elastic(1e5, 0.3, 500.0);
    let build = |solid: &Solid, material, settings: ElasticSettings| {
        ElasticModel::build(solid, &[material], &settings, &NoProgress).err()
    };
    let error = build(&solid, material, ElasticSettings { handles: 65, ..ElasticSettings::default() });
    assert_eq!(error, Some(ElasticError::TooManyHandles { handles: 65, most: 64 }));
    let error = build(&solid, material, ElasticSettings { substeps: 0, ..ElasticSettings::default() });
    assert!(matches!(error, Some(ElasticError::Setting { field: "substeps", .. })));
    let error = build(&solid, elastic(f32::NAN, 0.3, 500.0), ElasticSettings::default());
    assert!(matches!(error, Some(ElasticError::Material(_))), "{error:?}");
    let error = build(&solid, elastic(1e5, 0.3, 0.0), ElasticSettings::default());
    assert!(matches!(error, Some(ElasticError::Material(_))), "{error:?}");
    let mut two = solid.clone();
    two.regions.fill(1);
    assert_eq!(
        build(&two, material, ElasticSettings::default()),
        Some(ElasticError::NoMaterial { region: 1, materials: 1 })
    );
}
