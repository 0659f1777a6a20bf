use glam::{DMat3, DVec3, UVec3, dvec3};

use super::super::random;
use super::super::tests::{Watch, beam, material, on_threads};
use super::super::{BasisKind, NoProgress, skinning_weights};
use super::network::PARTS;
use super::*;
use crate::Solid;

/// A network small enough for slow twins.
const SMALL: SimplicitsSettings = SimplicitsSettings {
    steps: 12,
    layers: 2,
    points: 96,
    motions: 3,
    learning_rate: 1e-3,
    elastic_weight: 0.1,
    orthogonality_weight: 1e6,
};

fn cage() -> PartCage {
    PartCage::build(&beam(), 20, PartCage::MOST_NODES).unwrap()
}

/// ELU, its slope and its curve.
fn elu(z: f64) -> (f64, f64) {
    if z > 0.0 { (z, 1.0) } else { (z.exp() - 1.0, z.exp()) }
}

/// The network by its formula: weights and their gradients at a point.
fn slow_network(network: Network, parameters: &[f64], point: [f32; 3]) -> (Vec<f64>, Vec<DVec3>) {
    let mut values: Vec<f64> = point.iter().map(|&x| f64::from(x)).collect();
    let mut slopes = vec![DVec3::X, DVec3::Y, DVec3::Z];
    let mut at = 0;
    for k in 0..network.layers + 2 {
        let last = k == network.layers + 1;
        let outputs = if last { network.outputs } else { 64 };
        let number = |row: usize, column: usize| parameters[at + row + outputs * column];
        let (mut next, mut next_slopes) = (Vec::new(), Vec::new());
        for row in 0..outputs {
            let z = number(row, values.len()) + (0..values.len()).map(|c| number(row, c) * values[c]).sum::<f64>();
            let dz = (0..values.len()).map(|c| slopes[c] * number(row, c)).sum::<DVec3>();
            let (value, slope) = if last { (z, 1.0) } else { elu(z) };
            next.push(value);
            next_slopes.push(dz * slope);
        }
        at += outputs * (values.len() + 1);
        (values, slopes) = (next, next_slopes);
    }
    (values, slopes)
}

/// The energy of one motion at one point by its formula.
fn slow_energy(motions: &Motions, motion: usize, point: &Point, weights: &[f64], slopes: &[DVec3], ramp: f64) -> f64 {
    let place = DVec3::from_array(point.at.map(f64::from)).extend(1.0);
    let mut f = DMat3::IDENTITY;
    for (j, (&w, &dw)) in weights.iter().zip(slopes).enumerate() {
        for a in 0..3 {
            let moved: f64 = (0..4).map(|c| motions.at(motion, j, a, c) * place[c]).sum();
            for b in 0..3 {
                f.col_mut(b)[a] += w * motions.at(motion, j, a, b) + moved * dw[b];
            }
        }
    }
    let (lambda, mu) = (f64::from(point.lambda), f64::from(point.mu));
    let strain = (f + f.transpose()) * 0.5 - DMat3::IDENTITY;
    let squared = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>();
    let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
    let linear = mu * squared(&strain) + 0.5 * lambda * trace * trace;
    let j = f.determinant() - 1.0;
    let stable = 0.5 * mu * (squared(&f) - 3.0) + 0.5 * (lambda + mu) * j * j - mu * j;
    (1.0 - ramp) * linear + ramp * stable
}

/// The whole loss by its formula.
fn slow_loss(
    training: &SimplicitsTraining,
    parameters: &[f64],
    points: &[Point],
    motions: &Motions,
    ramp: f64,
) -> (f64, f64) {
    let (settings, count) = (training.state.settings, training.network.outputs);
    let mut gram = vec![0.0; count * count];
    let mut energy = 0.0;
    for point in points {
        let (weights, slopes) = slow_network(training.network, parameters, point.at);
        for i in 0..count {
            (0..count).for_each(|j| gram[i * count + j] += weights[i] * weights[j]);
        }
        energy += (0..motions.count).map(|m| slow_energy(motions, m, point, &weights, &slopes, ramp)).sum::<f64>();
    }
    let scale = f64::from(settings.elastic_weight) * training.points.volume / points.len() as f64;
    let off = |k: usize| gram[k] - if k / count == k % count { 1.0 } else { 0.0 };
    let mean = (0..count * count).map(|k| off(k) * off(k)).sum::<f64>() / (count * count) as f64;
    (scale * energy, f64::from(settings.orthogonality_weight) * mean)
}

