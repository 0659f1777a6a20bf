//! Scores of methods on a small labelled scene: two balls on a floor.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside the functions marked as such")]

use std::sync::Arc;

use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays, Mask2d, Pose, Selection, View, sh};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Features, RasterError, Rasterizer, Scene, VOTE_UNIT};
use splat_segment::aggregations::{Aggregated, Aggregation, MaskedView, VotedView};
use splat_segment::eval::{
    BenchScene, Correction, EvalMethod, EvalSettings, LabelMap, ObjectScore, Prompt, PromptKind, PromptMode, evaluate,
    next_click,
};
use splat_segment::{Run, SegmentError};

const LABELS: usize = 3;

/// A grey floor (0), a red ball (1) and a blue one (2) behind it and a little to the side.
fn bench() -> BenchScene {
    let mut arrays = CloudArrays::default();
    let mut labels = Vec::new();
    let mut add = |label: u8, mean: Vec3, scale: Vec3, rotation: Quat, color: Vec3| {
        arrays.means.push(mean);
        arrays.log_scales.push(scale.map(f32::ln));
        arrays.rotations.push(rotation);
        arrays.opacity_logits.push(4.0);
        arrays.sh.extend(((color - 0.5) / sh::C0).to_array());
        labels.push(label);
    };
    for k in 0..30 * 30 {
        let at = |n: i32| (n as f32 - 14.5) * 0.12;
        let shade = 0.45 + 0.03 * (k % 3) as f32;
        add(0, Vec3::new(at(k % 30), 0.5, at(k / 30)), Vec3::new(0.08, 0.01, 0.08), Quat::IDENTITY, Vec3::splat(shade));
    }
    for (label, center, color) in [
        (1, Vec3::new(-0.3, 0.1, -0.3), Vec3::new(0.9, 0.1, 0.1)),
        (2, Vec3::new(0.4, 0.1, 0.4), Vec3::new(0.1, 0.2, 0.9)),
    ] {
        const COUNT: i32 = 500;
        for k in 0..COUNT {
            // Points on a sphere by the golden angle, flat along it.
            let y = 1.0 - (2 * k + 1) as f32 / COUNT as f32;
            let (sin, cos) = (k as f32 * 2.399_963).sin_cos();
            let normal = Vec3::new(cos * (1.0 - y * y).sqrt(), y, sin * (1.0 - y * y).sqrt());
            let rotation = Quat::from_rotation_arc(Vec3::Z, normal);
            add(label, center + 0.38 * normal, Vec3::new(0.035, 0.035, 0.008), rotation, color);
        }
    }
    let cloud = Arc::new(Cloud::new(arrays).unwrap());
    let views = |count: usize, height: f32| -> Vec<View> {
        (0..count)
            .map(|k| {
                let (sin, cos) = (std::f32::consts::TAU * k as f32 / count as f32 - 1.2).sin_cos();
                let pose =
                    Pose::look_at(Vec3::new(2.6 * cos, height, 2.6 * sin), Vec3::new(0.0, 0.2, 0.0), Vec3::NEG_Y);
                View::perspective(pose, 0.8, 160, 120)
            })
            .collect()
    };
    let (cameras, held_back) = (views(12, -1.2), views(5, -0.9));
    let mut r = CpuRasterizer::new();
    let scene = Scene::of(cloud.clone());
    let mut weight = vec![0.0f32; cloud.len()];
    for view in &cameras {
        for (sum, total) in weight.iter_mut().zip(r.votes(&scene, view, &[]).unwrap().total) {
            *sum += (total as f64 * VOTE_UNIT) as f32;
        }
    }
    let values: Vec<f32> =
        labels.iter().flat_map(|&l| (0..LABELS).map(move |k| if k == usize::from(l) { 1.0 } else { 0.0 })).collect();
    let mut map = |view: &View| {
        let picture = r.features(&scene, view, Features { channels: LABELS, values: &values }).unwrap();
        let label = |w: &[f32]| w.iter().position(|&w| w > 0.5).unwrap_or(0) as u8;
        LabelMap { view: *view, labels: picture.chunks_exact(LABELS).map(label).collect() }
    };
    let maps: Vec<LabelMap> = cameras.iter().map(&mut map).collect();
    let click = |mask: &Mask2d| {
        let nothing = Mask2d::empty(mask.width(), mask.height());
        next_click(&[(mask, &nothing)]).unwrap().pixel
    };
    let prompts = [(1, "red ball", 0), (2, "blue ball", 6)].map(|(label, name, camera)| {
        let mask = maps[camera].mask(label);
        let inside: Vec<[u32; 2]> =
            (0..120).flat_map(|y| (0..160).map(move |x| [x, y])).filter(|p| mask.contains(p[0], p[1])).collect();
        let side = |c: usize| inside.iter().map(move |p| p[c]);
        let rectangle =
            [side(0).min().unwrap(), side(1).min().unwrap(), side(0).max().unwrap(), side(1).max().unwrap()];
        let corrections = [(camera + 4) % 12, (camera + 8) % 12].map(|camera| {
            let mask = maps[camera].mask(label);
            Correction { camera, click: click(&mask), mask }
        });
        Prompt {
            label,
            name: name.to_owned(),
            kind: PromptKind::Main,
            camera,
            click: click(&mask),
            rectangle,
            mask,
            corrections: corrections.to_vec(),
        }
    });
    let held_back = held_back.iter().map(map).collect();
    BenchScene { name: "balls".to_owned(), cloud, labels, weight, cameras, held_back, prompts: prompts.to_vec() }
}

