//! What holds for every frame, whatever the scene.

mod common;

use std::sync::Arc;

use splat_core::{Mask2d, SelectMode, Selection, Similarity, View};
use splat_raster::cpu::{CpuRasterizer, InstructionSet};
use splat_raster::{Features, Frame, Instance, Outputs, RasterError, Rasterizer, Scene, VOTE_UNIT, Votes};

/// Everything a frame can hold.
fn everything<'a>(features: &'a [f32], masks: &'a [&'a Mask2d]) -> Outputs<'a> {
    Outputs {
        color: true,
        median_depth: true,
        expected_depth: true,
        features: Some(Features { channels: 3, values: features }),
        visibility: Some(1.0 / 255.0),
        first_hits: Some(0.5),
        strongest: true,
        votes: Some(masks),
        limit: None,
    }
}

fn frame(rasterizer: &mut CpuRasterizer, scene: &Scene, view: &View, outputs: &Outputs) -> Frame {
    let mut frame = Frame::default();
    rasterizer.draw(scene, view, outputs, &mut frame).expect("a frame");
    frame
}

/// Equal to the bit, NaN included.
fn same(a: &Frame, b: &Frame) {
    let bits = |v: &[f32]| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!((a.width, a.height), (b.width, b.height));
    assert_eq!(bits(a.color.as_flattened()), bits(b.color.as_flattened()), "color");
    assert_eq!(bits(&a.median_depth), bits(&b.median_depth), "median depth");
    assert_eq!(bits(&a.expected_depth), bits(&b.expected_depth), "expected depth");
    assert_eq!(bits(&a.features), bits(&b.features), "features");
    assert_eq!(a.visibility, b.visibility, "visibility");
    assert_eq!((&a.first_hits, &a.strongest), (&b.first_hits, &b.strongest), "ids");
    assert_eq!(a.votes, b.votes, "votes");
}

fn soft_mask(seed: u64, width: u32, height: u32) -> Mask2d {
    let mut r = common::Random(seed);
    let values = (0..width * height).map(|_| r.bits() as u8).collect();
    Mask2d::new(width, height, values).expect("a value per pixel")
}

/// A scene of three instances large enough for several workers.
fn busy_scene(seed: u64) -> (Scene, View, Vec<f32>) {
    let mut r = common::Random(seed);
    let cloud = Arc::new(common::cloud(seed, 20_000, 2));
    let mut scene = Scene::of(cloud.clone());
    for _ in 0..2 {
        let hidden = Selection::from_fn(cloud.len(), |_| r.bits().is_multiple_of(4));
        let transform = r.similarity();
        scene.instances.push(Instance { transform, hidden: Some(Arc::new(hidden)), ..Instance::new(cloud.clone()) });
    }
    let values = (0..scene.len() * 3).map(|_| r.range(-1.0, 1.0)).collect();
    (scene, common::view(seed, 211, 133), values)
}

#[test]
fn frames_are_equal_to_the_bit_on_any_number_of_threads() {
    let (scene, view, values) = busy_scene(1);
    let mask = soft_mask(2, view.width, view.height);
    let masks = [&mask];
    let outputs = everything(&values, &masks);
    for set in InstructionSet::ALL {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| frame(&mut CpuRasterizer::with(set), &scene, &view, &outputs))
        };
        let one = on(1);
        for threads in [2, 3, 8] {
            same(&one, &on(threads));
        }
    }
}

#[test]
fn a_used_rasteriser_and_a_used_frame_give_the_same_bits_as_new_ones() {
    let (scene, view, values) = busy_scene(3);
    let other = Scene::of(Arc::new(common::cloud(4, 500, 0)));
    let mask = soft_mask(5, view.width, view.height);
    let masks = [&mask];
    let outputs = everything(&values, &masks);
    let new = frame(&mut CpuRasterizer::new(), &scene, &view, &outputs);

    let mut used = CpuRasterizer::new();
    let mut into = Frame::default();
    used.draw(&other, &common::view(9, 400, 300), &Outputs { color: true, ..Outputs::default() }, &mut into).unwrap();
    used.draw(&scene, &view, &Outputs { votes: Some(&[]), ..Outputs::default() }, &mut into).unwrap();
    for _ in 0..2 {
        used.draw(&scene, &view, &outputs, &mut into).unwrap();
        same(&new, &into);
    }
    assert_eq!(used.timings().project, Default::default(), "the lists of the last frame were used again");
}

