//! The fast path against the slow reference, for every output and every instruction set.

mod common;

use std::sync::Arc;

use common::slow::{self, SlowFrame};
use splat_core::{Mask2d, Selection, View};
use splat_raster::cpu::{CpuRasterizer, InstructionSet};
use splat_raster::{Features, Frame, Instance, Outputs, Rasterizer, Scene, VOTE_UNIT};

const TAU: f32 = 0.3;
const CHANNELS: usize = 4;

fn features_of(count: usize) -> Vec<f32> {
    let mut r = common::Random(7);
    (0..count * CHANNELS).map(|_| r.range(-1.0, 1.0)).collect()
}

/// Draws everything with one instruction set; the mask has the pixels that are not in doubt.
fn draw(
    scene: &Scene,
    view: &View,
    set: InstructionSet,
    features: &[f32],
    slow: &SlowFrame,
    limit: Option<&[f32]>,
) -> Frame {
    let mask = Mask2d::from_fn(view.width, view.height, |x, y| !slow.doubt[(y * view.width + x) as usize]);
    let outputs = Outputs {
        color: true,
        median_depth: true,
        expected_depth: true,
        features: Some(Features { channels: CHANNELS, values: features }),
        visibility: Some(1.0 / 255.0),
        first_hits: Some(TAU),
        strongest: true,
        votes: Some(&[&mask]),
        limit,
    };
    let mut frame = Frame::default();
    CpuRasterizer::with(set).draw(scene, view, &outputs, &mut frame).expect("a frame");
    frame
}

/// Compares every output; what hangs on rounding is left out and must be little.
fn agree(what: &str, scene: &Scene, view: &View) {
    agree_limited(what, scene, view, None);
}

fn agree_limited(what: &str, scene: &Scene, view: &View, limit: Option<&[f32]>) {
    let features = features_of(scene.len());
    let slow = slow::draw_limited(scene, view, CHANNELS, &features, TAU.into(), limit.unwrap_or_default());
    let pixels = slow.doubt.len();
    let doubtful = slow.doubt.iter().filter(|&&d| d).count();
    // In a small picture of a dense capture hundreds of splats meet at a pixel, and one of them is near a threshold.
    assert!(doubtful * 3 < pixels * 2, "{what}: {doubtful} of {pixels} pixels hang on rounding");
    for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
        let what = format!("{what}, {}", set.name());
        let fast = draw(scene, view, set, &features, &slow, limit);
        let close = |a: f32, b: f64, tolerance: f64| {
            (a.is_nan() && b.is_nan()) || (f64::from(a) - b).abs() <= tolerance * b.abs().max(1.0)
        };
        for p in 0..pixels {
            let at = (p % view.width as usize, p / view.width as usize);
            if slow.doubt[p] {
                let (a, b) = (fast.color[p][3], slow.color[p][3]);
                assert!(close(a, b, 0.02), "{what}: alpha at {at:?} is {a}, not {b}");
                continue;
            }
            for c in 0..4 {
                let (a, b) = (fast.color[p][c], slow.color[p][c]);
                assert!(close(a, b, 1e-4), "{what}: color[{c}] at {at:?} is {a}, not {b}");
            }
            for c in 0..CHANNELS {
                let (a, b) = (fast.features[p * CHANNELS + c], slow.features[p * CHANNELS + c]);
                assert!(close(a, b, 1e-4), "{what}: feature {c} at {at:?} is {a}, not {b}");
            }
            // Both sides of the sum that decides whether there is an expected depth are rounded.
            if (slow.color[p][3] - 1e-3).abs() > 1e-4 {
                let (a, b) = (fast.expected_depth[p], slow.expected[p]);
                assert!(close(a, b, 1e-3), "{what}: expected depth at {at:?} is {a}, not {b}");
            }
            if !slow.pick_doubt[p] {
                let (a, b) = (fast.median_depth[p], slow.median[p]);
                assert!(close(a, b, 1e-5), "{what}: median depth at {at:?} is {a}, not {b}");
                assert_eq!(fast.first_hits[p], slow.hits[p], "{what}: first hit at {at:?}");
                assert_eq!(fast.strongest[p], slow.strongest[p], "{what}: strongest at {at:?}");
            }
        }
        for i in 0..scene.len() {
            let (inside, total) = (fast.votes.inside[0][i], fast.votes.total[i]);
            assert!(inside <= total, "{what}: votes of Gaussian {i}");
            let (a, b) = (inside as f64 * VOTE_UNIT, slow.certain[i]);
            assert!((a - b).abs() <= 0.01 + 1e-3 * b, "{what}: votes inside of Gaussian {i} are {a}, not {b}");
            let (a, b) = (total as f64 * VOTE_UNIT, slow.total[i]);
            let doubt = (b - slow.certain[i]).max(0.1);
            assert!((a - b).abs() <= doubt + 1e-3 * b, "{what}: votes of Gaussian {i} are {a}, not {b}");
            let seen = slow.largest[i] * 255.0;
            // What is not seen in the certain pixels may still be seen in the others.
            let only_certain = slow.total[i] - slow.certain[i] < 1e-9;
            if seen > 1.01 || (seen < 0.99 && only_certain) {
                assert_eq!(fast.visibility.contains(i), seen > 1.0, "{what}: visibility of Gaussian {i}");
            }
        }
    }
}

