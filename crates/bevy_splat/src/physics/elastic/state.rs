//! [`ElasticState`]: an elastic part in motion.

use std::sync::Arc;

use bevy::math::{DQuat, DVec3};
use bevy::prelude::*;
use splat_core::deform::Cage;
use splat_physics::{ElasticBody, ElasticModel, Frame, Spring};

use super::obstacle::{ContactSurface, ElasticLayers};
use super::surface::RestSurface;

/// An elastic part that is set up: its body, and where it is drawn. Written by this crate; removed with
/// [`ElasticPart`](super::ElasticPart).
#[derive(Component)]
pub struct ElasticState {
    pub(super) body: ElasticBody,
    pub(super) made: Made,
    /// Before and after the last fixed step.
    pub(super) before: Pose,
    pub(super) now: Pose,
    /// What was written into the `Transform` last: what else is there was written by others.
    pub(super) drawn: Transform,
    /// Whether the poses differ, or are not drawn yet.
    pub(super) unsettled: bool,
    /// Does not move until it is placed anew.
    pub(super) frozen: bool,
    /// What holds and pulls it, for the next step.
    pub(super) hands: Vec<Hand>,
    /// For the next step, in m/s^2.
    pub(super) gravity: DVec3,
    pub(super) layers: ElasticLayers,
    /// A box around all contact points that holds during the next step.
    pub(super) bounds: (DVec3, DVec3),
    /// What it touched in the last step, in rising order.
    pub(super) touched: Vec<Entity>,
    /// What it touched when it was put elsewhere.
    pub(super) left: Vec<Entity>,
    /// What was near when it fell asleep, and the gravity and hands that it fell asleep under.
    pub(super) near: Vec<Option<Entity>>,
    pub(super) slept_under: (DVec3, Vec<Hand>),
    /// Something since the last step asks that it be looked at, though it sleeps.
    pub(super) roused: bool,
}

/// A spring, and how its pull is damped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hand {
    pub(super) spring: Spring,
    /// Damping over stiffness, in s. It goes by how the part moves as a whole: so it is stable for every step.
    pub(super) damping: f64,
}

/// What a body was made of beside its model.
#[derive(Clone)]
pub(super) struct Made {
    pub(super) metres_per_unit: f64,
    /// In the space of the cloud.
    pub(super) cage: Cage,
    pub(super) surface: Arc<RestSurface>,
    /// For each contact point.
    pub(super) skin: Arc<[ContactSurface]>,
}

/// Where a part is and how it is bent.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pose {
    pub(super) rotation: DQuat,
    pub(super) translation: DVec3,
    /// Of the cage, in metres, in the body's frame.
    pub(super) nodes: Vec<Vec3>,
}

impl Pose {
    fn read(&mut self, body: &ElasticBody) {
        let frame = body.frame();
        (self.rotation, self.translation) = (frame.rotation, frame.translation);
        body.node_positions(&mut self.nodes);
    }
}

impl Pose {
    fn is_finite(&self) -> bool {
        // Both as they are drawn.
        let place = self.translation.as_vec3().is_finite() && self.rotation.as_quat().is_finite();
        place && self.nodes.iter().all(|node| node.is_finite())
    }
}

impl ElasticState {
    /// A body at rest where the `Transform` says.
    pub(super) fn new(model: Arc<ElasticModel>, made: Made, place: Transform) -> Self {
        let body = ElasticBody::new(model, frame_of(&place));
        let mut now = Pose::default();
        now.read(&body);
        Self {
            body,
            made,
            before: now.clone(),
            now,
            drawn: place,
            unsettled: true,
            frozen: false,
            hands: Vec::new(),
            gravity: DVec3::ZERO,
            layers: ElasticLayers::default(),
            bounds: (DVec3::ZERO, DVec3::ZERO),
            touched: Vec::new(),
            left: Vec::new(),
            near: Vec::new(),
            slept_under: (DVec3::ZERO, Vec::new()),
            roused: true,
        }
    }

    /// The body: where its points are and how they move, energies, stresses. In metres; see [`splat_physics`].
    pub fn body(&self) -> &ElasticBody {
        &self.body
    }

    /// Metres for a unit of the cloud.
    pub fn metres_per_unit(&self) -> f64 {
        self.made.metres_per_unit
    }

    /// Whether it rests and is not stepped.
    pub fn is_asleep(&self) -> bool {
        self.body.asleep()
    }

    /// Whether a step failed and it stands still until its `Transform` is written.
    pub fn is_frozen(&self) -> bool {
        self.frozen
    }

    /// Steps it again from the next fixed step on.
    pub fn wake(&mut self) {
        self.body.wake();
        self.roused = true;
    }

    /// What it touched in the last fixed step: entities of colliders and of other elastic parts, in rising order.
    pub fn touched(&self) -> &[Entity] {
        &self.touched
    }

    /// Of the cage's nodes as they are after the last fixed step, in metres, in the body's frame.
    pub fn nodes(&self) -> &[Vec3] {
        &self.now.nodes
    }

    /// The point of the part at rest, in the body's frame, that is now at a point of the world, or that moves with what is
    /// nearest to it.
    pub fn rest_point(&self, world: DVec3) -> DVec3 {
        let model = self.body.model();
        let nearest = |points: &mut dyn Iterator<Item = (DVec3, DVec3)>| {
            points.min_by(|a, b| a.1.distance_squared(world).total_cmp(&b.1.distance_squared(world)))
        };
        let contact = model.contact_points().iter().copied().zip(self.body.contact_positions());
        let samples = model.samples().iter().map(|s| s.position).zip(self.body.sample_positions());
        let found = nearest(&mut contact.chain(samples));
        let back = self.body.frame().rotation.conjugate();
        found.map_or(DVec3::ZERO, |(rest, now)| rest + back * (world - now))
    }

