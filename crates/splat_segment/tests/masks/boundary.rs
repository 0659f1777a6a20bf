use std::sync::Arc;

use splat_core::glam::{Quat, Vec3};
use splat_core::{Mask2d, Selection, View};
use splat_raster::{Instance, Rasterizer, Scene};
use splat_segment::aggregations::MaskedView;
use splat_segment::boundary::{Boundary, Extraction, Halo, StraddleSettings, extract, halo, silhouettes};
use splat_segment::{Run, SegmentError};

use crate::reference::Reference;
use crate::room::{Builder, Room, Seed};

/// A red slab beside a green one, and long Gaussians of either colour that reach over the border at x = 0.
struct Slabs {
    room: Room,
    selection: Selection,
    views: Vec<View>,
    masks: Vec<Mask2d>,
}

fn slabs() -> Slabs {
    let mut b = Builder::default();
    let mut seed = Seed(21);
    let (red, green) = (Vec3::new(0.8, 0.2, 0.2), Vec3::new(0.2, 0.7, 0.2));
    for i in 0..24 {
        for k in 0..16 {
            let (x, z) = ((i as f32 - 11.5) * 0.08, (k as f32 - 7.5) * 0.08);
            let scale = Vec3::new(0.045, 0.01, 0.045);
            let (label, color) = if x > 0.0 { (1, red) } else { (0, green) };
            b.add(label, Vec3::new(x, 0.0, z), scale, Quat::IDENTITY, 0.9, color);
        }
    }
    for k in 0..30 {
        let z = (k as f32 - 14.5) * 0.04;
        let (label, color, side) = if k % 2 == 0 { (1, red, 1.0) } else { (0, green, -1.0) };
        let scale = Vec3::new(0.16, 0.008, 0.02);
        let turn = Quat::from_rotation_y(0.3 * (seed.unit() - 0.5));
        b.add(label, Vec3::new(0.1 * side, -0.02, z), scale, turn, 0.85, color);
    }
    let room = b.build();
    let selection = room.object(1);
    let views: Vec<View> = (0..10)
        .map(|k| {
            let angle = k as f32 * 0.628;
            let eye = Vec3::new(angle.sin(), -1.6, -angle.cos());
            View::perspective(splat_core::Pose::look_at(eye, Vec3::ZERO, -Vec3::Y), 0.9, 120, 90)
        })
        .collect();
    // The border is known here: what of the plane y = 0 lies at x > 0 (and on the slab).
    let masks = views
        .iter()
        .map(|v| {
            Mask2d::from_fn(v.width, v.height, |x, y| {
                let far = v.unproject(splat_core::glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5), 1.0);
                let d = far - v.pose.position;
                let hit = v.pose.position - d * (v.pose.position.y / d.y);
                hit.x > 0.0 && hit.x < 1.02 && hit.z.abs() < 0.7
            })
        })
        .collect();
    Slabs { room, selection, views, masks }
}

impl Slabs {
    fn masked(&self) -> Vec<MaskedView<'_>> {
        self.views.iter().zip(&self.masks).map(|(v, m)| MaskedView::new(v, m)).collect()
    }

    fn extract(&self, boundary: Boundary) -> Extraction {
        let settings = StraddleSettings::default();
        extract(
            &mut Reference::default(),
            &self.room.cloud,
            &self.selection,
            &self.masked(),
            boundary,
            &settings,
            &Run::new(),
        )
        .unwrap()
    }

    fn halo(&self, e: &Extraction) -> Halo {
        halo(&mut Reference::default(), &Arc::new(e.object.clone()), &self.masked(), 0.2).unwrap()
    }

    /// Peak signal to noise of object and rest drawn together against the input, in dB, and largest error of a channel.
    fn likeness(&self, e: &Extraction) -> (f64, f32) {
        let both = Scene {
            instances: vec![Instance::new(Arc::new(e.object.clone())), Instance::new(Arc::new(e.rest.clone()))],
        };
        let (mut sum, mut count, mut largest) = (0.0f64, 0, 0.0f32);
        for v in &self.views {
            let mut r = Reference::default();
            let (a, b) = (r.render(&both, v).unwrap(), r.render(&self.room.scene, v).unwrap());
            for (a, b) in a.iter().zip(&b) {
                for c in 0..3 {
                    let d = a[c] - b[c];
                    largest = largest.max(d.abs());
                    sum += f64::from(d * d);
                    count += 1;
                }
            }
        }
        (-10.0 * (sum / f64::from(count)).max(1e-12).log10(), largest)
    }
}

