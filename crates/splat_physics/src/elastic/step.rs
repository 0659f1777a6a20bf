//! Moving a body through a step of time.

use faer::Mat;
use glam::{DMat3, DVec3};

use super::body::ElasticBody;
use super::model::point_at;
use super::newton::{Outcome, Problem, Tangent, add_scaled};
use super::terms::{Loads, Pushed, Spring, Touch};
use super::{Integrator, MOST_PUSHED};
use crate::world::{Contact, ContactWorld, RigidState};

/// Slip speed below which friction only creeps, in m/s.
const CREEP: f64 = 1e-3;
/// Slip speed from which the dynamic coefficient counts, in m/s.
const SLIPPING: f64 = 5e-3;
/// Contacts slower than this do not bounce, in m/s.
const BOUNCE: f64 = 0.2;
/// How many times stiffer contact is where it bounces.
const STRIKE: f64 = 20.0;
/// A body whose points move slower than this, in m/s, and stay where they are, for [`SLEEP_AFTER`] seconds falls asleep.
const SLEEP_BELOW: f64 = 0.05;
const SLEEP_AFTER: f64 = 0.5;
/// Where they are: within this part of the body's size.
const SLEEP_WITHIN: f64 = 5e-4;
/// A deformation gradient with a larger entry is no sound state.
const MOST_GRADIENT: f64 = 10.0;
/// How often a step that fails is cut in half.
const MOST_CUTS: u32 = 3;

/// What a step did.
#[derive(Clone, Debug, Default)]
pub struct StepReport {
    /// Points that were pressed against something.
    pub contacts: Vec<ContactForce>,
    /// Of Newton's method, over all substeps.
    pub iterations: usize,
    /// After the step, in J.
    pub kinetic: f64,
    /// After the step, in J.
    pub elastic: f64,
    /// It fell asleep in this step.
    pub slept: bool,
    /// It woke in this step.
    pub woke: bool,
    /// No length of step gave a sound state: the body is as it was before, and frozen.
    pub diverged: bool,
}

/// A contact point with the impulse it got.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactForce {
    /// Which of the model's contact points.
    pub point: u32,
    /// Where it is after the step, in world space.
    pub position: DVec3,
    /// Of the surface, away from it.
    pub normal: DVec3,
    /// On the part, over the step, in N s.
    pub impulse: DVec3,
    /// What it touched; see [`Contact::body`].
    pub body: Option<u32>,
}

/// What can be put back.
struct Saved {
    y: Mat<f64>,
    v: Mat<f64>,
    before: Option<(Mat<f64>, Mat<f64>, f64)>,
    rotation: DMat3,
    pressed: Vec<f64>,
    slipping: Vec<f64>,
    elastic: f64,
}

impl ElasticBody {
    /// Moves the body on by `dt` seconds.
    ///
    /// A step that ends in no sound state (a number that is not finite, a deformation gradient beyond 10, energy from nowhere) is
    /// tried again as 2, 4 and 8 shorter ones; if none is sound, the body is put back, frozen, and the report says so.
    ///
    /// The same calls give the same bits on one machine.
    pub fn step(&mut self, dt: f64, loads: &Loads<'_>, world: &mut dyn ContactWorld) -> StepReport {
        let mut report = StepReport::default();
        if self.frozen || !(dt > 0.0 && dt.is_finite()) {
            return report;
        }
        if self.asleep {
            if !self.roused(loads, world) {
                return report;
            }
            self.wake();
            report.woke = true;
        }
        if !finite_loads(loads) {
            self.freeze(&mut report);
            return report;
        }
        let saved = self.save();
        for cuts in 0..=MOST_CUTS {
            let parts = u32::from(self.model.settings.substeps) << cuts;
            let mut carried = Carried::default();
            let mut attempt = StepReport { woke: report.woke, ..StepReport::default() };
            let sound =
                (0..parts).all(|_| self.substep(dt / f64::from(parts), loads, world, &mut attempt, &mut carried));
            if sound {
                report = attempt;
                for body in carried.bodies {
                    let linear = body.state.linear_velocity - body.begin.linear_velocity;
                    let angular = body.state.angular_velocity - body.begin.angular_velocity;
                    world.push(body.body, linear, angular);
                }
                self.rest(dt, loads, &mut report);
                report.kinetic = self.kinetic_energy();
                report.elastic = self.elastic;
                return report;
            }
            self.restore(&saved);
        }
        self.freeze(&mut report);
        report
    }