#[test]
fn kept_lists_are_dropped_when_anything_they_depend_on_changes() {
    let (mut scene, view, _) = busy_scene(6);
    let outputs = Outputs { color: true, ..Outputs::default() };
    let mut used = CpuRasterizer::new();
    let mut check = |scene: &Scene, view: &View| {
        let kept = frame(&mut used, scene, view, &outputs);
        same(&kept, &frame(&mut CpuRasterizer::new(), scene, view, &outputs));
    };
    check(&scene, &view);
    let mut moved = view;
    moved.pose.position.x += 0.1;
    check(&scene, &moved);
    scene.instances[1].transform = Similarity::IDENTITY;
    check(&scene, &moved);
    // Changed in place as far as the caller can tell: the rasteriser's weak reference makes this a new allocation.
    if let Some(hidden) = &mut scene.instances[1].hidden {
        Arc::make_mut(hidden).invert();
    }
    check(&scene, &moved);
    scene.instances[2].hidden = None;
    check(&scene, &moved);
    scene.instances.pop();
    check(&scene, &moved);
}

#[test]
fn outputs_do_not_depend_on_which_others_are_asked_for() {
    let (scene, view, values) = busy_scene(7);
    let mask = soft_mask(8, view.width, view.height);
    let masks = [&mask];
    let all = everything(&values, &masks);
    let whole = frame(&mut CpuRasterizer::new(), &scene, &view, &all);
    let none = Outputs::default();
    let mut r = CpuRasterizer::new();
    let mut part = |outputs: Outputs| frame(&mut r, &scene, &view, &outputs);
    assert_eq!(part(Outputs { color: true, ..none }).color, whole.color);
    assert_eq!(part(Outputs { features: all.features, ..none }).features, whole.features);
    assert_eq!(part(Outputs { visibility: all.visibility, ..none }).visibility, whole.visibility);
    assert_eq!(part(Outputs { first_hits: all.first_hits, ..none }).first_hits, whole.first_hits);
    assert_eq!(part(Outputs { strongest: true, ..none }).strongest, whole.strongest);
    assert_eq!(part(Outputs { votes: all.votes, color: true, ..none }).votes, whole.votes);
    let empty = part(none);
    same(&empty, &Frame { width: view.width, height: view.height, ..Frame::default() });
}

#[test]
fn weights_and_transmittance_sum_to_one() {
    let (scene, view, _) = busy_scene(9);
    let ones = vec![1.0; scene.len()];
    let outputs =
        Outputs { color: true, features: Some(Features { channels: 1, values: &ones }), ..Outputs::default() };
    let frame = frame(&mut CpuRasterizer::new(), &scene, &view, &outputs);
    for (weights, color) in frame.features.iter().zip(&frame.color) {
        assert!((weights - color[3]).abs() < 2e-6, "weights {weights}, alpha {}", color[3]);
    }
    assert!(frame.color.iter().any(|c| c[3] > 0.99), "something opaque was drawn");
}

#[test]
fn votes_are_the_adjoint_of_features() {
    for seed in 10..15 {
        let (scene, view, _) = busy_scene(seed);
        let mut r = common::Random(seed);
        let f: Vec<f32> = (0..scene.len()).map(|_| r.range(-1.0, 1.0)).collect();
        let mask = soft_mask(seed, view.width, view.height);
        let masks = [&mask];
        let outputs =
            Outputs { features: Some(Features { channels: 1, values: &f }), votes: Some(&masks), ..Outputs::default() };
        let frame = frame(&mut CpuRasterizer::new(), &scene, &view, &outputs);
        let picture: f64 =
            frame.features.iter().zip(mask.values()).map(|(&f, &m)| f64::from(f) * f64::from(m) / 255.0).sum();
        let gaussians: f64 =
            f.iter().zip(&frame.votes.inside[0]).map(|(&f, &v)| f64::from(f) * v as f64 * VOTE_UNIT).sum();
        let size: f64 = frame.votes.inside[0].iter().map(|&v| v as f64 * VOTE_UNIT).sum();
        assert!((picture - gaussians).abs() < 1e-4 * size, "seed {seed}: {picture} and {gaussians} of {size}");
    }
}