#[test]
fn the_loss_and_its_gradient_are_those_of_the_formula() {
    let cage = cage();
    // Either loss alone, and both with the ramp half way: a gradient that is wrong in one cannot hide behind the other.
    for (elastic_weight, orthogonality_weight, ramp) in
        [(0.1, 1e-9, 0.0), (0.1, 1e-9, 1.0), (1e-9, 1e6, 0.5), (10.0, 10.0, 0.5)]
    {
        let settings = SimplicitsSettings { elastic_weight, orthogonality_weight, ..SMALL };
        let mut training = SimplicitsTraining::new(&cage, &[material(1e7, 0.3)], 5, settings, 3).unwrap();
        let points = training.points.draw(96, 3, 77);
        let motions = Motions::random(3, 4, 3, 78);
        let parameters: Vec<f64> =
            training.state.numbers[..training.network.len()].iter().map(|&x| f64::from(x)).collect();
        let loss = training.evaluate(&points, &motions, ramp as f32);
        let slow = |parameters: &[f64]| {
            let (elastic, orthogonality) = slow_loss(&training, parameters, &points, &motions, ramp);
            elastic + orthogonality
        };
        let exact = slow(&parameters);
        assert!(((loss.elastic + loss.orthogonality) / exact - 1.0).abs() < 1e-4, "{loss:?} {exact}");
        let gradient = training.gradient();
        let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        // Along a direction through all parameters, and along single ones of every layer.
        let all: Vec<f64> = (0..parameters.len()).map(|k| random::unit(5, 0, k as u64) - 0.5).collect();
        let along = |direction: &dyn Fn(usize) -> f64| {
            let moved =
                |by: f64| slow(&(0..parameters.len()).map(|k| parameters[k] + by * direction(k)).collect::<Vec<_>>());
            (moved(1e-5) - moved(-1e-5)) / 2e-5
        };
        let exact = along(&|k| all[k]);
        let ours: f64 = gradient.iter().zip(&all).map(|(g, d)| f64::from(*g) * d).sum();
        assert!((ours - exact).abs() < 1e-3 * norm, "{ours} {exact} {norm}");
        for k in (0..parameters.len()).step_by(397) {
            let exact = along(&|other| f64::from(u8::from(other == k)));
            assert!((f64::from(gradient[k]) - exact).abs() < 1e-3 * norm, "{k}: {} {exact} {norm}", gradient[k]);
        }
    }
}

