//! What a rigid part gets from this crate, and what it had before.

use avian3d::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::prelude::*;
use splat_physics::{MassProperties, Material};

use super::RigidPart;

/// Which of avian's components an entity got from this crate: these may be replaced and are taken away again. Those it had
/// before are the user's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Given {
    body: bool,
    collider: bool,
    mass: bool,
    friction: bool,
    restitution: bool,
    linear_damping: bool,
    angular_damping: bool,
}

/// Which of avian's components an entity has.
#[derive(QueryData)]
pub(in super::super) struct Has {
    body: bevy::ecs::query::Has<RigidBody>,
    own_collider: bevy::ecs::query::Has<Collider>,
    colliders: bevy::ecs::query::Has<RigidBodyColliders>,
    mass: bevy::ecs::query::Has<Mass>,
    friction: bevy::ecs::query::Has<Friction>,
    restitution: bevy::ecs::query::Has<Restitution>,
    linear_damping: bevy::ecs::query::Has<LinearDamping>,
    angular_damping: bevy::ecs::query::Has<AngularDamping>,
}

/// What a body is made of, as avian wants it.
pub(super) struct Body<'a> {
    pub(super) part: &'a RigidPart,
    pub(super) collider: &'a Collider,
    pub(super) mass: Weight,
    pub(super) material: Material,
}

/// Mass properties in avian's words.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weight {
    mass: Mass,
    center: CenterOfMass,
    inertia: AngularInertia,
}

impl Weight {
    /// `None` where there is nothing that could be moved: a body of no mass, or of no extent.
    pub(super) fn new(mass: &MassProperties) -> Option<Self> {
        let inertia = AngularInertia::from_mat3_unchecked(mass.inertia.as_mat3());
        let weight = Self { mass: Mass(mass.mass as f32), center: CenterOfMass(mass.center.as_vec3()), inertia };
        let least = weight.inertia.principal.min_element();
        // Below these a reciprocal is no 32-bit number.
        let sound = weight.mass.0.is_finite() && weight.mass.0 > 1e-30 && least > 1e-30;
        (sound && weight.center.is_finite() && inertia.is_finite()).then_some(weight)
    }
}

/// Gives an entity what makes it a body. `anew`: its collider, too.
pub(super) fn give(entity: &mut EntityCommands, has: &HasItem, mut given: Given, body: &Body, anew: bool) -> Given {
    let material = &body.material;
    if given.mass || !has.mass {
        entity.insert((body.mass.mass, body.mass.center, body.mass.inertia));
        entity.insert((NoAutoMass, NoAutoCenterOfMass, NoAutoAngularInertia));
        given.mass = true;
    }
    if given.friction || !has.friction {
        let friction = Friction::new(material.friction_dynamic).with_static_coefficient(material.friction_static);
        entity.insert(friction);
        given.friction = true;
    }
    if given.restitution || !has.restitution {
        entity.insert(Restitution::new(material.restitution));
        given.restitution = true;
    }
    if given.linear_damping || !has.linear_damping {
        entity.insert(LinearDamping(body.part.linear_damping.max(0.0)));
        given.linear_damping = true;
    }
    if given.angular_damping || !has.angular_damping {
        entity.insert(AngularDamping(body.part.angular_damping.max(0.0)));
        given.angular_damping = true;
    }
    // A body of the user's may have its colliders in children.
    let elsewhere = has.body && !given.body && has.colliders;
    if given.collider && anew || !given.collider && !has.own_collider && !elsewhere {
        entity.insert(body.collider.clone());
        given.collider = true;
    }
    if !has.body {
        entity.insert(RigidBody::Dynamic);
        given.body = true;
    }
    given
}

/// Takes away what was given.
pub(super) fn take(entity: &mut EntityCommands, given: Given) {
    // The body first: avian then has no collider's mass to reckon with.
    if given.body {
        entity.try_remove::<(RigidBody, LinearVelocity, AngularVelocity, Sleeping)>();
    }
    if given.collider {
        entity.try_remove::<Collider>();
    }
    if given.mass {
        entity.try_remove::<(Mass, CenterOfMass, AngularInertia)>();
        entity.try_remove::<(NoAutoMass, NoAutoCenterOfMass, NoAutoAngularInertia)>();
    }
    if given.friction {
        entity.try_remove::<Friction>();
    }
    if given.restitution {
        entity.try_remove::<Restitution>();
    }
    if given.linear_damping {
        entity.try_remove::<LinearDamping>();
    }
    if given.angular_damping {
        entity.try_remove::<AngularDamping>();
    }
}
