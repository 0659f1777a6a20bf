//! [`PartPhysicsStatus`]: how far the body of an entity is, and why it is none.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use bevy::prelude::*;
use splat_physics::MassProperties;

/// How far the setting up of a body is: written by this crate on every entity with a `RigidPart`, an
/// [`ElasticPart`](super::ElasticPart) or a [`StaticCapture`](super::StaticCapture), for all to read.
///
/// Until it is ready the entity stands still. A setting, a material or a set of Gaussians that changes later makes it pending
/// again, as far as the body depends on it; meanwhile the body it had stays.
#[derive(Component, Clone, Debug)]
pub enum PartPhysicsStatus {
    /// Being set up: how much is done, 0 to 1.
    Pending(f32),
    /// The body is there.
    Ready(PartPhysicsReport),
    /// There is no body, and why.
    Failed(PartPhysicsError),
}

impl PartPhysicsStatus {
    /// The report of a body that is ready.
    pub fn report(&self) -> Option<&PartPhysicsReport> {
        match self {
            Self::Ready(report) => Some(report),
            _ => None,
        }
    }

    /// Why there is no body.
    pub fn error(&self) -> Option<&PartPhysicsError> {
        match self {
            Self::Failed(error) => Some(error),
            _ => None,
        }
    }

    /// Whether it is still being set up.
    pub fn is_pending(&self) -> bool {
        matches!(self, Self::Pending(_))
    }
}

/// What a body was made of.
#[derive(Clone, Debug)]
pub struct PartPhysicsReport {
    /// What kind of body.
    pub body: PartBody,
    /// Metres per unit of the cloud that were assumed.
    pub metres_per_unit: f64,
    /// Gaussians that it was made of.
    pub gaussians: usize,
    /// In m^3; 0 for a static capture.
    pub volume: f64,
    /// In the body's frame: axes and origin of the cloud, lengths in metres. `None` for a static capture.
    pub mass: Option<MassProperties>,
    /// How long the setting up took, on another thread.
    pub took: Duration,
    /// What is not as it was asked for, or may not be as it was meant.
    pub warnings: Vec<PartPhysicsWarning>,
}

/// A kind of body.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PartBody {
    /// A rigid body.
    Rigid {
        /// Its collider, in a word.
        shape: &'static str,
        /// Convex pieces, voxels or other pieces that the collider is made of.
        pieces: usize,
    },
    /// An elastic body.
    Elastic {
        /// Handles, the constant one included.
        handles: usize,
        /// Cubature points.
        samples: usize,
    },
    /// Something that stands still.
    Static {
        /// Its surface, in a word.
        surface: &'static str,
        /// Pieces of it.
        chunks: usize,
    },
}

/// Something about a body that may not be as it was meant.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PartPhysicsWarning {
    /// Nobody has told how large the capture is: a world unit is taken for a metre.
    ScaleUnknown,
    /// The part has no material.
    MaterialAssumed(&'static str),
    /// The part still overlaps what it stands on, by so many metres, after it was raised as far as it may be.
    Overlaps(f64),
    /// The part was raised by so many metres along up, out of what it stood in.
    Raised(f64),
    /// Its surface has gaps too wide to close: it weighs what its convex hull would, or its surface alone.
    Open,
    /// It is in several pieces, of which the largest is the body; this share of the volume was left out.
    Pieces(f64),
    /// Another shape was used than the one asked for.
    Shape {
        /// The one asked for.
        asked: &'static str,
        /// The one used.
        used: &'static str,
    },
    /// Something the setting up has to say, in a sentence.
    Note(String),
}

impl fmt::Display for PartPhysicsWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ScaleUnknown => {
                write!(f, "nobody told how large the capture is: a unit is taken for a metre; give it a CaptureScale")
            }
            Self::MaterialAssumed(name) => write!(f, "the part has no PartMaterial: it is taken for {name}"),
            Self::Overlaps(depth) => {
                write!(f, "the part is {:.3} m inside what it stands on and will be pushed out of it", depth)
            }
            Self::Raised(height) => write!(f, "the part was raised by {:.3} m out of what it stood in", height),
            Self::Open => {
                f.write_str("the part's surface has gaps too wide to close: its hull or its shell was weighed")
            }
            Self::Pieces(share) => {
                write!(f, "the part is in pieces: {:.0} % of its volume were left out", 100.0 * share)
            }
            Self::Shape { asked, used } => write!(f, "the part cannot have the shape {asked}: it has {used}"),
            Self::Note(sentence) => f.write_str(sentence),
        }
    }
}

/// Why there is no body.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PartPhysicsError {
    /// The entity shows no cloud.
    #[error("the entity has no Splats; physics needs a capture, or a part that was taken out of one")]
    NoSplats,
    /// Its asset could not be loaded.
    #[error("the capture could not be loaded, see the log")]
    NotLoaded,
    /// Bodies cannot be stretched unevenly.
    #[error("the scale of the Transform is {0}, but a body needs the same along all axes; scale it evenly")]
    NonUniformScale(Vec3),
    /// The transform is mirrored, or holds NaN or zero.
    #[error("the Transform is mirrored, or has a NaN or a scale of zero: no body can stand there")]
    BadTransform,
    /// A scale nothing can be made of.
    #[error("{0} metres per unit is no scale; a number above zero is")]
    BadScale(f32),
    /// There is no such preset.
    #[error("there is no material `{name}`; known are {known}")]
    UnknownMaterial {
        /// The name given.
        name: String,
        /// All names.
        known: String,
    },
    /// A material's file could not be loaded.
    #[error("the material could not be loaded: {0}")]
    MaterialNotLoaded(String),
    /// A number of a material has no meaning.
    #[error("{0}")]
    Material(Arc<dyn std::error::Error + Send + Sync>),
    /// Its Gaussians enclose no solid, no surface, or no shape; or the body cannot be set up.
    #[error("{0}")]
    Setup(Arc<dyn std::error::Error + Send + Sync>),
    /// No collider fits its solid.
    #[error("no box, ball, hull or voxels fit the part: it is flat, or too small for 32-bit numbers; check its scale")]
    NoShape,
    /// It weighs nothing.
    #[error("the part has no mass, or more or less than 32-bit numbers hold; check its density and its scale")]
    NoMass,
    /// Rigid bodies need an engine.
    #[error("rigid parts need avian3d: add PhysicsPlugins, and SplatAvianPlugin if it was added later")]
    NoEngine,
    /// Nobody waits for it any more.
    #[error("stopped: the part was changed or removed")]
    Cancelled,
}

impl PartPhysicsError {
    /// What a step of the setting up answered.
    pub(super) fn setup(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Setup(Arc::new(error))
    }
}

/// A body is ready, for the first time or again.
#[derive(Message, Clone, Debug)]
pub struct PartPhysicsReady {
    /// Whose.
    pub entity: Entity,
    /// What it was made of.
    pub report: PartPhysicsReport,
}

/// A body could not be made; the entity has none.
#[derive(Message, Clone, Debug)]
pub struct PartPhysicsFailed {
    /// Whose.
    pub entity: Entity,
    /// Why.
    pub error: PartPhysicsError,
}
