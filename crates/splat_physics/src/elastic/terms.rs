//! What pulls at single points during a step: springs, contacts, friction.

use glam::{DMat3, DVec3};

use crate::world::{Contact, RigidState};

/// A force on one point, and how it changes as the point moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointTerm {
    /// `dP/dx`, in N: the force is its negative.
    pub(super) gradient: DVec3,
    /// `d2P/dx2`, without negative eigenvalues.
    pub(super) hessian: DMat3,
    /// In J.
    pub(super) energy: f64,
}

/// A rigid body that takes part in a step with six unknowns of its own: how it moves and turns in this step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pushed {
    /// Its name in the world.
    pub(super) body: u32,
    pub(super) state: RigidState,
    pub(super) shift: DVec3,
    pub(super) turn: DVec3,
}

impl Pushed {
    /// How far a point of it moves, which is `arm` away from its centre.
    pub(super) fn moved(&self, arm: DVec3) -> DVec3 {
        self.shift + self.turn.cross(arm)
    }
}

/// A contact during one step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    pub(super) contact: Contact,
    /// Where the point was when the step began.
    pub(super) begin: DVec3,
    /// Which of the step's pushed bodies, and where the contact lies from its centre.
    pub(super) pushed: Option<(usize, DVec3)>,
    /// In N/m.
    pub(super) stiffness: f64,
    /// The gap at which force begins, in metres: more than nothing where the point bounces.
    pub(super) offset: f64,
    /// Normal force that friction goes by, in N.
    pub(super) pressed: f64,
    /// Coulomb's coefficient in this step.
    pub(super) friction: f64,
    /// Slip over the step below which friction only creeps, in metres.
    pub(super) creep: f64,
    /// Length of the step, in s.
    pub(super) dt: f64,
}

impl Touch {
    /// How far the point moved past the surface, if it is at `at` now.
    pub(super) fn slid(&self, at: DVec3, pushed: &[Pushed]) -> DVec3 {
        let surface = match self.pushed {
            Some((k, arm)) => pushed[k].moved(arm),
            None => self.contact.velocity * self.dt,
        };
        at - self.begin - surface
    }

    /// Distance from the surface, in metres.
    pub(super) fn gap(&self, slid: DVec3) -> f64 {
        self.contact.gap + self.contact.normal.dot(slid)
    }

    /// Normal force at that gap, in N.
    pub(super) fn force(&self, gap: f64) -> f64 {
        self.stiffness * (self.offset - gap).max(0.0)
    }

    /// Quadratic penalty along the normal; Coulomb friction, smooth below the creep (Li and others, "Incremental Potential
    /// Contact", 2020, section 5), with the normal force of the iteration before.
    pub(super) fn term(&self, slid: DVec3) -> PointTerm {
        let n = self.contact.normal;
        let mut term = PointTerm { gradient: DVec3::ZERO, hessian: DMat3::ZERO, energy: 0.0 };
        let deep = self.offset - self.gap(slid);
        if deep > 0.0 {
            term.energy += 0.5 * self.stiffness * deep * deep;
            term.gradient -= n * (self.stiffness * deep);
            term.hessian += outer(n, n) * self.stiffness;
        }
        let most = self.friction * self.pressed;
        if most > 0.0 {
            let along = slid - n * n.dot(slid);
            let s = along.length();
            let e = self.creep;
            let plane = DMat3::IDENTITY - outer(n, n);
            // Force over slip. The Hessian is the parabola that touches the energy here and lies above it everywhere, not the exact
            // one: where a point begins to slip the exact one sends Newton's method to and fro.
            let over = if s < e { 2.0 / e - s / (e * e) } else { 1.0 / s };
            term.energy += most * if s < e { s * s / e - s.powi(3) / (3.0 * e * e) } else { s - e / 3.0 };
            term.gradient += along * (most * over);
            term.hessian += plane * (most * over);
        }
        term
    }
}

/// `a b^T`.
pub(super) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// `[a]x`: times b it is `a x b`.
pub(super) fn cross_matrix(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

/// A spring from a point of the body to a point in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// The point at rest, in the body's frame, in metres.
    pub point: DVec3,
    /// Where it is pulled, in world space.
    pub target: DVec3,
    /// In N/m.
    pub stiffness: f64,
}

/// What acts on a body from outside, beside contact.
#[derive(Clone, Copy, Debug)]
pub struct Loads<'a> {
    /// In m/s^2, world space.
    pub gravity: DVec3,
    /// Pins and drags.
    pub springs: &'a [Spring],
}

impl Default for Loads<'_> {
    fn default() -> Self {
        Self { gravity: DVec3::new(0.0, -9.81, 0.0), springs: &[] }
    }
}
