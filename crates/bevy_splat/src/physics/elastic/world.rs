//! [`Surroundings`]: everything one elastic part can touch in one step, as the solver asks for it.

use bevy::math::DVec3;
use splat_physics::world::{Contact, ContactWorld, RigidState};

use super::obstacle::{ContactSurface, ElasticObstacle, ObstacleMotion};
use super::surface::PartSurface;

/// Names of other elastic parts of the same island among bodies begin here; below are positions in the list of obstacles.
pub(super) const PARTS: u32 = 1 << 31;

/// An obstacle that the part may touch.
pub(super) struct Candidate<'a> {
    /// Its position in the list of all: of several that move as one, the first's.
    pub(super) index: u32,
    pub(super) obstacle: &'a ElasticObstacle,
    /// How it moves now, for one that is free and takes part in this step.
    pub(super) free: Option<RigidState>,
}

/// Another elastic part that the part may touch.
pub(super) struct Other<'a> {
    /// Its position in the island.
    pub(super) index: u32,
    pub(super) surface: &'a PartSurface,
    pub(super) skin: &'a [ContactSurface],
    /// As if it were rigid; `None` for one that rests, and is not woken by this one.
    pub(super) state: Option<RigidState>,
}

/// How fast a part that begins inside of something comes out, in m/s: at once, it would jump.
const RELIEF: f64 = 0.5;

/// How a step changed the velocities of a body: linear, angular.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shove {
    pub(super) body: u32,
    pub(super) linear: DVec3,
    pub(super) angular: DVec3,
}

pub(super) struct Surroundings<'a> {
    /// Of the part that asks: for each of its contact points.
    pub(super) skin: &'a [ContactSurface],
    /// A point well within the part.
    pub(super) inside: DVec3,
    /// Length of the step, in s.
    pub(super) dt: f64,
    pub(super) candidates: Vec<Candidate<'a>>,
    pub(super) others: Vec<Other<'a>>,
    /// What the step changed.
    pub(super) shoves: Vec<Shove>,
}

impl ContactWorld for Surroundings<'_> {
    fn contacts(&mut self, points: &[DVec3], reach: f64, out: &mut Vec<Contact>) {
        let plain = ContactSurface::default();
        let deepest = -RELIEF * self.dt;
        for (k, &point) in points.iter().enumerate() {
            let own = self.skin.get(k).unwrap_or(&plain);
            for candidate in &self.candidates {
                let obstacle = candidate.obstacle;
                let near =
                    |(low, high): (DVec3, DVec3)| point.cmpge(low - reach).all() && point.cmple(high + reach).all();
                if !obstacle.bounds.is_none_or(near) {
                    continue;
                }
                let Some((gap, normal)) = obstacle.shape.nearest(point, self.inside, reach) else { continue };
                let (friction, restitution) = own.with(&obstacle.surface);
                let velocity = match obstacle.motion {
                    ObstacleMotion::Moving { center, linear, angular } => linear + angular.cross(point - center),
                    _ => DVec3::ZERO,
                };
                out.push(Contact {
                    point: k as u32,
                    normal,
                    gap: gap.max(deepest),
                    velocity,
                    body: Some(candidate.index),
                    friction,
                    restitution,
                });
            }
            for other in &self.others {
                let Some((gap, normal)) = other.surface.nearest(point, reach) else { continue };
                // The surfaces of parts differ little from point to point: one stands for all.
                let (friction, restitution) = own.with(other.skin.first().unwrap_or(&plain));
                out.push(Contact {
                    point: k as u32,
                    normal,
                    gap: gap.max(deepest),
                    velocity: DVec3::ZERO,
                    body: Some(PARTS + other.index),
                    friction,
                    restitution,
                });
            }
        }
    }

    fn body(&self, body: u32) -> Option<RigidState> {
        if body >= PARTS {
            self.others.iter().find(|other| other.index + PARTS == body)?.state
        } else {
            self.candidates.iter().find(|candidate| candidate.index == body)?.free
        }
    }

    fn push(&mut self, body: u32, linear: DVec3, angular: DVec3) {
        self.shoves.push(Shove { body, linear, angular });
    }
}
