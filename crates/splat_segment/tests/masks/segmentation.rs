use splat_core::{Mask2d, View};
use splat_segment::aggregations::AGGREGATIONS;
use splat_segment::trackers::TrackedFrame;
use splat_segment::{AnnotationId, Occlusion, Presegmentation, Run, SegmentError, SegmentSettings, Segmentation};

use crate::reference::Reference;
use crate::room::{self, BALL, Room, Seed, cameras, room};

fn without_presegmentation() -> SegmentSettings {
    SegmentSettings { presegmentation: Presegmentation::Off, ..SegmentSettings::default() }
}

/// An exact mask with a random rectangle painted in or out.
fn scribbled(exact: &Mask2d, seed: &mut Seed) -> Mask2d {
    let (x0, y0) = (seed.below(80) as u32, seed.below(60) as u32);
    let (w, h) = (seed.below(30) as u32, seed.below(30) as u32);
    let value = seed.below(2) == 0;
    Mask2d::from_fn(exact.width(), exact.height(), |x, y| {
        if (x0..x0 + w).contains(&x) && (y0..y0 + h).contains(&y) { value } else { exact.contains(x, y) }
    })
}

fn tracked(mask: Mask2d, seed: &mut Seed) -> TrackedFrame {
    let weight = (seed.below(2) == 0).then(|| {
        let values = mask.values().iter().map(|_| (seed.next() >> 56) as u8).collect();
        Mask2d::new(mask.width(), mask.height(), values).unwrap()
    });
    TrackedFrame { mask, weight, confidence: 0.5 }
}

/// One random operation; whether it was one.
fn operate(s: &mut Segmentation, seed: &mut Seed, views: &[View], exact: &[Mask2d]) {
    let ids: Vec<AnnotationId> = s.annotations().map(|(id, _)| id).collect();
    let k = seed.below(views.len());
    let occlusion = if seed.below(2) == 0 { Occlusion::Occluded } else { Occlusion::Unoccluded };
    match seed.below(8) {
        0 | 1 => drop(s.annotate(views[k], scribbled(&exact[k], seed), occlusion).unwrap()),
        2 if !ids.is_empty() => {
            let id = ids[seed.below(ids.len())];
            let k = views.iter().position(|v| *v == s.annotations().find(|a| a.0 == id).unwrap().1.view).unwrap();
            s.repaint(id, scribbled(&exact[k], seed)).unwrap();
        }
        3 if !ids.is_empty() => drop(s.remove(ids[seed.below(ids.len())]).unwrap()),
        4 if !ids.is_empty() => s.set_occlusion(ids[seed.below(ids.len())], occlusion).unwrap(),
        5 => {
            let from = seed.below(views.len());
            s.set_views((from..views.len()).map(|k| views[k]).collect());
        }
        _ if !s.views().is_empty() => {
            let k = seed.below(s.views().len());
            let e = views.iter().position(|v| *v == s.views()[k]).unwrap();
            let frame = tracked(scribbled(&exact[e], seed), seed);
            s.set_tracked(k, (seed.below(4) > 0).then_some(frame)).unwrap();
        }
        _ => {}
    }
}

#[test]
fn any_sequence_of_changes_equals_a_full_run_bit_for_bit() {
    let room = room();
    let mut r = Reference::default();
    let views = cameras(6);
    let exact: Vec<Mask2d> = views.iter().map(|v| room.mask(&mut r, v, BALL)).collect();
    for (round, settings) in [without_presegmentation(), SegmentSettings::default()].into_iter().enumerate() {
        let mut seed = Seed(0xabc + round as u64);
        let mut s = Segmentation::new(room.scene.clone(), settings);
        let mut undo: Vec<Segmentation> = Vec::new();
        for step in 0..40 {
            undo.push(s.clone());
            operate(&mut s, &mut seed, &views, &exact);
            if seed.below(3) == 0 {
                continue;
            }
            let before = r.frames;
            s.update(&mut r, &Run::new()).unwrap();
            let incremental = r.frames - before;
            let sums = s.update(&mut r, &Run::new()).unwrap().clone();
            let mut full = s.without_caches();
            let before = r.frames;
            assert_eq!(*full.update(&mut r, &Run::new()).unwrap(), sums, "round {round} step {step}");
            assert!(incremental <= r.frames - before, "a change draws no more than everything");
            assert_eq!(full.result(&mut r, &Run::new()).unwrap(), s.result(&mut r, &Run::new()).unwrap());
            if seed.below(4) == 0 {
                // Undo: the old value is still what it was.
                let mut old = undo[seed.below(undo.len())].clone();
                let sums = old.update(&mut r, &Run::new()).unwrap().clone();
                assert_eq!(*old.without_caches().update(&mut r, &Run::new()).unwrap(), sums);
                s = old;
            }
        }
    }
}

fn annotated(room: &Room, r: &mut Reference, views: &[View]) -> Segmentation {
    let mut s = Segmentation::new(room.scene.clone(), without_presegmentation());
    for v in views {
        let mask = room.mask(r, v, BALL);
        s.annotate(*v, mask, Occlusion::Occluded).unwrap();
    }
    s
}

