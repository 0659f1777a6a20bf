//! [`Prepared`]: all that does not depend on where the user points.

use rayon::prelude::*;
use splat_core::Neighbours;
use splat_core::{Selection, View};
use splat_raster::{Rasterizer, Scene};

use super::edges::edges;
use super::evidence::{Evidence, EvidenceSettings};
use super::features::features;
use super::patches::PatchGraph;
use super::superpoints::{SuperpointSettings, superpoints};
use super::tree::{MergeTree, TREES};
use crate::{Run, SegmentError};

/// A capture taken apart into patches, with several merge trees over them. Ready for any number of clicks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prepared {
    /// Patches and borders.
    pub graph: PatchGraph,
    /// One tree per entry of [`TREES`].
    pub trees: Vec<MergeTree>,
}

/// Neighbours of a Gaussian in the graph.
const NEIGHBOURS: usize = 10;

impl Prepared {
    /// Takes a capture apart.
    ///
    /// `scene`: the capture as one instance (or several; ids count through them, and nothing joins across a gap).
    /// `views`: where it can be seen from, best the training cameras.
    ///
    /// # Errors
    /// [`SegmentError::NothingToDo`] without Gaussians or views, [`SegmentError::Cancelled`], [`SegmentError::Raster`].
    pub fn new(scene: &Scene, views: &[View], raster: &mut dyn Rasterizer, run: &Run) -> Result<Self, SegmentError> {
        let [instance] = scene.instances.as_slice() else {
            return Err(SegmentError::NothingToDo { what: "single capture" });
        };
        let cloud = &*instance.cloud;
        if cloud.is_empty() {
            return Err(SegmentError::NothingToDo { what: "Gaussian" });
        }
        if views.is_empty() {
            return Err(SegmentError::NothingToDo { what: "view" });
        }
        let evidence = Evidence::gather(scene, views, &EvidenceSettings::default(), raster, run)?;
        run.step("neighbours", 0, 1)?;
        let neighbours = Neighbours::build(cloud.means(), NEIGHBOURS);
        run.step("superpoints", 0, 1)?;
        let features = features(cloud, &neighbours, &evidence);
        let edges = edges(cloud, &neighbours, &features);
        let (of, count) = superpoints(cloud.len(), &edges, &SuperpointSettings::default());
        let graph = PatchGraph::new(cloud, &features, &evidence, &edges, of, count);
        run.step("trees", 0, 1)?;
        let trees = TREES.par_iter().map(|settings| MergeTree::new(&graph, settings)).collect();
        Ok(Self { graph, trees })
    }

    /// Number of patches.
    pub fn patch_count(&self) -> usize {
        self.graph.patches.len()
    }

    /// All Gaussians of the patches `chosen`.
    pub fn gaussians(&self, chosen: &Selection) -> Selection {
        Selection::from_fn(self.graph.of.len(), |i| chosen.contains(self.graph.of[i] as usize))
    }
}
