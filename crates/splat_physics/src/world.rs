//! What an elastic part touches: [`ContactWorld`].

use glam::{DMat3, DVec3};

/// Surroundings that can be asked for the surface nearest to points; in metres, world space.
///
/// Implemented by planes, by the distance field of a static capture, and by a physics engine's colliders.
pub trait ContactWorld {
    /// Appends to `out` the contacts of all `points` that are nearer than `reach` to a surface or inside one, in rising order of
    /// `point`; the same answer for the same question.
    fn contacts(&mut self, points: &[DVec3], reach: f64, out: &mut Vec<Contact>);

    /// A rigid body that [`Contact::body`] names and that can be pushed; `None` for one that cannot (static or kinematic).
    fn body(&self, _body: u32) -> Option<RigidState> {
        None
    }

    /// Tells how a step changed the velocities of a body that can be pushed: linear in m/s, angular in rad/s.
    fn push(&mut self, _body: u32, _linear: DVec3, _angular: DVec3) {}
}

/// A point and the plane it must stay above for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Position in the list of points asked about.
    pub point: u32,
    /// Unit normal of the surface, away from it.
    pub normal: DVec3,
    /// Distance from the surface along the normal in metres, negative inside.
    pub gap: f64,
    /// Velocity of the surface there, in m/s; zero for what stands still and for bodies that can be pushed.
    pub velocity: DVec3,
    /// What the surface belongs to; see [`ContactWorld::body`]. `None`: it stands still.
    pub body: Option<u32>,
    /// Coulomb's coefficients of this pair of surfaces, dynamic and static.
    pub friction: [f64; 2],
    /// Of this pair, 0..=1.
    pub restitution: f64,
}

/// A rigid body at the beginning of a step, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidState {
    /// In kg.
    pub mass: f64,
    /// About the centre of mass, along the world's axes, in kg m^2.
    pub inertia: DMat3,
    /// Centre of mass, in metres.
    pub center: DVec3,
    /// Of the centre of mass, in m/s, with what this step's gravity adds.
    pub linear_velocity: DVec3,
    /// In rad/s.
    pub angular_velocity: DVec3,
}

/// Nothing to touch.
#[derive(Clone, Copy, Debug, Default)]
pub struct EmptyWorld;

impl ContactWorld for EmptyWorld {
    fn contacts(&mut self, _points: &[DVec3], _reach: f64, _out: &mut Vec<Contact>) {}
}

/// A half space below a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneWorld {
    /// Unit normal, away from the solid side.
    pub normal: DVec3,
    /// `normal . p` of points on the plane, in metres.
    pub offset: f64,
    /// Coulomb's coefficients, dynamic and static.
    pub friction: [f64; 2],
    /// 0..=1.
    pub restitution: f64,
}

impl ContactWorld for PlaneWorld {
    fn contacts(&mut self, points: &[DVec3], reach: f64, out: &mut Vec<Contact>) {
        let plane = *self;
        out.extend(points.iter().enumerate().filter_map(|(k, p)| {
            let gap = plane.normal.dot(*p) - plane.offset;
            (gap < reach).then_some(Contact {
                point: k as u32,
                normal: plane.normal,
                gap,
                velocity: DVec3::ZERO,
                body: None,
                friction: plane.friction,
                restitution: plane.restitution,
            })
        }));
    }
}