/// Answers with what it is told to.
struct Told(Selection);

impl Aggregation for Told {
    fn name(&self) -> &'static str {
        "told"
    }

    fn description(&self) -> &'static str {
        "says what it was told"
    }

    fn source(&self) -> &'static str {
        "this test"
    }

    fn decide(&self, _: usize, _: &[VotedView<'_>]) -> Option<Aggregated> {
        let (selection, seen) = (self.0.clone(), Selection::all(self.0.len()));
        Some(Aggregated { score: vec![0.0; selection.len()], selection, seen })
    }

    fn run(
        &self,
        scene: &Scene,
        _: &[MaskedView<'_>],
        _: &mut dyn Rasterizer,
        _: &Run,
    ) -> Result<Aggregated, SegmentError> {
        self.decide(scene.len(), &[]).ok_or(SegmentError::NothingUnderMask)
    }
}

fn ask(bench: &BenchScene, method: EvalMethod, prompt: PromptMode, clicks: u32) -> Vec<ObjectScore> {
    let settings = EvalSettings { method, prompt, clicks };
    evaluate(bench, &settings, &mut CpuRasterizer::new(), &Run::new()).unwrap()
}

fn told(bench: &BenchScene, selected: impl Fn(usize) -> bool) -> ObjectScore {
    let selection = Selection::from_fn(bench.cloud.len(), selected);
    // A rule lives as long as the program.
    let rule = EvalMethod::Aggregation(Box::leak(Box::new(Told(selection))));
    let bench = BenchScene { prompts: bench.prompts[..1].to_vec(), ..bench.clone() };
    ask(&bench, rule, PromptMode::Mask, 0).remove(0)
}

#[test]
fn the_labels_themselves_have_full_scores_and_nothing_has_none() {
    let bench = bench();
    let s = told(&bench, |i| bench.labels[i] == 1);
    assert_eq!((s.iou_visible, s.iou_weighted, s.iou_2d, s.boundary_iou_2d), (1.0, 1.0, Some(1.0), Some(1.0)));
    assert_eq!(s.removal_residual, Some(0.0));

    let s = told(&bench, |_| false);
    assert_eq!((s.iou_visible, s.iou_weighted, s.iou_2d, s.boundary_iou_2d), (0.0, 0.0, Some(0.0), Some(0.0)));
    assert!((0.8..=1.0).contains(&s.removal_residual.unwrap()), "{s:?}");
}

#[test]
fn a_surface_taken_from_a_ball_leaves_what_is_behind_it_to_be_seen() {
    let bench = bench();
    // The upper half: about half of the pixels then show the inside of the lower one.
    let half = told(&bench, |i| bench.labels[i] == 1 && bench.cloud.means()[i].y < 0.1);
    assert!((0.3..0.9).contains(&half.iou_visible) && half.iou_2d.unwrap() < 0.9, "{half:?}");
    assert!((0.2..0.9).contains(&half.removal_residual.unwrap()), "{half:?}");
    // Too much taken costs overlap, but leaves nothing of the ball.
    let all = told(&bench, |_| true);
    assert!(all.iou_visible < 0.5 && all.iou_2d.unwrap() < 0.5);
    assert_eq!(all.removal_residual, Some(0.0));
}

#[test]
fn ignored_gaussians_and_pixels_count_nowhere() {
    let mut bench = bench();
    let exact = told(&bench, |i| bench.labels[i] == 1);
    bench.labels.iter_mut().filter(|l| **l == 2).for_each(|l| *l = 255);
    bench.held_back.iter_mut().flat_map(|m| &mut m.labels).filter(|l| **l == 2).for_each(|l| *l = 255);
    let with_more = told(&bench, |i| bench.labels[i] != 0);
    assert_eq!((with_more.iou_visible, with_more.iou_weighted), (1.0, 1.0));
    // Pixels along the balls' common edge mix both, and belong to neither in the map.
    assert!(with_more.iou_2d.unwrap() > 0.98, "{with_more:?}");
    assert_eq!(exact.iou_2d, Some(1.0));
}

#[test]
fn held_back_views_with_too_few_pixels_of_the_object_do_not_count() {
    let mut bench = bench();
    for map in &mut bench.held_back {
        let mut left = 199;
        for l in map.labels.iter_mut().filter(|l| **l == 1) {
            *l = if left > 0 { 1 } else { 0 };
            left -= i32::from(left > 0);
        }
    }
    let s = told(&bench, |i| bench.labels[i] == 1);
    assert_eq!((s.iou_2d, s.boundary_iou_2d, s.removal_residual), (None, None, None));
    assert_eq!(s.iou_visible, 1.0);
}

#[test]
fn the_graph_answers_every_prompt_on_two_balls() {
    let bench = bench();
    let mut by_mode = Vec::new();
    for mode in PromptMode::ALL {
        let scores = ask(&bench, EvalMethod::Graph, mode, 0);
        assert_eq!(scores.iter().map(|s| s.label).collect::<Vec<_>>(), [1, 2]);
        for s in &scores {
            assert_eq!(s.seconds[0].0, "prepare");
            assert!(s.clicks.is_empty() && s.iou_visible > 0.5, "{mode:?}: {s:?}");
        }
        by_mode.push(scores);
    }
    let [click, best, steps, ..] = &by_mode[..] else { panic!("six modes") };
    for k in 0..2 {
        assert!(best[k].iou_visible >= click[k].iou_visible, "{best:?} {click:?}");
        assert!(steps[k].iou_visible > 0.8, "{steps:?}");
    }
}

#[test]
fn the_scripted_user_starts_from_the_best_of_three_and_gives_as_many_clicks_as_asked() {
    let bench = bench();
    let scores = ask(&bench, EvalMethod::Graph, PromptMode::Best3, 4);
    for s in &scores {
        assert_eq!(s.clicks.iter().map(|c| c.n).collect::<Vec<_>>(), [1, 2, 3, 4]);
        assert_eq!(s.clicks[0].iou_visible, s.iou_visible);
        assert!(s.clicks[3].iou_visible >= s.iou_visible - 0.01, "{s:?}");
    }
}

#[test]
fn scores_are_the_same_bits_on_one_thread_and_on_four() {
    let bench = bench();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut scores = pool.install(|| ask(&bench, EvalMethod::Graph, PromptMode::Mask3, 3));
        scores.iter_mut().for_each(|s| s.seconds.clear());
        scores
    };
    assert_eq!(on(1), on(4));
}

