//! Gaussians and pictures at the edge of what numbers can say, on every instruction set.

mod common;

use std::sync::Arc;

use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays, View};
use splat_raster::cpu::{CpuRasterizer, InstructionSet};
use splat_raster::{Frame, Outputs, Rasterizer, Scene};

/// Draws with every instruction set; all must be finite and agree within 1e-4.
fn draw(scene: &Scene, view: &View) -> Frame {
    let outputs = Outputs {
        color: true,
        median_depth: true,
        first_hits: Some(0.5),
        strongest: true,
        visibility: Some(1.0 / 255.0),
        votes: Some(&[]),
        ..Outputs::default()
    };
    let mut first: Option<Frame> = None;
    for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
        let mut frame = Frame::default();
        CpuRasterizer::with(set).draw(scene, view, &outputs, &mut frame).expect("a frame");
        assert!(frame.color.as_flattened().iter().all(|v| v.is_finite()), "{}", set.name());
        if let Some(first) = &first {
            for (a, b) in first.color.as_flattened().iter().zip(frame.color.as_flattened()) {
                assert!((a - b).abs() < 1e-4 * a.max(1.0), "{}: {b}, not {a}", set.name());
            }
        }
        first.get_or_insert(frame);
    }
    first.expect("the portable one is always there")
}

fn alpha_in_the_middle(frame: &Frame) -> f32 {
    frame.color[(frame.height / 2 * frame.width + frame.width / 2) as usize][3]
}

fn one(mean: Vec3, scale: f32, logit: f32) -> Scene {
    Scene::of(common::plain(&[(mean, scale, logit)]))
}

#[test]
fn values_that_are_not_finite_are_skipped_and_their_neighbours_are_drawn() {
    let good = common::plain(&[(Vec3::new(0.0, 0.0, 2.0), 0.5, 3.0); 40]);
    let view = common::forward_view(40, 30);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for field in 0..11 {
            let mut arrays = (*good).clone().into_arrays();
            match field {
                0..3 => arrays.means[17][field] = bad,
                3..6 => arrays.log_scales[17][field - 3] = bad,
                6 => arrays.rotations[17].x = bad,
                7 => arrays.rotations[17].w = bad,
                8 => arrays.opacity_logits[17] = f32::NAN,
                9 => arrays.sh[17 * 3] = bad,
                _ => arrays.opacity_logits[17] = bad,
            }
            let cloud = Cloud::new(arrays).unwrap();
            let drawable = cloud.drawable(17) && cloud.opacity_logits()[17] != f32::NEG_INFINITY;
            let frame = draw(&Scene::of(Arc::new(cloud)), &view);
            assert!(alpha_in_the_middle(&frame) > 0.9);
            assert!(drawable || frame.votes.total[17] == 0, "field {field}, {bad}");
            assert!(frame.votes.total[0] > 0);
        }
    }
}

#[test]
fn infinite_logits_are_full_and_no_opacity() {
    let view = common::forward_view(40, 30);
    let full = draw(&one(Vec3::new(0.0, 0.0, 2.0), 1.0, f32::INFINITY), &view);
    assert!((alpha_in_the_middle(&full) - 0.99).abs() < 1e-6);
    let none = draw(&one(Vec3::new(0.0, 0.0, 2.0), 1.0, f32::NEG_INFINITY), &view);
    assert!(none.color.iter().all(|c| *c == [0.0; 4]));
}

#[test]
fn a_gaussian_of_no_size_is_as_wide_as_the_low_pass() {
    let mut arrays = (*common::plain(&[(Vec3::new(0.0, 0.0, 2.0), 1.0, 20.0)])).clone().into_arrays();
    arrays.log_scales[0] = Vec3::splat(-1e30);
    let cloud = Arc::new(Cloud::new(arrays).unwrap());
    let frame = draw(&Scene::of(cloud.clone()), &common::forward_view(41, 31));
    // Pixel (20, 15) has its centre at the mean; its neighbour is 1 px away: exp(-1 / (2 * 0.3)).
    let at = |x: usize| frame.color[15 * 41 + x][3];
    assert!((at(20) - 0.99).abs() < 1e-5);
    assert!((at(21) - (-1.0f32 / 0.6).exp()).abs() < 1e-5);
    // The antialiased form takes the opacity that the low-pass gave: nothing is left of a point.
    let point = common::antialiased((*cloud).clone());
    let frame = draw(&Scene::of(Arc::new(point)), &common::forward_view(41, 31));
    assert!(frame.color.iter().all(|c| c[3] == 0.0));
}

#[test]
fn a_gaussian_of_a_million_units_covers_the_picture_evenly() {
    for scale in [1e6, 1e15, 1e30] {
        for mean in [Vec3::new(0.0, 0.0, 2.0), Vec3::new(0.3, -0.2, 0.011)] {
            let frame = draw(&one(mean, scale, 0.0), &common::forward_view(100, 70));
            for c in &frame.color {
                assert!((c[3] - 0.5).abs() < 1e-4, "scale {scale}: alpha {}", c[3]);
            }
        }
    }
}

