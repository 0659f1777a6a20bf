use super::super::pencil::{Pencil, element_mass};
use super::super::volume::mean_squares;
use super::*;

use std::f64::consts::PI;

const MODES: BasisKind = BasisKind::Eigenmodes { exponent: 0.5 };

fn modes(solid: &Solid, along: u32, materials: &[Material], handles: usize) -> (PartCage, BasisWeights) {
    let cage = PartCage::build(solid, along, PartCage::MOST_NODES).unwrap();
    let weights = skinning_weights(&MODES, &cage, materials, handles, 1, &NoProgress).unwrap();
    (cage, weights)
}

/// `integral w_i w_j / volume` over the active volume, from the formula.
fn gram(cage: &PartCage, weights: &BasisWeights, i: usize, j: usize) -> f64 {
    let mass = element_mass();
    let (mut sum, mut volume) = (0.0, 0.0);
    for cell in (0..cage.active.len()).filter(|&cell| cage.active[cell]) {
        let fill = f64::from(cage.fill[cell]).max(0.05);
        let corners = cage.cage.corners(cage.cell_at(cell));
        volume += fill;
        for a in 0..8 {
            for b in 0..8 {
                sum += fill * mass[a][b] * weights.at_node(corners[a])[i] * weights.at_node(corners[b])[j];
            }
        }
    }
    sum / volume
}

#[test]
fn the_modes_of_a_bar_are_cosines() {
    let (cage, weights) = modes(&beam(), 20, &[material(1e7, 0.3)], 6);
    // k^2 pi^2 / L^2; the trilinear cells are stiffer by (k pi h / L)^2 / 12.
    for k in 1..=4 {
        let exact = (f64::from(k) * PI).powi(2);
        let stiffer = 1.0 + exact * 0.05 * 0.05 / 12.0;
        let value = weights.report.eigenvalues[k as usize - 1];
        assert!((value / (exact * stiffer) - 1.0).abs() < 1e-3, "{k}: {value} {exact}");
        // What lies between the nodes is straight, so that its mean square is less than the cosine's.
        let scale = (6.0 / (2.0 + (f64::from(k) * PI * 0.05).cos())).sqrt();
        let mut sign = 0.0;
        for node in 0..cage.cage.node_count() {
            let cosine = scale * (f64::from(k) * PI * cage.node_position(node).x).cos();
            let weight = weights.at_node(node)[k as usize - 1];
            sign = if node == 0 { (cosine * weight).signum() } else { sign };
            assert!((weight - sign * cosine).abs() < 1e-4, "{k} {node}: {weight} {cosine}");
        }
    }
}

#[test]
fn weights_are_orthonormal_over_the_volume_and_the_last_is_one() {
    let ball = carved(UVec3::splat(24), 0.02, |at| (at.as_dvec3() - 11.5).length() < 12.0);
    let (cage, weights) = modes(&ball, 12, &[material(1e6, 0.4)], 16);
    let handles = weights.handles;
    assert!(handles >= 16);
    assert_eq!(weights.nodes.len(), cage.cage.node_count() * handles);
    for i in 0..handles {
        for j in 0..=i {
            let wanted = f64::from(u8::from(i == j));
            assert!((gram(&cage, &weights, i, j) - wanted).abs() < 1e-5, "{i} {j}");
        }
        assert!((mean_squares(&cage, handles, &weights.nodes)[i] - 1.0).abs() < 1e-5);
    }
    for node in 0..cage.cage.node_count() {
        assert_eq!(weights.at_node(node)[handles - 1], 1.0);
        assert!(weights.at_node(node).iter().all(|&weight| weight == f64::from(weight as f32)));
    }
    assert!(weights.report.eigenvalues.windows(2).all(|pair| pair[0] <= pair[1]));
    for j in 0..handles {
        let column = || (0..cage.cage.node_count()).map(|node| weights.at_node(node)[j]);
        let (low, high) = (column().fold(f64::MAX, f64::min), column().fold(f64::MIN, f64::max));
        assert!(high >= 0.99 * -low, "{j}: the largest is positive ({low}, {high})");
    }
}

