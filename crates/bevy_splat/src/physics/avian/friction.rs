//! Friction at rest: avian3d 0.7 keeps its coefficient but only ever uses the one of sliding.

use avian3d::prelude::*;
use bevy::prelude::*;

use super::super::rigid::RigidPart;

/// Surfaces that move slower than this against each other are at rest, in m/s: what is put down falls freely for a step before
/// there is a contact, and then slips by what gravity added.
const AT_REST: f32 = 0.1;

/// Gives contacts of rigid parts their coefficient of friction at rest while nothing slides.
///
/// A contact holds as long as what it has to hold is at most the coefficient at rest times what presses it; then it slides,
/// and the coefficient is the lower one. Both are mixed from the two colliders as avian mixes the one it uses.
pub(super) fn hold(
    mut contacts: ResMut<ContactGraph>,
    parts: Query<(), With<RigidPart>>,
    frictions: Query<&Friction>,
    velocities: Query<(&LinearVelocity, &AngularVelocity)>,
    default: Res<DefaultFriction>,
) {
    if parts.is_empty() {
        return;
    }
    for pair in contacts.iter_active_touching_mut() {
        let bodies = [pair.body1, pair.body2];
        if !bodies.into_iter().flatten().any(|body| parts.contains(body)) {
            continue;
        }
        let friction = |collider: Entity, body: Option<Entity>| {
            let own = frictions.get(collider).ok().or_else(|| frictions.get(body?).ok());
            own.copied().unwrap_or(default.0)
        };
        let mixed = friction(pair.collider1, pair.body1).combine(friction(pair.collider2, pair.body2));
        if !(mixed.static_coefficient > mixed.dynamic_coefficient) {
            continue;
        }
        let velocity = |body: Option<Entity>, anchor: Vec3| {
            let Some((linear, angular)) = body.and_then(|body| velocities.get(body).ok()) else { return Vec3::ZERO };
            linear.0 + angular.0.cross(anchor)
        };
        for manifold in &mut pair.manifolds {
            let slips = |point: &ContactPoint| {
                let slip = velocity(pair.body2, point.anchor2) - velocity(pair.body1, point.anchor1);
                slip.reject_from_normalized(manifold.normal).length() > AT_REST
            };
            if !manifold.points.iter().any(slips) {
                manifold.friction = mixed.static_coefficient;
            }
        }
    }
}
