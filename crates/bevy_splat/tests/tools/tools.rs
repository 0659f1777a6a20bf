//! What gestures select.

use bevy::picking::pointer::{PointerAction, PointerButton, PointerId};
use bevy::prelude::*;
use bevy_splat::prelude::*;
use bevy_splat::tools::{Brush, Lasso, Rectangle};
use splat_raster::cpu::CpuRasterizer;
use splat_segment::project::{Lift, lift};

use crate::harness::{BEAR, ROOM, Stage};

/// A loop around the bear.
fn around(center: Vec2) -> Vec<Vec2> {
    (0..12).map(|k| center + 40.0 * Vec2::from_angle(k as f32 * 0.5) * Vec2::new(1.0, 1.2)).collect()
}

/// What a shape means, by the engine-free road.
fn meant(stage: &Stage, mask: &Mask2d, how: Lift) -> Selection {
    lift(&mut CpuRasterizer::new(), &stage.scene(), &stage.view(), mask, how).unwrap()
}

fn polygon(stage: &Stage, points: &[Vec2]) -> Mask2d {
    let view = stage.view();
    Mask2d::polygon(view.width, view.height, points)
}

fn press(stage: &mut Stage, keys: &[KeyCode]) {
    let mut input = stage.app.world_mut().resource_mut::<ButtonInput<KeyCode>>();
    input.reset_all();
    keys.iter().for_each(|key| input.press(*key));
}

#[test]
fn a_lasso_selects_what_its_polygon_lifts_in_four_modes() {
    let mut stage = Stage::new();
    stage.app.insert_resource(ActiveTool::of::<Lasso>());
    let (first, second) = (around(BEAR), around(BEAR + Vec2::new(35.0, -10.0)));
    let how = Lift::Frustum(Footprint::Center);
    let (a, b) = (polygon(&stage, &first), polygon(&stage, &second));
    let (a, b) = (meant(&stage, &a, how), meant(&stage, &b, how));
    assert!(a.count() > 100 && b.count() > 100);
    let keys = [
        (SelectMode::New, vec![]),
        (SelectMode::Add, vec![KeyCode::ShiftLeft]),
        (SelectMode::Subtract, vec![KeyCode::ControlRight]),
        (SelectMode::Intersect, vec![KeyCode::ShiftRight, KeyCode::ControlLeft]),
    ];
    for (mode, keys) in keys {
        press(&mut stage, &[]);
        stage.drag(PointerId::Mouse, &first);
        assert_eq!(stage.selection(), a);
        press(&mut stage, &keys);
        stage.drag(PointerId::Mouse, &second);
        let mut expected = a.clone();
        expected.apply(mode, &b);
        assert_eq!(stage.selection(), expected, "{mode:?}");
    }
}

#[test]
fn keys_give_way_to_the_mode_that_was_set() {
    let mut stage = Stage::new();
    stage.app.insert_resource(ToolMode(SelectMode::Add));
    for (keys, mode) in [(vec![KeyCode::ControlLeft], SelectMode::Subtract), (vec![], SelectMode::Add)] {
        press(&mut stage, &keys);
        stage.app.update();
        assert_eq!(stage.app.world().resource::<ToolMode>().0, mode);
    }
}

#[test]
fn a_finger_draws_as_the_mouse_does_and_other_pointers_wait() {
    let mut stage = Stage::new();
    stage.app.insert_resource(ActiveTool::of::<Rectangle>());
    let finger = PointerId::Touch(7);
    stage.app.world_mut().spawn(finger);
    let (from, to) = (BEAR - 30.0, BEAR + Vec2::new(20.0, 40.0));
    stage.pointer(finger, from, PointerAction::Press(PointerButton::Primary));
    stage.click(BEAR + 60.0);
    stage.pointer(finger, to, PointerAction::Move { delta: Vec2::ONE });
    let gesture = stage.app.world().resource::<Gesture>().0.clone().unwrap();
    assert_eq!((gesture.pointer, gesture.camera, &*gesture.tool), (finger, stage.camera, "rectangle"));
    assert_eq!(gesture.shape, Some(Shape2d::Rect(from, to)));
    assert_eq!(gesture.shape.unwrap().outline().len(), 4);
    stage.pointer(finger, to, PointerAction::Release(PointerButton::Primary));
    let mask = Mask2d::from_fn(400, 300, |x, y| {
        let p = Vec2::new(x as f32, y as f32) + 0.5;
        p.cmpge(from).all() && p.cmplt(to).all()
    });
    assert_eq!(stage.selection(), meant(&stage, &mask, Lift::Frustum(Footprint::Center)));
    assert_eq!(stage.app.world().resource::<Gesture>().0, None);
}