#[test]
fn a_needle_of_a_thousand_to_one_stays_thin_in_every_direction() {
    for turn in 0..12 {
        let angle = turn as f32 * 0.26;
        let arrays = CloudArrays {
            means: vec![Vec3::new(0.0, 0.0, 2.0)],
            log_scales: vec![Vec3::new(10.0f32.ln(), 0.001f32.ln(), 0.001f32.ln())],
            rotations: vec![Quat::from_rotation_z(angle)],
            opacity_logits: vec![10.0],
            sh: vec![0.5; 3],
            ..CloudArrays::default()
        };
        let scene = Scene::of(Arc::new(Cloud::new(arrays).unwrap()));
        let view = common::forward_view(201, 201);
        let frame = draw(&scene, &view);
        let slow = common::slow::draw(&scene, &view, 0, &[], 0.5);
        for (p, (a, b)) in frame.color.iter().zip(&slow.color).enumerate() {
            assert!(slow.doubt[p] || (f64::from(a[3]) - b[3]).abs() < 1e-3, "turn {turn}: {} not {}", a[3], b[3]);
        }
        assert!(frame.color.iter().filter(|c| c[3] > 0.5).count() > 150, "turn {turn}: no holes");
    }
}

#[test]
fn nothing_at_or_behind_the_near_plane_is_drawn() {
    let mut view = common::forward_view(40, 30);
    view.near = 0.5;
    for (z, drawn) in [(-3.0, false), (0.0, false), (0.5, false), (0.500_001, true), (3.0, true)] {
        let frame = draw(&one(Vec3::new(0.0, 0.0, z), 0.2, 3.0), &view);
        assert_eq!(alpha_in_the_middle(&frame) > 0.5, drawn, "z = {z}");
        assert_eq!(frame.visibility.count(), usize::from(drawn), "z = {z}");
    }
}

#[test]
fn a_picture_of_one_pixel_and_a_long_thin_one_are_drawn() {
    let scene = one(Vec3::new(0.0, 0.0, 2.0), 5000.0, 3.0);
    for (width, height) in [(1, 1), (1, 500), (500, 1), (17, 33)] {
        let frame = draw(&scene, &common::forward_view(width, height));
        assert_eq!(frame.color.len(), (width * height) as usize);
        assert!(frame.first_hits.iter().all(|&id| id == 0));
    }
}

#[test]
fn nothing_is_drawn_of_nothing() {
    let view = common::forward_view(40, 30);
    for scene in [Scene::default(), Scene::of(Arc::new(Cloud::default()))] {
        let frame = draw(&scene, &view);
        assert!(frame.color.iter().all(|c| *c == [0.0; 4]));
        assert!(frame.median_depth.iter().all(|z| z.is_nan()));
        assert!(frame.strongest.iter().all(|&id| id == Frame::NO_ID));
        assert_eq!((frame.visibility.len(), frame.votes.total.len()), (0, 0));
    }
}

#[test]
fn any_bits_in_any_field_never_panic_nor_spoil_a_picture() {
    for seed in 1..=20 {
        println!("seed {seed}");
        let mut r = common::Random(seed);
        let count = 300;
        let mut any = |n: usize| -> Vec<f32> { (0..n).map(|_| f32::from_bits(r.bits() as u32)).collect() };
        let vectors = |v: Vec<f32>| v.chunks(3).map(Vec3::from_slice).collect::<Vec<_>>();
        let arrays = CloudArrays {
            means: vectors(any(3 * count)),
            log_scales: vectors(any(3 * count)),
            rotations: any(4 * count).chunks(4).map(Quat::from_slice).collect(),
            opacity_logits: any(count),
            sh_degree: 1,
            sh: any(12 * count),
            ..CloudArrays::default()
        };
        let cloud = Arc::new(Cloud::new(arrays).unwrap());
        let view = common::view(seed, 64, 48);
        for set in InstructionSet::ALL {
            let mut frame = Frame::default();
            let outputs = Outputs { color: true, median_depth: true, votes: Some(&[]), ..Outputs::default() };
            CpuRasterizer::with(set).draw(&Scene::of(cloud.clone()), &view, &outputs, &mut frame).unwrap();
            assert!(frame.color.iter().all(|c| (0.0..=1.0).contains(&c[3])), "{}", set.name());
        }
    }
}

#[test]
fn splats_at_every_corner_of_the_tiles_are_drawn_whole() {
    let view = common::forward_view(64, 48);
    for x in [0.0, 15.5, 16.0, 31.9, 63.0, 64.0, -1.0] {
        for y in [0.0, 15.9, 16.0, 32.1, 47.5, 49.0] {
            let at = view.unproject(splat_core::glam::Vec2::new(x, y), 2.0);
            let scene = one(at, 0.02, 4.0);
            let frame = draw(&scene, &view);
            let slow = common::slow::draw(&scene, &view, 0, &[], 0.5);
            for (p, (a, b)) in frame.color.iter().zip(&slow.color).enumerate() {
                assert!(slow.doubt[p] || (f64::from(a[3]) - b[3]).abs() < 1e-4, "({x}, {y}): pixel {p}");
            }
        }
    }
}
