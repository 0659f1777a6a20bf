//! Frames of the GPU against those of the CPU: colours, depths, ids, features, visibility and votes, on generated clouds, the
//! generated room and real captures.

#![cfg(feature = "gpu")]
#![expect(clippy::print_stdout, reason = "skipped tests say so, others how far frames are apart")]

mod common;

use std::path::Path;
use std::sync::Arc;

use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays, Mask2d, Selection, Similarity, View};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::gpu::{Gpu, GpuError, GpuOptions, GpuRasterizer, Precision, Subgroups};
use splat_raster::{Features, Frame, Instance, Outputs, Rasterizer, Scene};

/// A rasteriser on this machine's device, if it has one.
fn gpu(options: GpuOptions) -> Option<GpuRasterizer> {
    match Gpu::headless(options) {
        Ok(gpu) => Some(GpuRasterizer::new(gpu)),
        Err(GpuError::NoAdapter { .. }) => {
            println!("skipped: no Vulkan device");
            None
        }
        Err(e) => panic!("{e}"),
    }
}

/// Masks of a view: a disc, a soft slope, and all.
fn masks(view: &View) -> Vec<Mask2d> {
    let (w, h) = (view.width, view.height);
    let disc = Mask2d::from_fn(w, h, |x, y| (x as f32 / w as f32 - 0.5).hypot(y as f32 / h as f32 - 0.5) < 0.3);
    let slope = Mask2d::new(w, h, (0..w * h).map(|p| (p % w * 255 / w) as u8).collect()).expect("a mask");
    let all = Mask2d::new(w, h, vec![255; (w * h) as usize]).expect("a mask");
    vec![disc, slope, all, Mask2d::empty(w, h)]
}

/// How far frames may be apart.
#[derive(Clone, Copy)]
struct Bounds {
    /// Mean and largest difference of a pixel's colour.
    color: (f32, f32),
    /// Share of the pixels that may name another Gaussian.
    ids: f64,
}

/// Colour mean 1/255 and worst 4/255; ids on 99.9 % of the pixels.
const BOUNDS: Bounds = Bounds { color: (1.0 / 255.0, 4.0 / 255.0), ids: 1e-3 };

fn share(count: usize, of: usize) -> f64 {
    count as f64 / of.max(1) as f64
}

/// Draws a scene with both and compares every output.
fn compare(gpu: &mut GpuRasterizer, name: &str, scene: &Scene, view: &View, limit: Option<&[f32]>, bounds: Bounds) {
    let masks = masks(view);
    let masks: Vec<&Mask2d> = masks.iter().collect();
    // Six channels: more than one dispatch, and not a multiple of four.
    let values: Vec<f32> = (0..scene.len() * 6).map(|i| (i * 7919 % 1000) as f32 / 1000.0).collect();
    let outputs = Outputs {
        color: true,
        median_depth: true,
        expected_depth: true,
        features: Some(Features { channels: 6, values: &values }),
        visibility: Some(1.0 / 255.0),
        first_hits: Some(0.5),
        strongest: true,
        votes: Some(&masks),
        limit,
    };
    let (mut expected, mut found) = (Frame::default(), Frame::default());
    CpuRasterizer::new().draw(scene, view, &outputs, &mut expected).expect("a frame");
    gpu.draw(scene, view, &outputs, &mut found).expect("a frame");
    let pixels = expected.color.len();
    assert_eq!(found.color.len(), pixels, "{name}");

    let (mut sum, mut worst) = (0.0f64, 0.0f32);
    for (a, b) in found.color.as_flattened().iter().zip(expected.color.as_flattened()) {
        assert!(a.is_finite(), "{name}: a colour is {a}");
        // Colours above 1 are clipped when they are shown.
        let difference = (a.min(1.0) - b.min(1.0)).abs();
        (sum, worst) = (sum + f64::from(difference), worst.max(difference));
    }
    let mean = (sum / (4 * pixels.max(1)) as f64) as f32;

    let different = |a: &[u32], b: &[u32]| share(a.iter().zip(b).filter(|(a, b)| a != b).count(), a.len());
    let hits = different(&found.first_hits, &expected.first_hits);
    let strongest = different(&found.strongest, &expected.strongest);
    let depths = |a: &[f32], b: &[f32]| {
        let close = |a: f32, b: f32| (a.is_nan() && b.is_nan()) || (a - b).abs() <= 2e-3 * b.abs();
        share(a.iter().zip(b).filter(|(a, b)| !close(**a, **b)).count(), a.len())
    };
    let median = depths(&found.median_depth, &expected.median_depth);
    let mean_depth = depths(&found.expected_depth, &expected.expected_depth);
    let features = found.features.iter().zip(&expected.features).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let mut both = found.visibility.clone();
    both.apply(splat_core::SelectMode::Intersect, &expected.visibility);
    let visibility =
        share(found.visibility.count() + expected.visibility.count() - 2 * both.count(), expected.visibility.count());
    let votes = |a: &[u64], b: &[u64]| {
        let apart: u64 = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).sum();
        (apart as f64 / b.iter().sum::<u64>().max(1) as f64, a.iter().sum::<u64>().abs_diff(b.iter().sum()))
    };
    let (apart, whole) = votes(&found.votes.total, &expected.votes.total);
    println!(
        "{name}: colour {:.3}/255 mean, {:.2}/255 worst; hits {:.3} %, strongest {:.3} %, median {:.3} %, mean depth \
         {:.3} %, features {features:.4}, visible {:.3} %, votes {:.4} % apart",
        mean * 255.0,
        worst * 255.0,
        hits * 100.0,
        strongest * 100.0,
        median * 100.0,
        mean_depth * 100.0,
        visibility * 100.0,
        apart * 100.0,
    );
    let (mean_bound, worst_bound) = bounds.color;
    assert!(mean <= mean_bound && worst <= worst_bound, "{name}: colours");
    assert!(hits <= bounds.ids && strongest <= 3.0 * bounds.ids, "{name}: ids");
    assert!(median <= bounds.ids && mean_depth <= bounds.ids, "{name}: depths");
    // Neighbours in depth have similar colours, but nothing in common in these features: a change of order shows.
    assert!(features <= 0.1 && visibility <= 2e-2, "{name}: features or visibility");
    let sum: u64 = expected.votes.total.iter().sum();
    assert!(whole as f64 <= 1e-3 * sum as f64 && apart < 2e-2, "{name}: totals");
    for (m, (a, b)) in found.votes.inside.iter().zip(&expected.votes.inside).enumerate() {
        let (apart, whole) = votes(a, b);
        let sum: u64 = b.iter().sum();
        // Rounding down leaves at most a unit per Gaussian.
        assert!(whole as f64 <= 1e-3 * sum as f64 + a.len() as f64 && apart < 2e-2, "{name}: votes of mask {m}");
    }
    assert!(found.votes.inside[3].iter().all(|v| *v == 0), "{name}: an empty mask has votes");
    // The mask that is everywhere: what is inside is all.
    for (inside, total) in found.votes.inside[2].iter().zip(&found.votes.total) {
        assert_eq!(inside, total, "{name}");
    }
}

