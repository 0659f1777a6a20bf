//! The nonlinear solve of one step.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::{Llt, Solve};
use faer::{Accum, Mat, Par, Side};
use glam::{DMat3, DVec3};

use super::ElasticModel;
use super::energy::Hessian;
use super::model::point_at;
use super::stiffness::{assemble, turned};
use super::terms::{PointTerm, Pushed, Spring, Touch, cross_matrix};
use crate::linear::polar;

/// Iterations of a step.
pub(super) const MOST_ITERATIONS: usize = 24;
/// Halvings of a step that does not go down.
const MOST_HALVINGS: usize = 12;
/// In contact a solve ends when an iteration can gain less than this part of what the best one gained.
const SETTLED: f64 = 1e-4;
/// The same where bodies are pushed, which carry on what is left over.
const SETTLED_TWO_WAY: f64 = 1e-7;
/// An iteration that shortens the way left by less than this may want another Hessian.
const SLOW: f64 = 0.3;
/// Where elastic forces change otherwise than the Hessian says, by this part of what it says, it is taken anew.
const STALE: f64 = 0.35;
/// New Hessians in one solve.
const MOST_REFRESHES: usize = 6;
/// Iterations after which the forces that friction goes by stay as they are, so that the others converge.
const PRESSING: usize = 5;

/// The elastic Hessian that directions are found with: of some state the body was in, seen from the part's frame there.
///
/// It turns with the part. A step seldom needs another one: the gradient is always exact, so that an old Hessian costs
/// iterations, never accuracy.
pub(super) struct Tangent {
    /// `None`: that at rest.
    hessian: Option<Mat<f64>>,
    /// The part's rotation where it was taken.
    taken: DMat3,
    /// Factor of the last system without point terms: the scales it was made with, and it.
    factor: Option<([f64; 2], Llt<f64>)>,
}

impl Tangent {
    pub(super) fn at_rest() -> Self {
        Self { hessian: None, taken: DMat3::IDENTITY, factor: None }
    }
}

/// A body's coordinates and what they are wanted to be.
pub(super) struct Problem<'a> {
    pub(super) model: &'a ElasticModel,
    /// Where the coordinates would go if nothing but inertia and gravity moved them; without inertia, the pull of gravity itself.
    pub(super) free: Mat<f64>,
    /// What velocities are differences from: `v = (y - base) / h`.
    pub(super) base: &'a Mat<f64>,
    /// Effective step, in s.
    pub(super) h: f64,
    /// 1, or 0 for a body at rest in equilibrium.
    pub(super) inertia: f64,
    /// Stiffness-proportional damping, in s.
    pub(super) damping: f64,
    pub(super) springs: &'a [(Vec<f64>, Spring)],
    pub(super) touches: Vec<Touch>,
    pub(super) pushed: Vec<Pushed>,
    /// RMS displacement that counts as nothing, in metres.
    pub(super) tolerance: f64,
    /// The part's rotation when the step began.
    pub(super) rotation: DMat3,
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    pub(super) iterations: usize,
    /// Whether everything is finite and the way left is short.
    pub(super) converged: bool,
    /// Elastic energy, in J.
    pub(super) elastic: f64,
    /// Largest entry of a deformation gradient.
    pub(super) largest_gradient: f64,
}

/// Coordinates with what follows from them.
struct State {
    y: Mat<f64>,
    pushed: Vec<Pushed>,
    gradients: Vec<DMat3>,
    objective: f64,
    elastic: f64,
}

