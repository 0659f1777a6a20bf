//! Elastic parts among avian3d's bodies: its colliders are what parts touch, and free bodies are pushed back by as much.

use std::collections::BTreeMap;
use std::sync::Arc;

use avian3d::dynamics::solver::islands::BodyIslandNode;
use avian3d::parry::math::Pose;
use avian3d::prelude::*;
use bevy::math::{DMat3, DVec3, FloatExt};
use bevy::prelude::*;
use splat_physics::world::RigidState;

use super::elastic_shape::ColliderShape;
use crate::physics::SplatPhysicsSystems;
use crate::physics::elastic::{
    CombineRule, ContactSurface, ElasticLayers, ElasticObstacle, ElasticObstacles, ElasticPrepareSystems, ElasticShove,
    ElasticShoves, ElasticState, ElasticTick, ObstacleMotion,
};
use crate::physics::ground::CaptureGround;

/// Adds the systems.
pub(super) fn plugin(app: &mut App) {
    app.init_resource::<Resisted>().add_observer(leave).add_systems(
        FixedPostUpdate,
        (
            own.in_set(ElasticPrepareSystems::Gather),
            find.in_set(ElasticPrepareSystems::Obstacles),
            shove.after(SplatPhysicsSystems::Step).before(PhysicsSystems::StepSimulation),
            feel.in_set(SplatPhysicsSystems::Writeback),
        ),
    );
}

/// Bodies that sleep and can be woken.
type Asleep<'w, 's> = Query<'w, 's, (), (With<Sleeping>, With<BodyIslandNode>)>;

fn wake(commands: &mut Commands, asleep: &Asleep, bodies: &[Entity]) {
    for &body in bodies.iter().filter(|body| asleep.contains(**body)) {
        commands.queue(WakeBody(body));
    }
}

/// What lay on a part that is none any more has lost its support.
fn leave(removed: On<Remove, ElasticState>, mut commands: Commands, asleep: Asleep, parts: Query<&ElasticState>) {
    if let Ok(state) = parts.get(removed.event().entity) {
        wake(&mut commands, &asleep, state.touched());
    }
}

/// Gravity, pause and layers are avian's.
fn own(
    mut commands: Commands,
    asleep: Asleep,
    gravity: Res<Gravity>,
    clock: Res<Time<Physics>>,
    mut tick: ResMut<ElasticTick>,
    mut parts: Query<(&mut ElasticState, Option<&GravityScale>, Option<&CollisionLayers>)>,
) {
    tick.0 *= if clock.is_paused() { 0.0 } else { clock.relative_speed_f64() };
    for (mut state, scale, layers) in &mut parts {
        let layers =
            layers.map(|layers| ElasticLayers { memberships: layers.memberships.0, filters: layers.filters.0 });
        let scale = scale.map_or(1.0, |scale| scale.0);
        wake(&mut commands, &asleep, &state.take_left());
        state.set_surroundings((gravity.0 * scale).as_dvec3(), layers.unwrap_or_default());
    }
}

type Colliders<'a> = (
    &'a Collider,
    &'a Position,
    &'a Rotation,
    Option<&'a ColliderOf>,
    Option<&'a CollisionLayers>,
    Option<&'a Friction>,
    Option<&'a Restitution>,
    Option<&'a ChildOf>,
);

type Bodies<'a> = (
    &'a RigidBody,
    &'a Position,
    &'a Rotation,
    &'a LinearVelocity,
    &'a AngularVelocity,
    &'a ComputedMass,
    &'a ComputedAngularInertia,
    &'a ComputedCenterOfMass,
    Option<&'a LockedAxes>,
    Option<&'a Dominance>,
    Option<&'a GravityScale>,
    Option<&'a Friction>,
    Option<&'a Restitution>,
    Has<Sleeping>,
);

type Solid = (Without<Sensor>, Without<ColliderDisabled>);

