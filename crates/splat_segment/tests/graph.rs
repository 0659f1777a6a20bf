//! From clicks, boxes and masks to objects, on two balls on a floor.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its world should stop there")]

use std::sync::Arc;

use splat_core::glam::{Quat, Vec2, Vec3};
use splat_core::{Cloud, CloudArrays, Mask2d, Pose, Selection, View, sh};
use splat_raster::Scene;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::Run;
use splat_segment::graph::clicks::{ClickKind, ClickState};
use splat_segment::graph::edges::Edge;
use splat_segment::graph::look::Look;
use splat_segment::graph::masks::{MaskCutSettings, outside_in_sight};
use splat_segment::graph::prepared::Prepared;
use splat_segment::graph::superpoints::{SuperpointSettings, superpoints};
use splat_segment::votes::{ViewVotes, VoteSums};

struct World {
    scene: Scene,
    labels: Vec<u8>,
    views: Vec<View>,
    prepared: Prepared,
}

/// A grey floor (0), a red ball (1) and a blue one (2) that touch it.
fn world() -> World {
    let mut a = CloudArrays::default();
    let mut labels = Vec::new();
    let mut add = |label: u8, mean: Vec3, scale: Vec3, rotation: Quat, color: Vec3| {
        a.means.push(mean);
        a.log_scales.push(scale.map(f32::ln));
        a.rotations.push(rotation);
        a.opacity_logits.push(4.0);
        a.sh.extend(((color - 0.5) / sh::C0).to_array());
        labels.push(label);
    };
    for k in 0..40 * 40 {
        let at = |n: i32| (n as f32 - 19.5) * 0.1;
        add(0, Vec3::new(at(k % 40), 0.5, at(k / 40)), Vec3::new(0.07, 0.01, 0.07), Quat::IDENTITY, Vec3::splat(0.5));
    }
    for (label, center, color) in [
        (1, Vec3::new(-0.6, 0.1, 0.0), Vec3::new(0.9, 0.1, 0.1)),
        (2, Vec3::new(0.6, 0.1, 0.2), Vec3::new(0.1, 0.2, 0.9)),
    ] {
        for k in 0..600 {
            // Points on a sphere by the golden angle, flat along it.
            let y = 1.0 - (2 * k + 1) as f32 / 600.0;
            let (sin, cos) = (k as f32 * 2.399_963).sin_cos();
            let normal = Vec3::new(cos * (1.0 - y * y).sqrt(), y, sin * (1.0 - y * y).sqrt());
            let rotation = Quat::from_rotation_arc(Vec3::Z, normal);
            add(label, center + 0.4 * normal, Vec3::new(0.035, 0.035, 0.008), rotation, color);
        }
    }
    let views: Vec<View> = (0..12)
        .map(|k| {
            let (sin, cos) = (std::f32::consts::TAU * k as f32 / 12.0 - 1.6).sin_cos();
            let pose = Pose::look_at(Vec3::new(3.0 * cos, -1.4, 3.0 * sin), Vec3::new(0.0, 0.2, 0.0), Vec3::NEG_Y);
            View::perspective(pose, 0.8, 320, 240)
        })
        .collect();
    let scene = Scene::of(Arc::new(Cloud::new(a).unwrap()));
    let prepared = Prepared::new(&scene, &views, &mut CpuRasterizer::new(), &Run::new()).unwrap();
    World { scene, labels, views, prepared }
}

impl World {
    fn look(&self, view: usize) -> Look {
        Look::draw(&self.prepared, &self.scene, &self.views[view], &mut CpuRasterizer::new()).unwrap()
    }

    fn center(&self, view: usize, label: u8) -> Vec2 {
        let mean = if label == 1 { Vec3::new(-0.6, 0.1, 0.0) } else { Vec3::new(0.6, 0.1, 0.2) };
        self.views[view].project(mean).unwrap().0
    }

    fn iou(&self, selection: &Selection, label: u8) -> f64 {
        let truth = Selection::from_fn(self.labels.len(), |i| self.labels[i] == label);
        selection.jaccard(&truth)
    }

