//! Which Gaussians each of many views sees.

use splat_core::{Selection, View};
use splat_raster::{Rasterizer, Scene};

use crate::{Run, SegmentError};

/// Largest weight over the picture above which a Gaussian counts as visible: 1/255, a step of an 8-bit picture.
pub const VISIBLE_WEIGHT: f32 = 1.0 / 255.0;

/// Visible sets of some views, and how alike they are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ViewSets {
    /// One set per view, in the order given.
    pub sets: Vec<Selection>,
}

impl ViewSets {
    /// Draws every view once, for visibility alone.
    ///
    /// Pictures are drawn with their longer side at most `side_px`: who sees what hardly depends on the size.
    ///
    /// # Errors
    /// [`SegmentError::Cancelled`], [`SegmentError::Raster`].
    pub fn draw<'a>(
        raster: &mut dyn Rasterizer,
        scene: &Scene,
        views: impl ExactSizeIterator<Item = &'a View>,
        side_px: u32,
        run: &Run,
    ) -> Result<Self, SegmentError> {
        let total = views.len();
        let mut sets = Vec::with_capacity(total);
        for (done, view) in views.enumerate() {
            run.step("visibility", done, total)?;
            sets.push(raster.visibility(scene, &within(view, side_px), VISIBLE_WEIGHT)?);
        }
        Ok(Self { sets })
    }

    /// Jaccard index of two views: Gaussians both see over Gaussians either sees, 0..=1.
    pub fn similarity(&self, a: usize, b: usize) -> f64 {
        self.sets[a].jaccard(&self.sets[b])
    }
}

/// The same view with its longer side at most `side_px`.
pub(crate) fn within(view: &View, side_px: u32) -> View {
    let longer = view.width.max(view.height);
    if longer <= side_px || side_px == 0 {
        return *view;
    }
    let scaled = |n: u32| ((u64::from(n) * u64::from(side_px)).div_ceil(u64::from(longer)) as u32).max(1);
    view.resized(scaled(view.width), scaled(view.height))
}
