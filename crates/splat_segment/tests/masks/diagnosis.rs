use splat_core::Mask2d;
use splat_segment::aggregations::MaskedView;
use splat_segment::diagnosis::{disagreements, next_click, next_views, uncertainty};
use splat_segment::votes::{ViewVotes, VoteSums};
use splat_segment::{Run, SegmentError};

use crate::reference::Reference;
use crate::room::{self, BALL, camera, cameras, room};

#[test]
fn the_view_with_the_wrong_mask_disagrees_most() {
    let room = room();
    let mut r = Reference::default();
    let views = cameras(6);
    let mut masks: Vec<Mask2d> = views.iter().map(|v| room.mask(&mut r, v, BALL)).collect();
    let x0 = (0..80).find(|&x| (0..60).any(|y| masks[3].contains(x, y))).unwrap();
    masks[3] = Mask2d::from_fn(80, 60, |x, y| masks[3].contains(x, y) && x > x0 + 5);
    let list: Vec<MaskedView<'_>> = views.iter().zip(&masks).map(|(v, m)| MaskedView::new(v, m)).collect();
    let got = disagreements(&mut r, &room.scene, &room.object(BALL), &list, &Run::new()).unwrap();
    assert_eq!(got.len(), 6);
    assert_eq!(got[0].mask, 3);
    assert!(got[0].iou < 0.8 && got[0].missed == 0 && got[0].extra > 10, "{:?}", got[0]);
    assert!(got[1..].iter().all(|d| d.iou > 0.9), "{got:?}");
}

#[test]
fn what_no_view_saw_next_to_the_object_is_uncertain_and_the_view_behind_it_is_suggested() {
    let room = room();
    let mut r = Reference::default();
    let front = camera(0.0, 0.9, 3.2, room::SIZE);
    let mask = room.mask(&mut r, &front, BALL);
    let votes = ViewVotes::draw(&mut r, &room.scene, &front, &mask, None).unwrap();
    let mut sums = VoteSums::new(room.cloud.len());
    sums.add(&votes, 1);
    let selection = sums.above(0.5);
    let u = uncertainty(&room.scene, &sums, [&votes].into_iter(), &selection);
    assert!(u.iter().all(|u| (0.0..=1.0).contains(u)));
    let mean = |front: bool| {
        let of: Vec<f32> = (0..u.len())
            .filter(|&i| room.labels[i] == BALL && (room.cloud.means()[i].z < -0.1) == front)
            .filter(|&i| room.cloud.means()[i].z < 0.2)
            .map(|i| u[i])
            .collect();
        of.iter().sum::<f32>() / of.len() as f32
    };
    assert!(mean(true) < 0.2, "the front is settled: {}", mean(true));
    assert!(mean(false) > mean(true) + 0.2, "the far side is not: {} {}", mean(false), mean(true));

    let candidates: Vec<_> = (0..8).map(|k| camera(k as f32 / 8.0, 0.9, 3.2, room::SIZE)).collect();
    let ranked = next_views(&mut r, &room.scene, &u, &candidates, &[front], &Run::new()).unwrap();
    assert_eq!(ranked.len(), 8);
    assert!(ranked.windows(2).all(|w| w[0].gain >= w[1].gain));
    assert_eq!(ranked.last().unwrap().candidate, 0, "the annotated view teaches nothing: {ranked:?}");
    assert!([2, 3, 4, 5, 6].contains(&ranked[0].candidate), "{ranked:?}");

    let best = candidates[ranked[0].candidate];
    let click = next_click(&mut r, &room.scene, &u, &best).unwrap().unwrap();
    assert!(click.x < 80 && click.y < 60 && click.uncertainty > 0.1 && click.area > 3);
    let nothing = vec![0.0; u.len()];
    assert_eq!(next_click(&mut r, &room.scene, &nothing, &best).unwrap(), None);
    let got = next_views(&mut r, &room.scene, &u[1..], &candidates, &[], &Run::new());
    assert!(matches!(got, Err(SegmentError::Length { .. })));
}

#[test]
fn masks_that_contradict_each_other_leave_their_gaussians_uncertain() {
    let room = room();
    let mut r = Reference::default();
    let view = camera(0.0, 0.9, 3.2, room::SIZE);
    let mask = room.mask(&mut r, &view, BALL);
    let yes = ViewVotes::draw(&mut r, &room.scene, &view, &mask, None).unwrap();
    let no = ViewVotes::draw(&mut r, &room.scene, &view, &Mask2d::empty(80, 60), None).unwrap();
    let mut sums = VoteSums::new(room.cloud.len());
    sums.add(&yes, 1);
    sums.add(&no, 1);
    let u = uncertainty(&room.scene, &sums, [&yes, &no].into_iter(), &room.object(BALL));
    let seen: Vec<usize> = (0..u.len()).filter(|&i| room.labels[i] == BALL && sums.total()[i] > 200_000).collect();
    assert!(seen.len() > 50 && seen.iter().all(|&i| u[i] > 0.8));
}
