//! How unlike two neighbouring Gaussians are.

use glam::Vec3;
use rayon::prelude::*;
use splat_core::Cloud;
use splat_core::Neighbours;

use super::features::Feature;

/// An undirected edge of the neighbour graph, `a < b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Lower id.
    pub a: u32,
    /// Higher id.
    pub b: u32,
    /// Dissimilarity, 0 (alike) to about 6.
    pub d: f32,
}

/// Colour difference in CIE Lab that counts as 1.
pub(super) const LAB_UNIT: f32 = 20.0;
// Print and texture tear objects apart, contacts between things are concave; `docs/selection.md` has the ablation.
const COLOR: f32 = 0.5;
const CONCAVE: f32 = 1.0;
const CONVEX: f32 = 0.25;
const GAP: f32 = 0.25;
/// Share of the colour term that is left where the surface runs on smoothly.
const COLOR_ON_SMOOTH: f32 = 0.5;

/// All edges of the neighbour graph with their dissimilarity, in order of the Gaussian that lists them and of nearness.
pub fn edges(cloud: &Cloud, neighbours: &Neighbours, features: &[Feature]) -> Vec<Edge> {
    let means = cloud.means();
    (0..cloud.len() as u32)
        .into_par_iter()
        .with_min_len(4096)
        .fold(Vec::new, |mut out, i| {
            let (ids, distances) = neighbours.of(i as usize);
            for (&j, &distance) in ids.iter().zip(distances) {
                if j == u32::MAX {
                    break;
                }
                // A pair of mutual neighbours is listed once, by its lower id.
                if i > j && neighbours.of(j as usize).0.contains(&i) {
                    continue;
                }
                let (a, b) = (i.min(j), i.max(j));
                let apart = means[a as usize] - means[b as usize];
                let d = dissimilarity(&features[a as usize], &features[b as usize], apart, distance);
                out.push(Edge { a, b, d });
            }
            out
        })
        .reduce(Vec::new, |mut left, mut right| {
            left.append(&mut right);
            left
        })
}

/// Dissimilarity of two neighbours; `apart` runs from b to a, `distance` is its length.
fn dissimilarity(a: &Feature, b: &Feature, apart: Vec3, distance: f32) -> f32 {
    let cos = a.normal.dot(b.normal);
    let sure = a.confidence.min(b.confidence).powi(4);
    let smooth = sure * cos.max(0.0).powi(4);
    let color = (a.lab - b.lab).length() / LAB_UNIT * (1.0 - (1.0 - COLOR_ON_SMOOTH) * smooth);
    let convex = (a.normal - b.normal).dot(apart) > 0.0;
    let bend = (1.0 - cos) * sure * if convex { CONVEX } else { CONCAVE };
    let spacing = a.spacing.max(b.spacing);
    let gap = if spacing > 0.0 { (distance / (2.0 * spacing) - 1.0).clamp(0.0, 2.0) } else { 0.0 };
    let d = COLOR * color + bend + GAP * gap;
    if d.is_finite() { d } else { 10.0 }
}
