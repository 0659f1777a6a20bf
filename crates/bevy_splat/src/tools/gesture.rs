//! [`Gesture`]: from the press of a pointer to its release.

use std::borrow::Cow;

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Camera, Camera3d, RenderTarget};
use bevy::picking::backend::ray::{RayId, RayMap};
use bevy::picking::pointer::{Location, PointerAction, PointerId, PointerInput};
use bevy::prelude::*;
use splat_core::SelectMode;

use super::{ActiveTool, SplatToolTable, ToolMode, ToolProjection, ToolSettings, ToolTargets};
use crate::placed::PlacedSplats;
use crate::render::view_pixel;
use crate::select::{SelectBy, SelectRequest, Shape2d};

/// What is being drawn now, if anything: to be shown as a line, for instance.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct Gesture(pub Option<GestureInProgress>);

/// A press that was not yet released.
#[derive(Clone, Debug, PartialEq)]
pub struct GestureInProgress {
    /// The tool's name.
    pub tool: Cow<'static, str>,
    /// The camera whose picture is drawn on.
    pub camera: Entity,
    /// The pointer; others are not heard meanwhile.
    pub pointer: PointerId,
    /// How its set will combine with what is selected: the mode at the press.
    pub mode: SelectMode,
    /// Where the pointer was, in physical pixels of the camera's viewport.
    pub points: Vec<Vec2>,
    /// What the tool makes of them, in the same pixels; see [`Shape2d::outline`].
    pub shape: Option<Shape2d>,
    target: bevy::camera::NormalizedRenderTarget,
}

/// Ends the gesture in progress without a selection.
#[derive(Message, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CancelGesture;

type Eye<'a> = (Entity, &'a Camera, &'a RenderTarget, Option<&'a RenderLayers>);

#[expect(clippy::too_many_arguments, reason = "each is one thing that a gesture depends on")]
pub(super) fn follow(
    mut gesture: ResMut<Gesture>,
    mut inputs: MessageReader<PointerInput>,
    mut cancels: MessageReader<CancelGesture>,
    (active, mode, settings, table): (Res<ActiveTool>, Res<ToolMode>, Res<ToolSettings>, Res<SplatToolTable>),
    rays: Option<Res<RayMap>>,
    cameras: Query<Eye, With<Camera3d>>,
    splats: PlacedSplats,
    mut requests: MessageWriter<SelectRequest>,
) {
    // A camera that is gone, or another tool, ends what was begun.
    let stale = |g: &GestureInProgress| !cameras.contains(g.camera) || active.0.as_ref() != Some(&g.tool);
    let cancelled = cancels.read().count() > 0;
    if gesture.0.as_ref().is_some_and(|g| cancelled || stale(g)) {
        gesture.0 = None;
    }
    for input in inputs.read() {
        match input.action {
            PointerAction::Press(button) if button == settings.button && gesture.0.is_none() => {
                let Some(tool) = active.0.clone().filter(|name| table.get(name).is_some()) else { continue };
                let Some(camera) = camera_under(input, &cameras, rays.as_deref()) else { continue };
                gesture.0 = Some(GestureInProgress {
                    tool,
                    camera,
                    pointer: input.pointer_id,
                    mode: mode.0,
                    points: Vec::new(),
                    shape: None,
                    target: input.location.target.clone(),
                });
                extend(&mut gesture, &input.location, &cameras, &table, &settings);
            }
            _ if gesture.0.as_ref().is_none_or(|g| g.pointer != input.pointer_id) => {}
            PointerAction::Move { .. } => extend(&mut gesture, &input.location, &cameras, &table, &settings),
            PointerAction::Cancel => gesture.0 = None,
            PointerAction::Release(button) if button == settings.button => {
                extend(&mut gesture, &input.location, &cameras, &table, &settings);
                if let Some(done) = gesture.0.take() {
                    finish(&done, &settings, &cameras, &splats, &mut requests);
                }
            }
            _ => {}
        }
    }
}

/// The camera on top whose viewport the press is in.
fn camera_under(input: &PointerInput, cameras: &Query<Eye, With<Camera3d>>, rays: Option<&RayMap>) -> Option<Entity> {
    let under = |(entity, camera, target, _): &Eye| {
        // Bevy knows which window is the primary one, and makes rays for it.
        let ray = rays.is_some_and(|rays| rays.map.contains_key(&RayId::new(*entity, input.pointer_id)));
        let here = target.normalize(None).as_ref() == Some(&input.location.target) || ray;
        let inside = camera.logical_viewport_rect().is_some_and(|rect| rect.contains(input.location.position));
        camera.is_active && here && inside
    };
    let top = cameras.iter().filter(under).max_by_key(|(entity, camera, ..)| (camera.order, *entity));
    top.map(|(entity, ..)| entity)
}

/// Adds where the pointer is now.
fn extend(
    gesture: &mut ResMut<Gesture>,
    location: &Location,
    cameras: &Query<Eye, With<Camera3d>>,
    table: &SplatToolTable,
    settings: &ToolSettings,
) {
    let Some(g) = &mut gesture.0 else { return };
    let Ok((_, camera, ..)) = cameras.get(g.camera) else { return };
    if location.target != g.target {
        return;
    }
    let pixel = view_pixel(camera, location.position).filter(|pixel| pixel.is_finite());
    if let Some(pixel) = pixel.filter(|pixel| g.points.last() != Some(pixel)) {
        g.points.push(pixel);
        g.shape = table.get(&g.tool).and_then(|tool| tool.shape(&g.points, settings));
    }
}

/// Asks for what the shape means, of every capture that is meant.
fn finish(
    gesture: &GestureInProgress,
    settings: &ToolSettings,
    cameras: &Query<Eye, With<Camera3d>>,
    splats: &PlacedSplats,
    requests: &mut MessageWriter<SelectRequest>,
) {
    let (Some(shape), Ok((_, _, _, layers))) = (&gesture.shape, cameras.get(gesture.camera)) else { return };
    let entities = match &settings.targets {
        ToolTargets::InView => splats.seen_on(layers),
        ToolTargets::These(entities) => entities.clone(),
    };
    let (camera, mode) = (gesture.camera, gesture.mode);
    for entity in entities {
        let shape = shape.clone();
        let by = match settings.projection {
            ToolProjection::Frustum(footprint) => SelectBy::Frustum { camera, shape, footprint },
            ToolProjection::Depth(footprint, tolerance) => SelectBy::Depth { camera, shape, footprint, tolerance },
            ToolProjection::Surface => SelectBy::Surface { camera, shape },
        };
        requests.write(SelectRequest { entity, mode, by });
    }
}