    /// Puts the body into equilibrium under loads, without motion and without contact; whether it was found.
    pub fn settle(&mut self, loads: &Loads<'_>) -> bool {
        if !finite_loads(loads) {
            return false;
        }
        let saved = self.save();
        let springs = self.spring_rows(loads.springs);
        let mut y = self.y.clone();
        let mut tangent = std::mem::replace(&mut self.tangent, Tangent::at_rest());
        // Gravity as a pull that does not change: the first-order part of an inertia of nothing.
        let mut sound = true;
        for _ in 0..8 {
            let outcome = {
                let mut problem = Problem {
                    model: &self.model,
                    free: self.gravity_pull(loads.gravity),
                    base: &saved.y,
                    h: 1.0,
                    inertia: 0.0,
                    damping: 0.0,
                    springs: &springs,
                    touches: Vec::new(),
                    pushed: Vec::new(),
                    tolerance: 1e-9 * self.model.size,
                    rotation: self.rotation,
                };
                problem.solve(&mut y, &mut tangent)
            };
            self.y.clone_from(&y);
            self.elastic = outcome.elastic;
            sound = outcome.converged && outcome.largest_gradient < MOST_GRADIENT;
            self.update_rotation();
            if !sound || outcome.iterations < super::newton::MOST_ITERATIONS {
                break;
            }
        }
        self.tangent = tangent;
        if !sound {
            self.restore(&saved);
        }
        self.v = Mat::zeros(self.model.rank(), 3);
        self.before = None;
        sound
    }

    fn substep(
        &mut self,
        dt: f64,
        loads: &Loads<'_>,
        world: &mut dyn ContactWorld,
        report: &mut StepReport,
        carried: &mut Carried,
    ) -> bool {
        let springs = self.spring_rows(loads.springs);
        let coasted = self.coasted(dt);
        let (mut contacts, begins) = self.contacts(dt, loads, &coasted, world);
        carried.move_surfaces(&mut contacts, &begins, world);
        let two_way = contacts.iter().any(|c| c.body.is_some_and(|b| world.body(b).is_some()));
        let met = self.meets(&contacts, &begins, &coasted);
        let second = match (&self.before, self.model.settings.integrator) {
            (Some((_, _, last)), Integrator::Bdf2) => (*last - dt).abs() < 1e-9 * dt && !two_way && !met,
            _ => false,
        };
        // Backward differences: v' = (y' - base) / h, y' = free + h^2 a.
        let (h, base, mut free) = match &self.before {
            Some((y, v, _)) if second => {
                let h = 2.0 / 3.0 * dt;
                let base = blended(&self.y, y);
                let mut free = base.clone();
                add_scaled(&mut free, &blended(&self.v, v), h);
                (h, base, free)
            }
            _ => (dt, self.y.clone(), coasted.clone()),
        };
        add_scaled(&mut free, &self.gravity_pull(loads.gravity), h * h);
        let pushed = pushed_bodies(&contacts, carried, world, h);
        let touches = self.touches(&contacts, &begins, &pushed, dt, h);
        let before = self.kinetic_energy() + self.elastic;
        let contact_count = touches.len();
        let mut problem = Problem {
            model: &self.model,
            free,
            base: &base,
            h,
            inertia: 1.0,
            damping: self.damping(dt, second),
            springs: &springs,
            touches,
            pushed,
            // In contact a hundredth of a millimetre for a metre, else a tenth of that.
            tolerance: self.model.size * if contact_count == 0 { 1e-6 } else { 1e-5 },
            rotation: self.rotation,
        };
        // The nearest guess: it goes on as it did.
        let mut y = match &self.before {
            Some((_, v, _)) if second => {
                let mut y = coasted;
                add_scaled(&mut y, &self.v, 0.5 * dt);
                add_scaled(&mut y, v, -0.5 * dt);
                y
            }
            _ if contact_count == 0 => problem.free.clone(),
            _ => coasted,
        };
        let outcome = problem.solve(&mut y, &mut self.tangent);
        report.iterations += outcome.iterations;
        let mut v = y.clone();
        add_scaled(&mut v, &base, -1.0);
        for a in 0..3 {
            v.col_as_slice_mut(a).iter_mut().for_each(|v| *v /= h);
        }
        if two_way {
            self.balance(&y, &mut v, &problem, loads.gravity, dt);
        }
        let (touches, pushed) = (std::mem::take(&mut problem.touches), std::mem::take(&mut problem.pushed));
        drop(problem);
        let old_y = std::mem::replace(&mut self.y, y);
        let old_v = std::mem::replace(&mut self.v, v);
        self.elastic = outcome.elastic;
        self.update_rotation();
        if !self.sound(&outcome, before, loads, dt, &old_v, !springs.is_empty() || contact_count > 0) {
            return false;
        }
        // A step that ended what was being extrapolated begins a new history.
        self.before = (!(met || two_way)).then_some((old_y, old_v, dt));
        self.keep_contacts(&touches, &pushed, dt, report);
        carried.advance(&pushed, dt, world);
        true
    }

