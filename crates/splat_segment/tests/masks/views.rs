use splat_core::glam::Vec3;
use splat_core::{Mask2d, Selection};
use splat_segment::views::{
    Plan, PlanKind, TurnaroundSettings, ViewSets, chain, evenly_spaced, most_similar, ring_from, turnaround,
};
use splat_segment::{Run, SegmentError};

use crate::reference::Reference;
use crate::room::{self, BALL, Builder, camera, cameras, room};

#[test]
fn evenly_spaced_views_include_first_and_last() {
    assert_eq!(evenly_spaced(10, 4), [0, 3, 6, 9]);
    assert_eq!(evenly_spaced(5, 2), [0, 4]);
    assert_eq!(evenly_spaced(5, 1), [2]);
    assert_eq!(evenly_spaced(3, 50), [0, 1, 2]);
    assert_eq!(evenly_spaced(0, 5), [0; 0]);
    assert_eq!(evenly_spaced(5, 0), [0; 0]);
    for (n, m) in [(100, 7), (36, 35), (9, 8)] {
        let got = evenly_spaced(n, m);
        let slow: Vec<usize> = (0..m).map(|j| (j as f64 * (n - 1) as f64 / (m - 1) as f64).round() as usize).collect();
        assert_eq!(got, slow);
        assert!(got.windows(2).all(|w| w[0] < w[1]));
    }
}

#[test]
fn the_turnaround_circles_the_object_at_the_annotated_height_and_distance() {
    let room = room();
    let mut r = Reference::default();
    let view = camera(0.02, 1.2, 3.0, room::SIZE);
    let mask = room.mask(&mut r, &view, BALL);
    let settings = TurnaroundSettings { count: 12, fill: None, least_visible: 0.0 };
    let t = turnaround(&mut r, &room.scene, &view, &mask, &settings, &Run::new()).unwrap();
    assert_eq!((t.views.len(), t.dropped.len()), (12, 0));
    // One stands inside the box and is moved nearer; the others are on the circle.
    assert!(t.moved <= 1);
    assert!(t.center.distance(Vec3::new(-0.7, -0.52, 0.0)) < 0.5, "{}", t.center);
    assert!(t.radius > 0.2 && t.radius < 0.6, "{}", t.radius);
    let up = -view.pose.world_from_view.y_axis;
    let from_center = |v: &splat_core::View| v.pose.position - t.center;
    let plain = |v: &&splat_core::View| (from_center(v).length() - from_center(&view).length()).abs() < 1e-3;
    assert_eq!(t.views.iter().filter(plain).count(), 12 - t.moved);
    for v in t.views.iter().filter(plain) {
        assert!((from_center(v).dot(up) - from_center(&view).dot(up)).abs() < 1e-3);
        let (p, _) = v.project(t.center).unwrap();
        assert!((p.x - 40.0).abs() < 0.01 && (p.y - 30.0).abs() < 0.01, "looks at the centre");
        v.check().unwrap();
    }
    assert!(t.views[0].pose.position.distance(view.pose.position) < 1e-3);
    let opposite = (from_center(&t.views[6]) + from_center(&t.views[0])).reject_from_normalized(up);
    assert!(opposite.length() < 1e-3, "half way round is opposite");
}

#[test]
fn the_turnaround_comes_nearer_to_a_small_object() {
    let room = room();
    let mut r = Reference::default();
    let view = camera(0.0, 2.0, 9.0, room::SIZE);
    let mask = room.mask(&mut r, &view, BALL);
    let settings = TurnaroundSettings { count: 4, ..TurnaroundSettings::default() };
    let t = turnaround(&mut r, &room.scene, &view, &mask, &settings, &Run::new()).unwrap();
    for v in &t.views {
        let fill = 2.0 * v.intrinsics.fy * t.radius / v.pose.position.distance(t.center) / 60.0;
        assert!((0.39..0.75).contains(&fill), "{fill}");
    }
}