#[test]
fn a_brush_paints_the_surface_also_over_the_edge_of_the_picture() {
    let mut stage = Stage::new();
    stage.app.insert_resource(ActiveTool::of::<Brush>());
    let mut settings = stage.app.world_mut().resource_mut::<ToolSettings>();
    (settings.brush_radius, settings.projection) = (15.0, ToolProjection::Surface);
    let points = [BEAR, Vec2::new(395.0, 290.0), Vec2::new(430.0, 320.0)];
    stage.drag(PointerId::Mouse, &points);
    let mask = Mask2d::stroke(400, 300, &points, 15.0);
    let painted = meant(&stage, &mask, Lift::Surface(0.5));
    assert_eq!(stage.selection(), painted);
    assert!(painted.count() > 50);
}

#[test]
fn what_is_cancelled_or_is_no_shape_selects_nothing() {
    let mut stage = Stage::new();
    stage.drag(PointerId::Mouse, &around(BEAR));
    assert_eq!(stage.selection().count(), 0, "no tool is active");
    stage.app.insert_resource(ActiveTool::of::<Lasso>());
    let points = around(BEAR);
    let begin = |stage: &mut Stage| {
        stage.pointer(PointerId::Mouse, points[0], PointerAction::Press(PointerButton::Primary));
        for &at in &points[1..] {
            stage.pointer(PointerId::Mouse, at, PointerAction::Move { delta: Vec2::ONE });
        }
        assert!(stage.app.world().resource::<Gesture>().0.is_some());
    };
    let end = |stage: &mut Stage, what: &str| {
        stage.pointer(PointerId::Mouse, points[0], PointerAction::Release(PointerButton::Primary));
        assert_eq!(stage.app.world().resource::<Gesture>().0, None, "{what}");
        assert_eq!(stage.selection().count(), 0, "{what}");
    };
    begin(&mut stage);
    press(&mut stage, &[KeyCode::Escape]);
    end(&mut stage, "Escape");
    press(&mut stage, &[]);
    begin(&mut stage);
    stage.app.world_mut().write_message(CancelGesture);
    end(&mut stage, "a message");
    begin(&mut stage);
    stage.pointer(PointerId::Mouse, points[0], PointerAction::Cancel);
    end(&mut stage, "the pointer's own cancel");
    begin(&mut stage);
    stage.app.insert_resource(ActiveTool::of::<Brush>());
    end(&mut stage, "another tool");
    stage.app.insert_resource(ActiveTool::of::<Lasso>());
    stage.drag(PointerId::Mouse, &[BEAR]);
    assert_eq!(stage.selection().count(), 0, "a press is no lasso");
    stage.drag(PointerId::Mouse, &[Vec2::new(-20.0, 40.0), BEAR, BEAR + 40.0]);
    assert_eq!(stage.selection().count(), 0, "it began outside");
    stage.drag(PointerId::Mouse, &around(BEAR));
    assert!(stage.selection().count() > 0);
}

#[test]
fn a_gesture_is_for_all_captures_in_view_or_for_those_that_are_named() {
    let mut stage = Stage::new();
    stage.app.insert_resource(ActiveTool::of::<Lasso>());
    let other = stage.splats(UPRIGHT);
    stage.app.update();
    stage.drag(PointerId::Mouse, &around(BEAR));
    let all = stage.selection();
    assert!(all.count() > 0);
    assert_eq!(stage.app.world().get::<SplatSelection>(other).map(|s| &s.0), Some(&all));
    let before = stage.selection();
    stage.app.world_mut().resource_mut::<ToolSettings>().targets = ToolTargets::These(vec![other]);
    stage.drag(PointerId::Mouse, &around(BEAR + 50.0));
    assert_eq!(stage.selection(), before);
    assert_ne!(stage.app.world().get::<SplatSelection>(other).unwrap().0, before);
    assert_eq!(ROOM.cloud.len(), before.len());
}
