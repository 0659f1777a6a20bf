//! [`ElasticModel`]: all that never changes while a part moves.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use glam::{DMat3, DVec3};

use super::cubature::{self, Sample};
use super::energy::{Hessian, Moduli};
use super::orthonormal::orthonormal;
use super::stiffness::{self, lowest_frequency};
use super::{ElasticError, ElasticSettings};
use crate::{
    BasisKind, BasisWeights, MassProperties, Material, PartCage, Progress, Solid, skinning_weights, surface_points,
};

/// A part with its skinning weights, samples and all products of them; shared by all bodies made of it.
///
/// A point at rest `X` moves to `x = sum_k b_k(X) y_k`: `b` are [`rank`](Self::rank) functions with `sum over samples of
/// mass * b_k * b_l = (k == l)`, combined from the weights times 1, x, y and z (Modi and others, "Simplicits", 2024, section 3).
/// The coordinates `y` are positions, not displacements: rest, like every rigid motion, is one choice of them.
pub struct ElasticModel {
    pub(super) settings: ElasticSettings,
    pub(super) materials: Vec<Material>,
    pub(super) cage: PartCage,
    pub(super) weights: BasisWeights,
    pub(super) samples: Vec<Sample>,
    pub(super) moduli: Vec<Moduli>,
    /// Centre and size of the coordinates in which the affine motions are told.
    pub(super) center: DVec3,
    pub(super) size: f64,
    /// `4 handles x rank`: from coordinates to handles.
    pub(super) combination: Mat<f64>,
    /// `3 samples x rank`: `d b_k / d X_b` at sample i in row `3 i + b`.
    pub(super) gradients: Mat<f64>,
    /// The same, for Hessians.
    pub(super) gradients_f32: Mat<f32>,
    /// Of the volume-weighted mean of the gradients: `3 x rank`.
    pub(super) mean_gradient: Mat<f64>,
    /// `rank`: coordinates of the function 1.
    pub(super) ones: Vec<f64>,
    /// `rank x 3`: coordinates of the body at rest.
    pub(super) rest: Mat<f64>,
    /// `rank` values for each contact point.
    pub(super) contact_rows: Vec<f64>,
    pub(super) contact_points: Vec<DVec3>,
    /// `3 rank x 3 rank`, by axis first: of the elastic energy at rest.
    pub(super) rest_hessian: Mat<f64>,
    pub(super) mass: MassProperties,
    /// Lowest angular frequency of the free body, in rad/s.
    pub(super) frequency: f64,
    /// Of all samples, weighted by volume and stiffness.
    pub(super) damping_ratio: f64,
}

impl ElasticModel {
    /// Makes a body of a solid.
    ///
    /// `materials`: one for each region of the solid. The densities decide masses, the moduli the basis and the stresses.
    ///
    /// # Errors
    /// [`ElasticError`].
    ///
    /// Cost: the basis (tens of milliseconds for eigenmodes, seconds for a network), then about `samples * (4 handles)^2`.
    pub fn build(
        solid: &Solid,
        materials: &[Material],
        settings: &ElasticSettings,
        progress: &dyn Progress,
    ) -> Result<Self, ElasticError> {
        settings.check()?;
        for material in materials {
            material.check()?;
        }
        if let Some(&region) = solid.regions.iter().find(|&&r| usize::from(r) >= materials.len()) {
            return Err(ElasticError::NoMaterial { region, materials: materials.len() });
        }
        let materials = effective(materials, settings);
        let cage = PartCage::build(solid, u32::from(settings.cage_cells), MOST_NODES)?;
        let handles = if settings.basis == BasisKind::Affine { 1 } else { usize::from(settings.handles) };
        let weights = skinning_weights(&settings.basis, &cage, &materials, handles, settings.seed, progress)?;
        if progress.cancelled() {
            return Err(ElasticError::Cancelled);
        }
        Self::from_weights(solid, &materials, settings, cage, weights)
    }

