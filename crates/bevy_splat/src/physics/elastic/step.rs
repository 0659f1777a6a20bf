//! Fixed steps of all elastic parts.
//!
//! Parts that can touch each other, or the same free body, are an island and are stepped one after the other in the order of
//! their entities; islands are stepped side by side. So the result does not depend on threads.

use std::collections::BTreeMap;

use bevy::math::DVec3;
use bevy::prelude::*;
use rayon::prelude::*;
use splat_physics::world::RigidState;
use splat_physics::{Loads, StepReport};

use super::obstacle::{ElasticGround, ElasticObstacle, ElasticObstacles, ObstacleMotion};
use super::state::ElasticState;
use super::surface::PartSurface;
use super::world::{Candidate, Other, PARTS, Shove, Surroundings};

/// An awake free body slower than this, in m/s, does not keep a part from resting beside it.
const STILL: f64 = 0.05;
/// A part slower than this, in m/s, does not wake a free body that rests.
const GENTLE: f64 = 0.15;

/// Length of the fixed step that is being made, in s; 0 while physics is paused. Set in
/// [`SplatPhysicsSystems::Prepare`](crate::physics::SplatPhysicsSystems::Prepare).
#[derive(Resource, Clone, Copy, Debug, Default)]
pub(in super::super) struct ElasticTick(pub(in super::super) f64);

/// How free obstacles were pushed in this fixed step: filled within
/// [`SplatPhysicsSystems::Step`](crate::physics::SplatPhysicsSystems::Step), for the engine that moves them.
#[derive(Resource, Clone, Debug, Default, Deref, DerefMut)]
pub struct ElasticShoves(pub Vec<ElasticShove>);

/// A change of velocity of a free obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElasticShove {
    /// Its position in [`ElasticObstacles`]: of several with the same entity, the first.
    pub obstacle: usize,
    /// Of its centre of mass, in m/s.
    pub linear: DVec3,
    /// In rad/s.
    pub angular: DVec3,
}

/// What steps told, for [`tell`](super::write::tell): by part.
#[derive(Resource, Default)]
pub(super) struct ElasticReports(pub(super) Vec<PartReport>);

pub(super) struct PartReport {
    pub(super) part: Entity,
    pub(super) step: StepReport,
    /// Entities of the contacts' bodies.
    pub(super) others: BTreeMap<u32, Option<Entity>>,
}

/// Steps all parts.
pub(super) fn step(
    tick: Res<ElasticTick>,
    obstacles: Res<ElasticObstacles>,
    ground: Res<ElasticGround>,
    mut shoves: ResMut<ElasticShoves>,
    mut reports: ResMut<ElasticReports>,
    mut states: Query<(Entity, &mut ElasticState)>,
) {
    shoves.0.clear();
    if !(tick.0 > 0.0) {
        return;
    }
    let mut parts: Vec<(Entity, Mut<ElasticState>)> = states.iter_mut().collect();
    parts.sort_unstable_by_key(|(entity, _)| *entity);
    let all: Vec<Known> = known(obstacles.iter().chain(ground.iter()));
    let islands = islands(&parts, &all);
    let mut members: Vec<Vec<Member>> = islands.iter().map(|_| Vec::new()).collect();
    let mut of = vec![usize::MAX; parts.len()];
    for (k, island) in islands.iter().enumerate() {
        island.iter().for_each(|&part| of[part] = k);
    }
    for (part, (entity, state)) in parts.into_iter().enumerate() {
        members[of[part]].push(Member { entity, state: state.into_inner() });
    }
    let dt = tick.0;
    let told: Vec<IslandReport> = members.into_par_iter().map(|members| Island::new(members, &all).step(dt)).collect();
    for island in told {
        shoves.0.extend(island.shoves);
        reports.0.extend(island.reports);
    }
}

/// An obstacle, and the first of those that move as one with it.
struct Known<'a> {
    obstacle: &'a ElasticObstacle,
    body: u32,
}

/// Free obstacles of one entity are one body.
fn known<'a>(obstacles: impl Iterator<Item = &'a ElasticObstacle>) -> Vec<Known<'a>> {
    let mut first: BTreeMap<Entity, u32> = BTreeMap::new();
    (0_u32..)
        .zip(obstacles)
        .map(|(index, obstacle)| {
            let free = matches!(obstacle.motion, ObstacleMotion::Free { .. });
            let body = match obstacle.entity {
                Some(entity) if free => *first.entry(entity).or_insert(index),
                _ => index,
            };
            Known { obstacle, body }
        })
        .collect()
}

