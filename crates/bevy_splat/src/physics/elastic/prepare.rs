//! What happens to parts before they are stepped: where they were put, what pushes and what holds them.

use bevy::prelude::*;

use super::messages::{ElasticExploded, ElasticPush};
use super::obstacle::{ElasticLayers, ElasticObstacles};
use super::state::{ElasticState, is_sound};
use super::step::ElasticTick;

/// What pulls at all elastic parts, in m/s^2; 9.81 down along y by default. Beside avian3d its `Gravity` is used instead, and
/// `GravityScale` of parts.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect, Deref, DerefMut)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct ElasticGravity(pub Vec3);

impl Default for ElasticGravity {
    fn default() -> Self {
        Self(Vec3::NEG_Y * 9.81)
    }
}

/// Takes over `Transform`s that others wrote.
pub(super) fn take_places(
    mut states: Query<(Entity, &mut ElasticState, &mut Transform)>,
    mut exploded: MessageWriter<ElasticExploded>,
) {
    for (part, mut state, mut place) in &mut states {
        if *place == state.drawn {
            continue;
        }
        if is_sound(&place) {
            state.take(&place);
        } else {
            let kept = state.drawn;
            *place = Transform { scale: if place.scale.is_finite() { place.scale } else { kept.scale }, ..kept };
            if !std::mem::replace(&mut state.frozen, true) {
                exploded.write(ElasticExploded { part });
            }
        }
    }
}

/// Before a fixed step all is where the last one left it, and not where it was drawn.
pub(super) fn before_step(mut states: Query<(&mut ElasticState, &mut Transform)>) {
    for (mut state, mut place) in &mut states {
        if state.unsettled {
            let now = state.placed();
            place.set_if_neq(now);
            state.drawn = now;
        }
    }
}

/// What holds for the step to come, before others have their say.
pub(super) fn begin(
    time: Res<Time>,
    gravity: Res<ElasticGravity>,
    mut tick: ResMut<ElasticTick>,
    mut obstacles: ResMut<ElasticObstacles>,
    mut states: Query<&mut ElasticState>,
) {
    tick.0 = time.delta_secs_f64();
    obstacles.0.clear();
    for mut state in &mut states {
        state.hands.clear();
        state.gravity = gravity.0.as_dvec3();
        state.layers = ElasticLayers::default();
    }
}

/// Pushes what is to be pushed.
pub(super) fn push(
    mut pushes: MessageReader<ElasticPush>,
    mut states: Query<&mut ElasticState>,
    mut exploded: MessageWriter<ElasticExploded>,
) {
    for push in pushes.read() {
        let Ok(mut state) = states.get_mut(push.part) else { continue };
        if state.frozen {
            continue;
        }
        if !(push.point.is_finite() && push.impulse.is_finite()) {
            state.frozen = true;
            exploded.write(ElasticExploded { part: push.part });
            continue;
        }
        let rest = state.rest_point(push.point.as_dvec3());
        state.body.push(rest, push.impulse.as_dvec3());
        state.roused = true;
    }
}

/// Boxes that parts stay in during the step.
pub(super) fn spread(tick: Res<ElasticTick>, mut states: Query<&mut ElasticState>) {
    for mut state in &mut states {
        state.spread(tick.0);
    }
}
