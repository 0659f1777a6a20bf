//! [`GpuInstance`]: a cloud on the GPU, placed in a scene.

use std::sync::Arc;

use splat_core::Similarity;

use super::{GpuBits, GpuCloud, GpuDeformation, GpuIds, GpuTint};
use crate::RasterError;

/// The GPU's form of an [`Instance`](crate::Instance): the same fields mean the same.
#[derive(Clone, Debug)]
pub struct GpuInstance {
    /// The Gaussians.
    pub cloud: Arc<GpuCloud>,
    /// From the cloud's space to the scene's.
    pub transform: Similarity,
    /// By cloud id, as long as the cloud.
    pub hidden: Option<Arc<GpuBits>>,
    /// Only these Gaussians belong to the instance; ids of the scene count through this list.
    pub subset: Option<Arc<GpuIds>>,
    /// By cloud id: sRGB red, green, blue, and strength 0..=255 with which they are mixed over its colour.
    pub tint: Option<Arc<GpuTint>>,
    /// How the cloud is bent before it is placed.
    pub deformation: Option<Arc<GpuDeformation>>,
}

impl GpuInstance {
    /// The cloud where it is and as it is, all of it, nothing hidden.
    pub fn new(cloud: Arc<GpuCloud>) -> Self {
        Self { cloud, transform: Similarity::IDENTITY, hidden: None, subset: None, tint: None, deformation: None }
    }

    /// Gaussians of the instance, hidden ones included.
    pub fn len(&self) -> usize {
        self.subset.as_ref().map_or(self.cloud.len(), |s| s.ids.len())
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether both are in the same pose at the same place.
    pub(super) fn is_placed_as(&self, other: &Self) -> bool {
        let same_pose = match (&self.deformation, &other.deformation) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        same_pose && self.transform == other.transform
    }

    /// Whether both are the same Gaussians with the same bits, lists, tints and memory of poses.
    pub(super) fn has_sources_of(&self, other: &Self) -> bool {
        fn same<T>(a: &Option<Arc<T>>, b: &Option<Arc<T>>) -> bool {
            match (a, b) {
                (None, None) => true,
                (Some(a), Some(b)) => Arc::ptr_eq(a, b),
                _ => false,
            }
        }
        Arc::ptr_eq(&self.cloud, &other.cloud)
            && same(&self.hidden, &other.hidden)
            && same(&self.subset, &other.subset)
            && same(&self.tint, &other.tint)
            && self.deformation.as_ref().map(|d| &d.buffer) == other.deformation.as_ref().map(|d| &d.buffer)
    }

    /// Checks that all belongs to the cloud.
    pub(super) fn check(&self) -> Result<(), RasterError> {
        let expected = self.cloud.len();
        let fits = |what, found| {
            if found == expected { Ok(()) } else { Err(RasterError::Length { what, found, expected }) }
        };
        if let Some(hidden) = &self.hidden {
            fits("hidden", hidden.len)?;
        }
        if let Some(tint) = &self.tint {
            fits("tint", tint.len)?;
        }
        if let Some(last) = self.subset.as_ref().and_then(|s| s.ids.last())
            && *last as usize >= expected
        {
            return Err(RasterError::Length { what: "subset", found: *last as usize, expected });
        }
        Ok(())
    }
}