    /// The same with weights that were made before.
    ///
    /// # Errors
    /// [`ElasticError`].
    pub fn from_weights(
        solid: &Solid,
        materials: &[Material],
        settings: &ElasticSettings,
        cage: PartCage,
        weights: BasisWeights,
    ) -> Result<Self, ElasticError> {
        let materials = &effective(materials, settings);
        let count = match settings.cubature {
            0 => cubature::needed(weights.handles),
            asked => usize::from(asked),
        };
        let samples = cubature::samples(solid, count, settings.seed);
        let contact_points = surface_points(solid, usize::from(settings.contact_points), settings.seed);
        Self::from_samples(materials, settings, cage, weights, samples, contact_points)
    }

    /// What [`from_weights`](Self::from_weights) and a baked file share: everything else follows from these.
    pub(super) fn from_samples(
        materials: &[Material],
        settings: &ElasticSettings,
        cage: PartCage,
        weights: BasisWeights,
        samples: Vec<Sample>,
        contact_points: Vec<DVec3>,
    ) -> Result<Self, ElasticError> {
        let of = |s: &Sample| &materials[usize::from(s.region)];
        let masses: Vec<f64> = samples.iter().map(|s| s.volume * f64::from(of(s).density)).collect();
        let moduli: Vec<Moduli> = samples
            .iter()
            .map(|s| {
                let (lambda, mu) = of(s).lame();
                Moduli { lambda, mu }
            })
            .collect();
        let mass = mass_of(&samples, &masses);
        if !(mass.mass > 0.0 && mass.mass.is_finite() && mass.center.is_finite()) {
            return Err(ElasticError::NotFinite("its mass"));
        }
        let reach = samples.iter().map(|s| s.position.distance(mass.center)).fold(0.0, f64::max);
        let (center, size) = (mass.center, reach.max(f64::MIN_POSITIVE));

        let functions = 4 * weights.handles;
        let frame = Functions { cage: &cage, weights: &weights, center, size };
        let mut weighted = Mat::<f64>::zeros(samples.len(), functions);
        let mut row = vec![0.0; functions];
        for (i, sample) in samples.iter().enumerate() {
            frame.values(sample.position, &mut row);
            row.iter().enumerate().for_each(|(c, v)| weighted[(i, c)] = v * masses[i].sqrt());
        }
        // The constant handle first: every rigid motion is then told exactly, by the first four functions alone.
        let constant = 4 * (weights.handles - 1);
        let found = orthonormal(weighted, &[constant + 3, constant, constant + 1, constant + 2]);
        let combination = found.combination;
        let rank = found.rank;

        let mut raw = Mat::<f64>::zeros(3 * samples.len(), functions);
        let mut rows = vec![[0.0; 3]; functions];
        for (i, sample) in samples.iter().enumerate() {
            frame.gradients(sample.position, &mut rows);
            for (c, gradient) in rows.iter().enumerate() {
                (0..3).for_each(|b| raw[(3 * i + b, c)] = gradient[b]);
            }
        }
        let gradients = product(&raw, &combination);
        let gradients_f32 = Mat::from_fn(gradients.nrows(), rank, |r, c| gradients[(r, c)] as f32);
        let volume: f64 = samples.iter().map(|s| s.volume).sum();
        let mean_gradient = Mat::from_fn(3, rank, |b, k| {
            samples.iter().enumerate().map(|(i, s)| s.volume * gradients[(3 * i + b, k)]).sum::<f64>() / volume
        });

        let mut rest = Mat::<f64>::zeros(rank, 3);
        let mut ones = vec![0.0; rank];
        let mut own = vec![0.0; rank];
        for (sample, &m) in samples.iter().zip(&masses) {
            frame.combined(sample.position, &combination, &mut row, &mut own);
            // Functions beyond the first four have no part in rigid motions: what rounding says of them is left out.
            ones[0] += m * own[0];
            for (k, &b) in own.iter().enumerate().take(4) {
                (0..3).for_each(|a| rest[(k, a)] += m * b * sample.position[a]);
            }
        }
        let missed = samples.iter().fold(0.0_f64, |worst, sample| {
            let mut own = vec![0.0; rank];
            frame.combined(sample.position, &combination, &mut vec![0.0; functions], &mut own);
            worst.max((point_at(&own, &rest) - sample.position).length())
        });
        if rank < 4 || !(missed < 1e-6 * size) {
            return Err(ElasticError::TooThin { samples: samples.len(), rank: rank.min(3) });
        }
        let mut contact_rows = Vec::with_capacity(contact_points.len() * rank);
        for &point in &contact_points {
            frame.combined(point, &combination, &mut row, &mut own);
            contact_rows.extend_from_slice(&own);
        }
        let volumes: Vec<f64> = samples.iter().map(|s| s.volume).collect();
        let at_rest: Vec<Hessian> =
            moduli.iter().map(|&m| settings.energy.hessian(&DMat3::IDENTITY, &DMat3::IDENTITY, m)).collect();
        let rest_hessian = stiffness::assemble(&gradients_f32, &volumes, &at_rest);
        let frequency = lowest_frequency(&rest_hessian, &rest, &ones);
        if !frequency.is_finite() {
            return Err(ElasticError::NotFinite("its stiffness"));
        }
        let stiffness = |s: &Sample| s.volume * f64::from(of(s).youngs_modulus);
        let damping_ratio = samples.iter().map(|s| stiffness(s) * f64::from(of(s).damping_ratio)).sum::<f64>()
            / samples.iter().map(stiffness).sum::<f64>().max(f64::MIN_POSITIVE);
        Ok(Self {
            settings: settings.clone(),
            materials: materials.to_vec(),
            cage,
            weights,
            samples,
            moduli,
            center,
            size,
            combination,
            gradients,
            gradients_f32,
            mean_gradient,
            ones,
            rest,
            contact_rows,
            contact_points,
            rest_hessian,
            mass,
            frequency,
            damping_ratio,
        })
    }