#[test]
fn the_sampled_linear_loss_is_its_closed_form() {
    // E = sigma^2 (2 mu + lambda/2) sum_j integral [3 w^2 + 2 w X.grad w + (1 + |X|^2) |grad w|^2] dV.
    let cage = PartCage::build(&Solid::cuboid(DVec3::ZERO, dvec3(1.0, 0.5, 0.25), 0.0625), 16, 8000).unwrap();
    let points = Points::new(&cage, &[material(1e6, 0.3)]).unwrap();
    let weights = |x: DVec3| {
        [(x.x, DVec3::X), ((2.0 * x.y).sin(), DVec3::Y * 2.0 * (2.0 * x.y).cos()), (x.z * x.x, dvec3(x.z, 0.0, x.x))]
    };
    // The integral on a fine grid of midpoints.
    let mut integral = 0.0;
    let steps = UVec3::new(64, 32, 16);
    let cell = 1.0 / 64.0;
    for k in 0..steps.element_product() {
        let at = UVec3::new(k % steps.x, k / steps.x % steps.y, k / (steps.x * steps.y));
        let x = (at.as_dvec3() + 0.5) * cell;
        for (w, dw) in weights(x) {
            integral += 3.0 * w * w + 2.0 * w * x.dot(dw) + (1.0 + x.length_squared()) * dw.length_squared();
        }
    }
    integral *= cell * cell * cell;
    let count = 512;
    let samples = points.draw(count, 1, 1);
    let (lambda, mu) = (f64::from(samples[0].lambda), f64::from(samples[0].mu));
    let exact = 0.01 * (2.0 * mu + 0.5 * lambda) * integral;

    let outputs: Vec<f32> = (0..PARTS)
        .flat_map(|part| {
            samples.iter().flat_map(move |point| {
                let at = DVec3::from_array(point.at.map(f64::from));
                weights(at).map(|(w, dw)| if part == 0 { w as f32 } else { dw[part - 1] as f32 })
            })
        })
        .collect();
    // The motions differ much more than the points do: 8192 of them scatter the mean by half a percent.
    let mut elastic = Elastic::new(3, 256, count);
    let mut gradient = vec![0.0; outputs.len()];
    let scale = points.volume / (count * 256 * 32) as f64;
    let sampled: f64 = (0..32)
        .map(|stream| {
            let motions = Motions::random(256, 3, 2, stream);
            elastic.evaluate(&motions, &samples, &outputs, (scale as f32, 0.0), &mut gradient)
        })
        .sum();
    assert!((sampled / exact - 1.0).abs() < 0.02, "{sampled} {exact}");
}

#[test]
fn motions_have_their_deviation_and_points_their_volume() {
    let motions = Motions::random(100, 15, 7, 1);
    let numbers: Vec<f64> =
        (0..100).flat_map(|m| (0..15).map(move |j| (m, j))).map(|(m, j)| motions.at(m, j, 1, 2)).collect();
    let mean = numbers.iter().sum::<f64>() / 1500.0;
    let square = numbers.iter().map(|z| z * z).sum::<f64>() / 1500.0;
    assert!(mean.abs() < 0.01 && (square.sqrt() / 0.1 - 1.0).abs() < 0.05, "{mean} {square}");
    let points = Points::new(&cage(), &[material(3e4, 0.0)]).unwrap();
    assert!((points.volume - 0.04).abs() < 1e-6);
    let drawn = points.draw(1000, 7, 2);
    // 0.2 of the points in 0.2 of the length, and moduli relative to a mean of 1e5.
    let part = drawn.iter().filter(|point| point.at[0] < 0.2).count();
    assert!((190..=210).contains(&part), "{part}");
    assert!(drawn.iter().all(|point| point.at[1] <= 0.2 && (point.mu - 5e4).abs() < 1.0 && point.lambda == 0.0));
}

#[test]
fn training_lowers_the_loss() {
    let cage = cage();
    let settings = SimplicitsSettings { steps: 60, points: 256, layers: 3, ..SMALL };
    let mut training = SimplicitsTraining::new(&cage, &[material(1e7, 0.3)], 6, settings, 1).unwrap();
    training.step().unwrap();
    let first = training.state().loss;
    training.run(&NoProgress).unwrap();
    assert!(training.done());
    assert!(training.state().loss < 0.1 * first, "{first} {}", training.state().loss);
}

#[test]
fn weights_have_unit_squares_and_end_with_one() {
    let cage = cage();
    let kind = BasisKind::Simplicits(SMALL);
    let weights = skinning_weights(&kind, &cage, &[material(1e6, 0.3)], 5, 1, &NoProgress).unwrap();
    assert_eq!((weights.handles, weights.nodes.len()), (5, 5 * 525));
    assert_eq!(weights.report.steps, 12);
    for square in mean_squares(&cage, 5, &weights.nodes) {
        assert!((square - 1.0).abs() < 1e-5);
    }
    for node in 0..525 {
        assert_eq!(weights.at_node(node)[4], 1.0);
        assert!(weights.at_node(node).iter().all(|&w| w.is_finite() && w == f64::from(w as f32)));
    }
}

