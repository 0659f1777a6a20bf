use std::sync::{Arc, Mutex};

use splat_segment::trackers::{Reference as Given, TRACKERS, TrackJob, tracker};
use splat_segment::{Occlusion, Run, SegmentError, SegmentSettings, Segmentation};

use crate::reference::Reference;
use crate::room::{self, BALL, BOX, cameras, room};

fn mask_iou(a: &splat_core::Mask2d, b: &splat_core::Mask2d) -> f64 {
    let (mut both, mut either) = (0, 0);
    for (&x, &y) in a.values().iter().zip(b.values()) {
        both += u32::from(x >= 128 && y >= 128);
        either += u32::from(x >= 128 || y >= 128);
    }
    if either == 0 { 1.0 } else { f64::from(both) / f64::from(either) }
}

#[test]
fn every_tracker_follows_an_object_around_from_two_masks() {
    let room = room();
    let mut r = Reference::default();
    let views: Vec<_> = (0..16).map(|k| room::camera(k as f32 / 16.0, 1.6, 3.2, room::SIZE)).collect();
    for label in [BALL, BOX] {
        let given = [views[0], views[7]];
        let masks = given.map(|v| room.mask(&mut r, &v, label));
        let references = [
            Given { view: &given[0], mask: &masks[0], before: 0 },
            Given { view: &given[1], mask: &masks[1], before: 7 },
        ];
        let job = TrackJob { scene: &room.scene, views: &views, references: &references };
        for t in TRACKERS {
            let frames = t.track(&job, &mut r, &Run::new()).unwrap();
            assert_eq!(frames.len(), views.len());
            let ious: Vec<f64> =
                views.iter().zip(&frames).map(|(v, f)| mask_iou(&f.mask, &room.mask(&mut r, v, label))).collect();
            let mean = ious.iter().sum::<f64>() / ious.len() as f64;
            println!("{} object {label}: mean IoU {mean:.3} {ious:.2?}", t.name());
            assert!(mean > 0.85, "{}: {mean}", t.name());
            assert!(frames.iter().all(|f| (0.0..=1.0).contains(&f.confidence)));
            assert_eq!(frames, t.track(&job, &mut r, &Run::new()).unwrap(), "the same bits again");
        }
    }
}

#[test]
fn trackers_report_progress_stop_on_request_and_need_something_to_follow() {
    let room = room();
    let views = cameras(3);
    let mask = room.mask(&mut Reference::default(), &views[0], BALL);
    let references = [Given { view: &views[0], mask: &mask, before: 0 }];
    for t in TRACKERS {
        assert_eq!(tracker(t.name()).unwrap().name(), t.name());
        assert!(!t.description().is_empty());
        let job = TrackJob { scene: &room.scene, views: &views, references: &references };
        let seen = Arc::new(Mutex::new(Vec::new()));
        let run = Run::with_progress({
            let seen = seen.clone();
            move |p| seen.lock().unwrap().push(p)
        });
        t.track(&job, &mut Reference::default(), &run).unwrap();
        let seen = seen.lock().unwrap();
        assert!(seen.len() >= views.len() && seen.iter().all(|p| p.done < p.total));
        let stopped = Run::new();
        stopped.cancel();
        assert_eq!(t.track(&job, &mut Reference::default(), &stopped), Err(SegmentError::Cancelled));
        let nothing = TrackJob { references: &[], ..job };
        let got = t.track(&nothing, &mut Reference::default(), &Run::new());
        assert!(matches!(got, Err(SegmentError::NothingToDo { .. })));
    }
    assert!(tracker("no such tracker").is_none());
}

#[test]
fn the_road_from_one_mask_to_the_object_and_a_correction_helps() {
    let room = room();
    let mut r = Reference::default();
    let mut s = Segmentation::new(room.scene.clone(), SegmentSettings::default());
    let ring: Vec<_> = (0..12).map(|k| room::camera(k as f32 / 12.0, 1.6, 3.2, room::SIZE)).collect();
    s.set_views(ring.clone());
    let front = ring[0];
    let mask = room.mask(&mut r, &front, BALL);
    s.annotate(front, mask, Occlusion::Unoccluded).unwrap();
    s.track(TRACKERS[0], &mut r, &Run::new()).unwrap();
    let first = s.result(&mut r, &Run::new()).unwrap();

    // What all exact masks see decides who counts.
    let mut exact = Segmentation::new(room.scene.clone(), SegmentSettings::default());
    for v in &ring {
        let mask = room.mask(&mut r, v, BALL);
        exact.annotate(*v, mask, Occlusion::Occluded).unwrap();
    }
    let total = exact.update(&mut r, &Run::new()).unwrap().total().to_vec();
    let one = room.iou(&first.selection, BALL, &total);
    assert!(one > 0.8, "one mask: {one}");

    let back = ring[6];
    let mask = room.mask(&mut r, &back, BALL);
    s.annotate(back, mask, Occlusion::Unoccluded).unwrap();
    s.track(TRACKERS[0], &mut r, &Run::new()).unwrap();
    let two = room.iou(&s.result(&mut r, &Run::new()).unwrap().selection, BALL, &total);
    println!("one mask {one:.3}, two {two:.3}");
    assert!(two > 0.9 && two >= one - 0.01, "two masks: {two}, one: {one}");
}
