//! [`SimplicitsTraining`]: weights by a network trained on the elastic energy of random motions.
//!
//! The method of Modi, Sharp, Perel, Sueda and Levin, "Simplicits: Mesh-Free, Geometry-Agnostic Elastic Simulation" (2024), with
//! three deviations: one scale for all axes; moduli relative to their mean, so that the two losses keep their balance for any
//! material; gradients of the weights by the chain rule, where theirs are finite differences.

mod energy;
mod network;
mod points;
#[cfg(test)]
mod tests;

use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3;

use self::energy::{Elastic, Motions, Point, add_orthogonality, gram, orthogonality};
use self::network::{Network, Pass};
use self::points::Points;
use super::volume::mean_squares;
use super::{
    BasisError, BasisReport, BasisWeights, MOST_HANDLES, PartCage, Progress, SimplicitsSettings, check_materials,
};
use crate::Material;

/// Points that are taken through the network at once. Fixed, so that sums are made in the same order on any number of threads.
const CHUNK: usize = 64;

/// All that a training is made of; with the part and its materials it goes on with the same bits as if it had never stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct SimplicitsState {
    /// As given.
    pub settings: SimplicitsSettings,
    /// Handles, the constant one among them.
    pub handles: usize,
    /// As given.
    pub seed: u64,
    /// Of the part and the materials it was trained on.
    pub key: u64,
    /// Steps done.
    pub step: u32,
    /// Loss of the last step; 0 before the first.
    pub loss: f64,
    /// The network's numbers, then Adam's first moments, then its second ones, as many of each.
    pub numbers: Vec<f32>,
}

/// A network on the way to being weights.
pub struct SimplicitsTraining<'a> {
    cage: &'a PartCage,
    points: Points,
    network: Network,
    state: SimplicitsState,
    chunks: Vec<Chunk>,
}

/// Room for some of the points.
struct Chunk {
    pass: Pass,
    elastic: Elastic,
    energy: f64,
}

/// The two parts of the loss.
#[derive(Clone, Copy, Debug)]
struct Loss {
    elastic: f64,
    orthogonality: f64,
}

impl<'a> SimplicitsTraining<'a> {
    /// Begins at step 0. `handles`: at least 2, the constant one among them.
    ///
    /// # Errors
    /// [`BasisError::HandlesOutOfRange`], [`BasisError::Setting`], [`BasisError::MaterialMissing`], [`BasisError::Stiffness`].
    pub fn new(
        cage: &'a PartCage,
        materials: &[Material],
        handles: usize,
        settings: SimplicitsSettings,
        seed: u64,
    ) -> Result<Self, BasisError> {
        let network = network(&settings, handles)?;
        let mut numbers = network.start(seed);
        numbers.resize(3 * network.len(), 0.0);
        let key = key(cage, materials);
        Self::begin(
            cage,
            materials,
            network,
            SimplicitsState { settings, handles, seed, key, step: 0, loss: 0.0, numbers },
        )
    }

    /// Goes on from a saved state.
    ///
    /// # Errors
    /// [`BasisError::OtherTraining`] if the state is not of this part and these materials, or not a state at all; and those of
    /// [`Self::new`].
    pub fn resume(cage: &'a PartCage, materials: &[Material], state: SimplicitsState) -> Result<Self, BasisError> {
        let network = network(&state.settings, state.handles)?;
        let sound = state.numbers.len() == 3 * network.len() && state.numbers.iter().all(|number| number.is_finite());
        if !sound || state.step > state.settings.steps || state.key != key(cage, materials) {
            return Err(BasisError::OtherTraining);
        }
        Self::begin(cage, materials, network, state)
    }

    fn begin(
        cage: &'a PartCage,
        materials: &[Material],
        network: Network,
        state: SimplicitsState,
    ) -> Result<Self, BasisError> {
        check_materials(cage, materials)?;
        let count = state.settings.points as usize;
        let chunk = |first: usize| {
            let points = CHUNK.min(count - first);
            let elastic = Elastic::new(network.outputs, usize::from(state.settings.motions), points);
            Chunk { pass: Pass::new(network, points), elastic, energy: 0.0 }
        };
        let chunks = (0..count).step_by(CHUNK).map(chunk).collect();
        Ok(Self { cage, points: Points::new(cage, materials)?, network, state, chunks })
    }

    /// What to save.
    pub fn state(&self) -> &SimplicitsState {
        &self.state
    }