    /// The exact mask of an object: pixels whose strongest Gaussian is its.
    fn mask(&self, look: &Look, label: u8) -> Mask2d {
        Mask2d::from_fn(look.view.width, look.view.height, |x, y| {
            let id = look.solid[(y * look.view.width + x) as usize];
            self.labels.get(id as usize) == Some(&label)
        })
    }
}

#[test]
fn a_click_on_either_ball_proposes_it() {
    let w = world();
    for label in [1, 2] {
        for view in [0, 4, 8] {
            let look = w.look(view);
            let at = w.center(view, label);
            let Some(gaussian) = look.gaussian(at) else { panic!("nothing at {at}") };
            if w.labels[gaussian as usize] != label {
                continue; // The other ball stands in front.
            }
            let found = w.prepared.hypotheses(&look, w.prepared.graph.of[gaussian as usize], at);
            let ious: Vec<f64> = found
                .proposals
                .iter()
                .map(|&k| w.iou(&w.prepared.gaussians(&found.ranked[k].patches), label))
                .collect();
            assert!(ious.iter().any(|&v| v > 0.9), "ball {label}, view {view}: {ious:?}");
            assert!(found.wheel.len() <= 12 && found.proposals.len() <= 3);
            let masses: Vec<f32> = found.wheel.iter().map(|&k| found.ranked[k].mass).collect();
            assert!(masses.is_sorted(), "the wheel runs from part to group: {masses:?}");
        }
    }
}

#[test]
fn correcting_clicks_add_and_take_away_whole_things() {
    let w = world();
    let look = w.look(0);
    let at = w.center(0, 1);
    let patch = w.prepared.graph.of[look.gaussian(at).unwrap() as usize];
    let ball = Selection::from_fn(w.prepared.patch_count(), |p| {
        let count =
            |l: u8| (0..w.labels.len()).filter(|&i| w.prepared.graph.of[i] as usize == p && w.labels[i] == l).count();
        count(1) > count(0) + count(2)
    });
    let mut state = ClickState::new(ball, patch);
    state.correct(&w.prepared, &look, w.center(0, 2), ClickKind::Positive);
    let both = state.selection(&w.prepared);
    let truth = Selection::from_fn(w.labels.len(), |i| w.labels[i] != 0);
    assert!(both.jaccard(&truth) > 0.85, "{}", both.jaccard(&truth));
    state.correct(&w.prepared, &look, w.center(0, 2), ClickKind::Negative);
    let again = w.iou(&state.selection(&w.prepared), 1);
    assert!(again > w.iou(&both, 1) + 0.1, "{again} after {}", w.iou(&both, 1));
    // A click on nothing changes nothing.
    let before = state.clone();
    state.correct(&w.prepared, &look, Vec2::new(-5.0, 3.0), ClickKind::Negative);
    assert_eq!(state, before);
}

#[test]
fn a_box_and_an_exact_mask_give_the_ball_with_its_unseen_side() {
    let w = world();
    let look = w.look(0);
    let mask = w.mask(&look, 1);
    let inside: Vec<(u32, u32)> =
        (0..240).flat_map(|y| (0..320).map(move |x| (x, y))).filter(|&(x, y)| mask.contains(x, y)).collect();
    let x = |f: fn(u32, u32) -> u32, start| inside.iter().fold(start, |m, p| f(m, p.0));
    let y = |f: fn(u32, u32) -> u32, start| inside.iter().fold(start, |m, p| f(m, p.1));
    let rectangle = [x(u32::min, 999), y(u32::min, 999), x(u32::max, 0), y(u32::max, 0)];
    let boxed = w.prepared.object_in_box(&look, rectangle);
    assert!(w.iou(&w.prepared.gaussians(&boxed[0].patches), 1) > 0.9);
    assert!(w.prepared.object_in_box(&look, [0, 0, 1, 1]).is_empty(), "the corner shows nothing");

    let mut raster = CpuRasterizer::new();
    let mut sums = VoteSums::new(w.labels.len());
    sums.add(&ViewVotes::draw(&mut raster, &w.scene, &look.view, &mask, None).unwrap(), 1);
    let out = outside_in_sight(&w.scene, &look.view, &mask, &mut raster).unwrap();
    let whole = w.prepared.object_from_votes(&sums, Some(&out), &MaskCutSettings::default());
    assert!(w.iou(&whole, 1) > 0.9, "{}", w.iou(&whole, 1));
    let ruled_out = (0..w.labels.len()).filter(|&i| out.contains(i) && w.labels[i] == 1).count();
    assert_eq!(ruled_out, 0, "nothing of the object lies outside its mask");
}

