//! The cantilever beam against a fine finite element model (H8 with incompatible modes, 40 x 8 x 8 elements, linear), whose tip
//! sinks by these lengths in metres under its own weight.

use glam::DVec3;

use super::{beam, clamp, elastic, model};
use crate::elastic::{ElasticBody, ElasticSettings, Frame, Loads};
use crate::{BasisKind, SimplicitsSettings};

const TIP: DVec3 = DVec3::new(1.0, 0.0, 0.0);
/// Young's moduli near and far from the clamp, and how far the tip sinks.
const CASES: [([f32; 2], f64); 3] = [([1e7, 1e7], 0.037546), ([1e8, 1e7], 0.006101), ([1e7, 1e9], 0.034794)];

/// How far the tip sinks, as a part of what the finite elements say.
fn tip_ratio(settings: &ElasticSettings, case: usize) -> f64 {
    let (youngs, reference) = CASES[case];
    let materials = youngs.map(|e| elastic(e, 0.3, 1000.0));
    let mut body = ElasticBody::new(model(&beam(), &materials, settings), Frame::IDENTITY);
    assert!(body.settle(&Loads { gravity: DVec3::new(0.0, 0.0, -9.81), springs: &clamp(1e9) }), "case {case}");
    -body.point_position(TIP).z / reference
}

#[test]
fn eigenmodes_bend_as_finite_elements_do() {
    let settings = ElasticSettings::default();
    let [a, b, c] = [0, 1, 2].map(|case| tip_ratio(&settings, case));
    assert!((0.94..=1.06).contains(&a), "A {a}");
    assert!((0.88..=1.06).contains(&b), "B {b}");
    assert!((0.94..=1.06).contains(&c), "C {c}");
}

#[test]
fn a_network_of_three_hundred_steps_bends_nearly_as_finite_elements_do() {
    let basis = BasisKind::Simplicits(SimplicitsSettings::default());
    let settings =
        ElasticSettings { basis, handles: 16, cubature: 1152, most_poisson_ratio: 0.45, ..ElasticSettings::default() };
    let [a, b, c] = [0, 1, 2].map(|case| tip_ratio(&settings, case));
    assert!((0.92..=1.06).contains(&a), "A {a}");
    assert!(b >= 0.75, "B {b}");
    assert!(c >= 0.6, "C {c}");
}

#[test]
fn the_beam_swings_at_its_frequency() {
    let materials = [elastic(1e7, 0.3, 1000.0); 2];
    let mut body = ElasticBody::new(model(&beam(), &materials, &ElasticSettings::default()), Frame::IDENTITY);
    let springs = clamp(1e9);
    assert!(body.settle(&Loads { gravity: DVec3::new(0.0, 0.0, -1.0), springs: &springs }));
    let free = Loads { gravity: DVec3::ZERO, springs: &springs };
    let dt = 1.0 / 240.0;
    let heights: Vec<f64> = (0..480)
        .map(|_| {
            assert!(!body.step(dt, &free, &mut crate::world::EmptyWorld).diverged);
            body.point_position(TIP).z
        })
        .collect();
    // Times at which the tip comes up through the middle, a straight line between steps.
    let ups: Vec<f64> = heights
        .windows(2)
        .enumerate()
        .filter(|(_, w)| w[0] < 0.0 && w[1] >= 0.0)
        .map(|(k, w)| (k as f64 - w[0] / (w[1] - w[0])) * dt)
        .collect();
    assert!(ups.len() >= 5, "{ups:?}");
    let frequency = (ups.len() - 1) as f64 / (ups[ups.len() - 1] - ups[0]);
    assert!((frequency / 3.2308 - 1.0).abs() < 0.05, "{frequency} Hz");
}

/// Regression numbers of a prototype, not truth: how far the tip of a soft beam moves, in metres.
#[test]
fn soft_beams_hang_down() {
    for (youngs, expected) in [(1e6, DVec3::new(-0.064, 0.0, -0.336)), (3e5, DVec3::new(-0.343, 0.0, -0.727))] {
        let materials = [elastic(youngs, 0.3, 1000.0); 2];
        let mut body = ElasticBody::new(model(&beam(), &materials, &ElasticSettings::default()), Frame::IDENTITY);
        assert!(body.settle(&Loads { gravity: DVec3::new(0.0, 0.0, -9.81), springs: &clamp(1e9) }));
        let moved = body.point_position(TIP) - TIP;
        assert!(moved.distance(expected) < 0.05 * expected.length(), "{youngs}: {moved}");
    }
}
