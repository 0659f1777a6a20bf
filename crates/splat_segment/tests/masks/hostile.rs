//! Empty clouds, one Gaussian, numbers that are none, giants.

use splat_core::glam::{Quat, Vec3};
use splat_core::{Mask2d, View};
use splat_segment::aggregations::{AGGREGATIONS, MaskedView};
use splat_segment::boundary::{Boundary, extract};
use splat_segment::project::{DepthTolerance, Footprint, Lift, lift};
use splat_segment::trackers::TRACKERS;
use splat_segment::{Occlusion, Run, SegmentSettings, Segmentation};

use crate::reference::Reference;
use crate::room::{Builder, Room, camera, room};

const LIFTS: [Lift; 6] = [
    Lift::Frustum(Footprint::Center),
    Lift::Frustum(Footprint::Ellipse),
    Lift::Frustum(Footprint::Weight(0.5)),
    Lift::Depth(Footprint::Center, DepthTolerance { factor: 2.0, floor: 0.005 }),
    Lift::Depth(Footprint::Ellipse, DepthTolerance { factor: 2.0, floor: 0.005 }),
    Lift::Surface(0.5),
];

fn whole_road(room: &Room, view: View, mask: &Mask2d) {
    let mut r = Reference::default();
    let n = room.cloud.len();
    for how in LIFTS {
        assert_eq!(lift(&mut r, &room.scene, &view, mask, how).unwrap().len(), n);
    }
    let mut s = Segmentation::new(room.scene.clone(), SegmentSettings::default());
    s.set_views(vec![view, camera(0.4, 1.0, 3.0, (view.width, view.height))]);
    s.annotate(view, mask.clone(), Occlusion::Unoccluded).unwrap();
    s.track(TRACKERS[0], &mut r, &Run::new()).unwrap();
    let got = s.result(&mut r, &Run::new()).unwrap();
    assert_eq!((got.selection.len(), got.score.len()), (n, n));
    for rule in AGGREGATIONS {
        let got = s.result_by(*rule, &mut r, &Run::new()).unwrap();
        assert!(got.score.iter().all(|s| s.is_finite()), "{}", rule.name());
    }
    let masked = [MaskedView::new(&view, mask)];
    for boundary in [Boundary::Keep, Boundary::SPLIT, Boundary::Trim] {
        let e =
            extract(&mut r, &room.cloud, &got.selection, &masked, boundary, &Default::default(), &Run::new()).unwrap();
        assert!(e.object.len() + e.rest.len() >= n);
    }
}

#[test]
fn an_empty_cloud_and_a_single_gaussian_go_the_whole_road() {
    let view = camera(0.0, 1.0, 3.0, (16, 12));
    let half = Mask2d::from_fn(16, 12, |x, _| x < 8);
    whole_road(&Builder::default().build(), view, &half);
    let mut b = Builder::default();
    b.add(1, Vec3::new(0.0, -0.4, 0.0), Vec3::splat(0.3), Quat::IDENTITY, 0.9, Vec3::ONE);
    let one = b.build();
    whole_road(&one, view, &half);
    whole_road(&one, view, &Mask2d::empty(16, 12));
    whole_road(&one, view, &Mask2d::from_fn(16, 12, |_, _| true));
    let tiny = camera(0.0, 1.0, 3.0, (1, 1));
    whole_road(&one, tiny, &Mask2d::from_fn(1, 1, |_, _| true));
}

#[test]
fn numbers_that_are_none_and_giants_do_no_harm() {
    let room = room();
    let mut b = Builder::default();
    let (one, color) = (Vec3::splat(0.1), Vec3::splat(0.5));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
        b.add(0, Vec3::new(bad, 0.0, 0.0), one, Quat::IDENTITY, 0.9, color);
        b.add(0, Vec3::ZERO, Vec3::new(bad, 0.1, 0.1), Quat::IDENTITY, 0.9, color);
        b.add(0, Vec3::ZERO, one, Quat::from_xyzw(bad, 0.0, 0.0, 1.0), 0.9, color);
        b.add(0, Vec3::ZERO, one, Quat::IDENTITY, bad, color);
    }
    b.add(0, Vec3::ZERO, Vec3::ZERO, Quat::IDENTITY, 0.9, color);
    b.add(0, Vec3::ZERO, one, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), 0.9, color);
    b.add(0, Vec3::new(0.0, 0.0, 5.0), Vec3::splat(1e6), Quat::IDENTITY, 0.2, color);
    for i in 0..room.cloud.len() {
        let color = room.cloud.base_color(i);
        b.add(room.labels[i], room.cloud.means()[i], room.cloud.scale(i), room.cloud.rotation(i), 0.9, color);
    }
    let view = camera(0.1, 1.0, 3.0, (32, 24));
    whole_road(&b.build(), view, &Mask2d::from_fn(32, 24, |x, y| x > 8 && x < 20 && y > 6));
}
