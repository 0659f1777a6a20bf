//! What messages select.

use bevy::prelude::*;
use bevy_splat::prelude::*;
use bevy_splat::select::SelectError;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::project::{Lift, lift};

use crate::harness::{BEAR, ROOM, Stage};

fn every(step: usize) -> Selection {
    Selection::from_fn(ROOM.cloud.len(), |i| i.is_multiple_of(step))
}

const MODES: [SelectMode; 4] = [SelectMode::New, SelectMode::Add, SelectMode::Subtract, SelectMode::Intersect];

#[test]
fn modes_combine_and_the_delta_leads_back() {
    let mut stage = Stage::new();
    for mode in MODES {
        stage.select(SelectMode::New, SelectBy::Set(every(2)));
        stage.forget::<SelectionChanged>();
        stage.select(mode, SelectBy::Set(every(3)));
        let mut expected = every(2);
        expected.apply(mode, &every(3));
        assert_eq!(stage.selection(), expected, "{mode:?}");
        let change = stage.all::<SelectionChanged>().pop().unwrap();
        assert_eq!((change.entity, change.before, change.after), (stage.capture, every(2).count(), expected.count()));
        change.delta.apply(&mut expected);
        assert_eq!(expected, every(2));
    }
}

#[test]
fn hidden_and_locked_gaussians_and_those_of_others_are_never_added() {
    let mut stage = Stage::new();
    let capture = stage.capture;
    let len = ROOM.cloud.len();
    let mut flags = stage.app.world_mut().get_mut::<SplatFlags>(capture).unwrap();
    flags.hide(&every(5));
    flags.lock(&every(7));
    let ids: Vec<u32> = (0..len as u32).filter(|id| id % 11 != 0).collect();
    stage.app.world_mut().entity_mut(capture).insert(SplatSubset(ids.into()));
    stage.select(SelectMode::New, SelectBy::All);
    let free = |i: usize| [5, 7, 11].into_iter().all(|n| !i.is_multiple_of(n));
    assert_eq!(stage.selection(), Selection::from_fn(len, free));
    stage.select(SelectMode::Subtract, SelectBy::Set(every(2)));
    stage.select(SelectMode::New, SelectBy::Inverse);
    assert_eq!(stage.selection(), Selection::from_fn(len, |i| free(i) && i % 2 == 0));
    stage.select(SelectMode::New, SelectBy::Nothing);
    assert_eq!(stage.selection().count(), 0);
}

#[test]
fn a_request_that_changes_nothing_says_nothing_and_one_that_cannot_be_says_why() {
    let mut stage = Stage::new();
    let capture = stage.capture;
    stage.select(SelectMode::Add, SelectBy::Nothing);
    assert!(stage.all::<SelectionChanged>().is_empty() && stage.app.world().get::<SplatSelection>(capture).is_none());
    stage.select(SelectMode::New, SelectBy::Set(every(9)));
    let before = stage.selection();
    let shape = Shape2d::Rect(Vec2::ZERO, Vec2::ONE);
    let wrong = [
        (SelectBy::Set(Selection::all(3)), SelectError::Length { expected: ROOM.cloud.len(), found: 3 }),
        (SelectBy::Part(PartId(4)), SelectError::UnknownPart { entity: capture, part: PartId(4) }),
        (SelectBy::Surface { camera: capture, shape }, SelectError::NoView(capture)),
    ];
    for (by, reason) in wrong {
        stage.forget::<SelectFailed>();
        stage.select(SelectMode::New, by);
        assert_eq!(stage.all::<SelectFailed>(), [SelectFailed { entity: capture, reason }]);
    }
    assert_eq!(stage.selection(), before);
    stage.forget::<SelectFailed>();
    let entity = stage.camera;
    stage.app.world_mut().write_message(SelectRequest { entity, mode: SelectMode::New, by: SelectBy::All });
    stage.app.update();
    assert_eq!(stage.all::<SelectFailed>()[0].reason, SelectError::NotSplats(entity));
}