#[test]
fn stopping_and_going_on_gives_the_bits_of_one_run() {
    let (cage, materials) = (cage(), [material(1e6, 0.3)]);
    let mut whole = SimplicitsTraining::new(&cage, &materials, 5, SMALL, 4).unwrap();
    whole.run(&NoProgress).unwrap();
    for stop in [0, 1, 7, 12] {
        let mut first = SimplicitsTraining::new(&cage, &materials, 5, SMALL, 4).unwrap();
        let watch = Watch { stop_after: Some(stop), ..Watch::default() };
        let answer = first.run(&watch);
        assert_eq!(answer, if stop < 12 { Err(BasisError::Cancelled) } else { Ok(()) });
        assert_eq!(first.state().step, stop);
        let state = first.state().clone();
        let mut second = SimplicitsTraining::resume(&cage, &materials, state).unwrap();
        second.run(&NoProgress).unwrap();
        assert_eq!(second.state(), whole.state());
        assert_eq!(second.weights(), whole.weights());
    }
}

#[test]
fn the_bits_are_the_same_on_any_threads_and_differ_by_seed() {
    let (cage, materials) = (cage(), [material(1e6, 0.3)]);
    let run = |seed: u64| {
        let mut training = SimplicitsTraining::new(&cage, &materials, 5, SMALL, seed).unwrap();
        training.run(&NoProgress).unwrap();
        training.weights()
    };
    let (one, three) = (on_threads(1, || run(1)), on_threads(3, || run(1)));
    assert_eq!(one, three);
    assert_ne!(one.nodes, run(2).nodes);
}

#[test]
fn a_state_of_something_else_is_refused() {
    let (cage, materials) = (cage(), [material(1e6, 0.3)]);
    let state = SimplicitsTraining::new(&cage, &materials, 5, SMALL, 4).unwrap().state().clone();
    let resume = |materials: &[Material], change: &dyn Fn(&mut SimplicitsState)| {
        let mut state = state.clone();
        change(&mut state);
        SimplicitsTraining::resume(&cage, materials, state).err()
    };
    assert_eq!(resume(&materials, &|_| ()), None);
    let other = Some(BasisError::OtherTraining);
    assert_eq!(resume(&[material(2e6, 0.3)], &|_| ()), other);
    assert_eq!(resume(&materials, &|state| state.step = 13), other);
    assert_eq!(resume(&materials, &|state| state.handles = 6), other);
    assert_eq!(resume(&materials, &|state| state.numbers.truncate(10)), other);
    assert_eq!(resume(&materials, &|state| state.numbers[5] = f32::NAN), other);
    assert_eq!(resume(&materials, &|state| state.key ^= 1), other);
    assert!(matches!(
        resume(&materials, &|state| state.settings.layers = 0),
        Some(BasisError::Setting { name: "layers", .. })
    ));
}

#[test]
fn settings_out_of_range_are_told() {
    let (cage, materials) = (cage(), [material(1e6, 0.3)]);
    let ask = |settings: SimplicitsSettings| match SimplicitsTraining::new(&cage, &materials, 5, settings, 0).err() {
        Some(BasisError::Setting { name, .. }) => name,
        _ => "",
    };
    assert_eq!(ask(SMALL), "");
    assert_eq!(ask(SimplicitsSettings { steps: 0, ..SMALL }), "steps");
    assert_eq!(ask(SimplicitsSettings { layers: 17, ..SMALL }), "layers");
    assert_eq!(ask(SimplicitsSettings { points: 15, ..SMALL }), "points");
    assert_eq!(ask(SimplicitsSettings { points: u32::MAX, ..SMALL }), "points");
    assert_eq!(ask(SimplicitsSettings { motions: 0, ..SMALL }), "motions");
    assert_eq!(ask(SimplicitsSettings { learning_rate: f32::NAN, ..SMALL }), "learning_rate");
    assert_eq!(ask(SimplicitsSettings { elastic_weight: -1.0, ..SMALL }), "elastic_weight");
    assert_eq!(ask(SimplicitsSettings { orthogonality_weight: f32::INFINITY, ..SMALL }), "orthogonality_weight");
    assert!(SimplicitsTraining::new(&cage, &materials, 1, SMALL, 0).is_err());
    assert!(SimplicitsTraining::new(&cage, &[], 5, SMALL, 0).is_err());
}
