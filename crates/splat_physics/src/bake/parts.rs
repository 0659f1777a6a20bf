//! How the parts of a body are written: cage, weights, materials, mass, training.

use splat_core::deform::Cage;

use super::{BakeError, Baked, Sink, Source};
use crate::basis::{
    BasisKind, BasisReport, BasisWeights, MOST_HANDLES, PartCage, RegionShare, SimplicitsSettings, SimplicitsState,
};
use crate::{MassProperties, Material};

/// Which part a file is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BakedPart {
    /// Of the Gaussians and the settings that all else was worked out from; another one means that the file is out of date.
    pub key: u64,
    /// Metres per unit of the cloud; positive and finite.
    pub metres_per_unit: f64,
    /// Of what was random.
    pub seed: u64,
}

impl Baked for BakedPart {
    const LEAST: usize = 24;

    fn write(&self, to: &mut Sink) {
        to.put(&self.key);
        to.put(&self.metres_per_unit);
        to.put(&self.seed);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let own = Self { key: from.get()?, metres_per_unit: from.get()?, seed: from.get()? };
        let sound = own.metres_per_unit > 0.0 && own.metres_per_unit.is_finite();
        if sound { Ok(own) } else { Err(from.unsound("the scale is not a positive number")) }
    }
}

impl Baked for Material {
    const LEAST: usize = 28;

    fn write(&self, to: &mut Sink) {
        to.put(&[
            self.density,
            self.youngs_modulus,
            self.poisson_ratio,
            self.friction_static,
            self.friction_dynamic,
            self.restitution,
            self.damping_ratio,
        ]);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let [density, youngs_modulus, poisson_ratio, friction_static, friction_dynamic, restitution, damping_ratio] =
            from.get()?;
        let own = Self {
            density,
            youngs_modulus,
            poisson_ratio,
            friction_static,
            friction_dynamic,
            restitution,
            damping_ratio,
        };
        own.check().map_err(|_| from.unsound("a material has a number out of range"))?;
        Ok(own)
    }
}

impl Baked for MassProperties {
    const LEAST: usize = 13 * 8;

    fn write(&self, to: &mut Sink) {
        to.put(&self.mass);
        to.put(&self.center);
        to.put(&self.inertia);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let own = Self { mass: from.get()?, center: from.get()?, inertia: from.get()? };
        let sound = own.mass > 0.0 && own.mass.is_finite() && own.center.is_finite() && own.inertia.is_finite();
        if sound { Ok(own) } else { Err(from.unsound("the mass properties are not those of a body")) }
    }
}

impl Baked for RegionShare {
    const LEAST: usize = 5;

    fn write(&self, to: &mut Sink) {
        to.put(&self.region);
        to.put(&self.share);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let own = Self { region: from.get()?, share: from.get()? };
        if (0.0..=1.0).contains(&own.share) { Ok(own) } else { Err(from.unsound("a region has no share of its cell")) }
    }
}

impl Baked for Cage {
    const LEAST: usize = 28;

    fn write(&self, to: &mut Sink) {
        to.put(&self.origin);
        to.put(&self.cell);
        to.put(&self.cells);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let own = Self { origin: from.get()?, cell: from.get()?, cells: from.get()? };
        let sound = own.origin.is_finite() && own.cell > 0.0 && own.cell.is_finite() && own.cells.min_element() > 0;
        // As many cells as numbers of bytes could count, so that no product of theirs overflows.
        let few = own.cells.max_element() < 1 << 20 && own.cells.as_u64vec3().element_product() < 1 << 40;
        if sound && few { Ok(own) } else { Err(from.unsound("the cage has no place, no cells or too many")) }
    }
}

impl Baked for PartCage {
    const LEAST: usize = Cage::LEAST + 4 * 8;

    fn write(&self, to: &mut Sink) {
        to.put(&self.cage);
        to.put(&self.active);
        to.put(&self.fill);
        to.put(&self.shares_start);
        to.put(&self.shares);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let (cage, active, fill) = (from.get()?, from.get()?, from.get()?);
        let own = Self::from_parts(cage, active, fill, from.get()?, from.get()?);
        own.ok_or_else(|| from.unsound("the cage's cells are not all there or hold what cells cannot"))
    }
}