    /// What pulls in the next step.
    pub(super) fn springs(&self) -> Vec<Spring> {
        let rigid = self.hands.iter().any(|hand| hand.damping > 0.0).then(|| self.body.rigid_state());
        let pull = |hand: &Hand| {
            let mut spring = hand.spring;
            if let Some(rigid) = rigid.filter(|_| hand.damping > 0.0) {
                let arm = self.body.point_position(spring.point) - rigid.center;
                spring.target -= hand.damping * (rigid.linear_velocity + rigid.angular_velocity.cross(arm));
            }
            spring
        };
        self.hands.iter().map(pull).collect()
    }

    /// Tells what pulls at the part and whom it touches in the step to come.
    #[cfg(feature = "avian")]
    pub(in super::super) fn set_surroundings(&mut self, gravity: DVec3, layers: ElasticLayers) {
        (self.gravity, self.layers) = (gravity, layers);
    }

    /// What it touched when it was put elsewhere, once.
    #[cfg(feature = "avian")]
    pub(in super::super) fn take_left(&mut self) -> Vec<Entity> {
        std::mem::take(&mut self.left)
    }

    /// A box in world space that the part stays in during the step to come: least and greatest corner.
    pub fn reach(&self) -> (DVec3, DVec3) {
        self.bounds
    }

    /// Keeps the poses of the step before and after. Returns whether the body is where nothing can be, and so stays drawn as it
    /// was.
    pub(super) fn advance(&mut self) -> bool {
        std::mem::swap(&mut self.before, &mut self.now);
        self.now.read(&self.body);
        let lost = !self.now.is_finite();
        if lost {
            self.now.clone_from(&self.before);
        }
        self.unsettled = true;
        lost
    }

    /// Takes the pose as it is, with nothing to move through.
    pub(super) fn settle(&mut self) {
        self.now.read(&self.body);
        self.before.clone_from(&self.now);
        self.unsettled = true;
    }

    /// The pose some way from the step before to the step after, and the part of the `Transform` that belongs to it.
    ///
    /// `fraction`: 0 to 1. The centre of mass moves straight, and not the cloud's origin, which may lie far outside.
    pub(super) fn between(&self, fraction: f64) -> (Transform, Vec<Vec3>) {
        let center = self.body.model().mass().center;
        let (a, b) = (&self.before, &self.now);
        if fraction >= 1.0 || a == b {
            return (self.transform(b.rotation, b.translation), b.nodes.clone());
        }
        let rotation = a.rotation.slerp(b.rotation, fraction);
        let middle = (a.rotation * center + a.translation).lerp(b.rotation * center + b.translation, fraction);
        let nodes = a.nodes.iter().zip(&b.nodes).map(|(a, b)| a.lerp(*b, fraction as f32)).collect();
        (self.transform(rotation, middle - rotation * center), nodes)
    }

    /// The `Transform` after the last step.
    pub(super) fn placed(&self) -> Transform {
        self.transform(self.now.rotation, self.now.translation)
    }

    fn transform(&self, rotation: DQuat, translation: DVec3) -> Transform {
        Transform { translation: translation.as_vec3(), rotation: rotation.as_quat(), scale: self.drawn.scale }
    }

    /// Takes over a `Transform` that somebody else wrote: the part is carried along with how it bends and moves, or, if it was
    /// frozen, put there at rest. Returns whether that was so; `false` too for one that is not finite.
    pub(super) fn take(&mut self, place: &Transform) -> bool {
        let moved = place.translation != self.drawn.translation || place.rotation != self.drawn.rotation;
        if !moved {
            self.drawn.scale = place.scale;
            return false;
        }
        let to = frame_of(place);
        if self.frozen {
            self.body.place(to);
            self.frozen = false;
        } else {
            let from = self.body.frame();
            let rotation = to.rotation * from.rotation.conjugate();
            self.body.carry(Frame { rotation, translation: to.translation - rotation * from.translation });
        }
        self.left.append(&mut self.touched);
        // What sleeps beside it may lie on it without pressing.
        self.left.extend(self.near.iter().flatten());
        self.drawn = *place;
        self.roused = true;
        self.settle();
        true
    }

    /// Where its points are and how far they may get in a step: a box that holds both.
    pub(super) fn spread(&mut self, dt: f64) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in self.body.contact_positions() {
            (low, high) = (low.min(p), high.max(p));
        }
        let speed = (2.0 * self.body.kinetic_energy() / self.body.model().mass().mass).sqrt();
        let margin = 2.0 * (speed + self.gravity.length() * dt) * dt + 0.01 * (high - low).length();
        self.bounds = (low - margin, high + margin);
    }
}

/// The frame of a body whose entity has this `Transform`.
pub(super) fn frame_of(place: &Transform) -> Frame {
    Frame { rotation: place.rotation.as_dquat().normalize(), translation: place.translation.as_dvec3() }
}

/// Whether a body can stand there.
pub(super) fn is_sound(place: &Transform) -> bool {
    place.is_finite() && place.rotation.length_squared() > 1e-6
}