    /// Whether all steps are done.
    pub fn done(&self) -> bool {
        self.state.step >= self.state.settings.steps
    }

    /// Goes on to the last step.
    ///
    /// # Errors
    /// [`BasisError::Cancelled`], with the state as the last finished step left it; [`BasisError::Numerical`] if the network's
    /// numbers overflow.
    pub fn run(&mut self, progress: &dyn Progress) -> Result<(), BasisError> {
        while !self.done() {
            if progress.cancelled() {
                return Err(BasisError::Cancelled);
            }
            self.step()?;
            progress.report(self.state.step as f32 / self.state.settings.steps as f32);
        }
        Ok(())
    }

    /// One step of Adam.
    ///
    /// # Errors
    /// [`BasisError::Numerical`] if the loss is not finite; the state stays as it was.
    pub fn step(&mut self) -> Result<(), BasisError> {
        let (settings, step) = (self.state.settings, self.state.step);
        let stream = 1 + 2 * u64::from(step);
        let points = self.points.draw(settings.points as usize, self.state.seed, stream);
        let motions = Motions::random(usize::from(settings.motions), self.network.outputs, self.state.seed, stream + 1);
        let ramp = f64::from(step) / f64::from(settings.steps);
        let loss = self.evaluate(&points, &motions, ramp as f32);
        let loss = loss.elastic + loss.orthogonality;
        if !loss.is_finite() {
            return Err(BasisError::Numerical { what: "the loss of the training is not finite" });
        }
        self.state.step += 1;
        self.state.loss = loss;
        self.adam();
        Ok(())
    }

    /// The loss; its gradient is left in the chunks.
    fn evaluate(&mut self, points: &[Point], motions: &Motions, ramp: f32) -> Loss {
        let (settings, outputs) = (self.state.settings, self.network.outputs);
        let parameters = &self.state.numbers[..self.network.len()];
        let grams: Vec<Vec<f32>> = self
            .chunks
            .par_iter_mut()
            .zip(points.par_chunks(CHUNK))
            .map(|(chunk, points)| {
                let places: Vec<[f32; 3]> = points.iter().map(|point| point.at).collect();
                chunk.pass.forth(parameters, &places);
                gram(&chunk.pass.outputs, outputs, points.len())
            })
            .collect();
        let mut sum = vec![0.0; outputs * outputs];
        grams.iter().for_each(|gram| sum.iter_mut().zip(gram).for_each(|(sum, &value)| *sum += f64::from(value)));
        let (orthogonality, factor) = orthogonality(&sum, outputs, f64::from(settings.orthogonality_weight));
        let scale = f64::from(settings.elastic_weight) * self.points.volume / points.len() as f64;
        self.chunks.par_iter_mut().zip(points.par_chunks(CHUNK)).for_each(|(chunk, points)| {
            let Chunk { pass, elastic, energy } = chunk;
            *energy = elastic.evaluate(motions, points, &pass.outputs, (scale as f32, ramp), &mut pass.output_gradient);
            add_orthogonality(&factor, &pass.outputs, outputs, points.len(), &mut pass.output_gradient);
            pass.back(parameters);
        });
        Loss { elastic: self.chunks.iter().map(|chunk| chunk.energy).sum(), orthogonality }
    }

    /// The gradient of the last loss.
    fn gradient(&self) -> Vec<f32> {
        let mut sum = vec![0.0; self.network.len()];
        for chunk in &self.chunks {
            sum.iter_mut().zip(&chunk.pass.gradient).for_each(|(sum, value)| *sum += value);
        }
        sum
    }

    /// Kingma and Ba, "Adam" (2015), with their constants.
    fn adam(&mut self) {
        const MEAN: f32 = 0.9;
        const SQUARE: f32 = 0.999;
        const TINY: f32 = 1e-8;
        let gradient = self.gradient();
        let step = f64::from(self.state.step);
        let bias = |beta: f32| (1.0 - f64::from(beta).powf(step)) as f32;
        let (mean_bias, square_bias) = (bias(MEAN), bias(SQUARE));
        let rate = self.state.settings.learning_rate;
        let (parameters, moments) = self.state.numbers.split_at_mut(self.network.len());
        let (means, squares) = moments.split_at_mut(self.network.len());
        for (((value, mean), square), g) in parameters.iter_mut().zip(means).zip(squares).zip(gradient) {
            *mean = MEAN * *mean + (1.0 - MEAN) * g;
            *square = SQUARE * *square + (1.0 - SQUARE) * g * g;
            *value -= rate * (*mean / mean_bias) / ((*square / square_bias).sqrt() + TINY);
        }
    }