#[test]
fn preparing_gives_the_same_bits_on_any_number_of_threads() {
    let w = world();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = one.install(|| Prepared::new(&w.scene, &w.views, &mut CpuRasterizer::new(), &Run::new()).unwrap());
    assert_eq!(again, w.prepared);
}

#[test]
fn nodes_of_a_tree_hold_what_their_children_hold() {
    let w = world();
    for tree in &w.prepared.trees {
        for (n, node) in tree.nodes.iter().enumerate().skip(tree.leaves) {
            let mut below: Vec<u32> = node.children.iter().flat_map(|&c| tree.patches(c).to_vec()).collect();
            let mut own = tree.patches(n as u32).to_vec();
            below.sort_unstable();
            own.sort_unstable();
            assert_eq!(own, below);
            let count: u32 = own.iter().map(|&p| w.prepared.graph.patches[p as usize].count).sum();
            assert_eq!(node.count, count);
            let crossing: u32 = w
                .prepared
                .graph
                .borders
                .iter()
                .filter(|b| own.binary_search(&b.a).is_ok() != own.binary_search(&b.b).is_ok())
                .map(|b| b.count)
                .sum();
            assert_eq!(node.border, crossing);
            for c in node.children {
                assert!(tree.nodes[c as usize].height <= node.height);
            }
        }
    }
}

/// Felzenszwalb's merging, written out: labels looked up and rewritten one by one.
fn slow_superpoints(count: usize, edges: &[Edge], s: &SuperpointSettings) -> Vec<usize> {
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_by(|&a, &b| edges[a].d.total_cmp(&edges[b].d));
    let mut label: Vec<usize> = (0..count).collect();
    let mut inner = vec![0.0f32; count];
    let size = |label: &[usize], l: usize| label.iter().filter(|&&x| x == l).count();
    let join = |label: &mut [usize], from: usize, to: usize| {
        label.iter_mut().filter(|l| **l == from).for_each(|l| *l = to);
    };
    for &k in &order {
        let e = edges[k];
        let (a, b) = (label[e.a as usize], label[e.b as usize]);
        let limit = |l: usize| inner[l] + s.k / size(&label, l) as f32;
        if a != b && e.d <= limit(a).min(limit(b)) {
            join(&mut label, a, b);
            inner[b] = e.d;
        }
    }
    for &k in &order {
        let e = edges[k];
        let (a, b) = (label[e.a as usize], label[e.b as usize]);
        if a != b && size(&label, a).min(size(&label, b)) < s.min_size as usize {
            join(&mut label, a, b);
        }
    }
    label
}

#[test]
fn superpoints_are_those_of_the_written_out_algorithm() {
    for seed in 1..20u64 {
        let mut state = seed;
        let mut next = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let count = 60;
        let edges: Vec<Edge> = (0..150)
            .map(|_| (next(count), next(count), next(1000)))
            .filter(|e| e.0 != e.1)
            .map(|(a, b, d)| Edge { a: a.min(b) as u32, b: a.max(b) as u32, d: d as f32 * 0.002 })
            .collect();
        let settings = SuperpointSettings { k: 0.8, min_size: 4 };
        let (fast, _) = superpoints(count as usize, &edges, &settings);
        let slow = slow_superpoints(count as usize, &edges, &settings);
        for i in 0..count as usize {
            for j in 0..i {
                assert_eq!(fast[i] == fast[j], slow[i] == slow[j], "seed {seed}: {i} and {j}");
            }
        }
    }
}