#[test]
fn views_in_which_the_object_is_hidden_are_moved_or_dropped() {
    let room = room();
    let mut r = Reference::default();
    // A wall around the back: views from there see nothing of the ball.
    let mut b = Builder::default();
    for i in 0..room.cloud.len() {
        let color = room.cloud.base_color(i);
        b.add(room.labels[i], room.cloud.means()[i], room.cloud.scale(i), room.cloud.rotation(i), 0.95, color);
    }
    for i in 0..60 {
        for k in 0..60 {
            let mean = Vec3::new(i as f32 * 0.3 - 9.0, 1.0 - k as f32 * 0.3, 1.2);
            b.add(9, mean, Vec3::new(0.25, 0.25, 0.02), Default::default(), 0.95, Vec3::splat(0.4));
        }
    }
    let walled = b.build();
    let view = camera(0.0, 0.6, 3.0, room::SIZE);
    let mask = room.mask(&mut r, &view, BALL);
    let settings = TurnaroundSettings { count: 8, fill: None, least_visible: 0.2 };
    let t = turnaround(&mut r, &walled.scene, &view, &mask, &settings, &Run::new()).unwrap();
    assert_eq!(t.views.len() + t.dropped.len(), 8);
    assert!(t.moved + t.dropped.len() >= 1, "{t:?}");
    assert!(t.dropped.iter().all(|d| d.visible < 0.2));
    for v in &t.views {
        assert!(v.pose.position.z < 1.2, "no camera behind the wall: {}", v.pose.position);
    }
}

#[test]
fn a_mask_over_nothing_makes_no_turnaround() {
    let room = room();
    let view = cameras(1)[0];
    let empty = Mask2d::empty(80, 60);
    let got =
        turnaround(&mut Reference::default(), &room.scene, &view, &empty, &TurnaroundSettings::default(), &Run::new());
    assert_eq!(got, Err(SegmentError::NothingUnderMask));
}

#[test]
fn the_most_similar_view_is_the_one_next_to_it() {
    let room = room();
    let mut r = Reference::default();
    let ring: Vec<_> = (0..12).map(|k| camera(k as f32 / 12.0, 1.5, 3.2, room::SIZE)).collect();
    let sets = ViewSets::draw(&mut r, &room.scene, ring.iter(), 320, &Run::new()).unwrap();
    let asked = [camera(4.2 / 12.0, 1.5, 3.2, room::SIZE), camera(9.9 / 12.0, 1.5, 3.2, room::SIZE)];
    let asked = ViewSets::draw(&mut r, &room.scene, asked.iter(), 320, &Run::new()).unwrap();
    assert_eq!(most_similar(&asked.sets[0], &sets.sets), Some(4));
    let plan = Plan::new(PlanKind::Ring, &sets, &asked.sets);
    assert_eq!(plan.order, ring_from(4, 12));
    assert_eq!(plan.before, [0, 6], "view 10 is the sixth after view 4");

    // Shuffled, a chain finds the way round again: every step goes to a neighbour on the ring.
    let shuffled: Vec<usize> = vec![5, 0, 9, 2, 11, 4, 7, 1, 10, 3, 8, 6];
    let mixed = ViewSets { sets: shuffled.iter().map(|&k| sets.sets[k].clone()).collect() };
    let plan = Plan::new(PlanKind::Unordered, &mixed, &asked.sets);
    let path: Vec<usize> = plan.order.iter().map(|&k| shuffled[k]).collect();
    let mut sorted = path.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, (0..12).collect::<Vec<_>>());
    let jumps = path.windows(2).filter(|w| (w[0] + 12 - w[1]) % 12 != 1 && (w[1] + 12 - w[0]) % 12 != 1).count();
    assert!(jumps <= 1, "{path:?}");
}

#[test]
fn plans_of_nothing_are_empty() {
    assert_eq!(most_similar(&Selection::none(5), &[]), None);
    assert!(chain(&ViewSets::default(), 0).is_empty());
    assert_eq!(Plan::new(PlanKind::Ring, &ViewSets::default(), &[Selection::none(3)]).before, [0]);
    let none = ViewSets { sets: vec![Selection::none(3); 3] };
    assert_eq!(Plan::new(PlanKind::Unordered, &none, &[]).order.len(), 3);
}