#[test]
fn votes_of_a_mask_and_its_complement_add_up_to_the_total() {
    let (scene, view, _) = busy_scene(16);
    let mut r = common::Random(17);
    let hard = Mask2d::from_fn(view.width, view.height, |_, _| r.bits().is_multiple_of(2));
    let rest = Mask2d::from_fn(view.width, view.height, |x, y| !hard.contains(x, y));
    let full = Mask2d::from_fn(view.width, view.height, |_, _| true);
    let none = Mask2d::empty(view.width, view.height);
    let votes: Votes = CpuRasterizer::new().votes(&scene, &view, &[&hard, &rest, &full, &none]).unwrap();
    assert!(votes.total.iter().any(|&v| v > 1 << 16));
    for i in 0..scene.len() {
        assert_eq!(votes.inside[0][i] + votes.inside[1][i], votes.total[i]);
        assert_eq!((votes.inside[2][i], votes.inside[3][i]), (votes.total[i], 0));
    }
    assert_eq!(CpuRasterizer::new().votes(&scene, &view, &[]).unwrap().total, votes.total);
}

#[test]
fn one_cloud_cut_into_two_instances_gives_the_same_bits() {
    let cloud = common::cloud(18, 3000, 3);
    let ids: Vec<u32> = (0..3000).collect();
    let parts = [cloud.pick(&ids[..1234]), cloud.pick(&ids[1234..])].map(|c| Instance::new(Arc::new(c)));
    let (cut, whole) = (Scene { instances: parts.into() }, Scene::of(Arc::new(cloud)));
    let view = common::view(18, 150, 100);
    let values = vec![0.5; 9000];
    let mask = soft_mask(19, 150, 100);
    let masks = [&mask];
    let outputs = everything(&values, &masks);
    same(
        &frame(&mut CpuRasterizer::new(), &cut, &view, &outputs),
        &frame(&mut CpuRasterizer::new(), &whole, &view, &outputs),
    );
}

#[test]
fn hidden_gaussians_are_as_good_as_removed() {
    let cloud = Arc::new(common::cloud(20, 3000, 1));
    let mut r = common::Random(21);
    let shown = Selection::from_fn(cloud.len(), |_| !r.bits().is_multiple_of(3));
    let view = common::view(20, 150, 100);
    let outputs = Outputs { color: true, strongest: true, visibility: Some(0.01), ..Outputs::default() };
    let hidden = frame(&mut CpuRasterizer::new(), &Scene::of_selected(cloud.clone(), &shown), &view, &outputs);
    let ids = shown.ids();
    let removed = frame(&mut CpuRasterizer::new(), &Scene::of(Arc::new(cloud.pick(&ids))), &view, &outputs);
    assert_eq!(hidden.color, removed.color);
    for (&a, &b) in hidden.strongest.iter().zip(&removed.strongest) {
        assert_eq!(a, if b == Frame::NO_ID { b } else { ids[b as usize] });
    }
    let seen: Vec<u32> = removed.visibility.iter().map(|i| ids[i]).collect();
    assert_eq!(hidden.visibility.ids(), seen);
    let mut outside = hidden.visibility.clone();
    outside.apply(SelectMode::Subtract, &shown);
    assert_eq!(outside.count(), 0);
}

#[test]
fn a_turned_capture_seen_by_a_turned_camera_looks_the_same() {
    let cloud = Arc::new(common::cloud(22, 500, 4));
    let view = common::view(22, 120, 90);
    let transform = common::Random(23).similarity();
    let mut turned = view;
    turned.pose.world_from_view = transform.rotation_matrix() * view.pose.world_from_view;
    turned.pose.position = transform.apply(view.pose.position);
    turned.near *= transform.scale;
    let scene = Scene { instances: vec![Instance { transform, ..Instance::new(cloud.clone()) }] };
    let mut r = CpuRasterizer::new();
    let (a, b) = (r.render(&Scene::of(cloud), &view).unwrap(), r.render(&scene, &turned).unwrap());
    let far = a.as_flattened().iter().zip(b.as_flattened()).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
    // A contribution at its threshold may be in one and not in the other.
    assert!(far * 200 < a.len(), "{far} of {} values differ", 4 * a.len());
}