impl Problem<'_> {
    /// Minimises `inertia / 2 |y - free|^2 + h^2 (elastic + damping + points)` from `y` on.
    pub(super) fn solve(&mut self, y: &mut Mat<f64>, tangent: &mut Tangent) -> Outcome {
        let mut outcome = Outcome::default();
        let mut state = self.at(y.clone(), self.pushed.clone());
        let mut refreshes = 0;
        let mut last = f64::INFINITY;
        let mut first: f64 = 0.0;
        let size = self.model.mass.mass.sqrt() * self.tolerance;
        while outcome.iterations < MOST_ITERATIONS && state.objective.is_finite() {
            outcome.iterations += 1;
            if (2..=PRESSING).contains(&outcome.iterations) {
                self.press(&state);
                state.objective = self.objective(&state);
            }
            let gradient = self.gradient(&state);
            let Some(direction) = self.direction(&state, &gradient, tangent) else { break };
            let (next, part) = self.search(&state, &direction);
            let Some(next) = next else {
                // Nothing goes down from here: either this is the bottom, or the Hessian is of another place.
                if direction.length <= size || refreshes == MOST_REFRESHES {
                    outcome.converged = direction.length <= 1e3 * size;
                    break;
                }
                self.refresh(&state, tangent);
                refreshes += 1;
                continue;
            };
            let moved = part * direction.length;
            first = first.max(state.objective - next.objective);
            // In contact the last of the way is friction making up its mind.
            let enough = if self.pushed.is_empty() { SETTLED } else { SETTLED_TWO_WAY };
            let settled = !self.touches.is_empty() && -direction.slope < enough * first;
            if moved <= size || settled {
                state = next;
                outcome.converged = true;
                break;
            }
            let slow = refreshes < MOST_REFRESHES && (part < 1.0 || moved > SLOW * last);
            let stale = slow && self.stale(&gradient, &next, &direction, part, tangent);
            last = moved;
            state = next;
            if stale {
                self.refresh(&state, tangent);
                refreshes += 1;
            }
        }
        outcome.elastic = state.elastic;
        outcome.largest_gradient = state
            .gradients
            .iter()
            .flat_map(|f| f.to_cols_array())
            .fold(0.0, |most: f64, e| if e.is_finite() { most.max(e.abs()) } else { f64::INFINITY });
        // Out of iterations is no failure by itself: the objective has only gone down.
        outcome.converged |= state.objective.is_finite() && outcome.iterations == MOST_ITERATIONS;
        self.pushed = std::mem::take(&mut state.pushed);
        *y = state.y;
        outcome
    }

    fn at(&self, y: Mat<f64>, pushed: Vec<Pushed>) -> State {
        let gradients = deformation_gradients(self.model, &y);
        let mut state = State { y, pushed, gradients, objective: 0.0, elastic: 0.0 };
        state.elastic = self.elastic(&state.gradients);
        state.objective = self.objective(&state);
        state
    }

    fn elastic(&self, gradients: &[DMat3]) -> f64 {
        let energy = self.model.settings.energy;
        let of = |(f, (s, &m)): (&DMat3, (&super::Sample, &super::energy::Moduli))| {
            s.volume * energy.density(f, &self.rotation, m)
        };
        gradients.iter().zip(self.model.samples.iter().zip(&self.model.moduli)).map(of).sum()
    }

    fn objective(&self, state: &State) -> f64 {
        let mut sum = 0.0;
        if self.inertia > 0.0 {
            for a in 0..3 {
                let pairs = state.y.col_as_slice(a).iter().zip(self.free.col_as_slice(a));
                sum += 0.5 * self.inertia * pairs.map(|(y, f)| (y - f) * (y - f)).sum::<f64>();
            }
        } else {
            sum -= self.h * self.h * dot(&state.y, &self.free);
        }
        for p in &state.pushed {
            let (shift, turn) = self.free_motion(p);
            let (ds, dt) = (p.shift - shift, p.turn - turn);
            sum += 0.5 * (p.state.mass * ds.length_squared() + dt.dot(p.state.inertia * dt));
        }
        let mut potential = state.elastic;
        if self.damping > 0.0 {
            let moved = difference(&state.y, self.base);
            let pull = self.damp(&moved);
            potential += 0.5 * dot(&moved, &pull) * self.damping / self.h;
        }
        potential += self.point_terms(state).map(|(_, _, t)| t.energy).sum::<f64>();
        sum + self.h * self.h * potential
    }

    /// How a pushed body would move in this step if nothing touched it.
    fn free_motion(&self, p: &Pushed) -> (DVec3, DVec3) {
        (p.state.linear_velocity * self.h, p.state.angular_velocity * self.h)
    }

    /// The rest Hessian, turned with the part, times coordinates.
    fn damp(&self, moved: &Mat<f64>) -> Mat<f64> {
        let local = turned(moved, &self.rotation.transpose());
        turned(&unstack(&times(&self.model.rest_hessian, &stack(&local)), moved.nrows()), &self.rotation)
    }

    /// Springs and touches: row of the point, which touch it is, and its term.
    fn point_terms<'s>(&'s self, state: &'s State) -> impl Iterator<Item = (&'s [f64], Option<usize>, PointTerm)> {
        let springs = self.springs.iter().map(|(row, spring)| {
            let away = point_at(row, &state.y) - spring.target;
            let term = PointTerm {
                gradient: away * spring.stiffness,
                hessian: DMat3::from_diagonal(DVec3::splat(spring.stiffness)),
                energy: 0.5 * spring.stiffness * away.length_squared(),
            };
            (row.as_slice(), None, term)
        });
        let touches = self.touches.iter().enumerate().map(|(k, touch)| {
            let row = self.row(touch);
            (row, Some(k), touch.term(touch.slid(point_at(row, &state.y), &state.pushed)))
        });
        springs.chain(touches)
    }

    fn row(&self, touch: &Touch) -> &[f64] {
        let rank = self.model.rank();
        let at = touch.contact.point as usize * rank;
        &self.model.contact_rows[at..at + rank]
    }

    /// Friction goes by the normal force of where the points are now.
    fn press(&mut self, state: &State) {
        for k in 0..self.touches.len() {
            let touch = &self.touches[k];
            let gap = touch.gap(touch.slid(point_at(self.row(touch), &state.y), &state.pushed));
            self.touches[k].pressed = self.touches[k].force(gap);
        }
    }

    /// Whether elastic forces changed along a step otherwise than the Hessian says.
    fn stale(&self, before: &Gradient, next: &State, direction: &Direction, part: f64, tangent: &Tangent) -> bool {
        let frame = self.rotation * tangent.taken.transpose();
        let hessian = tangent.hessian.as_ref().unwrap_or(&self.model.rest_hessian);
        let local = turned(&direction.step, &frame.transpose());
        let said = turned(&unstack(&times(hessian, &stack(&local)), local.nrows()), &frame);
        let now = self.elastic_gradient(next);
        let (mut off, mut all) = (0.0, 0.0);
        for a in 0..3 {
            let columns = said.col_as_slice(a).iter().zip(now.col_as_slice(a)).zip(before.elastic.col_as_slice(a));
            for ((said, now), before) in columns {
                let said = said * part * self.h * self.h;
                off += (now - before - said).powi(2);
                all += said * said;
            }
        }
        // Where inertia decides, what elastic forces do is of no account.
        let inertia = self.inertia * part * direction.length;
        off.sqrt() > STALE * (all.sqrt() + inertia)
    }

    /// Newton's direction, seen from the frame that the Hessian was taken in.
    fn direction(&self, state: &State, gradient: &Gradient, tangent: &mut Tangent) -> Option<Direction> {
        let rank = self.model.rank();
        let bodies = state.pushed.len();
        let n = 3 * rank + 6 * bodies;
        let h2 = self.h * self.h;
        // From the frame of the Hessian to the world.
        let frame = self.rotation * tangent.taken.transpose();
        let mut right = Mat::<f64>::zeros(n, 1);
        let local = turned(&gradient.coordinates, &frame.transpose());
        for a in 0..3 {
            for k in 0..rank {
                right[(a * rank + k, 0)] = -local[(k, a)];
            }
        }
        for (b, (shift, turn)) in gradient.pushed.iter().enumerate() {
            let (shift, turn) = (frame.transpose() * *shift, frame.transpose() * *turn);
            for a in 0..3 {
                right[(3 * rank + 6 * b + a, 0)] = -shift[a];
                right[(3 * rank + 6 * b + 3 + a, 0)] = -turn[a];
            }
        }
        let elastic = h2 * (1.0 + self.damping / self.h);
        let alone = self.springs.is_empty() && self.touches.is_empty();
        let key = [elastic, self.inertia];
        let solution = match &tangent.factor {
            Some((made, factor)) if alone && *made == key => factor.solve(&right),
            _ => {
                let base = tangent.hessian.as_ref().unwrap_or(&self.model.rest_hessian);
                let mut system = Mat::<f64>::zeros(n, n);
                for c in 0..3 * rank {
                    for (to, from) in system.col_as_slice_mut(c)[c..].iter_mut().zip(&base.col_as_slice(c)[c..]) {
                        *to = elastic * from;
                    }
                    // In equilibrium nothing but springs holds the rigid motions.
                    system[(c, c)] += if self.inertia > 0.0 { self.inertia } else { 1e-9 * elastic * base[(c, c)] };
                }
                self.add_points(state, &frame, &mut system);
                let factor = factor(system)?;
                let solution = factor.solve(&right);
                if alone {
                    tangent.factor = Some((key, factor));
                }
                solution
            }
        };
        let mut step = Mat::<f64>::zeros(rank, 3);
        for a in 0..3 {
            step.col_as_slice_mut(a).copy_from_slice(&solution.col_as_slice(0)[a * rank..(a + 1) * rank]);
        }
        let step = turned(&step, &frame);
        let vector = |at: usize| frame * DVec3::new(solution[(at, 0)], solution[(at + 1, 0)], solution[(at + 2, 0)]);
        let pushed: Vec<(DVec3, DVec3)> =
            (0..bodies).map(|b| (vector(3 * rank + 6 * b), vector(3 * rank + 6 * b + 3))).collect();
        let mut slope = dot(&step, &gradient.coordinates);
        let mut length = dot(&step, &step);
        for ((p, g), s) in pushed.iter().zip(&gradient.pushed).zip(&state.pushed) {
            slope += p.0.dot(g.0) + p.1.dot(g.1);
            length += s.state.mass * p.0.length_squared() + p.1.dot(s.state.inertia * p.1);
        }
        (slope.is_finite() && length.is_finite()).then(|| Direction { step, pushed, slope, length: length.sqrt() })
    }

    /// `h^2` times the slope of the elastic energy.
    fn elastic_gradient(&self, state: &State) -> Mat<f64> {
        let model = self.model;
        let energy = model.settings.energy;
        let h2 = self.h * self.h;
        let mut stresses = Mat::<f64>::zeros(3 * state.gradients.len(), 3);
        for (i, f) in state.gradients.iter().enumerate() {
            let p = energy.stress(f, &self.rotation, model.moduli[i]) * (h2 * model.samples[i].volume);
            for a in 0..3 {
                (0..3).for_each(|b| stresses[(3 * i + b, a)] = p.col(b)[a]);
            }
        }
        let mut slope = Mat::<f64>::zeros(model.rank(), 3);
        matmul(slope.as_mut(), Accum::Replace, model.gradients.as_ref().transpose(), stresses.as_ref(), 1.0, Par::Seq);
        slope
    }

    fn gradient(&self, state: &State) -> Gradient {
        let h2 = self.h * self.h;
        let elastic = self.elastic_gradient(state);
        let mut coordinates = elastic.clone();
        if self.inertia > 0.0 {
            add_scaled(&mut coordinates, &state.y, self.inertia);
            add_scaled(&mut coordinates, &self.free, -self.inertia);
        } else {
            add_scaled(&mut coordinates, &self.free, -h2);
        }
        if self.damping > 0.0 {
            let pull = self.damp(&difference(&state.y, self.base));
            add_scaled(&mut coordinates, &pull, h2 * self.damping / self.h);
        }
        let mut pushed: Vec<(DVec3, DVec3)> = state
            .pushed
            .iter()
            .map(|p| {
                let (shift, turn) = self.free_motion(p);
                ((p.shift - shift) * p.state.mass, p.state.inertia * (p.turn - turn))
            })
            .collect();
        for (row, touch, term) in self.point_terms(state) {
            let force = term.gradient * h2;
            if force == DVec3::ZERO {
                continue;
            }
            for a in 0..3 {
                coordinates.col_as_slice_mut(a).iter_mut().zip(row).for_each(|(g, b)| *g += force[a] * b);
            }
            if let Some((k, arm)) = touch.and_then(|k| self.touches[k].pushed) {
                pushed[k].0 -= force;
                pushed[k].1 -= arm.cross(force);
            }
        }
        Gradient { elastic, coordinates, pushed }
    }

    /// Adds the Hessians of the point terms and of the pushed bodies to the lower half of the system.
    fn add_points(&self, state: &State, frame: &DMat3, system: &mut Mat<f64>) {
        let rank = self.model.rank();
        let h2 = self.h * self.h;
        let to_frame = frame.transpose();
        let active: Vec<(&[f64], Option<usize>, DMat3)> = self
            .point_terms(state)
            .filter(|(_, _, t)| t.hessian != DMat3::ZERO)
            .map(|(row, touch, t)| (row, touch, to_frame * t.hessian * *frame * h2))
            .collect();
        if !active.is_empty() {
            let rows = Mat::from_fn(rank, active.len(), |k, p| active[p].0[k]);
            let mut block = Mat::<f64>::zeros(rank, rank);
            for a in 0..3 {
                for c in 0..=a {
                    if active.iter().all(|p| p.2.col(c)[a] == 0.0) {
                        continue;
                    }
                    let scaled = Mat::from_fn(rank, active.len(), |k, p| rows[(k, p)] * active[p].2.col(c)[a]);
                    matmul(block.as_mut(), Accum::Replace, scaled.as_ref(), rows.as_ref().transpose(), 1.0, Par::Seq);
                    for k in 0..rank {
                        let from = if a == c { k } else { 0 };
                        let to = &mut system.col_as_slice_mut(c * rank + k)[a * rank..(a + 1) * rank];
                        to[from..].iter_mut().zip(&block.col_as_slice(k)[from..]).for_each(|(s, b)| *s += b);
                    }
                }
            }
        }
        for (b, p) in state.pushed.iter().enumerate() {
            let at = 3 * rank + 6 * b;
            let inertia = to_frame * p.state.inertia * *frame;
            for c in 0..3 {
                system[(at + c, at + c)] += p.state.mass;
                (c..3).for_each(|a| system[(at + 3 + a, at + 3 + c)] += inertia.col(c)[a]);
            }
        }
        for (row, touch, h) in &active {
            let Some((body, arm)) = touch.and_then(|k| self.touches[k].pushed) else { continue };
            let at = 3 * rank + 6 * body;
            // The contact moves with the body by `shift - [arm]x turn`.
            let turn = -cross_matrix(to_frame * arm);
            let (ht, tht) = (*h * turn, turn.transpose() * *h * turn);
            for a in 0..3 {
                for c in 0..3 {
                    if a >= c {
                        system[(at + a, at + c)] += h.col(c)[a];
                        system[(at + 3 + a, at + 3 + c)] += tht.col(c)[a];
                    }
                    system[(at + 3 + a, at + c)] += ht.transpose().col(c)[a];
                    for (k, b) in row.iter().enumerate() {
                        system[(at + a, c * rank + k)] -= h.col(c)[a] * b;
                        system[(at + 3 + a, c * rank + k)] -= ht.transpose().col(c)[a] * b;
                    }
                }
            }
        }
    }

    /// Halves the step until the objective falls as the slope says it should.
    fn search(&self, state: &State, direction: &Direction) -> (Option<State>, f64) {
        let mut part = 1.0;
        if !(direction.slope < 0.0) {
            return (None, 0.0);
        }
        for _ in 0..MOST_HALVINGS {
            let mut y = state.y.clone();
            add_scaled(&mut y, &direction.step, part);
            let pushed = state
                .pushed
                .iter()
                .zip(&direction.pushed)
                .map(|(p, d)| Pushed { shift: p.shift + d.0 * part, turn: p.turn + d.1 * part, ..*p })
                .collect();
            let next = self.at(y, pushed);
            if next.objective <= state.objective + 1e-4 * part * direction.slope {
                return (Some(next), part);
            }
            part *= 0.5;
        }
        (None, part)
    }

    /// Takes the Hessian of where the body is.
    fn refresh(&self, state: &State, tangent: &mut Tangent) {
        let model = self.model;
        let energy = model.settings.energy;
        let hessians: Vec<Hessian> =
            state.gradients.iter().zip(&model.moduli).map(|(f, &m)| energy.hessian(f, &self.rotation, m)).collect();
        let volumes: Vec<f64> = model.samples.iter().map(|s| s.volume).collect();
        tangent.hessian = Some(assemble(&model.gradients_f32, &volumes, &hessians));
        tangent.taken = self.rotation;
        tangent.factor = None;
    }
}