impl Baked for BasisReport {
    const LEAST: usize = 5 * 8;

    fn write(&self, to: &mut Sink) {
        to.put(&(self.handles_wanted as u64));
        to.put(&(self.pieces as u64));
        to.put(&self.eigenvalues);
        to.put(&(self.steps as u64));
        to.put(&self.loss);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        Ok(Self {
            handles_wanted: from.get::<u64>()? as usize,
            pieces: from.get::<u64>()? as usize,
            eigenvalues: from.get()?,
            steps: from.get::<u64>()? as usize,
            loss: from.get()?,
        })
    }
}

/// Weights are representable as `f32`, and are written as that.
impl Baked for BasisWeights {
    const LEAST: usize = 16 + BasisReport::LEAST;

    fn write(&self, to: &mut Sink) {
        to.put(&(self.handles as u64));
        to.put(&(self.nodes.len() as u64));
        self.nodes.iter().for_each(|&weight| to.put(&(weight as f32)));
        to.put(&self.report);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let (handles, nodes) = (from.get::<u64>()?, from.get::<Vec<f32>>()?);
        let own =
            Self { handles: handles as usize, nodes: nodes.into_iter().map(f64::from).collect(), report: from.get()? };
        // Modes of one value may exceed what can be asked for.
        if !(1..=2 * MOST_HANDLES).contains(&own.handles) || !own.nodes.len().is_multiple_of(own.handles) {
            return Err(from.unsound("the weights are not as many for each node"));
        }
        let ends = own.nodes.iter().skip(own.handles - 1).step_by(own.handles).all(|&weight| weight == 1.0);
        if !ends || own.nodes.iter().any(|weight| !weight.is_finite()) {
            return Err(from.unsound("the last weight is not 1 everywhere, or one is not a number"));
        }
        Ok(own)
    }
}

impl Baked for SimplicitsSettings {
    const LEAST: usize = 23;

    fn write(&self, to: &mut Sink) {
        to.put(&self.steps);
        to.put(&self.layers);
        to.put(&self.points);
        to.put(&self.motions);
        to.put(&[self.learning_rate, self.elastic_weight, self.orthogonality_weight]);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let (steps, layers, points, motions) = (from.get()?, from.get()?, from.get()?, from.get()?);
        let [learning_rate, elastic_weight, orthogonality_weight] = from.get()?;
        Ok(Self { steps, layers, points, motions, learning_rate, elastic_weight, orthogonality_weight })
    }
}

impl Baked for BasisKind {
    const LEAST: usize = 1;

    fn write(&self, to: &mut Sink) {
        match self {
            Self::Eigenmodes { exponent } => {
                to.put(&0_u8);
                to.put(exponent);
            }
            Self::Simplicits(settings) => {
                to.put(&1_u8);
                to.put(settings);
            }
            Self::Affine => to.put(&2_u8),
        }
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        match from.get::<u8>()? {
            0 => Ok(Self::Eigenmodes { exponent: from.get()? }),
            1 => Ok(Self::Simplicits(from.get()?)),
            2 => Ok(Self::Affine),
            _ => Err(from.unsound("the basis is of no known kind")),
        }
    }
}

/// Whether it is sound is found by [`crate::SimplicitsTraining::resume`], which knows the part.
impl Baked for SimplicitsState {
    const LEAST: usize = SimplicitsSettings::LEAST + 8 * 5 + 4;

    fn write(&self, to: &mut Sink) {
        to.put(&self.settings);
        to.put(&(self.handles as u64));
        to.put(&self.seed);
        to.put(&self.key);
        to.put(&self.step);
        to.put(&self.loss);
        to.put(&self.numbers);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        Ok(Self {
            settings: from.get()?,
            handles: usize::try_from(from.get::<u64>()?).unwrap_or(usize::MAX),
            seed: from.get()?,
            key: from.get()?,
            step: from.get()?,
            loss: from.get()?,
            numbers: from.get()?,
        })
    }
}
