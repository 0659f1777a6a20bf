//! [`ElasticBody`]: where a part is and how it moves.

use std::collections::HashMap;
use std::sync::Arc;

use faer::Mat;
use glam::{DMat3, DQuat, DVec3, Vec3};

use super::ElasticModel;
use super::energy::von_mises;
use super::model::point_at;
use super::newton::{Tangent, add_scaled, deformation_gradients, dot, rotation};
use super::stiffness::turned;
use crate::world::RigidState;

/// A rigid motion: `x = rotation * X + translation`, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// A unit quaternion.
    pub rotation: DQuat,
    /// In world space.
    pub translation: DVec3,
}

impl Frame {
    /// Nothing moved.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// Where a point of the body's frame is.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }
}

/// An elastic part in motion.
pub struct ElasticBody {
    pub(super) model: Arc<ElasticModel>,
    /// Positions, `rank x 3`, and velocities; coordinates have unit mass.
    pub(super) y: Mat<f64>,
    pub(super) v: Mat<f64>,
    /// Positions, velocities and length of the step before, as far as the second-order scheme may use it.
    pub(super) before: Option<(Mat<f64>, Mat<f64>, f64)>,
    pub(super) rotation: DMat3,
    pub(super) tangent: Tangent,
    /// For each contact point: normal force in the last step in N, and slip speed in m/s.
    pub(super) pressed: Vec<f64>,
    pub(super) slipping: Vec<f64>,
    /// Rows of points that springs pulled at.
    pub(super) rows: HashMap<[u64; 3], Vec<f64>>,
    pub(super) asleep: bool,
    pub(super) frozen: bool,
    /// For how long it has not moved, in s.
    pub(super) still: f64,
    /// Where it was when it began not to.
    pub(super) still_at: Mat<f64>,
    /// Gravity and springs it fell asleep under.
    pub(super) slept_under: Option<(DVec3, Vec<super::Spring>)>,
    pub(super) elastic: f64,
}

impl ElasticBody {
    /// The part at rest, placed in the world.
    pub fn new(model: Arc<ElasticModel>, frame: Frame) -> Self {
        let points = model.contact_points.len();
        let mut body = Self {
            y: model.rest.clone(),
            v: Mat::zeros(model.rank(), 3),
            before: None,
            rotation: DMat3::IDENTITY,
            tangent: Tangent::at_rest(),
            pressed: vec![0.0; points],
            slipping: vec![0.0; points],
            rows: HashMap::new(),
            asleep: false,
            frozen: false,
            still: 0.0,
            still_at: model.rest.clone(),
            slept_under: None,
            elastic: 0.0,
            model,
        };
        body.place(frame);
        body
    }

    /// What it is made of.
    pub fn model(&self) -> &Arc<ElasticModel> {
        &self.model
    }

    /// Puts the part at rest somewhere else; it wakes, and a frozen one moves again.
    pub fn place(&mut self, frame: Frame) {
        let rotation = DMat3::from_quat(frame.rotation.normalize());
        self.y = turned(&self.model.rest, &rotation);
        self.translate(frame.translation);
        self.v = Mat::zeros(self.model.rank(), 3);
        self.rotation = rotation;
        self.tangent = Tangent::at_rest();
        self.pressed.fill(0.0);
        self.slipping.fill(0.0);
        self.elastic = 0.0;
        self.frozen = false;
        self.wake();
    }

    /// Moves the part as it is, with its deformation and its velocities turned along: `motion` goes from where it is to where it
    /// shall be.
    pub fn carry(&mut self, motion: Frame) {
        let turn = DMat3::from_quat(motion.rotation.normalize());
        self.y = turned(&self.y, &turn);
        self.translate(motion.translation);
        self.v = turned(&self.v, &turn);
        self.rotation = turn * self.rotation;
        self.wake();
    }

    fn translate(&mut self, by: DVec3) {
        for a in 0..3 {
            self.y.col_as_slice_mut(a).iter_mut().zip(&self.model.ones).for_each(|(y, one)| *y += one * by[a]);
        }
    }

    /// The rigid motion nearest to what the part did.
    pub fn frame(&self) -> Frame {
        let rotation = DQuat::from_mat3(&self.rotation).normalize();
        Frame { rotation, translation: self.center() - rotation * self.model.mass.center }
    }

