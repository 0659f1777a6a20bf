//! The nouns of the toolkit: what a capture is, where a camera stands, which pixels and which Gaussians are meant.
//!
//! - [`Cloud`]: a set of 3D Gaussians as structure of arrays; immutable once built.
//! - [`View`]: pose, intrinsics and size of one picture.
//! - [`Mask2d`]: soft mask over the pixels of a view.
//! - [`Selection`]: one bit per Gaussian, with the same four [`SelectMode`]s as a mask.
//! - [`Parts`]: named, coloured, disjoint labels over a cloud.
//! - [`Similarity`]: rotation, uniform scale, translation, spherical harmonics included.
//!
//! Nothing here opens a file, draws a picture or prints. Conventions:
//!
//! - Camera space is x right, y down, z forward; pixel (x, y) is the square from x to x + 1, its centre x + 0.5.
//! - Quaternions are (x, y, z, w) in memory. Scales are natural logarithms, opacities logits, colours display-referred (sRGB-encoded).
//! - Spherical harmonics have INRIA's order and signs, degree 0 to 4, chosen at run time.
//! - A Gaussian's id is its position in the input file, [`GaussianId`].

pub mod bounds;
mod cloud;
pub mod color;
mod criterion;
mod delta;
mod mask;
mod neighbours;
pub mod orient;
mod parts;
mod selection;
pub mod sh;
mod surroundings;
mod transform;
mod transformed;
mod view;

pub use cloud::{Cloud, CloudArrays, CloudError, ExtraProperty, ExtraValues, GaussianId, Source};
pub use criterion::{Criterion, Likeness, similar};
pub use delta::SelectionDelta;
pub use mask::{Beyond, Mask2d, MaskError, MaskPieces, PixelBox, Sides};
pub use neighbours::{KdTree, NO_NEIGHBOUR, Neighbours};
pub use parts::{Children, Part, PartId, Parts, PartsError, part_color};
pub use selection::{SelectMode, Selection};
pub use transform::{Similarity, SimilarityError};
pub use view::{DEFAULT_NEAR, Intrinsics, Orbit, Pose, Projection, View, ViewError};

pub use glam;