#[test]
fn every_output_equals_the_reference_for_random_clouds_of_every_degree() {
    for seed in 1..=10 {
        println!("seed {seed}");
        let cloud = common::cloud(seed, 300, (seed % 5) as u8);
        agree(&format!("seed {seed}"), &Scene::of(Arc::new(cloud)), &common::view(seed, 83, 61));
    }
}

#[test]
fn orthographic_views_equal_the_reference() {
    for seed in 11..=14 {
        let cloud = common::cloud(seed, 200, 2);
        let view = common::orthographic(common::view(seed, 70, 50));
        agree(&format!("orthographic seed {seed}"), &Scene::of(Arc::new(cloud)), &view);
    }
}

#[test]
fn antialiased_clouds_equal_the_reference_beside_others() {
    for seed in 21..=24 {
        let mut r = common::Random(seed);
        let first = Instance { transform: r.similarity(), ..Instance::new(Arc::new(common::cloud(seed, 150, 1))) };
        let second = common::antialiased(common::cloud(seed + 100, 150, 3));
        let second = Instance { transform: r.similarity(), ..Instance::new(Arc::new(second)) };
        let scene = Scene { instances: vec![first, second] };
        agree(&format!("antialiased seed {seed}"), &scene, &common::view(seed, 64, 64));
    }
}

#[test]
fn transformed_instances_with_hidden_gaussians_equal_the_reference() {
    for seed in 31..=34 {
        let mut r = common::Random(seed);
        let cloud = Arc::new(common::cloud(seed, 120, 4));
        let instances = (0..3)
            .map(|_| Instance {
                transform: r.similarity(),
                hidden: Some(Arc::new(Selection::from_fn(120, |_| r.bits().is_multiple_of(3)))),
                ..Instance::new(cloud.clone())
            })
            .collect();
        agree(&format!("instances seed {seed}"), &Scene { instances }, &common::view(seed, 80, 45));
    }
}

#[test]
fn subsets_and_tints_equal_the_reference() {
    for seed in 61..=64 {
        let mut r = common::Random(seed);
        let cloud = Arc::new(common::cloud(seed, 150, (seed % 5) as u8));
        let instances = (0..3)
            .map(|k| Instance {
                transform: r.similarity(),
                hidden: (k == 1).then(|| Arc::new(Selection::from_fn(150, |_| r.bits().is_multiple_of(3)))),
                subset: Some((0..150).filter(|_| r.bits().is_multiple_of(2)).collect()),
                tint: (k < 2).then(|| (0..150).map(|_| (r.bits() as u32).to_le_bytes()).collect()),
                ..Instance::new(cloud.clone())
            })
            .collect();
        agree(&format!("subsets seed {seed}"), &Scene { instances }, &common::view(seed, 83, 45));
    }
}

#[test]
fn nothing_at_or_beyond_the_limit_of_a_pixel_is_drawn() {
    for seed in 71..=74 {
        let mut r = common::Random(seed);
        let scene = Scene::of(Arc::new(common::cloud(seed, 300, 1)));
        let view = common::view(seed, 83, 61);
        // Whole tiles without anything, with everything, and a mixture.
        let limit: Vec<f32> = (0..83 * 61)
            .map(|p| match (p % 83 / 16, p / 83 / 16) {
                (1, 1) => 0.0,
                (2, 1) => f32::INFINITY,
                _ => r.range(1.0, 5.0),
            })
            .collect();
        agree_limited(&format!("limit seed {seed}"), &scene, &view, Some(&limit));
    }
}

