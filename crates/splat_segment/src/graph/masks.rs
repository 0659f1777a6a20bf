//! From masks of one or more views to a whole object: what no view shows is decided by the capture's own structure.

use rayon::prelude::*;
use splat_core::{Mask2d, Selection, View};
use splat_raster::{Depth, Rasterizer, Scene, VOTE_UNIT};

use super::cut::CutGraph;
use super::prepared::Prepared;
use super::tree::TREES;
use crate::SegmentError;
use crate::presegment::{PresegmentSettings, Region, presegment};
use crate::votes::VoteSums;

/// How loud each witness speaks. Changing any by a factor of two moves the mean IoU by less than 0.01.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskCutSettings {
    /// Of a Gaussian that the masks see.
    pub seen: f32,
    /// Of a Gaussian no mask sees, for what the things it belongs to say (all trees together).
    pub kin: f32,
    /// Of a Gaussian outside an unoccluded mask.
    pub excluded: f32,
    /// Dissimilarity at which a border is 1/e as hard to cut as where there is none.
    pub softness: f32,
    /// Resistance of a border per edge of the neighbour graph.
    pub border: f32,
}

impl Default for MaskCutSettings {
    fn default() -> Self {
        Self { seen: 1.0, kin: 0.3, excluded: 3.0, softness: 0.7, border: 2.0 }
    }
}

/// Weight, in pixels, from which on a Gaussian's own votes count.
const SEEN_PIXELS: f64 = 0.3;
/// Capacities are integers in units of 1/1024: the cut is the same on every machine.
const UNIT: f32 = 1024.0;

/// Means within this share of the drawn depth count as on the surface.
const ON_SURFACE: f32 = 0.03;

/// Gaussians that a mask shows *not* to be part of its object: they lie outside it in the picture, and nothing nearer
/// hides them there. What is hidden, or outside the picture, stays open, so that an object behind another is not lost.
///
/// # Errors
/// [`SegmentError::Raster`] if the mask has another size than the view.
pub fn outside_in_sight(
    scene: &Scene,
    view: &View,
    mask: &Mask2d,
    raster: &mut dyn Rasterizer,
) -> Result<Selection, SegmentError> {
    let regions = presegment(scene, &[(view, mask)], &PresegmentSettings::default())?.regions;
    let depth = raster.depth(scene, view, Depth::Median)?;
    let mut out = Selection::none(scene.len());
    for (k, instance) in scene.instances.iter().enumerate() {
        let offset = scene.offset(k);
        for i in 0..instance.cloud.len() {
            let outside = match regions[offset + i] {
                Region::Unconnected => true,
                Region::Out => view.project(instance.mean(i)).is_some_and(|(pixel, z)| {
                    let (x, y) = (pixel.x.max(0.0) as u32, pixel.y.max(0.0) as u32);
                    let at = y.min(view.height - 1) as usize * view.width as usize + x.min(view.width - 1) as usize;
                    depth[at].is_nan() || z <= depth[at] * (1.0 + ON_SURFACE)
                }),
                Region::In | Region::Unknown => false,
            };
            if outside {
                out.insert(offset + i);
            }
        }
    }
    Ok(out)
}

impl Prepared {
    /// The object that the masks show, unseen sides included.
    ///
    /// `votes`: of all masks. `excluded`: Gaussians outside an unoccluded mask, if any; they can be part of the object only
    /// if the votes say so.
    pub fn object_from_votes(&self, votes: &VoteSums, excluded: Option<&Selection>, s: &MaskCutSettings) -> Selection {
        let n = self.graph.of.len();
        let patches = self.patch_count();
        let pixels = |v: u64| v as f64 * VOTE_UNIT;
        let mut inside = vec![0.0f64; patches];
        let mut total = vec![0.0f64; patches];
        let mut unary = vec![0.0f64; patches];
        let mut unseen = vec![0u32; patches];
        for (i, &p) in self.graph.of.iter().enumerate() {
            let p = p as usize;
            let (own_in, own) = (pixels(votes.inside()[i]), pixels(votes.total()[i]));
            inside[p] += own_in;
            total[p] += own;
            if own > SEEN_PIXELS {
                unary[p] += f64::from(s.seen) * (2.0 * own_in - own) / own;
            } else if excluded.is_some_and(|e| e.contains(i)) {
                unary[p] -= f64::from(s.excluded);
            } else {
                unseen[p] += 1;
            }
        }
        let kin = self.kin(&inside, &total);
        let mut graph = CutGraph::new(patches);
        for p in 0..patches {
            let u = unary[p] + f64::from(s.kin) * f64::from(unseen[p]) * kin[p];
            let capacity = (u.abs() * f64::from(UNIT)).round() as i64;
            graph.add_terminal(p, if u > 0.0 { capacity } else { 0 }, if u > 0.0 { 0 } else { capacity });
        }
        for b in &self.graph.borders {
            let ease = (-TREES[1].strength(b) / s.softness).exp();
            let capacity = (s.border * UNIT * b.count as f32 * ease).round() as i64;
            graph.add_edge(b.a as usize, b.b as usize, capacity);
        }
        let (chosen, _) = graph.solve();
        let decided: Vec<bool> = (0..n)
            .into_par_iter()
            .map(|i| {
                let (own_in, own) = (pixels(votes.inside()[i]), pixels(votes.total()[i]));
                if own > SEEN_PIXELS {
                    let share = own_in / own;
                    if share > 0.7 {
                        return true;
                    }
                    if share < 0.3 {
                        return false;
                    }
                } else if excluded.is_some_and(|e| e.contains(i)) {
                    return false;
                }
                chosen[self.graph.of[i] as usize]
            })
            .collect();
        Selection::from_fn(n, |i| decided[i])
    }

    /// What its kin say about every patch, -1..=1: in every tree, the smallest node around it of which the masks see enough
    /// speaks for all of it; the mean over the trees.
    fn kin(&self, inside: &[f64], total: &[f64]) -> Vec<f64> {
        let object: f64 = inside.iter().sum();
        let enough = (0.005 * object).max(10.0);
        let voices: Vec<Vec<f64>> = self
            .trees
            .par_iter()
            .map(|tree| {
                let mut node_in: Vec<f64> = inside.to_vec();
                let mut node_total: Vec<f64> = total.to_vec();
                for node in &tree.nodes[tree.leaves..] {
                    let [a, b] = node.children.map(|c| c as usize);
                    node_in.push(node_in[a] + node_in[b]);
                    node_total.push(node_total[a] + node_total[b]);
                }
                // Parents come after their children: from the top down every node knows its parent's voice.
                let mut voice = vec![0.0; tree.nodes.len()];
                for k in (0..tree.nodes.len()).rev() {
                    let parent = tree.nodes[k].parent as usize;
                    voice[k] = if node_total[k] >= enough || parent == k {
                        (2.0 * node_in[k] - node_total[k]) / node_total[k].max(1.0)
                    } else {
                        voice[parent]
                    };
                }
                voice.truncate(tree.leaves);
                voice
            })
            .collect();
        (0..self.patch_count()).map(|p| voices.iter().map(|v| v[p]).sum::<f64>() / voices.len().max(1) as f64).collect()
    }
}