/// Finds the colliders near parts.
#[expect(clippy::too_many_arguments, reason = "one for each kind of thing that is read or written")]
fn find(
    space: SpatialQuery,
    colliders: Query<Colliders, Solid>,
    bodies: Query<Bodies, Without<RigidBodyDisabled>>,
    disabled: Query<(), With<RigidBodyDisabled>>,
    grounds: Query<(), With<CaptureGround>>,
    parts: Query<(Entity, &ElasticState)>,
    (gravity, friction, restitution): (Res<Gravity>, Res<DefaultFriction>, Res<DefaultRestitution>),
    tick: Res<ElasticTick>,
    resisted: Res<Resisted>,
    mut obstacles: ResMut<ElasticObstacles>,
) {
    let mut near: Vec<Entity> = Vec::new();
    for (_, state) in &parts {
        let (low, high) = state.reach();
        near.extend(space.aabb_intersections_with_aabb(ColliderAabb { min: low.as_vec3(), max: high.as_vec3() }));
    }
    near.sort_unstable();
    near.dedup();
    for entity in near {
        let Ok((collider, position, rotation, of, layers, own_friction, own_restitution, child)) =
            colliders.get(entity)
        else {
            continue;
        };
        let body_entity = of.map(|of| of.body);
        let skipped = |entity: Entity| parts.contains(entity) || disabled.contains(entity);
        // Parts are no obstacles of themselves; what is left of a capture is known by its field.
        let of_ground = child.is_some_and(|child| grounds.contains(child.parent())) || grounds.contains(entity);
        if skipped(entity) || body_entity.is_some_and(skipped) || of_ground {
            continue;
        }
        let body = body_entity.and_then(|body| bodies.get(body).ok());
        let pose = Pose::from_parts(position.0, rotation.0);
        let bounds = collider.shape_scaled().compute_aabb(&pose);
        let (rough, bouncy) = body.map_or((None, None), |body| (body.11, body.12));
        let rough = own_friction.or(rough).copied().unwrap_or(friction.0);
        let bouncy = own_restitution.or(bouncy).copied().unwrap_or(restitution.0);
        let layers =
            layers.map(|layers| ElasticLayers { memberships: layers.memberships.0, filters: layers.filters.0 });
        let motion =
            body.map_or(ObstacleMotion::Still, |body| motion_of(body_entity, body, gravity.0, tick.0, &resisted));
        let shape = ColliderShape { shape: collider.shape_scaled().clone(), pose };
        let finite = bounds.mins.is_finite() && bounds.maxs.is_finite();
        obstacles.push(ElasticObstacle {
            entity: Some(body_entity.unwrap_or(entity)),
            shape: Arc::new(shape),
            bounds: finite.then(|| (bounds.mins.as_dvec3(), bounds.maxs.as_dvec3())),
            surface: ContactSurface {
                friction: [f64::from(rough.dynamic_coefficient), f64::from(rough.static_coefficient)],
                restitution: f64::from(bouncy.coefficient),
                friction_rule: rule(rough.combine_rule),
                restitution_rule: rule(bouncy.combine_rule),
            },
            layers: layers.unwrap_or_default(),
            motion,
        });
    }
}

fn rule(rule: CoefficientCombine) -> CombineRule {
    match rule {
        CoefficientCombine::Average => CombineRule::Average,
        CoefficientCombine::GeometricMean => CombineRule::GeometricMean,
        CoefficientCombine::Min => CombineRule::Min,
        CoefficientCombine::Multiply => CombineRule::Multiply,
        CoefficientCombine::Max => CombineRule::Max,
    }
}

/// How a body moves in the step to come.
fn motion_of(
    entity: Option<Entity>,
    body: <Bodies<'_> as bevy::ecs::query::QueryData>::Item<'_, '_>,
    gravity: Vec3,
    dt: f64,
    resisted: &Resisted,
) -> ObstacleMotion {
    let (kind, position, rotation, linear, angular, mass, inertia, center, locked, dominance, scale, _, _, asleep) =
        body;
    let (linear, angular) = (linear.0.as_dvec3(), angular.0.as_dvec3());
    let center = (position.0 + rotation.0 * center.0).as_dvec3();
    if !(linear.is_finite() && angular.is_finite() && center.is_finite()) {
        return ObstacleMotion::Still;
    }
    let told = || match linear == DVec3::ZERO && angular == DVec3::ZERO {
        true => ObstacleMotion::Still,
        false => ObstacleMotion::Moving { center, linear, angular },
    };
    let held = locked
        .is_some_and(|l| l.is_translation_x_locked() || l.is_translation_y_locked() || l.is_translation_z_locked());
    let mass = f64::from(mass.value());
    match kind {
        RigidBody::Static => ObstacleMotion::Still,
        RigidBody::Kinematic => told(),
        _ if held || dominance.is_some_and(|d| d.0 > 0) || !(mass > 0.0 && mass.is_finite()) => told(),
        RigidBody::Dynamic => {
            let turns = !locked
                .is_some_and(|l| l.is_rotation_x_locked() || l.is_rotation_y_locked() || l.is_rotation_z_locked());
            let tensor = inertia.rotated(rotation.0).value().to_mat3().as_dmat3();
            let sound = turns && tensor.is_finite() && tensor.determinant() > 0.0;
            // Much more than anything that touches it.
            let inertia = if sound { tensor } else { DMat3::IDENTITY * (1e9 * mass) };
            let factor = entity.map_or(1.0, |entity| resisted.factor(entity));
            let falls =
                if asleep { DVec3::ZERO } else { gravity.as_dvec3() * f64::from(scale.map_or(1.0, |s| s.0)) * dt };
            let state = RigidState {
                mass: mass * factor,
                inertia: inertia * factor,
                center,
                linear_velocity: linear + falls / factor,
                angular_velocity: angular,
            };
            ObstacleMotion::Free { state, asleep }
        }
    }
}