#[test]
fn splats_larger_than_many_tiles_equal_the_reference() {
    for seed in 41..=43 {
        let mut arrays = common::cloud(seed, 60, 0).into_arrays();
        for (scale, logit) in arrays.log_scales.iter_mut().zip(&mut arrays.opacity_logits) {
            *scale += 2.2;
            *logit -= 2.0;
        }
        let scene = Scene::of(Arc::new(splat_core::Cloud::new(arrays).unwrap()));
        agree(&format!("large seed {seed}"), &scene, &common::view(seed, 300, 170));
    }
}

#[test]
fn equal_depths_are_drawn_in_order_of_ids() {
    let mut r = common::Random(5);
    let gaussians: Vec<_> =
        (0..40).map(|_| (r.vector(-1.0, 1.0).with_z(3.0), r.range(0.05, 0.3), r.range(-1.0, 3.0))).collect();
    let mut arrays = Arc::unwrap_or_clone(common::plain(&gaussians)).into_arrays();
    arrays.sh = (0..120).map(|_| r.range(-1.0, 1.0)).collect();
    let scene = Scene::of(Arc::new(splat_core::Cloud::new(arrays).unwrap()));
    agree("equal depths", &scene, &common::forward_view(60, 60));
}

#[test]
fn real_captures_equal_the_reference() {
    for (name, size) in [("desk", (96, 72)), ("bench/trumpeter", (80, 60))] {
        let Some(folder) = common::capture(name) else { continue };
        let (cloud, _) = splat_io::read(folder.join("scene.ply")).expect("the capture");
        let views = splat_io::cameras::read(folder.join("cameras.json")).expect("its cameras").views;
        agree(name, &Scene::of(Arc::new(cloud)), &views[3].view.resized(size.0, size.1));
    }
}

#[test]
fn instruction_sets_with_the_same_rounding_give_the_same_bits() {
    let scene = Scene::of(Arc::new(common::cloud(51, 2000, 3)));
    let view = common::view(51, 200, 150);
    let features = features_of(scene.len());
    let slow = slow::draw(&Scene::default(), &view, 0, &[], 0.5);
    let bits = |v: &[f32]| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    for pair in [[InstructionSet::Avx2, InstructionSet::Avx512], [InstructionSet::Portable, InstructionSet::Sse2]] {
        if !pair.into_iter().all(InstructionSet::available) {
            println!("skipped: needs {} and {}", pair[0].name(), pair[1].name());
            continue;
        }
        let [a, b] = pair.map(|set| draw(&scene, &view, set, &features, &slow, None));
        assert_eq!(bits(a.color.as_flattened()), bits(b.color.as_flattened()));
        assert_eq!(bits(&a.features), bits(&b.features));
        assert_eq!(bits(&a.expected_depth), bits(&b.expected_depth));
        assert_eq!(bits(&a.median_depth), bits(&b.median_depth));
        assert_eq!((&a.first_hits, &a.strongest), (&b.first_hits, &b.strongest));
        assert_eq!((&a.visibility, &a.votes), (&b.visibility, &b.votes));
    }
}

/// The captures ship the sum of weights per Gaussian over all cameras, computed by another program and rounded to
/// logarithmic steps of at most 4 %.
#[test]
fn votes_of_all_cameras_equal_the_weights_shipped_with_a_capture() {
    let Some(folder) = common::capture("bench/cardbox") else { return };
    let (cloud, _) = splat_io::read(folder.join("scene.ply")).expect("the capture");
    let views = splat_io::cameras::read(folder.join("cameras.json")).expect("its cameras").views;
    let weights = splat_io::npy::read_f32(folder.join("weight.npy")).expect("its weights");
    let stats = std::fs::read_to_string(folder.join("stats.json")).expect("its figures");
    let near = stats.split_once("\"near\":").expect("near").1.split([',', '\n', '}']).next().expect("a number");
    let near: f32 = near.trim().parse().expect("a number");
    let scene = Scene::of(Arc::new(cloud));
    let mut sums = vec![0u64; scene.len()];
    let mut rasterizer = CpuRasterizer::new();
    for view in views {
        let votes = rasterizer.votes(&scene, &View { near, ..view.view }, &[]).expect("votes");
        sums.iter_mut().zip(votes.total).for_each(|(sum, total)| *sum += total);
    }
    let visible: Vec<usize> = (0..scene.len()).filter(|&i| weights[i] > 1.0).collect();
    let off = |&&i: &&usize| (sums[i] as f64 * VOTE_UNIT / f64::from(weights[i]) - 1.0).abs() > 0.05;
    let off = visible.iter().filter(off).count();
    assert!(visible.len() > 10_000 && off * 1000 < visible.len(), "{off} of {} weights differ", visible.len());
}