    /// Independent functions: unknowns of a step are three times as many.
    pub fn rank(&self) -> usize {
        self.combination.ncols()
    }

    /// Handles, the constant one included; fewer than were asked for where the part has no more.
    pub fn handles(&self) -> usize {
        self.weights.handles
    }

    /// The settings it was built with.
    pub fn settings(&self) -> &ElasticSettings {
        &self.settings
    }

    /// The materials, one for each region, as the solver uses them: with Poisson's ratio and contrast limited.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The cage, in metres, in the body's frame.
    pub fn cage(&self) -> &PartCage {
        &self.cage
    }

    /// Weights at the nodes of the cage.
    pub fn weights(&self) -> &BasisWeights {
        &self.weights
    }

    /// Where strain is measured.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Points of the surface that can touch something, at rest, in the body's frame.
    pub fn contact_points(&self) -> &[DVec3] {
        &self.contact_points
    }

    /// Mass, centre and inertia at rest.
    pub fn mass(&self) -> &MassProperties {
        &self.mass
    }

    /// The lowest frequency at which the free body swings, in Hz.
    pub fn frequency(&self) -> f64 {
        self.frequency / std::f64::consts::TAU
    }

    /// The functions at a point at rest, in the body's frame.
    pub(super) fn row(&self, point: DVec3) -> Vec<f64> {
        let frame = Functions { cage: &self.cage, weights: &self.weights, center: self.center, size: self.size };
        let mut own = vec![0.0; self.rank()];
        frame.combined(point, &self.combination, &mut vec![0.0; 4 * self.weights.handles], &mut own);
        own
    }
}

/// More nodes cost time and show nothing.
pub(super) const MOST_NODES: usize = 8000;

/// Materials as the solver can use them.
fn effective(materials: &[Material], settings: &ElasticSettings) -> Vec<Material> {
    let softest = materials.iter().map(|m| m.youngs_modulus).fold(f32::INFINITY, f32::min);
    let mut most_poisson = settings.most_poisson_ratio;
    if settings.handles <= 16 {
        // Fewer handles lock earlier.
        most_poisson = most_poisson.min(0.40_f64.max(most_poisson - 0.05));
    }
    materials
        .iter()
        .map(|m| Material {
            youngs_modulus: m.youngs_modulus.min(softest * settings.most_contrast as f32),
            poisson_ratio: m.poisson_ratio.min(most_poisson as f32),
            ..*m
        })
        .collect()
}

