//! From a box around an object to the object.

use splat_core::Selection;

use super::hypotheses::{Hypothesis, SIGNS};
use super::look::Look;
use super::prepared::Prepared;

/// What a node shows in the small picture.
#[derive(Clone, Copy)]
struct Shown {
    pixels: u32,
    inside: u32,
    low: [u32; 2],
    high: [u32; 2],
}

impl Shown {
    const NOTHING: Self = Self { pixels: 0, inside: 0, low: [u32::MAX; 2], high: [0; 2] };

    fn join(self, other: Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            inside: self.inside + other.inside,
            low: [self.low[0].min(other.low[0]), self.low[1].min(other.low[1])],
            high: [self.high[0].max(other.high[0]), self.high[1].max(other.high[1])],
        }
    }
}

/// Answers given at most.
const ANSWERS: usize = 12;

impl Prepared {
    /// Things that fill a box in the user's view, best first, at most twelve; empty if the box shows nothing.
    ///
    /// `rectangle`: left, top, right, bottom in pixels of the look's view, inclusive.
    ///
    /// A node of any tree is scored by the overlap of its bounding box with the rectangle, by the share of its pixels that lie
    /// inside, and a little by how strong its border is.
    pub fn object_in_box(&self, look: &Look, rectangle: [u32; 4]) -> Vec<Hypothesis> {
        let r = rectangle.map(|v| v / look.step);
        let mut leaves = vec![Shown::NOTHING; self.patch_count()];
        for (k, &p) in look.patch.iter().enumerate() {
            if p == Look::NOTHING {
                continue;
            }
            let (x, y) = ((k % look.width) as u32, (k / look.width) as u32);
            let inside = u32::from(x >= r[0] && x <= r[2] && y >= r[1] && y <= r[3]);
            let leaf = &mut leaves[p as usize];
            *leaf = leaf.join(Shown { pixels: 1, inside, low: [x, y], high: [x, y] });
        }
        let area = |low: [u32; 2], high: [u32; 2]| {
            let side = |a: u32, b: u32| if b >= a { (b - a + 1) as f32 } else { 0.0 };
            side(low[0], high[0]) * side(low[1], high[1])
        };
        let mut found: Vec<(f32, usize, u32)> = Vec::new();
        for (t, tree) in self.trees.iter().enumerate() {
            let mut shown = leaves.clone();
            for node in &tree.nodes[tree.leaves..] {
                let [a, b] = node.children.map(|c| shown[c as usize]);
                shown.push(a.join(b));
            }
            for (n, (s, node)) in shown.iter().zip(&tree.nodes).enumerate() {
                if s.inside == 0 {
                    continue;
                }
                let both = area([s.low[0].max(r[0]), s.low[1].max(r[1])], [s.high[0].min(r[2]), s.high[1].min(r[3])]);
                let either = area(s.low, s.high) + area([r[0], r[1]], [r[2], r[3]]) - both;
                let strength = (node.border_sum / (node.border as f32).max(1.0) + 0.01).ln();
                let score = both / either + 0.5 * s.inside as f32 / s.pixels as f32 + 0.05 * strength;
                found.push((score, t, n as u32));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut out: Vec<Hypothesis> = Vec::new();
        for (score, t, n) in found {
            let patches = Selection::from_ids(self.patch_count(), self.trees[t].patches(n).iter().copied());
            if out.iter().all(|o| o.patches != patches) {
                let mass = patches.iter().map(|p| self.graph.patches[p].mass).sum();
                out.push(Hypothesis { patches, score, mass, signs: [0.0; SIGNS] });
                if out.len() == ANSWERS {
                    break;
                }
            }
        }
        out
    }
}