#[test]
fn repainting_one_mask_draws_one_frame() {
    let room = room();
    let mut r = Reference::default();
    let views = cameras(5);
    let mut s = annotated(&room, &mut r, &views);
    s.update(&mut r, &Run::new()).unwrap();
    let id = s.annotations().nth(2).unwrap().0;
    let before = r.frames;
    s.repaint(id, Mask2d::empty(80, 60)).unwrap();
    s.update(&mut r, &Run::new()).unwrap();
    assert_eq!(r.frames - before, 1);
    s.remove(id).unwrap();
    s.set_theta(0.3);
    s.result(&mut r, &Run::new()).unwrap();
    assert_eq!(r.frames - before, 1, "removing and another threshold draw nothing");
    // Rules for votes alone draw nothing either.
    for rule in AGGREGATIONS.iter().filter(|a| !["gradient", "sirt"].contains(&a.name())) {
        s.result_by(*rule, &mut r, &Run::new()).unwrap();
    }
    assert_eq!(r.frames - before, 1);
}

#[test]
fn exact_masks_of_a_few_views_give_the_object() {
    let room = room();
    let mut r = Reference::default();
    let mut s = annotated(&room, &mut r, &cameras(10));
    let got = s.result(&mut r, &Run::new()).unwrap();
    let total = s.update(&mut r, &Run::new()).unwrap().total().to_vec();
    assert!(room.iou(&got.selection, BALL, &total) > 0.95);
    assert!(got.selection.iter().all(|i| got.seen.contains(i)));
}

#[test]
fn the_rule_by_name_votes_equals_the_result() {
    let room = room();
    let mut r = Reference::default();
    let mut s = annotated(&room, &mut r, &cameras(4));
    let result = s.result(&mut r, &Run::new()).unwrap();
    assert_eq!(s.result_by(AGGREGATIONS[0], &mut r, &Run::new()).unwrap(), result);
    let masks = s.masks();
    assert_eq!(masks.len(), 4);
    assert_eq!(s.votes().len(), 4);
    // And the rule run by itself over the same masks.
    assert_eq!(AGGREGATIONS[0].run(&room.scene, &masks, &mut r, &Run::new()).unwrap(), result);
}

#[test]
fn an_annotated_dense_view_does_not_count_its_tracked_mask() {
    let room = room();
    let mut r = Reference::default();
    let views = cameras(3);
    let mut s = annotated(&room, &mut r, &views[..1]);
    let alone = s.result(&mut r, &Run::new()).unwrap();
    s.set_views(views.clone());
    let wrong = Mask2d::from_fn(80, 60, |_, _| true);
    s.set_tracked(0, Some(TrackedFrame { mask: wrong, weight: None, confidence: 1.0 })).unwrap();
    assert_eq!(s.result(&mut r, &Run::new()).unwrap(), alone);
}

#[test]
fn stopping_and_errors_change_nothing() {
    let room = room();
    let mut r = Reference::default();
    let views = cameras(4);
    let mut s = annotated(&room, &mut r, &views);
    let sums = s.update(&mut r, &Run::new()).unwrap().clone();
    s.annotate(views[0], Mask2d::empty(80, 60), Occlusion::Occluded).unwrap();
    let stopped = Run::new();
    stopped.cancel();
    assert_eq!(s.update(&mut r, &stopped).unwrap_err(), SegmentError::Cancelled);
    let last = s.annotations().last().unwrap().0;
    s.remove(last).unwrap();
    let before = r.frames;
    assert_eq!(*s.update(&mut r, &stopped).unwrap(), sums, "nothing is missing, so there is nothing to stop");
    assert_eq!(r.frames, before);

    assert!(matches!(s.repaint(AnnotationId(99), Mask2d::empty(80, 60)), Err(SegmentError::Missing { .. })));
    assert!(matches!(s.remove(AnnotationId(99)), Err(SegmentError::Missing { .. })));
    let first = s.annotations().next().unwrap().0;
    assert!(matches!(s.repaint(first, Mask2d::empty(8, 6)), Err(SegmentError::Raster(_))));
    assert!(matches!(s.annotate(views[0], Mask2d::empty(1, 1), Occlusion::Occluded), Err(SegmentError::Raster(_))));
    assert!(matches!(s.set_tracked(0, None), Err(SegmentError::Missing { what: "view", .. })));
    assert_eq!(*s.update(&mut r, &Run::new()).unwrap(), sums);
}

#[test]
fn annotations_can_be_made_to_count_more() {
    let room = room();
    let mut r = Reference::default();
    let views = cameras(3);
    let settings = SegmentSettings { annotation_times: 3, ..without_presegmentation() };
    let mut s = Segmentation::new(room.scene.clone(), settings);
    let mask = room.mask(&mut r, &views[0], BALL);
    s.annotate(views[0], mask.clone(), Occlusion::Occluded).unwrap();
    let three = s.update(&mut r, &Run::new()).unwrap().total().to_vec();
    let mut once = Segmentation::new(room.scene.clone(), without_presegmentation());
    once.annotate(views[0], mask, Occlusion::Occluded).unwrap();
    let one = once.update(&mut r, &Run::new()).unwrap().total().to_vec();
    assert!(three.iter().zip(&one).all(|(a, b)| *a == 3 * b));
    let _ = room::SIZE;
}
