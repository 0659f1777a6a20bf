//! What steps did, told to `Transform`s, to what draws, and to who listens.

use std::sync::Arc;

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::time::Fixed;
use splat_core::deform::Deformation;

use super::messages::{ElasticContact, ElasticExploded, ElasticSlept, ElasticWoke};
use super::state::ElasticState;
use super::step::ElasticReports;
use crate::components::SplatDeformation;

/// Puts parts where the step left them.
pub(super) fn place(mut states: Query<(&mut ElasticState, &mut Transform)>) {
    for (mut state, mut place) in &mut states {
        if state.unsettled {
            let now = state.placed();
            place.set_if_neq(now);
            state.drawn = now;
        }
    }
}

/// Draws parts between the last two fixed steps.
pub(super) fn ease(
    mut commands: Commands,
    time: Res<Time<Fixed>>,
    mut states: Query<(Entity, &mut ElasticState, &mut Transform, Option<&mut SplatDeformation>)>,
) {
    let fraction = time.overstep_fraction_f64().clamp(0.0, 1.0);
    for (entity, mut state, mut place, deformation) in &mut states {
        if !state.unsettled {
            continue;
        }
        let (drawn, nodes) = state.between(fraction);
        place.set_if_neq(drawn);
        state.drawn = drawn;
        if state.before == state.now && (state.body.asleep() || state.frozen) {
            state.unsettled = false;
        }
        let unit = state.metres_per_unit() as f32;
        let nodes = nodes.into_iter().map(|node| node / unit).collect();
        // Where cells are turned inside out, how they were turned before counts.
        let before = deformation.as_ref().filter(|before| *before.0.cage() == state.made.cage);
        let deformed = match before {
            Some(before) => before.0.after(nodes),
            None => Deformation::new(state.made.cage, nodes),
        };
        // Nodes are finite, and as many as the cage has.
        let Ok(deformed) = deformed else { continue };
        let deformed = SplatDeformation(Arc::new(deformed));
        match deformation {
            Some(mut before) => *before = deformed,
            None => {
                commands.entity(entity).try_insert(deformed);
            }
        }
    }
}

/// Tells what happened.
pub(super) fn tell(
    mut reports: ResMut<ElasticReports>,
    mut contacts: MessageWriter<ElasticContact>,
    mut slept: MessageWriter<ElasticSlept>,
    mut woke: MessageWriter<ElasticWoke>,
    mut exploded: MessageWriter<ElasticExploded>,
) {
    for report in reports.0.drain(..) {
        let part = report.part;
        if report.step.woke {
            woke.write(ElasticWoke { part });
        }
        let mut bodies: Vec<Option<u32>> = report.step.contacts.iter().map(|contact| contact.body).collect();
        bodies.sort_unstable();
        bodies.dedup();
        for body in bodies {
            let (mut impulse, mut point, mut normal, mut weight) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, 0.0);
            for contact in report.step.contacts.iter().filter(|contact| contact.body == body) {
                let strength = contact.impulse.length();
                impulse += contact.impulse;
                point += contact.position * strength;
                normal += contact.normal * strength;
                weight += strength;
            }
            if weight > 0.0 {
                let other = body.and_then(|body| report.others.get(&body).copied().flatten());
                contacts.write(ElasticContact {
                    part,
                    other,
                    impulse: impulse.as_vec3(),
                    point: (point / weight).as_vec3(),
                    normal: normal.normalize_or_zero().as_vec3(),
                });
            }
        }
        if report.step.slept {
            slept.write(ElasticSlept { part });
        }
        if report.step.diverged {
            exploded.write(ElasticExploded { part });
        }
    }
}