    /// Gives the part as much momentum as pushed bodies lost: a solve that stops early leaves some of it to nobody. First-order
    /// steps only.
    fn balance(&self, y: &Mat<f64>, v: &mut Mat<f64>, around: &Problem<'_>, gravity: DVec3, dt: f64) {
        let model = &self.model;
        let rank = model.rank();
        let mut wanted = self.momentum() + gravity * (model.mass.mass * dt);
        for touch in around.touches.iter().filter(|touch| touch.pushed.is_none()) {
            let at = touch.contact.point as usize;
            let place = point_at(&model.contact_rows[at * rank..(at + 1) * rank], y);
            wanted -= touch.term(touch.slid(place, &[])).gradient * dt;
        }
        for p in &around.pushed {
            wanted -= (p.shift / dt - p.state.linear_velocity) * p.state.mass;
        }
        for (row, spring) in around.springs {
            wanted += (spring.target - point_at(row, y)) * (spring.stiffness * dt);
        }
        let missing = (wanted - point_at(&model.ones, v)) / model.mass.mass;
        if missing.is_finite() {
            for a in 0..3 {
                v.col_as_slice_mut(a).iter_mut().zip(&model.ones).for_each(|(v, one)| *v += one * missing[a]);
            }
        }
    }

    /// Gravity as an acceleration of the coordinates.
    fn gravity_pull(&self, gravity: DVec3) -> Mat<f64> {
        Mat::from_fn(self.model.rank(), 3, |k, a| self.model.ones[k] * gravity[a])
    }

    /// Stiffness-proportional damping in s, less what the scheme swallows by itself: `omega dt / 2` of first order,
    /// `(omega dt)^3 / 4` of second. At least half remains: a part that is held somewhere swings slower than it does freely, and
    /// no scheme swallows slow motion.
    fn damping(&self, dt: f64, second: bool) -> f64 {
        let turn = self.model.frequency * dt;
        let own = if second { 0.25 * turn.powi(3) } else { 0.5 * turn };
        let wanted = (self.model.damping_ratio - own).max(0.5 * self.model.damping_ratio);
        2.0 * wanted / self.model.frequency.max(f64::MIN_POSITIVE)
    }

    fn spring_rows(&mut self, springs: &[Spring]) -> Vec<(Vec<f64>, Spring)> {
        springs.iter().map(|s| (self.spring_row(s.point), *s)).collect()
    }