fn placed(cloud: &Arc<Cloud>, transform: Similarity) -> Instance {
    Instance { transform, ..Instance::new(cloud.clone()) }
}

#[test]
fn generated_clouds_are_drawn_as_on_the_cpu_in_every_precision() {
    for precision in [Precision::Packed, Precision::Full] {
        let Some(mut gpu) = gpu(GpuOptions { precision, ..GpuOptions::default() }) else { return };
        for seed in 1..=3 {
            let mut cloud = common::cloud(seed, 1500, seed as u8 + 1);
            let mut view = common::view(seed, 150, 110);
            if seed == 2 {
                cloud = common::antialiased(cloud);
            }
            if seed == 3 {
                view = common::orthographic(view);
            }
            // One of a few pixels may hang on which of two splats comes first.
            let bounds = Bounds { ids: 5e-3, ..BOUNDS };
            compare(&mut gpu, &format!("{precision:?} {seed}"), &Scene::of(Arc::new(cloud)), &view, None, bounds);
        }
    }
}

#[test]
fn instances_subsets_hidden_ones_tints_and_limits_are_drawn_as_on_the_cpu() {
    let Some(mut gpu) = gpu(GpuOptions { subgroups: Subgroups::Off, ..GpuOptions::default() }) else { return };
    let cloud = Arc::new(common::cloud(7, 1800, 2));
    let other = Arc::new(common::antialiased(common::cloud(8, 700, 0)));
    let mut random = common::Random(3);
    let subset: Arc<[u32]> = (0..1800).filter(|i| i % 5 < 2).collect();
    let hidden = Arc::new(Selection::from_fn(1800, |i| i % 4 == 1));
    let tint: Arc<[[u8; 4]]> = (0..1800).map(|i| [255, 120, 0, (i % 256) as u8]).collect();
    let scene = Scene {
        instances: vec![
            Instance { hidden: Some(hidden), tint: Some(tint), ..placed(&cloud, random.similarity()) },
            placed(&other, random.similarity()),
            Instance { subset: Some(subset), ..placed(&cloud, random.similarity()) },
        ],
    };
    let view = common::view(4, 120, 130);
    let bounds = Bounds { ids: 5e-3, ..BOUNDS };
    compare(&mut gpu, "instances", &scene, &view, None, bounds);
    let limit: Vec<f32> =
        (0..120 * 130).map(|p| if p % 3 == 0 { f32::NAN } else { 1.5 + (p % 7) as f32 * 0.4 }).collect();
    compare(&mut gpu, "limit", &scene, &view, Some(&limit), bounds);
    compare(&mut gpu, "limit, orthographic", &scene, &common::orthographic(view), Some(&limit), bounds);
}