fn mass_of(samples: &[Sample], masses: &[f64]) -> MassProperties {
    let mass: f64 = masses.iter().sum();
    let center = samples.iter().zip(masses).map(|(s, &m)| s.position * m).sum::<DVec3>() / mass;
    let mut inertia = DMat3::ZERO;
    for (sample, &m) in samples.iter().zip(masses) {
        let d = sample.position - center;
        let outer = DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        inertia += (DMat3::from_diagonal(DVec3::splat(d.length_squared())) - outer) * m;
    }
    MassProperties { mass, center, inertia }
}

/// `a b`.
pub(super) fn product(a: &Mat<f64>, b: &Mat<f64>) -> Mat<f64> {
    let mut out = Mat::zeros(a.nrows(), b.ncols());
    matmul(out.as_mut(), Accum::Replace, a.as_ref(), b.as_ref(), 1.0, Par::Seq);
    out
}

/// `sum_k row_k y_k`.
pub(super) fn point_at(row: &[f64], y: &Mat<f64>) -> DVec3 {
    let along = |a: usize| row.iter().zip(y.col_as_slice(a)).map(|(b, y)| b * y).sum();
    DVec3::new(along(0), along(1), along(2))
}

/// The weights times 1, x, y, z: column `4 j + c` is weight j times coordinate c, the last of which is 1.
struct Functions<'a> {
    cage: &'a PartCage,
    weights: &'a BasisWeights,
    center: DVec3,
    size: f64,
}

impl Functions<'_> {
    fn local(&self, point: DVec3) -> [f64; 4] {
        let x = (point - self.center) / self.size;
        [x.x, x.y, x.z, 1.0]
    }

    fn values(&self, point: DVec3, out: &mut [f64]) {
        let x = self.local(point);
        let weights = self.at(point);
        for (j, w) in weights.iter().enumerate() {
            (0..4).for_each(|c| out[4 * j + c] = w.0 * x[c]);
        }
    }

    fn gradients(&self, point: DVec3, out: &mut [[f64; 3]]) {
        let x = self.local(point);
        for (j, (w, gradient)) in self.at(point).iter().enumerate() {
            for c in 0..4 {
                let mut d = *gradient * x[c];
                if c < 3 {
                    d[c] += w / self.size;
                }
                out[4 * j + c] = d.to_array();
            }
        }
    }

    /// Values of the combined functions; `scratch` has room for the raw ones.
    fn combined(&self, point: DVec3, combination: &Mat<f64>, scratch: &mut [f64], out: &mut [f64]) {
        self.values(point, scratch);
        for (k, out) in out.iter_mut().enumerate() {
            *out = scratch.iter().zip(combination.col_as_slice(k)).map(|(b, c)| b * c).sum();
        }
    }

    /// Weights and their gradients at a point.
    fn at(&self, point: DVec3) -> Vec<(f64, DVec3)> {
        let handles = self.weights.handles;
        let cage = &self.cage.cage;
        let cell = f64::from(cage.cell);
        // Weights of points outside the cage are those of its nearest point: the cage has a ring of cells around the part.
        let at = ((point - cage.origin.as_dvec3()) / cell).clamp(DVec3::ZERO, cage.cells.as_dvec3());
        let node = at.floor().min((cage.cells - 1).as_dvec3());
        let corners = cage.corners(node.as_uvec3());
        let (up, down) = (at - node, DVec3::ONE - (at - node));
        let mut out = vec![(0.0, DVec3::ZERO); handles];
        for (k, corner) in corners.into_iter().enumerate() {
            let nodes = &self.weights.nodes[corner * handles..(corner + 1) * handles];
            let side = |axis: usize| if k >> axis & 1 == 1 { (up[axis], 1.0) } else { (down[axis], -1.0) };
            let [(x, dx), (y, dy), (z, dz)] = [side(0), side(1), side(2)];
            let (value, slope) = (x * y * z, DVec3::new(dx * y * z, x * dy * z, x * y * dz) / cell);
            for (out, &w) in out.iter_mut().zip(nodes) {
                out.0 += value * w;
                out.1 += slope * w;
            }
        }
        out
    }
}