#[test]
fn inputs_that_do_not_fit_are_refused_with_a_sentence() {
    let scene = Scene::of(common::plain(&[(splat_core::glam::Vec3::Z, 0.1, 3.0)]));
    let view = common::forward_view(20, 10);
    let mut r = CpuRasterizer::new();
    let small = Mask2d::empty(10, 10);
    let error = r.votes(&scene, &view, &[&small]).unwrap_err();
    assert_eq!(error, RasterError::SizeMismatch { mask: (10, 10), view: (20, 10) });
    let features = Features { channels: 2, values: &[1.0] };
    let error = r.features(&scene, &view, features).unwrap_err();
    assert_eq!(error, RasterError::Length { what: "features", found: 1, expected: 2 });
    let error = r.features(&scene, &view, Features { channels: 0, values: &[] }).unwrap_err();
    assert!(matches!(error, RasterError::Length { what: "features", .. }));
    let mut wrong = scene.clone();
    wrong.instances[0].hidden = Some(Arc::new(Selection::none(2)));
    let error = r.render(&wrong, &view).unwrap_err();
    assert_eq!(error, RasterError::Length { what: "hidden", found: 2, expected: 1 });
    for (width, height) in [(0, 10), (10, 0), (40_000, 10), (32_768, 32_768)] {
        let view = View { width, height, ..view };
        let error = r.render(&scene, &view).unwrap_err();
        assert!(error.to_string().contains(&format!("{width}x{height}")), "{error}");
    }
    let view = View { near: f32::NAN, ..view };
    assert!(matches!(r.render(&scene, &view), Err(RasterError::View(_))));
}

#[test]
fn a_subset_draws_what_a_cloud_of_its_gaussians_draws_to_the_bit() {
    let cloud = Arc::new(common::cloud(81, 400, 3));
    let ids: Vec<u32> = (0..400).filter(|i| i % 3 == 1 || i % 50 > 40).collect();
    let part = cloud.pick(&ids);
    let view = common::view(81, 120, 90);
    let subset = Instance { subset: Some(ids.clone().into()), ..Instance::new(cloud) };
    let scene = Scene { instances: vec![subset] };
    let mut rasterizer = CpuRasterizer::new();
    let outputs = Outputs { color: true, first_hits: Some(0.5), votes: Some(&[]), ..Outputs::default() };
    let (mut a, mut b) = (Frame::default(), Frame::default());
    rasterizer.draw(&scene, &view, &outputs, &mut a).unwrap();
    rasterizer.draw(&Scene::of(Arc::new(part)), &view, &outputs, &mut b).unwrap();
    assert_eq!((a.color, a.first_hits, a.votes), (b.color, b.first_hits, b.votes));
    assert_eq!(scene.len(), ids.len());
    assert_eq!(scene.locate(5), Some((0, ids[5])));
    assert_eq!(scene.locate(ids.len() as u32), None);
}

#[test]
fn a_limit_without_numbers_is_none_and_a_wrong_one_is_refused() {
    let scene = Scene::of(Arc::new(common::cloud(82, 200, 0)));
    let view = common::view(82, 50, 40);
    let mut rasterizer = CpuRasterizer::new();
    let mut draw = |limit: Option<&[f32]>| {
        let mut frame = Frame::default();
        rasterizer
            .draw(&scene, &view, &Outputs { color: true, limit, ..Outputs::default() }, &mut frame)
            .map(|()| frame)
    };
    let plain = draw(None).unwrap();
    assert_eq!(draw(Some(&[f32::NAN; 2000])).unwrap().color, plain.color);
    assert_eq!(draw(Some(&[f32::INFINITY; 2000])).unwrap().color, plain.color);
    assert!(draw(Some(&[0.0; 2000])).unwrap().color.iter().all(|c| *c == [0.0; 4]));
    assert_eq!(draw(Some(&[1.0; 7])).unwrap_err().to_string(), "`limit` has 7 values, 2000 were expected");
}

#[test]
fn a_subset_that_does_not_rise_or_leaves_its_cloud_is_refused() {
    let cloud = Arc::new(common::cloud(83, 20, 0));
    for ids in [vec![3, 3], vec![4, 2], vec![19, 20]] {
        let instance = Instance { subset: Some(ids.into()), ..Instance::new(cloud.clone()) };
        let error =
            CpuRasterizer::new().render(&Scene { instances: vec![instance] }, &common::view(83, 9, 9)).unwrap_err();
        assert_eq!(error.to_string(), "the subset of instance 0 is not a list of rising ids below 20");
    }
}