struct Direction {
    step: Mat<f64>,
    pushed: Vec<(DVec3, DVec3)>,
    /// Of the objective along it.
    slope: f64,
    /// In units of the square root of mass times metres.
    length: f64,
}

struct Gradient {
    /// The elastic part of `coordinates`.
    elastic: Mat<f64>,
    coordinates: Mat<f64>,
    pushed: Vec<(DVec3, DVec3)>,
}

/// Cholesky's factor of a matrix of which the lower half is given; with more on the diagonal where it has none.
fn factor(mut system: Mat<f64>) -> Option<Llt<f64>> {
    let n = system.nrows();
    let mut shift = 1e-10 * (0..n).map(|k| system[(k, k)]).fold(0.0, f64::max);
    for _ in 0..6 {
        if let Ok(factor) = Llt::new(system.as_ref(), Side::Lower) {
            return Some(factor);
        }
        (0..n).for_each(|k| system[(k, k)] += shift);
        shift *= 100.0;
    }
    None
}

/// `F` of every sample.
pub(super) fn deformation_gradients(model: &ElasticModel, y: &Mat<f64>) -> Vec<DMat3> {
    let mut all = Mat::<f64>::zeros(model.gradients.nrows(), 3);
    matmul(all.as_mut(), Accum::Replace, model.gradients.as_ref(), y.as_ref(), 1.0, Par::Seq);
    let (x, y, z) = (all.col_as_slice(0), all.col_as_slice(1), all.col_as_slice(2));
    let triples = x.as_chunks::<3>().0.iter().zip(y.as_chunks::<3>().0).zip(z.as_chunks::<3>().0);
    triples
        .map(|((x, y), z)| {
            DMat3::from_cols(DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]), DVec3::new(x[2], y[2], z[2]))
        })
        .collect()
}