fn overlap(a: (DVec3, DVec3), b: (DVec3, DVec3)) -> bool {
    a.0.cmple(b.1).all() && b.0.cmple(a.1).all()
}

fn near(state: &ElasticState, obstacle: &ElasticObstacle) -> bool {
    state.layers.touches(obstacle.layers) && obstacle.bounds.is_none_or(|bounds| overlap(bounds, state.bounds))
}

/// Groups of parts, each rising, in rising order of their first.
fn islands(parts: &[(Entity, Mut<ElasticState>)], obstacles: &[Known]) -> Vec<Vec<usize>> {
    let mut leader: Vec<usize> = (0..parts.len()).collect();
    fn find(leader: &mut [usize], mut k: usize) -> usize {
        while leader[k] != k {
            leader[k] = leader[leader[k]];
            k = leader[k];
        }
        k
    }
    let mut join = |a: usize, b: usize| {
        let (a, b) = (find(&mut leader, a), find(&mut leader, b));
        let (low, high) = (a.min(b), a.max(b));
        leader[high] = low;
    };
    // Along x, so that parts apart are not compared.
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_unstable_by(|&a, &b| parts[a].1.bounds.0.x.total_cmp(&parts[b].1.bounds.0.x).then(a.cmp(&b)));
    for (k, &a) in order.iter().enumerate() {
        for &b in &order[k + 1..] {
            if parts[b].1.bounds.0.x > parts[a].1.bounds.1.x {
                break;
            }
            if overlap(parts[a].1.bounds, parts[b].1.bounds) && parts[a].1.layers.touches(parts[b].1.layers) {
                join(a, b);
            }
        }
    }
    let mut first: BTreeMap<u32, usize> = BTreeMap::new();
    for known in obstacles.iter().filter(|known| matches!(known.obstacle.motion, ObstacleMotion::Free { .. })) {
        for part in (0..parts.len()).filter(|&k| near(&parts[k].1, known.obstacle)) {
            let first = *first.entry(known.body).or_insert(part);
            join(first, part);
        }
    }
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for k in 0..parts.len() {
        groups.entry(find(&mut leader, k)).or_default().push(k);
    }
    groups.into_values().collect()
}

struct Member<'a> {
    entity: Entity,
    state: &'a mut ElasticState,
}

struct IslandReport {
    shoves: Vec<ElasticShove>,
    reports: Vec<PartReport>,
}

struct Island<'a> {
    members: Vec<Member<'a>>,
    obstacles: &'a [Known<'a>],
    /// What free obstacles got so far: linear, angular.
    pushed: BTreeMap<u32, (DVec3, DVec3)>,
    /// Surfaces of members when the step began, where there are several.
    surfaces: Vec<Option<PartSurface>>,
}

/// Another member that one may touch.
struct Neighbour {
    member: usize,
    skin: std::sync::Arc<[super::obstacle::ContactSurface]>,
    state: Option<RigidState>,
}