    /// Centre of mass, in world space.
    pub fn center(&self) -> DVec3 {
        point_at(&self.model.ones, &self.y) / self.model.mass.mass
    }

    /// Where a point is, in world space; `rest`: in the body's frame.
    pub fn point_position(&self, rest: DVec3) -> DVec3 {
        point_at(&self.model.row(rest), &self.y)
    }

    /// How fast a point moves, in m/s, world space.
    pub fn point_velocity(&self, rest: DVec3) -> DVec3 {
        point_at(&self.model.row(rest), &self.v)
    }

    /// Where the contact points are, in world space.
    pub fn contact_positions(&self) -> Vec<DVec3> {
        let rows = self.model.contact_rows.chunks_exact(self.model.rank());
        rows.map(|row| point_at(row, &self.y)).collect()
    }

    /// Positions of all nodes of the cage, deformed, in the body's [`frame`](Self::frame): what splats follow.
    pub fn node_positions(&self, out: &mut Vec<Vec3>) {
        let model = &self.model;
        let frame = self.frame();
        let back = DMat3::from_quat(frame.rotation.conjugate());
        let mut y = self.y.clone();
        for a in 0..3 {
            let by = frame.translation[a];
            y.col_as_slice_mut(a).iter_mut().zip(&model.ones).for_each(|(y, one)| *y -= one * by);
        }
        // Handles in the frame, small numbers there: `f32` holds them.
        let handles = super::model::product(&model.combination, &turned(&y, &back));
        let handles: Vec<[Vec3; 4]> = (0..model.handles())
            .map(|j| {
                std::array::from_fn(|c| {
                    let row = 4 * j + c;
                    DVec3::new(handles[(row, 0)], handles[(row, 1)], handles[(row, 2)]).as_vec3()
                })
            })
            .collect();
        let cage = &model.cage.cage;
        out.clear();
        out.extend((0..cage.node_count()).map(|node| {
            let at = (cage.node_position(node) - model.center.as_vec3()) / model.size as f32;
            let weights = &model.weights.nodes[node * handles.len()..(node + 1) * handles.len()];
            let mut sum = [Vec3::ZERO; 4];
            for (handle, &w) in handles.iter().zip(weights) {
                (0..4).for_each(|c| sum[c] += handle[c] * w as f32);
            }
            sum[0] * at.x + sum[1] * at.y + sum[2] * at.z + sum[3]
        }));
    }

    /// Kinetic energy, in J.
    pub fn kinetic_energy(&self) -> f64 {
        0.5 * dot(&self.v, &self.v)
    }

    /// Elastic energy, in J.
    pub fn elastic_energy(&self) -> f64 {
        self.elastic
    }

    /// In kg m/s.
    pub fn momentum(&self) -> DVec3 {
        point_at(&self.model.ones, &self.v)
    }

    /// About the centre of mass, in kg m^2/s.
    pub fn angular_momentum(&self) -> DVec3 {
        let row = |m: &Mat<f64>, k: usize| DVec3::new(m[(k, 0)], m[(k, 1)], m[(k, 2)]);
        let about_origin: DVec3 = (0..self.model.rank()).map(|k| row(&self.y, k).cross(row(&self.v, k))).sum();
        about_origin - self.center().cross(self.momentum())
    }

    /// The rigid body with the same mass, momenta and place: what another body feels when it touches this one.
    pub fn rigid_state(&self) -> RigidState {
        let (mass, center) = (self.model.mass.mass, self.center());
        let mut second = DMat3::ZERO;
        for k in 0..self.model.rank() {
            let p = DVec3::new(self.y[(k, 0)], self.y[(k, 1)], self.y[(k, 2)]) - center * self.model.ones[k];
            second += DMat3::from_cols(p * p.x, p * p.y, p * p.z);
        }
        let trace = second.x_axis.x + second.y_axis.y + second.z_axis.z;
        let inertia = DMat3::from_diagonal(DVec3::splat(trace)) - second;
        let angular_velocity = inertia.inverse() * self.angular_momentum();
        RigidState { mass, inertia, center, linear_velocity: self.momentum() / mass, angular_velocity }
    }