#[test]
fn the_generated_room_is_drawn_as_on_the_cpu() {
    let Some(mut gpu) = gpu(GpuOptions::default()) else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/room");
    let (cloud, _) = splat_io::read(folder.join("scene.spz")).unwrap();
    let views = splat_io::cameras::read(folder.join("cameras.json")).unwrap().views;
    let scene = Scene::of(Arc::new(cloud));
    for k in [0, 20] {
        compare(&mut gpu, &format!("room {k}"), &scene, &views[k].view.resized(240, 180), None, BOUNDS);
    }
}

#[test]
fn captures_are_drawn_as_on_the_cpu() {
    for name in ["plaza", "bench/tumblewood"] {
        let Some(folder) = common::capture(name) else { return };
        let Some(mut gpu) = gpu(GpuOptions::default()) else { return };
        let (cloud, _) = splat_io::read(folder.join("scene.ply")).unwrap();
        let views = splat_io::cameras::read(folder.join("cameras.json")).unwrap().views;
        let scene = Scene::of(Arc::new(cloud));
        let view = views[views.len() / 2].view;
        let height = (320.0 * view.height as f32 / view.width as f32).round() as u32;
        compare(&mut gpu, name, &scene, &view.resized(320, height), None, BOUNDS);
    }
}

#[test]
fn clouds_at_the_edge_of_what_numbers_say_are_drawn_as_on_the_cpu() {
    let Some(mut gpu) = gpu(GpuOptions::default()) else { return };
    let view = common::forward_view(70, 50);
    let at = Vec3::new(0.0, 0.0, 2.0);
    let scenes = [
        ("nothing", Scene::default()),
        ("an empty cloud", Scene::of(Arc::new(Cloud::default()))),
        ("one", Scene::of(common::plain(&[(at, 0.3, 2.0)]))),
        ("behind", Scene::of(common::plain(&[(-at, 0.3, 2.0)]))),
        ("a million units", Scene::of(common::plain(&[(at, 1e6, 0.3), (at + 0.1, 0.2, 3.0)]))),
        ("many in one place", Scene::of(common::plain(&vec![(at, 0.4, -3.0); 3000]))),
    ];
    // Many that are alike: T creeps over the threshold of a hit.
    let bounds = Bounds { ids: 1e-2, ..BOUNDS };
    for (name, scene) in scenes {
        compare(&mut gpu, name, &scene, &view, None, bounds);
    }
    let good = common::plain(&[(at, 0.5, 3.0); 40]);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut arrays = (*good).clone().into_arrays();
        arrays.means[3].x = bad;
        arrays.log_scales[4].y = bad;
        arrays.rotations[5].z = bad;
        arrays.opacity_logits[6] = bad;
        let cloud = Arc::new(Cloud::new(arrays).unwrap());
        compare(&mut gpu, &format!("{bad}"), &Scene::of(cloud), &view, None, bounds);
    }
    let needle = CloudArrays {
        means: vec![at],
        log_scales: vec![Vec3::new(10.0f32.ln(), 0.001f32.ln(), 0.001f32.ln())],
        rotations: vec![Quat::from_rotation_z(0.4)],
        opacity_logits: vec![10.0],
        sh: vec![0.5; 3],
        ..CloudArrays::default()
    };
    compare(&mut gpu, "a needle", &Scene::of(Arc::new(Cloud::new(needle).unwrap())), &view, None, BOUNDS);
}

#[test]
fn the_same_frame_has_the_same_bits_drawn_again_elsewhere_and_after_another() {
    let Some(mut first) = gpu(GpuOptions::default()) else { return };
    let Some(mut second) = gpu(GpuOptions { subgroups: Subgroups::Off, ..GpuOptions::default() }) else { return };
    let scene = Scene::of(Arc::new(common::cloud(2, 3000, 1)));
    let (view, away) = (common::view(1, 130, 90), common::view(5, 60, 90));
    let outputs = Outputs { color: true, strongest: true, votes: Some(&[]), ..Outputs::default() };
    let draw = |raster: &mut GpuRasterizer, view: &View| {
        let mut frame = Frame::default();
        raster.draw(&scene, view, &outputs, &mut frame).unwrap();
        frame
    };
    let expected = draw(&mut first, &view);
    let same = |frame: Frame| {
        assert_eq!(frame.color, expected.color);
        assert_eq!(frame.strongest, expected.strongest);
        assert_eq!(frame.votes, expected.votes);
    };
    same(draw(&mut first, &view));
    draw(&mut first, &away);
    same(draw(&mut first, &view));
    same(draw(&mut second, &view));
}

#[test]
fn a_frame_that_needs_more_pairs_than_there_was_room_for_comes_back_whole() {
    let Some(mut gpu) = gpu(GpuOptions::default()) else { return };
    // 400 splats over the whole picture of 30 x 25 tiles: 300 000 pairs, where room for 65 536 is made at first.
    let cloud =
        common::plain(&(0..400).map(|i| (Vec3::new(0.0, 0.0, 2.0 + i as f32 * 0.01), 50.0, -4.0)).collect::<Vec<_>>());
    let bounds = Bounds { ids: 5e-3, ..BOUNDS };
    compare(&mut gpu, "many pairs", &Scene::of(cloud), &common::forward_view(480, 400), None, bounds);
}