#[test]
fn the_fast_modes_are_those_of_the_dense_problem() {
    // Two materials, cells in part full, a hole: nothing that symmetry could hide.
    let mut solid = carved(UVec3::new(14, 9, 7), 0.03, |at| !(at.x > 5 && at.y < 4 && at.z > 2));
    solid.regions.iter_mut().enumerate().for_each(|(k, region)| *region = u8::from(k % 14 > 8));
    let materials = [material(1e5, 0.3), material(1e7, 0.2)];
    let (cage, weights) = modes(&solid, 7, &materials, 10);
    let mut coefficients = vec![0.0; cage.active.len()];
    for (cell, coefficient) in coefficients.iter_mut().enumerate() {
        for part in cage.regions(cell) {
            let (lambda, mu) = materials[usize::from(part.region)].lame();
            *coefficient += f64::from(part.share) * (lambda + 4.0 * mu).sqrt();
        }
    }
    let active = coefficients.iter().filter(|&&c| c > 0.0).count() as f64;
    let mean = coefficients.iter().sum::<f64>() / active;
    coefficients.iter_mut().for_each(|c| *c /= mean);
    let pencil = Pencil::new(&cage, &coefficients);
    let n = pencil.len();
    // Dense M^-1/2 K M^-1/2 through unit vectors.
    let unit = faer::Mat::<f64>::identity(n, n);
    let (mut k, mut m) = (faer::Mat::<f64>::zeros(n, n), faer::Mat::<f64>::zeros(n, n));
    pencil.stiffness_times(unit.as_ref(), k.as_mut());
    pencil.mass_times(unit.as_ref(), m.as_mut());
    let eigen = m.self_adjoint_eigen(faer::Side::Lower).unwrap();
    let root =
        faer::Mat::from_fn(n, n, |row, column| eigen.U()[(row, column)] / eigen.S().column_vector()[column].sqrt());
    let scaled = root.transpose() * &k * &root;
    let values = scaled.self_adjoint_eigen(faer::Side::Lower).unwrap();
    let values = values.S().column_vector();
    assert!(values[0].abs() < 1e-10);
    for (j, value) in weights.report.eigenvalues.iter().enumerate() {
        let exact = values[j + 1] / cage.cell().powi(2);
        assert!((value / exact - 1.0).abs() < 1e-5, "{j}: {value} {exact}");
    }
}

#[test]
fn modes_of_one_value_stay_together() {
    // A square bar: its modes across come in pairs.
    let solid = Solid::cuboid(DVec3::ZERO, dvec3(0.2, 0.2, 1.0), 0.05);
    for handles in 2..24 {
        let (_, weights) = modes(&solid, 20, &[material(1e7, 0.3)], handles);
        let (_, more) = modes(&solid, 20, &[material(1e7, 0.3)], 40);
        let (last, next) = (weights.handles - 2, weights.handles - 1);
        let values = &more.report.eigenvalues;
        assert!(values[next] - values[last] > 1e-3 * values[next], "{handles}: {} {}", values[last], values[next]);
        assert!(weights.handles >= handles && weights.handles <= handles + 6);
        assert_eq!(weights.report.handles_wanted, handles);
    }
}

#[test]
fn stiff_regions_bend_less() {
    let mut solid = beam();
    let dims = solid.grid.dims;
    solid.regions.iter_mut().enumerate().for_each(|(k, region)| *region = u8::from(k as u32 % dims.x >= 10));
    let soft_and_stiff = [material(1e6, 0.3), material(1e8, 0.3)];
    let (cage, weights) = modes(&solid, 20, &soft_and_stiff, 8);
    let slope = |x: u32| {
        let at = |x: u32| weights.at_node(cage.cage.node_index(UVec3::new(x, 2, 2)))[0];
        (at(x + 1) - at(x)).abs()
    };
    // The flux c dw/dx is continuous, and c differs by the root of the ratio of the moduli; it falls over the length of a cell.
    let ratio = slope(9) / slope(10);
    assert!((ratio / 10.0 - 1.0).abs() < 0.15, "{ratio}");
}

#[test]
fn a_factor_common_to_all_moduli_changes_nothing() {
    let mut solid = beam();
    let dims = solid.grid.dims;
    solid.regions.iter_mut().enumerate().for_each(|(k, region)| *region = u8::from(k as u32 % dims.x >= 10));
    let one = modes(&solid, 20, &[material(1e6, 0.3), material(1e6, 0.3)], 8).1;
    let other = modes(&beam(), 20, &[material(3e8, 0.3)], 8).1;
    assert_eq!(one, other);
}

#[test]
fn separate_pieces_move_alone_until_they_are_too_many() {
    let solid = carved(UVec3::new(20, 6, 6), 0.1, |at| at.x % 10 < 4);
    let (cage, weights) = modes(&solid, 14, &[material(1e6, 0.3)], 12);
    assert_eq!((cage.pieces(), weights.report.pieces), (2, 2));
    assert_eq!(weights.report.eigenvalues[0], 0.0);
    assert!(weights.report.eigenvalues[1] > 0.0);
    let weight = |x: u32| weights.at_node(cage.cage.node_index(UVec3::new(x, 4, 4)))[0];
    assert!(weight(2).abs() < 1e-9 && weight(3).abs() < 1e-9);
    assert!(weight(12) > 0.5 && (weight(12) - weight(13)).abs() < 1e-6);
    let refused =
        |handles| skinning_weights(&MODES, &cage, &[material(1e6, 0.3)], handles, 1, &NoProgress).unwrap_err();
    assert_eq!(refused(3), BasisError::Disconnected { pieces: 2, handles: 3 });
    assert!(skinning_weights(&MODES, &cage, &[material(1e6, 0.3)], 4, 1, &NoProgress).is_ok());
}