#[test]
fn shapes_on_the_picture_select_what_the_projection_lifts() {
    let mut stage = Stage::new();
    let (camera, view, scene) = (stage.camera, stage.view(), stage.scene());
    let shape = Shape2d::Stroke { points: vec![BEAR, BEAR + Vec2::new(30.0, 10.0)], radius: 20.0 };
    let (footprint, tolerance) = (Footprint::Ellipse, DepthTolerance::default());
    let cases = [
        (SelectBy::Frustum { camera, shape: shape.clone(), footprint }, Lift::Frustum(footprint)),
        (SelectBy::Depth { camera, shape: shape.clone(), footprint, tolerance }, Lift::Depth(footprint, tolerance)),
        (SelectBy::Surface { camera, shape: shape.clone() }, Lift::Surface(0.5)),
    ];
    let mask = shape.mask(view.width, view.height);
    let mut counts = Vec::new();
    for (by, how) in cases {
        stage.select(SelectMode::New, by);
        let expected = lift(&mut CpuRasterizer::new(), &scene, &view, &mask, how).unwrap();
        assert_eq!(stage.selection(), expected, "{how:?}");
        counts.push(expected.count());
    }
    assert!(counts[0] > counts[1] && counts[1] > counts[2] && counts[2] > 0, "{counts:?}");
}

#[test]
fn what_another_capture_hides_is_not_at_the_seen_depth() {
    let mut stage = Stage::new();
    let camera = stage.camera;
    let by = SelectBy::Surface { camera, shape: Shape2d::Rect(BEAR - 15.0, BEAR + 15.0) };
    stage.select(SelectMode::New, by.clone());
    let alone = stage.selection();
    let towards = -0.6 * stage.view().forward();
    let curtain = stage.splats(UPRIGHT.with_translation(towards));
    stage.select(SelectMode::New, by);
    assert!(stage.selection().count() < alone.count());
    assert!(stage.app.world().get::<SplatSelection>(curtain).is_none());
}

#[test]
fn parts_and_likeness_select_as_the_core_does() {
    let mut stage = Stage::new();
    let (capture, len) = (stage.capture, ROOM.cloud.len());
    let parts = Parts::from_labels((0..len).map(|i| (i % 3) as u16).collect());
    stage.app.world_mut().entity_mut(capture).insert(SplatParts(parts.clone()));
    stage.select(SelectMode::New, SelectBy::Part(PartId(2)));
    assert_eq!(stage.selection(), parts.selection_of(PartId(2), default()));
    let seed = Selection::from_ids(len, [5, 77, 1234]);
    stage.select(SelectMode::New, SelectBy::Set(seed.clone()));
    let likeness = Likeness::default();
    stage.select(SelectMode::Add, SelectBy::Similar(likeness));
    assert_eq!(stage.selection(), splat_core::similar(&ROOM.cloud, &seed, &likeness));
    let criterion = Criterion::Opacity(0.2..=0.8);
    stage.select(SelectMode::New, SelectBy::Criterion(criterion.clone()));
    assert_eq!(stage.selection(), criterion.select(&ROOM.cloud));
}

#[test]
fn parts_are_made_of_what_is_selected_or_not_at_all() {
    let mut stage = Stage::new();
    let capture = stage.capture;
    let make =
        |stage: &mut Stage, entity, name: &str| bevy_splat::select::make_part(stage.app.world_mut(), entity, name);
    assert!(make(&mut stage, capture, "nothing").is_err());
    assert!(stage.app.world().get::<SplatParts>(capture).is_none());
    stage.select(SelectMode::New, SelectBy::Set(every(4)));
    let chair = make(&mut stage, capture, "chair").unwrap();
    stage.app.world_mut().get_mut::<SplatParts>(capture).unwrap().lock(chair).unwrap();
    let before = stage.app.world().get::<SplatParts>(capture).unwrap().clone();
    stage.select(SelectMode::New, SelectBy::Set(every(8)));
    assert!(make(&mut stage, capture, "seat").is_err(), "all of it is the locked chair's");
    assert_eq!(stage.app.world().get::<SplatParts>(capture), Some(&before));
    stage.app.world_mut().get_mut::<SplatParts>(capture).unwrap().unlock(chair).unwrap();

    // What is selected of a part's own entity becomes a part below it, in the capture's table.
    let out = bevy_splat::parts::extract_part(stage.app.world_mut(), capture, chair).unwrap();
    stage.app.world_mut().entity_mut(out).insert(SplatSelection(every(8)));
    let seat = make(&mut stage, out, "seat").unwrap();
    let parts = stage.app.world().get::<SplatParts>(capture).unwrap();
    assert_eq!(parts.get(seat).unwrap().parent(), Some(chair));
    assert_eq!(parts.selection_of(seat, default()), every(8));
    assert!(stage.app.world().get::<SplatParts>(out).is_none());
}