impl<'a> Island<'a> {
    fn new(members: Vec<Member<'a>>, obstacles: &'a [Known<'a>]) -> Self {
        let several = members.len() > 1;
        let surface =
            |state: &ElasticState| state.made.surface.at(state.body.contact_positions(), state.body.frame().rotation);
        let surfaces = members.iter().map(|member| several.then(|| surface(member.state))).collect();
        Self { members, obstacles, pushed: BTreeMap::new(), surfaces }
    }

    fn step(mut self, dt: f64) -> IslandReport {
        let mut reports = Vec::new();
        for k in 0..self.members.len() {
            reports.extend(self.step_one(k, dt));
        }
        let shoves = self.pushed.into_iter();
        let shoves = shoves.map(|(body, (linear, angular))| ElasticShove { obstacle: body as usize, linear, angular });
        IslandReport { shoves: shoves.collect(), reports }
    }

    fn step_one(&mut self, k: usize, dt: f64) -> Option<PartReport> {
        let entity = self.members[k].entity;
        let speed = speed(self.members[k].state);
        let neighbours = self.neighbours(k, speed, dt);
        let state = &mut *self.members[k].state;
        if state.frozen {
            return None;
        }
        let candidates: Vec<Candidate> = self
            .obstacles
            .iter()
            .filter(|known| known.obstacle.entity != Some(entity) && near(state, known.obstacle))
            .map(|&Known { obstacle, body }| Candidate {
                index: body,
                obstacle,
                free: free_state(obstacle, self.pushed.get(&body), speed),
            })
            .collect();
        let restless =
            candidates.iter().any(|c| matches!(c.obstacle.motion, ObstacleMotion::Free { asleep: false, .. }));
        let around: Vec<Option<Entity>> = candidates.iter().map(|c| c.obstacle.entity).collect();
        let was_asleep = state.body.asleep();
        if was_asleep {
            let moving = candidates.iter().any(|c| matches!(c.obstacle.motion, ObstacleMotion::Moving { .. }));
            let other_loads = state.slept_under.0 != state.gravity || state.slept_under.1 != state.hands;
            let pushed = neighbours.iter().any(|n| n.state.is_some_and(|s| s.linear_velocity.length() > STILL));
            if !(state.roused || restless || moving || other_loads || pushed || around != state.near) {
                return None;
            }
            state.body.wake();
        }
        state.roused = false;
        state.left.clear();
        let others = neighbours.iter().filter_map(|n| {
            let (skin, surface) = (&*n.skin, self.surfaces[n.member].as_ref()?);
            Some(Other { index: n.member as u32, surface, skin, state: n.state })
        });
        let skin = state.made.skin.clone();
        let mut world = Surroundings {
            skin: &skin,
            inside: state.body.center(),
            dt,
            candidates,
            others: others.collect(),
            shoves: Vec::new(),
        };
        let springs = state.springs();
        let loads = Loads { gravity: state.gravity, springs: &springs };
        let mut report = state.body.step(dt, &loads, &mut world);
        let Surroundings { candidates, shoves, .. } = world;
        report.woke |= was_asleep;
        if report.slept && restless {
            // What lies on it, or beside it, would lose its support.
            state.body.wake();
            report.slept = false;
        }
        if report.slept {
            state.near = around;
            state.slept_under = (state.gravity, state.hands.clone());
        }
        state.frozen |= report.diverged;
        if state.advance() {
            report.diverged |= !state.frozen;
            state.frozen = true;
        }
        let mut entities = BTreeMap::new();
        for body in report.contacts.iter().filter_map(|contact| contact.body) {
            let entity = match body.checked_sub(PARTS) {
                Some(member) => self.members.get(member as usize).map(|m| m.entity),
                None => candidates.iter().find(|c| c.index == body).and_then(|c| c.obstacle.entity),
            };
            entities.insert(body, entity);
        }
        let state = &mut *self.members[k].state;
        state.touched = entities.values().flatten().copied().collect();
        state.touched.sort_unstable();
        state.touched.dedup();
        if !report.diverged {
            shoves.into_iter().for_each(|shove| self.shove(shove));
        }
        Some(PartReport { part: entity, step: report, others: entities })
    }

    fn shove(&mut self, shove: Shove) {
        let Shove { body, linear, angular } = shove;
        match body.checked_sub(PARTS) {
            Some(member) => {
                if let Some(member) = self.members.get_mut(member as usize) {
                    member.state.body.kick(linear, angular);
                }
            }
            None => {
                let sum = self.pushed.entry(body).or_default();
                *sum = (sum.0 + linear, sum.1 + angular);
            }
        }
    }

    /// Other members near one that moves with `speed`.
    fn neighbours(&self, k: usize, speed: f64, dt: f64) -> Vec<Neighbour> {
        let me = &*self.members[k].state;
        let mut found = Vec::new();
        for (member, other) in self.members.iter().enumerate() {
            let state = &*other.state;
            if member == k || !state.layers.touches(me.layers) || !overlap(state.bounds, me.bounds) {
                continue;
            }
            let rests = state.frozen || state.body.asleep() && speed < GENTLE;
            let rigid = (!rests).then(|| {
                let mut rigid = state.body.rigid_state();
                // Those before have made this step already; its gravity is in their velocity.
                if member > k && !state.body.asleep() {
                    rigid.linear_velocity += state.gravity * dt;
                }
                rigid
            });
            found.push(Neighbour { member, skin: state.made.skin.clone(), state: rigid });
        }
        found
    }
}

/// Root of the mean square over the part's mass, in m/s.
fn speed(state: &ElasticState) -> f64 {
    (2.0 * state.body.kinetic_energy() / state.body.model().mass().mass).sqrt()
}

/// How a free obstacle moves, if it takes part in the step of a part that moves with `speed`.
fn free_state(obstacle: &ElasticObstacle, pushed: Option<&(DVec3, DVec3)>, speed: f64) -> Option<RigidState> {
    let ObstacleMotion::Free { state, asleep } = obstacle.motion else { return None };
    if asleep && pushed.is_none() && speed < GENTLE {
        return None;
    }
    let (linear, angular) = pushed.copied().unwrap_or_default();
    Some(RigidState {
        linear_velocity: state.linear_velocity + linear,
        angular_velocity: state.angular_velocity + angular,
        ..state
    })
}
