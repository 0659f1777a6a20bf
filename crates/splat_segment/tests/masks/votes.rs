use std::sync::Arc;

use splat_core::Mask2d;
use splat_raster::Rasterizer;
use splat_segment::SegmentError;
use splat_segment::votes::{LabelVotes, MaskKey, ViewVotes, VoteStore, VoteSums};

use crate::reference::Reference;
use crate::room::{self, BALL, BOX, Seed, cameras, room};

fn random_mask(seed: &mut Seed) -> Mask2d {
    let (w, h) = room::SIZE;
    let values = (0..w * h).map(|_| (seed.next() >> 56) as u8).collect();
    Mask2d::new(w, h, values).unwrap()
}

#[test]
fn masks_added_in_any_order_and_taken_away_again_leave_the_same_bits() {
    let room = room();
    let views = cameras(5);
    let mut seed = Seed(11);
    let drawn: Vec<(MaskKey, Arc<ViewVotes>)> = views
        .iter()
        .map(|v| {
            let mask = random_mask(&mut seed);
            let votes = ViewVotes::draw(&mut Reference::default(), &room.scene, v, &mask, None).unwrap();
            (MaskKey::new(v, &mask, None), Arc::new(votes))
        })
        .collect();
    let n = room.cloud.len();
    let mut all = VoteStore::new(n);
    drawn.iter().for_each(|(k, v)| all.add(*k, v.clone(), 2));
    let mut reversed = VoteStore::new(n);
    drawn.iter().rev().for_each(|(k, v)| reversed.add(*k, v.clone(), 2));
    assert_eq!(all, reversed);

    // Without the third, as if it had never been there; and with it again.
    let mut fewer = all.clone();
    assert_eq!(fewer.remove(&drawn[2].0).unwrap(), drawn[2].1);
    let mut never = VoteStore::new(n);
    for (i, (k, v)) in drawn.iter().enumerate().filter(|(i, _)| *i != 2) {
        let _ = i;
        never.add(*k, v.clone(), 2);
    }
    assert_eq!(fewer, never);
    fewer.add(drawn[2].0, drawn[2].1.clone(), 1);
    assert_ne!(fewer, all);
    fewer.add(drawn[2].0, drawn[2].1.clone(), 1);
    assert_eq!(fewer, all);
    fewer.take(&drawn[2].0, 2);
    assert_eq!(fewer, never);
    assert!(fewer.remove(&drawn[2].0).is_none());
}

#[test]
fn sums_equal_those_of_the_dense_votes() {
    let room = room();
    let views = cameras(3);
    let mut seed = Seed(5);
    let mut sums = VoteSums::new(room.cloud.len());
    let (mut inside, mut total) = (vec![0; room.cloud.len()], vec![0; room.cloud.len()]);
    for v in &views {
        let mask = random_mask(&mut seed);
        sums.add(&ViewVotes::draw(&mut Reference::default(), &room.scene, v, &mask, None).unwrap(), 1);
        let dense = Reference::default().votes(&room.scene, v, &[&mask]).unwrap();
        inside.iter_mut().zip(&dense.inside[0]).for_each(|(s, v)| *s += v);
        total.iter_mut().zip(&dense.total).for_each(|(s, v)| *s += v);
    }
    assert_eq!(sums.inside(), inside);
    assert_eq!(sums.total(), total);
    let above = sums.above(0.5);
    for i in 0..sums.len() {
        assert_eq!(above.contains(i), sums.seen(i) && 2 * inside[i] > total[i]);
        assert_eq!(sums.score(i).is_some(), total[i] >= 3277);
    }
}

#[test]
fn pixels_of_no_weight_say_nothing_and_full_weight_is_no_weight() {
    let room = room();
    let view = cameras(1)[0];
    let mut r = Reference::default();
    let mask = room.mask(&mut r, &view, BALL);
    let (w, h) = room::SIZE;
    let plain = ViewVotes::draw(&mut r, &room.scene, &view, &mask, None).unwrap();
    let full = Mask2d::new(w, h, vec![255; (w * h) as usize]).unwrap();
    assert_eq!(ViewVotes::draw(&mut r, &room.scene, &view, &mask, Some(&full)).unwrap(), plain);
    let none = Mask2d::empty(w, h);
    assert!(ViewVotes::draw(&mut r, &room.scene, &view, &mask, Some(&none)).unwrap().is_empty());
    // Only the mask counts: whatever is seen is inside.
    let only = ViewVotes::draw(&mut r, &room.scene, &view, &mask, Some(&mask)).unwrap();
    assert!(!only.is_empty() && only.iter().all(|(_, inside, total)| inside == total));
}

#[test]
fn label_maps_of_many_views_name_nearly_every_gaussian_rightly() {
    let room = room();
    let mut r = Reference::default();
    let mut votes = LabelVotes::new(room.cloud.len(), 4);
    let views = cameras(12);
    for v in &views {
        let map = room.label_map(&mut r, v);
        votes.add(&mut r, &room.scene, v, &map).unwrap();
    }
    let labels = votes.assign(None).unwrap();
    let total: Vec<u64> = (0..room.cloud.len()).map(|i| (0..4).map(|l| votes.inside(l)[i]).sum()).collect();
    for label in [BALL, BOX] {
        let selection = splat_core::Selection::from_fn(total.len(), |i| labels.label[i] == label);
        let iou = room.iou(&selection, label, &total);
        assert!(iou > 0.9, "label {label}: {iou}");
    }
    assert!(labels.confidence.iter().all(|c| (0.0..=1.0).contains(c)));

    // Adding and taking away leaves nothing behind.
    let before = votes.clone();
    let map = vec![BOX; (room::SIZE.0 * room::SIZE.1) as usize];
    votes.add(&mut r, &room.scene, &views[0], &map).unwrap();
    assert_ne!(before, votes);
    votes.take(&mut r, &room.scene, &views[0], &map).unwrap();
    assert_eq!(before, votes);
    assert!(matches!(
        votes.add(&mut r, &room.scene, &views[0], &map[1..]),
        Err(SegmentError::Length { what: "label map", .. })
    ));
}

#[test]
fn locked_labels_neither_lose_nor_win_gaussians() {
    let room = room();
    let mut r = Reference::default();
    let mut votes = LabelVotes::new(room.cloud.len(), 4);
    let view = cameras(1)[0];
    // A view that calls everything a box.
    votes.add(&mut r, &room.scene, &view, &vec![BOX; (room::SIZE.0 * room::SIZE.1) as usize]).unwrap();
    let current = &room.labels;
    let locked = votes.assign(Some((current, &[BALL]))).unwrap();
    assert!(locked.label.iter().zip(current).all(|(a, b)| (*a == BALL) == (*b == BALL)));
    let locked = votes.assign(Some((current, &[BOX]))).unwrap();
    assert!(locked.label.iter().zip(current).all(|(a, b)| (*a == BOX) == (*b == BOX)));
    assert!(votes.assign(Some((&current[1..], &[BOX]))).is_err());
}