    /// Contacts that this step may make, and where all contact points are.
    fn contacts(
        &self,
        dt: f64,
        loads: &Loads<'_>,
        coasted: &Mat<f64>,
        world: &mut dyn ContactWorld,
    ) -> (Vec<Contact>, Vec<DVec3>) {
        let begins = self.contact_positions();
        let rows = self.model.contact_rows.chunks_exact(self.model.rank());
        let moved = rows.zip(&begins).map(|(row, b)| point_at(row, coasted).distance(*b)).fold(0.0, f64::max);
        let reach = 1.5 * moved + 2.0 * loads.gravity.length() * dt * dt + 1e-3 * self.model.size;
        let mut contacts = Vec::new();
        world.contacts(&begins, reach.min(4.0 * self.model.size), &mut contacts);
        contacts.retain(|c| {
            (c.point as usize) < begins.len() && c.normal.is_normalized() && c.gap.is_finite() && c.velocity.is_finite()
        });
        (contacts, begins)
    }

    /// Whether a point that touched nothing is about to.
    fn meets(&self, contacts: &[Contact], begins: &[DVec3], coasted: &Mat<f64>) -> bool {
        let rank = self.model.rank();
        contacts.iter().any(|c| {
            let at = c.point as usize;
            let moved = point_at(&self.model.contact_rows[at * rank..(at + 1) * rank], coasted) - begins[at];
            self.pressed[at] == 0.0 && c.gap + c.normal.dot(moved) < 0.0
        })
    }

    fn touches(&self, contacts: &[Contact], begins: &[DVec3], pushed: &[Pushed], dt: f64, h: f64) -> Vec<Touch> {
        let model = &self.model;
        let rank = model.rank();
        let row = |at: usize| &model.contact_rows[at * rank..(at + 1) * rank];
        // All that touch share one stiffness: how deep things sink does not depend on how many points there are.
        let near = |c: &&Contact| {
            let at = c.point as usize;
            self.pressed[at] > 0.0 || c.gap + c.normal.dot(point_at(row(at), &self.v)) * dt < 0.0
        };
        let touching = contacts.iter().filter(near).count().max(1);
        let share = model.mass.mass / touching as f64;
        // A body that swings faster than steps can show bounces by its coefficient, one that does not by its own swing.
        let bounces = model.frequency * dt > std::f64::consts::PI;
        contacts
            .iter()
            .map(|c| {
                let at = c.point as usize;
                let body = c.body.and_then(|b| pushed.iter().position(|p| p.body == b));
                let arm = body.map(|k| (k, begins[at] - pushed[k].state.center));
                let surface = arm.map_or(c.velocity, |(k, arm)| {
                    pushed[k].state.linear_velocity + pushed[k].state.angular_velocity.cross(arm)
                });
                let approach = -(point_at(row(at), &self.v) - surface).dot(c.normal);
                let strikes = bounces && approach > BOUNCE && c.gap < approach * dt && self.pressed[at] == 0.0;
                let offset = if strikes { c.gap + c.restitution * approach * dt } else { 0.0 };
                Touch {
                    contact: *c,
                    begin: begins[at],
                    pushed: arm,
                    // A strike leaves with the speed it should only if the spring is much stiffer than what it turns round.
                    stiffness: model.settings.contact_stiffness * share / (h * h) * if strikes { STRIKE } else { 1.0 },
                    offset,
                    pressed: self.pressed[at],
                    friction: c.friction[usize::from(self.slipping[at] < SLIPPING)],
                    creep: CREEP * dt,
                    dt,
                }
            })
            .collect()
    }

    fn keep_contacts(&mut self, touches: &[Touch], pushed: &[Pushed], dt: f64, report: &mut StepReport) {
        self.pressed.fill(0.0);
        self.slipping.fill(0.0);
        report.contacts.clear();
        let rank = self.model.rank();
        for touch in touches {
            let at = touch.contact.point as usize;
            let position = point_at(&self.model.contact_rows[at * rank..(at + 1) * rank], &self.y);
            let slid = touch.slid(position, pushed);
            let force = touch.force(touch.gap(slid));
            if force > 0.0 {
                let along = slid - touch.contact.normal * touch.contact.normal.dot(slid);
                self.pressed[at] = self.pressed[at].max(force);
                self.slipping[at] = self.slipping[at].max(along.length() / dt);
                report.contacts.push(ContactForce {
                    point: touch.contact.point,
                    position,
                    normal: touch.contact.normal,
                    impulse: -touch.term(slid).gradient * dt,
                    body: touch.contact.body,
                });
            }
        }
    }