#[test]
fn equal_pieces_have_all_their_modes() {
    // Five equal cubes: each mode of one is there five times.
    let solid = carved(UVec3::new(30, 3, 3), 0.1, |at| at.x % 6 < 3);
    let (_, weights) = modes(&solid, 27, &[material(1e6, 0.3)], 20);
    let values = &weights.report.eigenvalues;
    assert_eq!(values[..4], [0.0; 4]);
    let same = values[4..].iter().filter(|&&value| (value / values[4] - 1.0).abs() < 1e-3).count();
    assert!(same >= 15, "{values:?}");
}

#[test]
fn the_bits_are_the_same_on_each_run_and_any_threads() {
    let ball = carved(UVec3::splat(20), 0.02, |at| (at.as_dvec3() - 9.5).length() < 10.0);
    let cage = PartCage::build(&ball, 12, PartCage::MOST_NODES).unwrap();
    let run = || skinning_weights(&MODES, &cage, &[material(1e6, 0.3)], 16, 9, &NoProgress).unwrap();
    let first = run();
    assert_eq!(first, run());
    for threads in [1, 3] {
        assert_eq!(first, on_threads(threads, run));
    }
}

#[test]
fn small_cages_give_as_many_handles_as_they_have() {
    let cube = Solid::cuboid(DVec3::ZERO, DVec3::ONE, 0.25);
    let (cage, weights) = modes(&cube, 1, &[material(1e6, 0.3)], 32);
    assert_eq!(cage.cage.node_count(), 8);
    assert_eq!(weights.handles, 8);
    let (cage, weights) = modes(&cube, 2, &[material(1e6, 0.3)], 64);
    assert_eq!((cage.cage.node_count(), weights.handles), (27, 27));
    assert!(weights.nodes.iter().all(|weight| weight.is_finite()));
}

#[test]
fn one_handle_is_one_everywhere() {
    let cage = PartCage::build(&beam(), 20, 8000).unwrap();
    for (kind, handles) in
        [(BasisKind::Affine, 32), (MODES, 1), (BasisKind::Simplicits(SimplicitsSettings::default()), 1)]
    {
        let weights = skinning_weights(&kind, &cage, &[material(1e6, 0.3)], handles, 1, &NoProgress).unwrap();
        assert_eq!((weights.handles, weights.nodes.len()), (1, 525));
        assert!(weights.nodes.iter().all(|&weight| weight == 1.0));
    }
}

#[test]
fn nodes_of_no_active_cell_get_bounded_values() {
    let bent = carved(UVec3::splat(20), 0.05, |at| at.x < 4 || at.y < 4);
    let (cage, weights) = modes(&bent, 20, &[material(1e6, 0.3)], 12);
    let active = cage.active_nodes();
    assert!(active.iter().any(|&active| !active));
    for j in 0..weights.handles {
        let inside = (0..active.len()).filter(|&node| active[node]).map(|node| weights.at_node(node)[j]);
        let (low, high) = inside.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)));
        for node in 0..active.len() {
            assert!((low - 1e-9..=high + 1e-9).contains(&weights.at_node(node)[j]));
        }
    }
}

#[test]
fn work_that_nobody_wants_stops() {
    let cage = PartCage::build(&beam(), 20, 8000).unwrap();
    let materials = [material(1e6, 0.3)];
    let watch = Watch::default();
    skinning_weights(&MODES, &cage, &materials, 16, 1, &watch).unwrap();
    let reports = watch.reports.load(Ordering::Relaxed);
    assert!(reports >= 3);
    for count in 0..reports {
        let watch = Watch { stop_after: Some(count), ..Watch::default() };
        let answer = skinning_weights(&MODES, &cage, &materials, 16, 1, &watch);
        assert!(count + 1 >= reports || answer == Err(BasisError::Cancelled), "{count}");
    }
}

#[test]
fn what_cannot_be_is_told() {
    let cage = PartCage::build(&beam(), 20, 8000).unwrap();
    let ask = |kind, materials: &[Material], handles| {
        skinning_weights(&kind, &cage, materials, handles, 1, &NoProgress).unwrap_err()
    };
    let good = [material(1e6, 0.3)];
    assert_eq!(ask(MODES, &good, 0), BasisError::HandlesOutOfRange { have: 0, most: 64 });
    assert_eq!(ask(MODES, &good, 65), BasisError::HandlesOutOfRange { have: 65, most: 64 });
    assert_eq!(ask(MODES, &[], 8), BasisError::MaterialMissing { region: 0, materials: 0 });
    for (modulus, ratio) in [(0.0, 0.3), (f32::NAN, 0.3), (1e6, 0.5), (-1.0, 0.3)] {
        let answer = ask(MODES, &[material(modulus, ratio)], 8);
        assert!(matches!(answer, BasisError::Stiffness { region: 0, .. }), "{answer}");
    }
    for exponent in [-0.1, 1.1, f64::NAN] {
        let answer = ask(BasisKind::Eigenmodes { exponent }, &good, 8);
        assert!(matches!(answer, BasisError::Setting { name: "exponent", .. }));
    }
}
