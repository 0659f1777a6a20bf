//! [`BasisKind`] and what the choices need.

use serde::{Deserialize, Serialize};

/// Which skinning weights an elastic part moves by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum BasisKind {
    /// The lowest modes of a Laplacian on the cage, weighted by stiffness: no training, honours stiff and soft regions.
    Eigenmodes {
        /// `p` of the coefficient `(lambda + 4 mu)^p`, 0..=1: 0 does not see the materials, 1 leaves no modes for stiff regions.
        exponent: f64,
    },
    /// A small network trained on the elastic energy of random motions (Modi et al., "Simplicits", 2024): twice as good for each
    /// handle in one material, worse where materials differ much.
    Simplicits(SimplicitsSettings),
    /// The constant weight alone: the part as one, stretching and shearing.
    Affine,
}

impl Default for BasisKind {
    fn default() -> Self {
        Self::Eigenmodes { exponent: 0.5 }
    }
}

/// How the network of [`BasisKind::Simplicits`] is shaped and trained.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimplicitsSettings {
    /// Steps of Adam, at least 1. More is not better in bending: 300 steps give 0.96 of a cantilever's deflection.
    pub steps: u32,
    /// Layers of 64 neurons after the first, 1..=16.
    pub layers: u8,
    /// Points in the part for each step, 16..=8192.
    pub points: u32,
    /// Random motions for each step, 1..=64.
    pub motions: u16,
    /// Of Adam, positive.
    pub learning_rate: f32,
    /// Weight of the elastic energy in the loss.
    pub elastic_weight: f32,
    /// Weight of the weights' distance from being orthonormal in the loss.
    pub orthogonality_weight: f32,
}

impl Default for SimplicitsSettings {
    fn default() -> Self {
        Self {
            steps: 300,
            layers: 6,
            points: 512,
            motions: 10,
            learning_rate: 1e-3,
            elastic_weight: 0.1,
            orthogonality_weight: 1e6,
        }
    }
}