    /// Whether the state can be: finite, not torn, and with no more energy than was there or came in.
    fn sound(&self, outcome: &Outcome, before: f64, loads: &Loads<'_>, dt: f64, old: &Mat<f64>, held: bool) -> bool {
        let after = self.kinetic_energy() + self.elastic;
        if !(after.is_finite() && outcome.largest_gradient < MOST_GRADIENT && outcome.converged) {
            return false;
        }
        let mass = self.model.mass.mass;
        let speed = (super::newton::dot(old, old) / mass).sqrt() + loads.gravity.length() * dt;
        let fallen = mass * loads.gravity.length() * speed * dt;
        // What springs and moving surfaces bring in is not known here; a jump of a thousand times is not theirs.
        let allowed = before + fallen + 1e-6 * mass * self.model.size.powi(2) / (dt * dt);
        held || after <= 1e3 * allowed
    }

    /// Falls asleep when nothing moved for long enough and something holds it.
    fn rest(&mut self, dt: f64, loads: &Loads<'_>, report: &mut StepReport) {
        let held = !report.contacts.is_empty() || !loads.springs.is_empty() || loads.gravity == DVec3::ZERO;
        let mass = self.model.mass.mass;
        let speed = (2.0 * self.kinetic_energy() / mass).sqrt();
        let away = (0..3).flat_map(|a| self.y.col_as_slice(a).iter().zip(self.still_at.col_as_slice(a)));
        let away = (away.map(|(y, s)| (y - s) * (y - s)).sum::<f64>() / mass).sqrt();
        if held && speed < SLEEP_BELOW && away < SLEEP_WITHIN * self.model.size {
            self.still += dt;
        } else {
            self.still = 0.0;
            self.still_at.clone_from(&self.y);
        }
        if self.still >= SLEEP_AFTER {
            self.v = Mat::zeros(self.model.rank(), 3);
            self.before = None;
            self.asleep = true;
            self.slept_under = Some((loads.gravity, loads.springs.to_vec()));
            report.slept = true;
        }
    }

    /// Whether anything is different from when the body fell asleep.
    fn roused(&self, loads: &Loads<'_>, world: &mut dyn ContactWorld) -> bool {
        let same = |(gravity, springs): &(DVec3, Vec<Spring>)| *gravity == loads.gravity && springs == loads.springs;
        if !self.slept_under.as_ref().is_some_and(same) {
            return true;
        }
        let mut contacts = Vec::new();
        let near = 1e-3 * self.model.size;
        world.contacts(&self.contact_positions(), near, &mut contacts);
        let held = self.pressed.iter().any(|&p| p > 0.0);
        let deepest = contacts.iter().map(|c| c.gap).fold(f64::INFINITY, f64::min);
        let moving = contacts.iter().any(|c| {
            let body = c.body.and_then(|b| world.body(b));
            let speed = body.map_or(c.velocity.length(), |s| {
                s.linear_velocity.length() + s.angular_velocity.length() * self.model.size
            });
            speed > 2.0 * SLEEP_BELOW
        });
        // What it lay on is gone, or something was pushed into it.
        moving || (held && contacts.is_empty()) || deepest < -0.05 * self.model.size
    }

    fn save(&self) -> Saved {
        Saved {
            y: self.y.clone(),
            v: self.v.clone(),
            before: self.before.clone(),
            rotation: self.rotation,
            pressed: self.pressed.clone(),
            slipping: self.slipping.clone(),
            elastic: self.elastic,
        }
    }

    fn restore(&mut self, saved: &Saved) {
        self.y.clone_from(&saved.y);
        self.v.clone_from(&saved.v);
        self.before.clone_from(&saved.before);
        self.rotation = saved.rotation;
        self.pressed.clone_from(&saved.pressed);
        self.slipping.clone_from(&saved.slipping);
        self.elastic = saved.elastic;
        self.tangent = Tangent::at_rest();
    }

    fn freeze(&mut self, report: &mut StepReport) {
        self.frozen = true;
        self.v = Mat::zeros(self.model.rank(), 3);
        self.before = None;
        report.diverged = true;
        report.kinetic = 0.0;
        report.elastic = self.elastic;
    }
}