#[test]
fn rules_over_masks_answer_boxes_and_masks_but_no_clicks() {
    let bench = bench();
    for name in EvalMethod::names().skip(1) {
        let method = EvalMethod::named(name).unwrap();
        assert_eq!(method.name(), name);
        for prompt in PromptMode::ALL {
            let settings = EvalSettings { method, prompt, clicks: 0 };
            let scores = evaluate(&bench, &settings, &mut CpuRasterizer::new(), &Run::new());
            if method.answers(prompt) {
                assert!(scores.unwrap().iter().all(|s| s.iou_visible > 0.0), "{name} {prompt:?}");
            } else {
                assert!(matches!(scores, Err(SegmentError::NothingToDo { .. })), "{name} {prompt:?}");
            }
        }
        let settings = EvalSettings { method, prompt: PromptMode::Mask, clicks: 2 };
        assert!(evaluate(&bench, &settings, &mut CpuRasterizer::new(), &Run::new()).is_err());
    }
    assert!(EvalMethod::named("magic").is_none());
}

#[test]
fn clicks_beside_everything_select_nothing() {
    let mut bench = bench();
    for p in &mut bench.prompts {
        p.click = [u32::MAX, 7];
        p.rectangle = [9, 9, 3, 3];
    }
    for s in ask(&bench, EvalMethod::Graph, PromptMode::Click, 0) {
        assert_eq!((s.iou_visible, s.iou_2d), (0.0, Some(0.0)));
    }
    // Corrections may still find the object.
    assert!(ask(&bench, EvalMethod::Graph, PromptMode::Best3, 3).iter().all(|s| s.clicks.len() == 3));
    assert_eq!(ask(&bench, EvalMethod::Graph, PromptMode::Box, 0).len(), 2);
}

#[test]
fn scenes_that_do_not_fit_together_are_refused() {
    let good = bench();
    assert_eq!(good.check(), Ok(()));
    let refused = |break_it: fn(&mut BenchScene)| {
        let mut bench = good.clone();
        break_it(&mut bench);
        let settings = EvalSettings { method: EvalMethod::Graph, prompt: PromptMode::Mask, clicks: 0 };
        evaluate(&bench, &settings, &mut CpuRasterizer::new(), &Run::new()).unwrap_err()
    };
    assert!(matches!(refused(|b| b.labels.truncate(5)), SegmentError::Length { what: "labels", found: 5, .. }));
    assert!(matches!(refused(|b| b.weight.clear()), SegmentError::Length { what: "weight", found: 0, .. }));
    assert!(matches!(refused(|b| b.held_back[0].labels.clear()), SegmentError::Length { what: "label map", .. }));
    assert!(matches!(refused(|b| b.prompts[0].camera = 99), SegmentError::Missing { found: 99, count: 12, .. }));
    assert!(matches!(
        refused(|b| b.prompts[1].corrections[0].mask = Mask2d::empty(3, 3)),
        SegmentError::Raster(RasterError::SizeMismatch { mask: (3, 3), .. })
    ));
    let empty = BenchScene { prompts: Vec::new(), ..good.clone() };
    assert!(ask(&empty, EvalMethod::Graph, PromptMode::Click, 5).is_empty());
}
