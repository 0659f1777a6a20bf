//! Trackers: from the user's masks in a few views to a mask in every dense view.
//!
//! A tracker gets the views in order and the references with the place at which each enters, and gives a soft mask and a
//! confidence per view. To add one: a file with `impl Tracker`, a line in [`TRACKERS`]. Trackers that need a network live
//! in a higher crate with the same kind of table; the application joins the two.

mod edges;
mod geometric;

pub use geometric::Geometric;

use splat_core::{Mask2d, View};
use splat_raster::{Rasterizer, Scene};

use crate::{Run, SegmentError};

/// A mask by the user, to be followed.
#[derive(Clone, Copy, Debug)]
pub struct Reference<'a> {
    /// What the mask was made for; need not be one of the dense views.
    pub view: &'a View,
    /// Soft mask of the view's size.
    pub mask: &'a Mask2d,
    /// Injected before the dense view at this position of the order.
    pub before: usize,
}

/// What is to be tracked.
#[derive(Clone, Copy, Debug)]
pub struct TrackJob<'a> {
    /// What is drawn; with pre-segmentation, the segment alone.
    pub scene: &'a Scene,
    /// Dense views in the order of tracking.
    pub views: &'a [View],
    /// The user's masks.
    pub references: &'a [Reference<'a>],
}

/// A tracked mask.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedFrame {
    /// Soft mask of the view's size.
    pub mask: Mask2d,
    /// How much each pixel of it may be relied on, 0..=255; `None` for all alike.
    pub weight: Option<Mask2d>,
    /// How far the tracker trusts the whole, 0..=1.
    pub confidence: f32,
}

/// Follows masks through views.
pub trait Tracker: Send + Sync {
    /// Short name, as in the program's options.
    fn name(&self) -> &'static str;

    /// One sentence for people who choose among trackers.
    fn description(&self) -> &'static str;

    /// One frame per view of the job, in its order.
    ///
    /// # Errors
    /// [`SegmentError::NothingToDo`] without references, [`SegmentError::Cancelled`], [`SegmentError::Raster`].
    fn track(
        &self,
        job: &TrackJob<'_>,
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<Vec<TrackedFrame>, SegmentError>;
}

/// Trackers that need no network; the first is the default.
pub static TRACKERS: &[&dyn Tracker] = &[&Geometric::DEFAULT];

/// A tracker by its name.
pub fn tracker(name: &str) -> Option<&'static dyn Tracker> {
    TRACKERS.iter().copied().find(|t| t.name() == name)
}
