//! [`ElasticDrag`] and [`ElasticGrab`]: pulling at a part, with the pointer or from code.

use bevy::math::DVec3;
use bevy::picking::events::{Drag, DragEnd, DragStart, Pointer};
use bevy::picking::pointer::{PointerButton, PointerId};
use bevy::prelude::*;
use splat_physics::Spring;

use super::state::{ElasticState, Hand};
use crate::picking::SplatHit;
use crate::{SplatCloud, Splats};

/// Lets pointers drag an elastic part by the point that they took hold of.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::physics::{ElasticPart, elastic::ElasticDrag};
/// # fn system(mut commands: Commands, part: Single<Entity, With<ElasticPart>>) {
/// commands.entity(*part).insert(ElasticDrag::default());
/// # }
/// ```
///
/// The point follows the pointer in a plane that faces the camera. Needs [`SplatPickingPlugin`](crate::picking::SplatPickingPlugin)
/// and Bevy's picking.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct ElasticDrag {
    /// Which button drags.
    pub button: PointerButton,
    /// How stiff the pull is: how fast the part would swing on it, in Hz. At 3 Hz it hangs 28 mm below the pointer.
    pub frequency: f32,
}

impl Default for ElasticDrag {
    fn default() -> Self {
        Self { button: PointerButton::Primary, frequency: FREQUENCY }
    }
}

const FREQUENCY: f32 = 3.0;
/// Share of critical damping of the pull.
const DAMPING: f64 = 0.7;

/// Pulls a point of an elastic part towards a point of the world, softly: what a drag inserts, and a script may.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct ElasticGrab {
    /// The point at rest, in the space of the cloud.
    pub point: Vec3,
    /// Where to, in world space.
    pub target: Vec3,
    /// How stiff; see [`ElasticDrag::frequency`].
    pub frequency: f32,
}

impl ElasticGrab {
    /// Pulls as the pointer does.
    pub fn new(point: Vec3, target: Vec3) -> Self {
        Self { point, target, frequency: FREQUENCY }
    }
}

/// The pointer that drags a part.
#[derive(Component)]
pub(super) struct DraggedBy {
    pointer: PointerId,
    camera: Entity,
    /// Where it took hold, in world space: the plane of the drag goes through it.
    start: Vec3,
}

/// Hands to parts what pulls at them.
pub(super) fn pull(mut grabs: Query<(&ElasticGrab, &mut ElasticState)>) {
    for (grab, mut state) in &mut grabs {
        let turn = std::f64::consts::TAU * f64::from(grab.frequency.max(0.0));
        let spring = Spring {
            point: grab.point.as_dvec3() * state.metres_per_unit(),
            target: grab.target.as_dvec3(),
            stiffness: state.body.model().mass().mass * turn * turn,
        };
        let damping = if turn > 0.0 { 2.0 * DAMPING / turn } else { 0.0 };
        state.hands.push(Hand { spring, damping });
    }
}

pub(super) fn take_hold(
    event: On<Pointer<DragStart>>,
    mut commands: Commands,
    clouds: Res<Assets<SplatCloud>>,
    parts: Query<(&ElasticDrag, &ElasticState, &Splats)>,
) {
    let Ok((drag, state, splats)) = parts.get(event.entity) else { return };
    let Some(start) = event.hit.position.filter(|_| event.button == drag.button) else { return };
    let mean = |hit: &SplatHit| clouds.get(&splats.0)?.cloud.means().get(hit.gaussian as usize).copied();
    let own = event.hit.extra_as::<SplatHit>().filter(|hit| hit.splats == event.entity).and_then(mean);
    let unit = state.metres_per_unit();
    let point = own.unwrap_or_else(|| (state.rest_point(start.as_dvec3()) / unit).as_vec3());
    let at: DVec3 = state.body().point_position(point.as_dvec3() * unit);
    commands.entity(event.entity).insert((
        ElasticGrab { point, target: at.as_vec3(), frequency: drag.frequency },
        DraggedBy { pointer: event.pointer_id, camera: event.hit.camera, start: at.as_vec3() },
    ));
}

pub(super) fn follow(
    event: On<Pointer<Drag>>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    mut parts: Query<(&ElasticDrag, &DraggedBy, &mut ElasticGrab)>,
) {
    let Ok((drag, by, mut grab)) = parts.get_mut(event.entity) else { return };
    if by.pointer != event.pointer_id || event.button != drag.button {
        return;
    }
    let Ok((camera, place)) = cameras.get(by.camera) else { return };
    let Ok(ray) = camera.viewport_to_world(place, event.pointer_location.position) else { return };
    let plane = InfinitePlane3d::new(place.forward());
    if let Some(target) = ray.plane_intersection_point(by.start, plane) {
        grab.target = target;
    }
}

pub(super) fn release(event: On<Pointer<DragEnd>>, mut commands: Commands, parts: Query<(&ElasticDrag, &DraggedBy)>) {
    let Ok((drag, by)) = parts.get(event.entity) else { return };
    if by.pointer == event.pointer_id && event.button == drag.button {
        commands.entity(event.entity).remove::<(ElasticGrab, DraggedBy)>();
    }
}
