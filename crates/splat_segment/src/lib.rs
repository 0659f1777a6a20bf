//! From clicks and masks to sets of Gaussians, without a network.
//!
//! One road: prompt -> 2D mask -> annotation -> views and tracked masks -> votes -> selection -> part.

pub mod aggregations;
pub mod boundary;
pub mod diagnosis;
mod distance;
mod error;
pub mod eval;
pub mod graph;
pub mod presegment;
pub mod project;
mod run;
mod segmentation;
pub mod trackers;
pub mod views;
pub mod votes;

pub use error::SegmentError;
pub use run::{Progress, Run};
pub use segmentation::{Annotation, AnnotationId, Occlusion, Presegmentation, SegmentSettings, Segmentation};