    /// Changes the velocity of the part as if it were rigid: linear in m/s, angular in rad/s about its centre of mass.
    pub fn kick(&mut self, linear: DVec3, angular: DVec3) {
        let center = self.center();
        for k in 0..self.model.rank() {
            let one = self.model.ones[k];
            let arm = DVec3::new(self.y[(k, 0)], self.y[(k, 1)], self.y[(k, 2)]) - center * one;
            let add = linear * one + angular.cross(arm);
            (0..3).for_each(|a| self.v[(k, a)] += add[a]);
        }
        self.wake();
    }

    /// Pushes the part about a point; `impulse` in N s, world space, `rest`: in the body's frame.
    ///
    /// What pushes is as wide as a hand on a toy: the impulse is spread over all within a third of the part's size. In a single
    /// point it would squeeze a few grams to nothing.
    pub fn push(&mut self, rest: DVec3, impulse: DVec3) {
        let model = self.model.clone();
        let reach = 0.33 * model.size;
        let share = |s: &super::Sample| (1.0 - s.position.distance_squared(rest) / (reach * reach)).max(0.0).powi(2);
        let near = model.samples.iter().map(|s| s.position.distance(rest)).fold(f64::INFINITY, f64::min);
        // A point beside the part pushes what of it is nearest.
        let (mut rows, mut sum) = (vec![0.0; model.rank()], 0.0);
        for sample in &model.samples {
            let at = if near < 0.5 * reach {
                share(sample)
            } else {
                f64::from(u8::from(sample.position.distance(rest) <= near))
            };
            if at > 0.0 {
                let mass = at * sample.volume * f64::from(model.materials[usize::from(sample.region)].density);
                rows.iter_mut().zip(model.row(sample.position)).for_each(|(row, b)| *row += mass * b);
                sum += mass;
            }
        }
        if !(sum > 0.0) {
            return;
        }
        for a in 0..3 {
            self.v.col_as_slice_mut(a).iter_mut().zip(&rows).for_each(|(v, b)| *v += b / sum * impulse[a]);
        }
        self.wake();
    }

    /// Von Mises' stress at each sample, in Pa.
    pub fn stresses(&self) -> Vec<f64> {
        let energy = self.model.settings.energy;
        let gradients = deformation_gradients(&self.model, &self.y);
        let of = |(f, &m): (&DMat3, &super::energy::Moduli)| von_mises(f, &energy.stress(f, &self.rotation, m));
        gradients.iter().zip(&self.model.moduli).map(of).collect()
    }

    /// Where the samples are, in world space.
    pub fn sample_positions(&self) -> Vec<DVec3> {
        self.model.samples.iter().map(|s| self.point_position(s.position)).collect()
    }

    /// Deformation gradients at the samples.
    pub fn deformation_gradients(&self) -> Vec<DMat3> {
        deformation_gradients(&self.model, &self.y)
    }

    /// Whether it rests and is not stepped.
    pub fn asleep(&self) -> bool {
        self.asleep
    }

    /// Whether a step failed: the part stays in its last sound state until it is [placed](Self::place) anew.
    pub fn frozen(&self) -> bool {
        self.frozen
    }

    /// Steps it again.
    pub fn wake(&mut self) {
        self.asleep = false;
        self.still = 0.0;
        self.slept_under = None;
        // What came from outside is no part of the history that the second-order scheme goes by.
        self.before = None;
    }

    /// The functions at a point that springs pull at, made once.
    pub(super) fn spring_row(&mut self, point: DVec3) -> Vec<f64> {
        let key = point.to_array().map(f64::to_bits);
        if self.rows.len() > 4096 {
            self.rows.clear();
        }
        let model = &self.model;
        self.rows.entry(key).or_insert_with(|| model.row(point)).clone()
    }

    /// Rotation of the whole part, or the last one where it has none.
    pub(super) fn update_rotation(&mut self) {
        if let Some(found) = rotation(&self.model, &self.y) {
            self.rotation = found;
        }
    }

    /// Where coordinates would be after moving on as they do.
    pub(super) fn coasted(&self, dt: f64) -> Mat<f64> {
        let mut y = self.y.clone();
        add_scaled(&mut y, &self.v, dt);
        y
    }
}