/// `(4 now - before) / 3`.
fn blended(now: &Mat<f64>, before: &Mat<f64>) -> Mat<f64> {
    Mat::from_fn(now.nrows(), now.ncols(), |r, c| (4.0 * now[(r, c)] - before[(r, c)]) / 3.0)
}

fn finite_loads(loads: &Loads<'_>) -> bool {
    let spring =
        |s: &Spring| s.point.is_finite() && s.target.is_finite() && s.stiffness.is_finite() && s.stiffness >= 0.0;
    loads.gravity.is_finite() && loads.springs.iter().all(spring)
}

/// The bodies that can be pushed among what is touched, in the order in which they come; those beyond [`MOST_PUSHED`] stand
/// still for the step.
fn pushed_bodies(contacts: &[Contact], carried: &Carried, world: &dyn ContactWorld, h: f64) -> Vec<Pushed> {
    let mut pushed: Vec<Pushed> = Vec::new();
    for body in contacts.iter().filter_map(|c| c.body) {
        if pushed.len() < MOST_PUSHED
            && !pushed.iter().any(|p| p.body == body)
            && let Some(state) = carried.state(body, world)
            && state.mass > 0.0
            && state.linear_velocity.is_finite()
            && state.angular_velocity.is_finite()
        {
            pushed.push(Pushed { body, state, shift: state.linear_velocity * h, turn: state.angular_velocity * h });
        }
    }
    pushed
}

/// Where surroundings are in the middle of a step: the world tells only where they are at its beginning.
#[derive(Default)]
struct Carried {
    elapsed: f64,
    bodies: Vec<CarriedBody>,
}

struct CarriedBody {
    body: u32,
    begin: RigidState,
    /// Now.
    state: RigidState,
    /// Turned since the beginning, in rad.
    turn: DVec3,
}

impl Carried {
    fn state(&self, body: u32, world: &dyn ContactWorld) -> Option<RigidState> {
        if let Some(known) = self.bodies.iter().find(|b| b.body == body) {
            return Some(known.state);
        }
        let state = world.body(body)?;
        Some(RigidState { center: state.center + state.linear_velocity * self.elapsed, ..state })
    }

    /// Moves the surfaces to where they are by now.
    fn move_surfaces(&self, contacts: &mut [Contact], points: &[DVec3], world: &dyn ContactWorld) {
        if self.elapsed == 0.0 {
            return;
        }
        for contact in contacts {
            let known = contact.body.and_then(|body| self.bodies.iter().find(|b| b.body == body));
            let begin = contact.body.and_then(|body| world.body(body));
            let moved = match (known, begin) {
                (Some(b), _) => {
                    let arm = points[contact.point as usize] - b.begin.center;
                    b.state.center - b.begin.center + b.turn.cross(arm)
                }
                (None, Some(state)) => {
                    let arm = points[contact.point as usize] - state.center;
                    (state.linear_velocity + state.angular_velocity.cross(arm)) * self.elapsed
                }
                (None, None) => contact.velocity * self.elapsed,
            };
            contact.gap -= contact.normal.dot(moved);
        }
    }

    /// Goes on by a substep in which `pushed` moved as they say, and all others as they did.
    fn advance(&mut self, pushed: &[Pushed], dt: f64, world: &dyn ContactWorld) {
        for p in pushed {
            if !self.bodies.iter().any(|b| b.body == p.body)
                && let Some(begin) = world.body(p.body)
            {
                let turn = begin.angular_velocity * self.elapsed;
                self.bodies.push(CarriedBody { body: p.body, begin, state: p.state, turn });
            }
        }
        for body in &mut self.bodies {
            let moved = pushed
                .iter()
                .find(|p| p.body == body.body)
                .map_or((body.state.linear_velocity * dt, body.state.angular_velocity * dt), |p| (p.shift, p.turn));
            body.state.center += moved.0;
            body.state.linear_velocity = moved.0 / dt;
            body.state.angular_velocity = moved.1 / dt;
            body.turn += moved.1;
        }
        self.elapsed += dt;
    }
}
