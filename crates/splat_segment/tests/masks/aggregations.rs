use splat_core::{Mask2d, View};
use splat_raster::{Features, Rasterizer};
use splat_segment::aggregations::{AGGREGATIONS, FlashSplat, MaskedView, VoteShare, adjoint, aggregation};
use splat_segment::votes::VoteSums;
use splat_segment::{Run, SegmentError};

use crate::reference::Reference;
use crate::room::{self, BALL, BOX, Seed, cameras, room};

#[test]
fn the_adjoint_is_the_adjoint() {
    let room = room();
    let mut seed = Seed(3);
    let view = cameras(3)[1];
    let f: Vec<f32> = (0..room.cloud.len()).map(|_| seed.unit() - 0.5).collect();
    let g: Vec<f32> = (0..room::SIZE.0 * room::SIZE.1).map(|_| (seed.unit() - 0.5) * 3.0).collect();
    let mut r = Reference::default();
    let picture = r.features(&room.scene, &view, Features { channels: 1, values: &f }).unwrap();
    let back = adjoint(&mut r, &room.scene, &view, &g).unwrap();
    let left: f64 = picture.iter().zip(&g).map(|(a, b)| f64::from(a * b)).sum();
    let right: f64 = f.iter().zip(&back).map(|(a, b)| f64::from(*a) * b).sum();
    let scale: f64 = picture.iter().zip(&g).map(|(a, b)| f64::from((a * b).abs())).sum();
    assert!((left - right).abs() < 2e-4 * scale, "{left} {right}");
    assert!(adjoint(&mut r, &room.scene, &view, &g[1..]).is_err());
    assert!(adjoint(&mut r, &room.scene, &view, &vec![0.0; g.len()]).unwrap().iter().all(|v| *v == 0.0));
}

/// Exact masks of all views, and the sums of their votes.
fn evidence(r: &mut Reference, label: u16) -> (room::Room, Vec<View>, Vec<Mask2d>, VoteSums) {
    let room = room();
    let views = cameras(10);
    let masks: Vec<Mask2d> = views.iter().map(|v| room.mask(r, v, label)).collect();
    let mut sums = VoteSums::new(room.cloud.len());
    for (v, m) in views.iter().zip(&masks) {
        sums.add(&MaskedView::new(v, m).votes(r, &room.scene).unwrap(), 1);
    }
    (room, views, masks, sums)
}

#[test]
fn every_rule_finds_the_object_from_exact_masks() {
    let mut r = Reference::default();
    for label in [BALL, BOX] {
        let (room, views, masks, sums) = evidence(&mut r, label);
        let input: Vec<MaskedView<'_>> = views.iter().zip(&masks).map(|(v, m)| MaskedView::new(v, m)).collect();
        for rule in AGGREGATIONS {
            let a = rule.run(&room.scene, &input, &mut r, &Run::new()).unwrap();
            let iou = room.iou(&a.selection, label, sums.total());
            println!("{:10} object {label}: IoU {iou:.3}, {} selected", rule.name(), a.selection.count());
            assert!(iou > 0.88, "{}: {iou}", rule.name());
            assert_eq!(a.score.len(), room.cloud.len());
            assert!(a.score.iter().all(|s| s.is_finite()), "{}", rule.name());
            let again = rule.run(&room.scene, &input, &mut r, &Run::new()).unwrap();
            assert_eq!(a, again, "{} gives other bits the second time", rule.name());
        }
    }
}

#[test]
fn flashsplat_without_slackness_is_the_majority() {
    let mut r = Reference::default();
    let (room, views, masks, _) = evidence(&mut r, BOX);
    let input: Vec<MaskedView<'_>> = views.iter().zip(&masks).map(|(v, m)| MaskedView::new(v, m)).collect();
    let run = |rule: &dyn splat_segment::aggregations::Aggregation, r: &mut Reference| {
        rule.run(&room.scene, &input, r, &Run::new()).unwrap().selection
    };
    assert_eq!(run(&FlashSplat { slackness: 0.0 }, &mut r), run(&VoteShare { theta: 0.5 }, &mut r));
    let (more, less) = (run(&FlashSplat { slackness: -0.6 }, &mut r), run(&FlashSplat { slackness: 0.6 }, &mut r));
    assert!(more.count() > less.count());
    assert!(less.iter().all(|i| more.contains(i)));
}

#[test]
fn rules_have_names_of_their_own_and_refuse_to_start_from_nothing() {
    let room = room();
    for rule in AGGREGATIONS {
        assert_eq!(aggregation(rule.name()).unwrap().name(), rule.name());
        assert!(!rule.description().is_empty() && !rule.source().is_empty());
        let got = rule.run(&room.scene, &[], &mut Reference::default(), &Run::new());
        assert!(matches!(got, Err(SegmentError::NothingToDo { .. })), "{}", rule.name());
        let run = Run::new();
        run.cancel();
        let view = cameras(1)[0];
        let mask = Mask2d::empty(view.width, view.height);
        let got = rule.run(&room.scene, &[MaskedView::new(&view, &mask)], &mut Reference::default(), &run);
        assert_eq!(got, Err(SegmentError::Cancelled), "{}", rule.name());
    }
    assert!(aggregation("no such rule").is_none());
}
