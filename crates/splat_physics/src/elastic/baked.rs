//! Elastic parts in `.splatphys` files.
//!
//! Kept is what takes time or chance to make: cage, weights, samples, contact points, settings. The rest follows from these, with
//! the same bits.

use super::{ElasticError, ElasticModel, ElasticSettings, Energy, Integrator, Sample};
use crate::bake::tags;
use crate::{BakeError, BakeReader, BakeWriter, Baked, BakedPart, Sink, Source};

impl ElasticModel {
    /// The bytes of a `.splatphys` file. `part`: what it was made of, for whoever reads it.
    pub fn to_bytes(&self, part: &BakedPart) -> Vec<u8> {
        let mut writer = BakeWriter::new();
        writer.put(tags::PART, part);
        writer.put(tags::CAGE, &self.cage);
        writer.put(tags::MATERIALS, &self.materials);
        writer.put(tags::BASIS, &self.settings.basis);
        writer.put(tags::WEIGHTS, &self.weights);
        writer.put(tags::SAMPLES, &self.samples);
        writer.put(tags::MASS, &self.mass);
        writer.put(tags::CONTACTS, &self.contact_points);
        writer.put(tags::SETTINGS, &self.settings);
        writer.finish()
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote: the same bits as the model that was written.
    ///
    /// # Errors
    /// [`BakeError`] if it is no such file, [`BakedModelError::Elastic`] if what it says cannot be an elastic part.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, BakedPart), BakedModelError> {
        let reader = BakeReader::new(bytes)?;
        let part = reader.get(tags::PART)?;
        let cage: crate::PartCage = reader.get(tags::CAGE)?;
        let materials: Vec<crate::Material> = reader.get(tags::MATERIALS)?;
        let weights: crate::BasisWeights = reader.get(tags::WEIGHTS)?;
        let samples: Vec<Sample> = reader.get(tags::SAMPLES)?;
        let settings = ElasticSettings { basis: reader.get(tags::BASIS)?, ..reader.get(tags::SETTINGS)? };
        let contacts = reader.get(tags::CONTACTS)?;
        settings.check()?;
        if weights.nodes.len() != cage.cage.node_count() * weights.handles {
            return Err(ElasticError::NotFinite("a weight that its file lacks").into());
        }
        if let Some(sample) = samples.iter().find(|s| usize::from(s.region) >= materials.len()) {
            return Err(ElasticError::NoMaterial { region: sample.region, materials: materials.len() }.into());
        }
        Ok((Self::from_samples(&materials, &settings, cage, weights, samples, contacts)?, part))
    }
}

/// Why a file is no elastic part.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BakedModelError {
    /// It is no sound file.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// What it says cannot be an elastic part.
    #[error(transparent)]
    Elastic(#[from] ElasticError),
}

impl Baked for Sample {
    const LEAST: usize = 33;

    fn write(&self, to: &mut Sink) {
        to.put(&self.position);
        to.put(&self.volume);
        to.put(&self.region);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let own = Self { position: from.get()?, volume: from.get()?, region: from.get()? };
        let sound = own.position.is_finite() && own.volume > 0.0 && own.volume.is_finite();
        if sound { Ok(own) } else { Err(from.unsound("a sample stands for no volume")) }
    }
}

/// All but the basis, which has a section of its own.
impl Baked for ElasticSettings {
    const LEAST: usize = 2 + 2 + 2 + 1 + 1 + 1 + 2 + 4 * 8;

    fn write(&self, to: &mut Sink) {
        to.put(&self.handles);
        to.put(&self.cubature);
        to.put(&self.cage_cells);
        to.put(&u8::from(self.integrator == Integrator::ImplicitEuler));
        to.put(&self.substeps);
        to.put(&u8::from(self.energy == Energy::Linear));
        to.put(&self.contact_points);
        to.put(&self.contact_stiffness);
        to.put(&self.most_poisson_ratio);
        to.put(&self.most_contrast);
        to.put(&self.seed);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        Ok(Self {
            handles: from.get()?,
            cubature: from.get()?,
            cage_cells: from.get()?,
            integrator: if from.get()? { Integrator::ImplicitEuler } else { Integrator::Bdf2 },
            substeps: from.get()?,
            energy: if from.get()? { Energy::Linear } else { Energy::StableNeoHookean },
            contact_points: from.get()?,
            contact_stiffness: from.get()?,
            most_poisson_ratio: from.get()?,
            most_contrast: from.get()?,
            seed: from.get()?,
            ..Self::default()
        })
    }
}