/// Rotation of the whole part; `None` where it is flat or inverted.
pub(super) fn rotation(model: &ElasticModel, y: &Mat<f64>) -> Option<DMat3> {
    let mut mean = DMat3::ZERO;
    for b in 0..3 {
        for a in 0..3 {
            mean.col_mut(b)[a] = (0..y.nrows()).map(|k| model.mean_gradient[(b, k)] * y[(k, a)]).sum();
        }
    }
    polar(&mean)
}

pub(super) fn difference(a: &Mat<f64>, b: &Mat<f64>) -> Mat<f64> {
    Mat::from_fn(a.nrows(), a.ncols(), |r, c| a[(r, c)] - b[(r, c)])
}

pub(super) fn add_scaled(to: &mut Mat<f64>, what: &Mat<f64>, by: f64) {
    for c in 0..to.ncols() {
        to.col_as_slice_mut(c).iter_mut().zip(what.col_as_slice(c)).for_each(|(t, w)| *t += by * w);
    }
}

pub(super) fn dot(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    let column = |c: usize| a.col_as_slice(c).iter().zip(b.col_as_slice(c)).map(|(x, y)| x * y).sum::<f64>();
    (0..a.ncols()).map(column).sum()
}

fn stack(y: &Mat<f64>) -> Mat<f64> {
    let rank = y.nrows();
    Mat::from_fn(3 * rank, 1, |r, _| y[(r % rank, r / rank)])
}

fn unstack(v: &Mat<f64>, rank: usize) -> Mat<f64> {
    Mat::from_fn(rank, 3, |k, a| v[(a * rank + k, 0)])
}

fn times(a: &Mat<f64>, b: &Mat<f64>) -> Mat<f64> {
    super::model::product(a, b)
}
