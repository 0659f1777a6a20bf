//! [`SegmentError`]: why masks could not be lifted.

use splat_core::{CloudError, MaskError};
use splat_raster::RasterError;

/// Why masks could not be lifted to Gaussians. Nothing has changed when one is returned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentError {
    /// A frame could not be drawn.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// Two masks, or a mask and its view, differ in size.
    #[error(transparent)]
    Mask(#[from] MaskError),
    /// The pieces of split Gaussians do not make a cloud.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// The caller asked to stop.
    #[error("stopped on request; nothing was changed")]
    Cancelled,
    /// There is no mask to start from.
    #[error("there is no {what} to start from; annotate at least one view")]
    NothingToDo {
        /// What is missing.
        what: &'static str,
    },
    /// The mask selects no surface, so that nothing can be said about where the object is.
    #[error("the mask covers no drawn Gaussian; paint it over something that is visible in its view")]
    NothingUnderMask,
    /// A per-Gaussian or per-pixel input has the wrong number of entries.
    #[error("`{what}` has {found} entries, {expected} were expected")]
    Length {
        /// Which input.
        what: &'static str,
        /// Entries given.
        found: usize,
        /// Entries expected.
        expected: usize,
    },
    /// A number named by the caller does not exist.
    #[error("{what} {found} does not exist; there are {count}")]
    Missing {
        /// What was named (`annotation`, `view`).
        what: &'static str,
        /// The number given.
        found: u64,
        /// How many there are.
        count: usize,
    },
}
