//! What an elastic part moves by: a cage around its solid, and weights at the cage's nodes.
//!
//! The motion is `x = X + sum_j w_j(X) Z_j [X; 1]` with a 3 x 4 matrix `Z_j` for each weight `w_j` (Modi et al., "Simplicits",
//! 2024). Weights live at the nodes of a [`PartCage`] and are trilinear between them; the last one is 1 everywhere. Where they come
//! from is a [`BasisKind`]; whatever uses them cannot tell.
//!
//! All of it gives the same bits on each run of one machine, on any number of threads.

mod cage;
mod eigenmodes;
mod error;
mod extrapolate;
mod kind;
mod lanczos;
mod pencil;
mod pieces;
mod progress;
mod random;
mod simplicits;
mod start;
#[cfg(test)]
mod tests;
mod volume;

pub use cage::{PartCage, RegionShare};
pub use error::BasisError;
pub use kind::{BasisKind, SimplicitsSettings};
pub use progress::{NoProgress, Progress};
pub use simplicits::{SimplicitsState, SimplicitsTraining};

use crate::Material;

/// Handles of one part, at most.
pub const MOST_HANDLES: usize = 64;

/// Skinning weights at the nodes of a cage.
#[derive(Clone, Debug, PartialEq)]
pub struct BasisWeights {
    /// Number of weights; may exceed what was asked for, where that would have split modes of the same eigenvalue.
    pub handles: usize,
    /// `node * handles + j`, for all nodes of the cage. The last weight is 1 everywhere; the others have a mean square of 1 over the
    /// active volume. All are representable as `f32`.
    pub nodes: Vec<f64>,
    /// How they came to be.
    pub report: BasisReport,
}

/// How [`BasisWeights`] came to be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BasisReport {
    /// Handles asked for.
    pub handles_wanted: usize,
    /// Pieces of the cage that share no node.
    pub pieces: usize,
    /// Eigenmodes: `integral c |grad w|^2 / (mean c * integral w^2)` of each weight but the last, in 1/m^2, rising.
    pub eigenvalues: Vec<f64>,
    /// Solutions of the linear system (eigenmodes), or steps of training (Simplicits).
    pub steps: usize,
    /// Simplicits: the loss of the last step.
    pub loss: f64,
}

impl BasisWeights {
    /// The weights of a node.
    pub fn at_node(&self, node: usize) -> &[f64] {
        &self.nodes[node * self.handles..(node + 1) * self.handles]
    }

    /// One handle that is 1 everywhere.
    pub fn affine(cage: &PartCage) -> Self {
        let report = BasisReport { handles_wanted: 1, pieces: cage.pieces(), ..BasisReport::default() };
        Self { handles: 1, nodes: vec![1.0; cage.cage.node_count()], report }
    }
}

/// Makes the weights of a part.
///
/// `materials`: one for each region that the cage names. `handles`: the constant weight among them; with 1, or for
/// [`BasisKind::Affine`], the constant weight is all. `seed`: of what is random; the same seed gives the same bits.
///
/// # Errors
/// [`BasisError::HandlesOutOfRange`] beyond [`MOST_HANDLES`] or where the cage has too few nodes, [`BasisError::Disconnected`] if
/// the cage has more pieces than half the handles, [`BasisError::MaterialMissing`], [`BasisError::Stiffness`],
/// [`BasisError::Setting`], [`BasisError::Cancelled`].
///
/// Cost: eigenmodes with 32 handles on 8000 nodes about 0.2 s, Simplicits with 300 steps and 16 handles some seconds.
pub fn skinning_weights(
    kind: &BasisKind,
    cage: &PartCage,
    materials: &[Material],
    handles: usize,
    seed: u64,
    progress: &dyn Progress,
) -> Result<BasisWeights, BasisError> {
    if !(1..=MOST_HANDLES).contains(&handles) {
        return Err(BasisError::HandlesOutOfRange { have: handles, most: MOST_HANDLES });
    }
    if handles == 1 || *kind == BasisKind::Affine {
        return Ok(BasisWeights {
            report: BasisReport { handles_wanted: handles, pieces: cage.pieces(), ..Default::default() },
            ..BasisWeights::affine(cage)
        });
    }
    if cage.pieces() * 2 > handles {
        return Err(BasisError::Disconnected { pieces: cage.pieces(), handles });
    }
    match kind {
        BasisKind::Eigenmodes { exponent } => eigenmodes::weights(cage, materials, handles, *exponent, seed, progress),
        BasisKind::Simplicits(settings) => simplicits::weights(cage, materials, handles, settings, seed, progress),
        BasisKind::Affine => Ok(BasisWeights::affine(cage)),
    }
}

/// Stiffness and other numbers of each cell, averaged over what is in it.
fn cell_means(cage: &PartCage, materials: &[Material], of: impl Fn(&Material) -> f64) -> Result<Vec<f64>, BasisError> {
    let mut means = vec![0.0; cage.active.len()];
    let of: Vec<f64> = materials.iter().map(of).collect();
    for (cell, mean) in means.iter_mut().enumerate() {
        for part in cage.regions(cell) {
            let value = of.get(usize::from(part.region));
            let missing = BasisError::MaterialMissing { region: part.region, materials: materials.len() };
            *mean += f64::from(part.share) * value.ok_or(missing)?;
        }
    }
    Ok(means)
}

/// Answers if a region that the cage names has no material or one without stiffness.
fn check_materials(cage: &PartCage, materials: &[Material]) -> Result<(), BasisError> {
    for part in &cage.shares {
        let missing = BasisError::MaterialMissing { region: part.region, materials: materials.len() };
        let material = materials.get(usize::from(part.region)).ok_or(missing)?;
        let stiffness = stiffness(material);
        if !(stiffness > 0.0 && stiffness.is_finite()) {
            return Err(BasisError::Stiffness { region: part.region, stiffness });
        }
    }
    Ok(())
}

/// `lambda + 4 mu`, in Pa: what the mean elastic energy of random motions weighs the gradients of weights by.
fn stiffness(material: &Material) -> f64 {
    let (lambda, mu) = material.lame();
    lambda + 4.0 * mu
}
