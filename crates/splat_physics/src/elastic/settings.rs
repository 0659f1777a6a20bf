//! [`ElasticSettings`] and what can be wrong with them.

use serde::{Deserialize, Serialize};

use super::Energy;
use crate::{BasisError, BasisKind, MOST_HANDLES, MaterialError};

/// How time is stepped; both are implicit, so that no step is too long to be stable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Integrator {
    /// Second order: a beam that swings at 3 Hz keeps 60 % of its energy over a second at 60 steps a second. Steps in which
    /// contacts are made are of the other kind, since what this one extrapolates ends there.
    #[default]
    Bdf2,
    /// First order: swallows motion (0.1 % is left in the same case). The most robust.
    ImplicitEuler,
}

/// How an elastic part is set up and stepped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ElasticSettings {
    /// Where the skinning weights come from.
    pub basis: BasisKind,
    /// Handles, the constant one included, 1..=64. More bend more finely; a step costs about their square.
    pub handles: u16,
    /// Points at which strain is measured; 0: 32 for each handle, at least 256. Fewer make a part too soft.
    pub cubature: u16,
    /// Cells of the cage along the longest side of the part.
    pub cage_cells: u16,
    /// Time stepping.
    pub integrator: Integrator,
    /// Steps that each step is cut into, 1..=16.
    pub substeps: u8,
    /// Strain energy.
    pub energy: Energy,
    /// Points of the surface that can touch something, 8..=4096.
    pub contact_points: u16,
    /// Stiffness of contact of the whole part, in units of its mass over the square of the time step: what rests sinks in by
    /// what gravity moves it in one step (about 1 mm at 60 steps a second) over this number.
    pub contact_stiffness: f64,
    /// Poisson's ratio is lowered to this, 0..=0.49: close to 0.5 few handles cannot move without changing the volume, and
    /// bend too little.
    pub most_poisson_ratio: f64,
    /// The stiffest material counts as at most this many times as stiff as the softest of the same part.
    pub most_contrast: f64,
    /// Of the samples and of what the basis draws at random.
    pub seed: u64,
}

impl Default for ElasticSettings {
    fn default() -> Self {
        Self {
            basis: BasisKind::default(),
            handles: 32,
            cubature: 0,
            cage_cells: 20,
            integrator: Integrator::default(),
            substeps: 1,
            energy: Energy::default(),
            contact_points: 256,
            contact_stiffness: 20.0,
            most_poisson_ratio: 0.45,
            most_contrast: 1000.0,
            seed: 0,
        }
    }
}

impl ElasticSettings {
    pub(super) fn check(&self) -> Result<(), ElasticError> {
        let wrong = |field, value| Err(ElasticError::Setting { field, value });
        match self {
            s if usize::from(s.handles) > MOST_HANDLES => {
                Err(ElasticError::TooManyHandles { handles: s.handles.into(), most: MOST_HANDLES })
            }
            s if s.handles == 0 => wrong("handles", 0.0),
            s if s.cage_cells == 0 => wrong("cage_cells", 0.0),
            s if !(1..=16).contains(&s.substeps) => wrong("substeps", f64::from(s.substeps)),
            s if !(8..=4096).contains(&s.contact_points) => wrong("contact_points", f64::from(s.contact_points)),
            s if !(s.contact_stiffness > 0.0 && s.contact_stiffness <= 1e6) => {
                wrong("contact_stiffness", s.contact_stiffness)
            }
            s if !(0.0..=0.49).contains(&s.most_poisson_ratio) => wrong("most_poisson_ratio", s.most_poisson_ratio),
            s if !(s.most_contrast >= 1.0) => wrong("most_contrast", s.most_contrast),
            _ => Ok(()),
        }
    }
}

/// Why a part cannot be made elastic.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ElasticError {
    /// A setting is out of its range.
    #[error("{field} = {value} is out of range; see ElasticSettings")]
    Setting {
        /// Its name.
        field: &'static str,
        /// What was asked.
        value: f64,
    },
    /// More handles than a step can carry.
    #[error("{handles} handles are more than {most}; ask for fewer")]
    TooManyHandles {
        /// Asked for.
        handles: usize,
        /// The most.
        most: usize,
    },
    /// A region of the solid names a material that was not given.
    #[error("the part has a region {region}, and there are only {materials} materials")]
    NoMaterial {
        /// The region's number.
        region: u8,
        /// Given.
        materials: usize,
    },
    /// A material cannot be.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// No cage, or no weights.
    #[error(transparent)]
    Basis(#[from] BasisError),
    /// The samples lie in a plane or on a line.
    #[error("the part is too thin to bend: its {samples} samples span {rank} of 4 affine motions; make it rigid")]
    TooThin {
        /// How many.
        samples: usize,
        /// Independent ones of the four.
        rank: usize,
    },
    /// A number came out as NaN or infinity.
    #[error("the part cannot be set up: {0} is not finite")]
    NotFinite(&'static str),
    /// The set-up was cancelled.
    #[error("the set-up was cancelled")]
    Cancelled,
}