#[test]
fn long_gaussians_over_the_border_are_found() {
    let s = slabs();
    let e = s.extract(Boundary::Keep);
    // The long ones are the last 30; every one of them reaches over.
    let settings = StraddleSettings::default();
    let found = splat_segment::boundary::straddlers(
        &mut Reference::default(),
        &s.room.scene,
        &s.room.cloud,
        &s.selection,
        &s.masked(),
        &settings,
        &Run::new(),
    )
    .unwrap();
    let first = s.room.cloud.len() as u32 - 30;
    let long = found.iter().filter(|f| f.id >= first && f.cut.is_some_and(|c| c.axis == 0)).count();
    assert!(long >= 27, "{long} of 30");
    assert_eq!(e.report.straddling, found.len());
    // Of the small ones only those next to the border.
    for f in found.iter().filter(|f| f.id < first && f.cut.is_some()) {
        let x = s.room.cloud.means()[f.id as usize].x;
        let z = s.room.cloud.means()[f.id as usize].z.abs();
        assert!(x.abs() < 0.13 || x > 0.8 || z > 0.5, "{f:?} at {x}");
    }
}

#[test]
fn keeping_changes_nothing() {
    let s = slabs();
    let e = s.extract(Boundary::Keep);
    assert_eq!(e.object, s.room.cloud.pick(&s.selection.ids()));
    assert_eq!(e.object_from, s.selection.ids());
    assert_eq!(e.object.len() + e.rest.len(), s.room.cloud.len());
    assert_eq!(e.report.cut_selected + e.report.cut_rest + e.report.pieces_object, 0);
}

#[test]
fn splitting_shrinks_the_halo_and_both_together_still_look_like_the_input() {
    let s = slabs();
    let keep = s.halo(&s.extract(Boundary::Keep));
    let trimmed = s.extract(Boundary::Trim);
    let trim = s.halo(&trimmed);
    println!("keep  {keep:?}\ntrim  {trim:?} likeness {:?} {:?}", s.likeness(&trimmed), trimmed.report);
    for pieces in [2, 4, 8] {
        let e = s.extract(Boundary::Split { pieces });
        let split = s.halo(&e);
        let (db, largest) = s.likeness(&e);
        println!("split {pieces} {split:?} {db:.1} dB, largest {largest:.3} {:?}", e.report);
        assert!(split.opacity < (if pieces == 2 { 0.7 } else { 0.55 }) * keep.opacity, "{pieces}: {split:?} {keep:?}");
        assert!(db > 30.0, "{pieces}: {db}");
        // Every piece knows where it came from, and colours are the parents'.
        assert_eq!(e.object.len(), e.object_from.len());
        assert_eq!(e.rest.len(), e.rest_from.len());
        for (k, &id) in e.object_from.iter().enumerate() {
            assert_eq!(e.object.sh_of(k), s.room.cloud.sh_of(id as usize));
        }
        assert!(e.object_from.windows(2).all(|w| w[0] <= w[1]));
        assert!(e.report.cut_selected > 0 && e.report.cut_rest > 0 && e.report.pieces_rest > 0);
    }
    assert!(trim.opacity < 0.6 * keep.opacity, "{trim:?} {keep:?}");
    assert!(trimmed.object.len() + trimmed.rest.len() == s.room.cloud.len());
}

#[test]
fn without_masks_nothing_is_known_of_the_edge() {
    let s = slabs();
    let settings = StraddleSettings::default();
    let mut r = Reference::default();
    let e = extract(&mut r, &s.room.cloud, &s.selection, &[], Boundary::SPLIT, &settings, &Run::new()).unwrap();
    assert_eq!(e.report, Default::default());
    let wrong = Selection::none(3);
    let got = extract(&mut r, &s.room.cloud, &wrong, &[], Boundary::SPLIT, &settings, &Run::new());
    assert!(matches!(got, Err(SegmentError::Length { what: "selection", .. })));
}

#[test]
fn silhouettes_of_the_selection_serve_where_there_are_no_masks() {
    let s = slabs();
    let mut r = Reference::default();
    let own = silhouettes(&mut r, &s.room.scene, &s.selection, &s.views, &Run::new()).unwrap();
    for (a, b) in own.iter().zip(&s.masks) {
        let same = a.values().iter().zip(b.values()).filter(|(x, y)| x == y).count();
        assert!(same as f64 > 0.93 * a.values().len() as f64);
    }
    let masked: Vec<MaskedView<'_>> = s.views.iter().zip(&own).map(|(v, m)| MaskedView::new(v, m)).collect();
    let e = extract(&mut r, &s.room.cloud, &s.selection, &masked, Boundary::SPLIT, &Default::default(), &Run::new())
        .unwrap();
    assert!(e.report.cut_selected > 0);
    assert!(s.halo(&e).opacity < s.halo(&s.extract(Boundary::Keep)).opacity);
}