/// How much of what parts pushed a body by was taken away again by what else it touches: a box on the floor is heavier, for
/// what lies on it, than the box. By body, 0 to 1; gone with the contact.
#[derive(Resource, Default)]
struct Resisted(BTreeMap<Entity, Push>);

#[derive(Clone, Copy, Debug, Default)]
struct Push {
    /// What the body was given, and had then, in m/s.
    linear: DVec3,
    after: DVec3,
    /// How much was left of it, 0 to 1.
    left: f64,
}

/// A body counts as at most so many times as heavy.
const HEAVIEST: f64 = 1e3;
/// From this factor on a body lies on something.
const SUPPORTED: f64 = 2.0;
/// What such a body is given in a step at most, in m/s.
const MOST_SHOVE: f64 = 0.25;

impl Resisted {
    fn factor(&self, entity: Entity) -> f64 {
        self.0.get(&entity).map_or(1.0, |push| 1.0 / push.left.max(1.0 / HEAVIEST))
    }
}

/// Hands to bodies what parts pushed them by.
fn shove(
    mut commands: Commands,
    shoves: Res<ElasticShoves>,
    obstacles: Res<ElasticObstacles>,
    asleep: Asleep,
    mut bodies: Query<(&mut LinearVelocity, &mut AngularVelocity, Option<&LockedAxes>)>,
    mut resisted: ResMut<Resisted>,
) {
    let mut pushed = BTreeMap::new();
    for &ElasticShove { obstacle, linear, angular } in shoves.iter() {
        let Some(entity) = obstacles.get(obstacle).and_then(|obstacle| obstacle.entity) else { continue };
        let Ok((mut velocity, mut spin, locked)) = bodies.get_mut(entity) else { continue };
        let factor = resisted.factor(entity);
        // What holds a body up takes its share of a push: all of it would be a blow that the next step throws back.
        let most = if factor > SUPPORTED { MOST_SHOVE / (linear.length() * factor).max(MOST_SHOVE) } else { 1.0 };
        let (linear, angular) = (linear * factor * most, angular * factor * most);
        if !(linear.is_finite() && angular.is_finite()) {
            continue;
        }
        let turns =
            !locked.is_some_and(|l| l.is_rotation_x_locked() || l.is_rotation_y_locked() || l.is_rotation_z_locked());
        velocity.0 += linear.as_vec3();
        if turns {
            spin.0 += angular.as_vec3();
        }
        wake(&mut commands, &asleep, &[entity]);
        let left = resisted.0.get(&entity).map_or(1.0, |push| push.left);
        pushed.insert(entity, Push { linear, after: velocity.0.as_dvec3(), left });
    }
    // Who is not pushed is free again.
    resisted.0 = pushed;
}

/// Measures how much of a push is left after avian's step.
fn feel(
    gravity: Res<Gravity>,
    tick: Res<ElasticTick>,
    bodies: Query<(&LinearVelocity, Option<&GravityScale>)>,
    mut resisted: ResMut<Resisted>,
) {
    for (entity, push) in &mut resisted.0 {
        let Ok((velocity, scale)) = bodies.get(*entity) else { continue };
        let size = push.linear.length_squared();
        if !(size > 1e-12) {
            continue;
        }
        let falls = gravity.0.as_dvec3() * f64::from(scale.map_or(1.0, |s| s.0)) * tick.0;
        let lost = velocity.0.as_dvec3() - falls - push.after;
        let left = (1.0 + lost.dot(push.linear) / size).clamp(0.0, 1.0);
        // Half of the way, so that one odd step does not decide.
        push.left = push.left.lerp(left, 0.5);
    }
}

#[cfg(test)]
#[path = "elastic_tests.rs"]
mod tests;