    /// The network's weights at the cage's nodes, each brought to a mean square of 1 over the active volume.
    pub fn weights(&self) -> BasisWeights {
        let (count, outputs) = (self.cage.cage.node_count(), self.network.outputs);
        let handles = outputs + 1;
        let parameters = &self.state.numbers[..self.network.len()];
        let places: Vec<[f32; 3]> =
            (0..count).map(|node| self.points.normalised(self.cage.node_position(node))).collect();
        let mut nodes = vec![1.0; count * handles];
        nodes.par_chunks_mut(CHUNK * handles).zip(places.par_chunks(CHUNK)).for_each(|(nodes, places)| {
            let mut pass = Pass::new(self.network, places.len());
            pass.forth(parameters, places);
            for (node, own) in nodes.chunks_exact_mut(handles).zip(pass.outputs.chunks_exact(outputs)) {
                node.iter_mut().zip(own).for_each(|(value, &weight)| *value = f64::from(weight));
            }
        });
        let squares = mean_squares(self.cage, handles, &nodes);
        for node in nodes.chunks_exact_mut(handles) {
            for (value, square) in node[..outputs].iter_mut().zip(&squares) {
                // A weight that training has left at nothing stays that.
                let scale = if *square > 0.0 { 1.0 / square.sqrt() } else { 1.0 };
                *value = f64::from((*value * scale) as f32);
            }
        }
        let report = BasisReport {
            handles_wanted: handles,
            pieces: self.cage.pieces(),
            eigenvalues: Vec::new(),
            steps: self.state.step as usize,
            loss: self.state.loss,
        };
        BasisWeights { handles, nodes, report }
    }
}

/// Trains from the first to the last step.
pub(super) fn weights(
    cage: &PartCage,
    materials: &[Material],
    handles: usize,
    settings: &SimplicitsSettings,
    seed: u64,
    progress: &dyn Progress,
) -> Result<BasisWeights, BasisError> {
    let mut training = SimplicitsTraining::new(cage, materials, handles, *settings, seed)?;
    training.run(progress)?;
    Ok(training.weights())
}

/// The network of some settings, checked.
fn network(settings: &SimplicitsSettings, handles: usize) -> Result<Network, BasisError> {
    if !(2..=MOST_HANDLES).contains(&handles) {
        return Err(BasisError::HandlesOutOfRange { have: handles, most: MOST_HANDLES });
    }
    let positive = |value: f32| value > 0.0 && value.is_finite();
    let checks = [
        ("steps", f64::from(settings.steps), settings.steps > 0),
        ("layers", f64::from(settings.layers), (1..=16).contains(&settings.layers)),
        ("points", f64::from(settings.points), (16..=8192).contains(&settings.points)),
        ("motions", f64::from(settings.motions), (1..=64).contains(&settings.motions)),
        ("learning_rate", f64::from(settings.learning_rate), positive(settings.learning_rate)),
        ("elastic_weight", f64::from(settings.elastic_weight), positive(settings.elastic_weight)),
        ("orthogonality_weight", f64::from(settings.orthogonality_weight), positive(settings.orthogonality_weight)),
    ];
    match checks.iter().find(|(.., sound)| !sound) {
        Some(&(name, value, _)) => Err(BasisError::Setting { name, value }),
        None => Ok(Network { layers: usize::from(settings.layers), outputs: handles - 1 }),
    }
}

/// Of all that a training takes from a part and its materials.
fn key(cage: &PartCage, materials: &[Material]) -> u64 {
    let mut hash = Xxh3::new();
    let mut add = |bits: u32| hash.update(&bits.to_le_bytes());
    cage.cage.cells.to_array().into_iter().for_each(&mut add);
    cage.cage.origin.to_array().into_iter().map(f32::to_bits).for_each(&mut add);
    add(cage.cage.cell.to_bits());
    cage.fill.iter().map(|part| part.to_bits()).for_each(&mut add);
    cage.shares_start.iter().copied().for_each(&mut add);
    for part in &cage.shares {
        add(u32::from(part.region));
        add(part.share.to_bits());
    }
    for material in materials {
        add(material.youngs_modulus.to_bits());
        add(material.poisson_ratio.to_bits());
    }
    hash.digest()
}
