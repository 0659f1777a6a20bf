//! [`ElasticPart`]: the wish that a part bends.

use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_physics::{BasisKind, ElasticSettings, Energy, Integrator, SimplicitsSettings};

/// Makes the Gaussians of an entity one soft body: it falls, bends, bounces off what it touches and is drawn bent.
///
/// Put it on the entity of a part that was [taken out](crate::SplatPartCommands::extract_part), or on any other
/// [`Splats`](crate::Splats), beside a [`PartMaterial`](crate::physics::PartMaterial):
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::prelude::*;
/// # use bevy_splat::physics::{ElasticPart, PartMaterial};
/// fn soften(mut commands: Commands, part: Single<Entity, With<SplatPart>>) {
///     commands.entity(*part).insert((ElasticPart::default(), PartMaterial::preset("rubber")));
/// }
/// # bevy::ecs::system::assert_is_system(soften);
/// ```
///
/// The body is set up in the background; [`PartPhysicsStatus`](crate::physics::PartPhysicsStatus) tells how far that is, and
/// until it is ready the part stands still. Then an [`ElasticState`](super::ElasticState) is there, which moves the entity's
/// `Transform` and its [`SplatDeformation`](crate::components::SplatDeformation). To remove this component gives the part its own shape back where it is.
///
/// A field that changes makes the body anew, as far as it depends on it. What touches it is in
/// [`elastic`](crate::physics::elastic).
#[derive(Component, Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ElasticPart {
    /// Where the skinning weights come from.
    pub basis: SkinningBasis,
    /// Handles, the constant one included, 1..=64. More bend more finely; a step costs about their square.
    pub handles: u16,
    /// Points at which strain is measured; 0: 32 for each handle, at least 256. Fewer make a part too soft.
    pub cubature: u16,
    /// Cells of the cage along the longest side of the part.
    pub cage_cells: u16,
    /// How time is stepped.
    pub integrator: ElasticIntegrator,
    /// Steps that each fixed step is cut into, 1..=16.
    pub substeps: u8,
    /// How stress follows from strain.
    pub energy: ElasticEnergy,
    /// Points of the surface that can touch something, 8..=4096; what is thinner than their distance slips between them.
    pub contact_points: u16,
    /// Thickness of the wall in metres of a part that is hollow; `None`: it is filled.
    pub hollow: Option<f32>,
    /// Whether a missing underside, which stood on something when the capture was made, is closed.
    pub close_bottom: bool,
    /// Of what is drawn at random. The same seed gives the same body, to the bit.
    pub seed: u64,
}

impl Default for ElasticPart {
    fn default() -> Self {
        let settings = ElasticSettings::default();
        Self {
            basis: SkinningBasis::default(),
            handles: settings.handles,
            cubature: settings.cubature,
            cage_cells: settings.cage_cells,
            integrator: ElasticIntegrator::default(),
            substeps: settings.substeps,
            energy: ElasticEnergy::default(),
            contact_points: settings.contact_points,
            hollow: None,
            close_bottom: true,
            seed: settings.seed,
        }
    }
}

impl ElasticPart {
    /// The same as the solver wants it.
    pub fn settings(&self) -> ElasticSettings {
        ElasticSettings {
            basis: self.basis.into(),
            handles: self.handles,
            cubature: self.cubature,
            cage_cells: self.cage_cells,
            integrator: match self.integrator {
                ElasticIntegrator::Bdf2 => Integrator::Bdf2,
                ElasticIntegrator::ImplicitEuler => Integrator::ImplicitEuler,
            },
            substeps: self.substeps,
            energy: match self.energy {
                ElasticEnergy::StableNeoHookean => Energy::StableNeoHookean,
                ElasticEnergy::Linear => Energy::Linear,
            },
            contact_points: self.contact_points,
            seed: self.seed,
            ..ElasticSettings::default()
        }
    }
}

/// How the stress of an [`ElasticPart`] follows from its strain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(Default, Clone, Debug, PartialEq)]
pub enum ElasticEnergy {
    /// Right for large strains, and sound when turned inside out.
    #[default]
    StableNeoHookean,
    /// Straight proportion, turned along with the part; for small strains.
    Linear,
}

/// How the time of an [`ElasticPart`] is stepped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(Default, Clone, Debug, PartialEq)]
pub enum ElasticIntegrator {
    /// Second order: keeps parts swinging.
    #[default]
    Bdf2,
    /// First order: swallows motion, and is the most robust.
    ImplicitEuler,
}

/// Which skinning weights an [`ElasticPart`] moves by.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default, Clone, Debug, PartialEq)]
pub enum SkinningBasis {
    /// The lowest modes of a Laplacian weighted by stiffness: no training, and it honours stiff and soft regions.
    Eigenmodes {
        /// How much the weights see of the materials, 0..=1; 0.5 is good.
        exponent: f64,
    },
    /// A small network, trained when the part is set up: twice as good for each handle in one material, worse where materials
    /// differ much. Takes seconds.
    Simplicits(SimplicitsBasis),
    /// The part as one, stretching and shearing.
    Affine,
}

impl Default for SkinningBasis {
    fn default() -> Self {
        Self::Eigenmodes { exponent: 0.5 }
    }
}

/// How the network of [`SkinningBasis::Simplicits`] is trained; see [`SimplicitsSettings`].
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default, Clone, Debug, PartialEq)]
#[serde(default)]
pub struct SimplicitsBasis {
    /// Steps of training, at least 1.
    pub steps: u32,
    /// Layers of 64 neurons after the first, 1..=16.
    pub layers: u8,
    /// Points in the part for each step, 16..=65536.
    pub points: u32,
    /// Random motions for each step, 1..=256.
    pub motions: u16,
    /// Of the optimiser, positive.
    pub learning_rate: f32,
    /// Weight of the elastic energy in the loss.
    pub elastic_weight: f32,
    /// Weight of the distance from being orthonormal in the loss.
    pub orthogonality_weight: f32,
}

impl Default for SimplicitsBasis {
    fn default() -> Self {
        let SimplicitsSettings { steps, layers, points, motions, learning_rate, elastic_weight, orthogonality_weight } =
            SimplicitsSettings::default();
        Self { steps, layers, points, motions, learning_rate, elastic_weight, orthogonality_weight }
    }
}

impl From<SkinningBasis> for BasisKind {
    fn from(basis: SkinningBasis) -> Self {
        match basis {
            SkinningBasis::Eigenmodes { exponent } => Self::Eigenmodes { exponent },
            SkinningBasis::Simplicits(training) => {
                let SimplicitsBasis {
                    steps,
                    layers,
                    points,
                    motions,
                    learning_rate,
                    elastic_weight,
                    orthogonality_weight,
                } = training;
                Self::Simplicits(SimplicitsSettings {
                    steps,
                    layers,
                    points,
                    motions,
                    learning_rate,
                    elastic_weight,
                    orthogonality_weight,
                })
            }
            SkinningBasis::Affine => Self::Affine,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_part_is_the_solvers_default() {
        assert_eq!(ElasticPart::default().settings(), ElasticSettings::default());
        let trained = SkinningBasis::Simplicits(SimplicitsBasis::default());
        assert_eq!(BasisKind::from(trained), BasisKind::Simplicits(SimplicitsSettings::default()));
    }
}
