use glam::{DMat3, DVec3};

use super::{cuboid, elastic, model};
use crate::elastic::{ElasticBody, ElasticSettings, Frame, Loads};
use crate::world::{Contact, ContactWorld, RigidState};

/// A rigid cube that starts at rest, seen by what comes from the left.
struct Cube {
    state: RigidState,
    face: f64,
}

impl ContactWorld for Cube {
    fn contacts(&mut self, points: &[DVec3], reach: f64, out: &mut Vec<Contact>) {
        let face = self.state.center.x - self.face;
        out.extend(points.iter().enumerate().filter_map(|(k, p)| {
            let gap = face - p.x;
            (gap < reach).then_some(Contact {
                point: k as u32,
                normal: -DVec3::X,
                gap,
                velocity: DVec3::ZERO,
                body: Some(7),
                friction: [0.3; 2],
                restitution: 0.0,
            })
        }));
    }

    fn body(&self, body: u32) -> Option<RigidState> {
        (body == 7).then_some(self.state)
    }

    fn push(&mut self, body: u32, linear: DVec3, angular: DVec3) {
        assert_eq!(body, 7);
        self.state.linear_velocity += linear;
        self.state.angular_velocity += angular;
    }
}

/// An elastic cube of 1 kg at 1 m/s hits a rigid one of `ratio` kg in free space: speeds of both afterwards.
fn struck(ratio: f64, substeps: u8) -> (f64, f64) {
    let settings = ElasticSettings { handles: 8, substeps, ..ElasticSettings::default() };
    let solid = cuboid(DVec3::splat(0.1), 0.01);
    let model = model(&solid, &[elastic(1e5, 0.3, 1000.0)], &settings);
    let mass = model.mass().mass;
    let mut body = ElasticBody::new(model, Frame::IDENTITY);
    body.kick(DVec3::X, DVec3::ZERO);
    let mut cube = Cube {
        state: RigidState {
            mass: ratio * mass,
            inertia: DMat3::IDENTITY * (ratio * mass * 0.01 / 6.0),
            center: DVec3::X * 0.15,
            linear_velocity: DVec3::ZERO,
            angular_velocity: DVec3::ZERO,
        },
        face: 0.05,
    };
    let dt = 1.0 / 60.0;
    let begin = body.momentum().x;
    for _ in 0..90 {
        let report = body.step(dt, &Loads { gravity: DVec3::ZERO, springs: &[] }, &mut cube);
        assert!(!report.diverged);
        cube.state.center += cube.state.linear_velocity * dt;
    }
    let end = body.momentum().x + cube.state.mass * cube.state.linear_velocity.x;
    assert!((end / begin - 1.0).abs() < 0.01, "ratio {ratio}: momentum {begin} -> {end}");
    (body.momentum().x / mass, cube.state.linear_velocity.x)
}

#[test]
fn what_is_struck_leaves_between_the_inelastic_and_the_elastic_speed() {
    for ratio in [10.0, 1.0, 0.1, 0.03] {
        for substeps in [1, 4] {
            let (own, struck) = struck(ratio, substeps);
            let inelastic = 1.0 / (1.0 + ratio);
            assert!((0.98 * inelastic..=2.02 * inelastic).contains(&struck), "ratio {ratio} x{substeps}: {struck}");
            assert!(own <= struck + 0.02, "ratio {ratio}: {own} passes {struck}");
        }
    }
}
