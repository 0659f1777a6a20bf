//! The nouns of the toolkit: what a capture is, where a camera stands, which pixels and which Gaussians are meant.
//!
//! | noun | what it is | what one does with it |
//! |---|---|---|
//! | [`Cloud`] | the 3D Gaussians of a capture, an array per value; immutable once built | [`extract`](Cloud::extract), [`without`](Cloud::without), [`concat`](Cloud::concat), [`transformed`](Cloud::transformed), [`with_sh_degree`](Cloud::with_sh_degree) |
//! | [`View`] | pose, intrinsics and size of one picture | [`project`](View::project), [`unproject`](View::unproject), [`orbit`](View::orbit), [`moved`](View::moved) |
//! | [`Mask2d`] | a soft mask over the pixels of a view | shapes ([`polygon`](Mask2d::polygon) ...), [`dilated`](Mask2d::dilated), [`pieces`](Mask2d::pieces), [`iou`](Mask2d::iou) |
//! | [`Selection`] | one bit per Gaussian | [`apply`](Selection::apply) by the four [`SelectMode`]s of masks, [`Criterion`], [`similar`], [`SelectionDelta`] for undo |
//! | [`Neighbours`] | the nearest others of every Gaussian | [`grown`](Neighbours::grown), [`shrunk`](Neighbours::shrunk), [`pieces`](Neighbours::pieces), [`filled`](Neighbours::filled), [`smoothed`](Neighbours::smoothed) |
//! | [`Parts`] | named, coloured, disjoint labels, nested one level | [`assign`](Parts::assign), [`selection_of`](Parts::selection_of) |
//! | [`Similarity`] | rotation, uniform scale, translation | [`apply`](Similarity::apply), [`compose`](Similarity::compose), [`inverse`](Similarity::inverse) |
//!
//! Beside them: [`sh`] (spherical harmonics and their exact rotation), [`bounds`] (that a handful of monster splats cannot decide),
//! [`orient`] (principal axes and the floor), [`color`] (CIE Lab).
//!
//! # Example
//!
//! The red Gaussians beside the one at the origin become a part, and the part a cloud of its own:
//!
//! ```
//! use splat_core::glam::{Quat, Vec3};
//! use splat_core::{Children, Cloud, CloudArrays, Criterion, Neighbours, Parts, SelectMode, Selection, sh};
//!
//! // A row of forty Gaussians, a red, a green, a red ...; the first fifteen stand apart from the rest.
//! let count = 40;
//! let color = |i: usize| if i % 2 == 0 { Vec3::new(0.9, 0.1, 0.1) } else { Vec3::new(0.1, 0.8, 0.1) };
//! let cloud = Cloud::new(CloudArrays {
//!     means: (0..count).map(|i| Vec3::X * (i as f32 + if i < 15 { 0.0 } else { 90.0 })).collect(),
//!     log_scales: vec![Vec3::splat(-1.0); count],
//!     rotations: vec![Quat::IDENTITY; count],
//!     opacity_logits: vec![3.0; count],
//!     sh: (0..count).flat_map(|i| ((color(i) - 0.5) / sh::C0).to_array()).collect(),
//!     ..CloudArrays::default()
//! })?;
//!
//! // What hangs together with the first Gaussian ...
//! let neighbours = Neighbours::build(cloud.means(), 4).touching(&cloud, 2.0);
//! let mut selection = neighbours.grown(&Selection::from_ids(count, [0]), 100);
//! assert_eq!(selection.count(), 15);
//! // ... and is red within a shade.
//! let red = Criterion::Color { srgb: Vec3::new(0.9, 0.1, 0.1), tolerance: 20.0 }.select(&cloud);
//! selection.apply(SelectMode::Intersect, &red);
//!
//! let mut parts = Parts::new(count);
//! let lamp = parts.add("lamp", [255, 80, 80], None)?;
//! parts.assign(lamp, &selection, SelectMode::New)?;
//! let object = cloud.extract(&parts.selection_of(lamp, Children::With));
//! assert_eq!((object.len(), object.means()[1]), (8, Vec3::X * 2.0));
//! assert_eq!(cloud.without(&selection).len(), 32);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Conventions
//!
//! Nothing here opens a file, draws a picture or prints. The same input gives the same bits, on any number of threads.
//!
//! - Camera space is x right, y down, z forward; pixel (x, y) is the square from x to x + 1, its centre x + 0.5.
//! - Quaternions are (x, y, z, w) in memory. Scales are natural logarithms, opacities logits, colours display-referred (sRGB-encoded).
//! - Spherical harmonics have INRIA's order and signs, degree 0 to 4, chosen at run time.
//! - A Gaussian's id is its position in the input file, [`GaussianId`].
//!
//! Feature `serde`: [`Selection`], [`Parts`] and the small types beside them can be written to and read from any format of serde,
//! in a few bytes for each run of equal Gaussians.

pub mod bounds;
mod cloud;
pub mod color;
mod criterion;
pub mod deform;
mod delta;
mod mask;
mod metres;
mod neighbours;
pub mod orient;
mod parts;
mod selection;
#[cfg(feature = "serde")]
mod serialize;
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
