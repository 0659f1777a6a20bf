//! What a click may mean: the nodes above the clicked patch in every tree, ranked.

use glam::Vec2;
use rayon::prelude::*;
use splat_core::Selection;

use super::look::Look;
use super::look::inside_distance;
use super::prepared::Prepared;
use super::tree::TREES;

/// One thing that the click may mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// Its patches.
    pub patches: Selection,
    /// How good a thing it is; higher is better, comparable within one click only.
    pub score: f32,
    /// Sum of the patches' masses.
    pub mass: f32,
    /// What the score is made of, in order of [`WEIGHTS`].
    pub signs: [f32; SIGNS],
}

/// What a click may mean, best first, and what is offered of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hypotheses {
    /// All distinct hypotheses, best first.
    pub ranked: Vec<Hypothesis>,
    /// Positions of up to three that differ clearly, best first.
    pub proposals: Vec<usize>,
    /// Positions of up to twelve, from part to group: the steps of the granularity wheel.
    pub wheel: Vec<usize>,
}

/// Number of signs a score is made of.
pub const SIGNS: usize = 15;

/// Weight, mean and spread of each sign.
pub const WEIGHTS: [(&str, f32, f32, f32); SIGNS] = [
    ("mass", -0.193, -3.408, 2.106),
    ("mass_fit", 0.047, -4.601, 6.060),
    ("edge_strength", 0.496, -0.527, 0.737),
    ("shape_strength", 0.048, -1.079, 0.753),
    ("border_length", 0.076, 2.798, 1.472),
    ("persistence", 0.165, 0.219, 0.350),
    ("agreement", 0.239, 0.823, 0.156),
    ("central", 1.233, 0.463, 0.276),
    ("picture_edge", 0.377, 0.105, 0.169),
    ("raggedness", -0.063, 4.067, 1.408),
    ("free", 0.542, 0.357, 0.290),
    ("occluded", 0.320, 0.114, 0.178),
    ("area", -0.547, -2.799, 1.655),
    ("area_fit", 0.537, -2.781, 3.366),
    ("solidity", -0.284, -1.631, 1.974),
];

/// Proposals overlap less than this (Jaccard index by mass).
const PROPOSALS_DIFFER: f32 = 0.8;
/// Steps of the wheel overlap less than this.
const STEPS_DIFFER: f32 = 0.96;
/// Hypotheses that overlap more than this are one.
const SAME: f32 = 0.985;

/// One tree's chain of ancestors of the clicked patch, and for every patch the first of them that contains it.
struct Chain {
    nodes: Vec<u32>,
    level: Vec<u16>,
}

const OUTSIDE: u16 = u16::MAX;

impl Prepared {
    /// Ranks what a click may mean.
    ///
    /// `patch`: the clicked patch; `at`: the clicked pixel of the view.
    pub fn hypotheses(&self, look: &Look, patch: u32, at: Vec2) -> Hypotheses {
        let chains: Vec<Chain> = (0..self.trees.len()).map(|t| self.chain(t, patch)).collect();
        let total: f32 = self.graph.patches.iter().map(|p| p.mass).sum();
        // Jaccard index by mass of every two nodes of different chains, from one two-dimensional histogram per pair.
        let overlaps = Overlaps::new(self, &chains);
        let mut kept: Vec<(usize, usize)> = Vec::new();
        for (t, chain) in chains.iter().enumerate() {
            for l in 0..chain.nodes.len() {
                if overlaps.mass(t, l) >= 3.0 && !kept.iter().any(|&k| overlaps.jaccard(k, (t, l)) > SAME) {
                    kept.push((t, l));
                }
            }
        }
        let borders: Vec<Vec<[f32; 3]>> = chains.iter().map(|c| self.border_sums(c)).collect();
        let outlines: Vec<Vec<Outline>> = chains.iter().map(|c| outlines(look, c)).collect();
        let pixel = look.pixel(at);
        let mut ranked: Vec<((usize, usize), Hypothesis)> = kept
            .par_iter()
            .map(|&(t, l)| {
                let chain = &chains[t];
                let node = &self.trees[t].nodes[chain.nodes[l] as usize];
                let parent = &self.trees[t].nodes[node.parent as usize];
                let mass = overlaps.mass(t, l);
                let share = (mass / total).max(1e-9).ln();
                let [count, edge, shape] = borders[t][l];
                let agreement = (0..chains.len())
                    .filter(|&u| u != t)
                    .map(|u| (0..chains[u].nodes.len()).map(|k| overlaps.jaccard((t, l), (u, k))).fold(0.0, f32::max))
                    .sum::<f32>()
                    / (chains.len() - 1).max(1) as f32;
                let o = &outlines[t][l];
                let seen_share = ((o.area + 1.0) / look.patch.len() as f32).ln();
                let (central, most) = centrality(look, chain, l as u16, pixel);
                let signs = [
                    share,
                    -(share + 3.0).powi(2),
                    (edge / count.max(1.0) + 0.01).ln(),
                    (shape / count.max(1.0) + 0.01).ln(),
                    ((count + 1.0) / (node.count as f32).sqrt()).ln(),
                    ((parent.height + 1e-3) / (node.height + 1e-3)).ln().min(3.0),
                    agreement,
                    central,
                    o.picture_edge / (o.length + o.picture_edge + 1.0),
                    (o.length * o.length / o.area.max(1.0)).max(1e-3).ln(),
                    o.free / (o.length + 1.0),
                    o.occluded / (o.length + 1.0),
                    seen_share,
                    -(seen_share + 3.0).powi(2),
                    (most * most / o.area.max(1.0) + 1e-3).ln(),
                ];
                let score = signs.iter().zip(&WEIGHTS).map(|(s, (_, w, mean, spread))| w * (s - mean) / spread).sum();
                let patches = Selection::from_fn(self.patch_count(), |p| chain.level[p] as usize <= l);
                ((t, l), Hypothesis { patches, score, mass, signs })
            })
            .collect();
        ranked.sort_by(|a, b| b.1.score.total_cmp(&a.1.score).then(a.0.cmp(&b.0)));
        let distinct = |most: usize, differ: f32| {
            let mut out: Vec<usize> = Vec::new();
            for k in 0..ranked.len() {
                if out.len() < most && out.iter().all(|&o| overlaps.jaccard(ranked[o].0, ranked[k].0) < differ) {
                    out.push(k);
                }
            }
            out
        };
        let proposals = distinct(3, PROPOSALS_DIFFER);
        let mut wheel = distinct(12, STEPS_DIFFER);
        wheel.sort_by(|&a, &b| ranked[a].1.mass.total_cmp(&ranked[b].1.mass).then(a.cmp(&b)));
        Hypotheses { ranked: ranked.into_iter().map(|r| r.1).collect(), proposals, wheel }
    }

    fn chain(&self, tree: usize, patch: u32) -> Chain {
        let tree = &self.trees[tree];
        let nodes = tree.ancestors(patch);
        let mut level = vec![OUTSIDE; self.patch_count()];
        // A node's patches are one run that contains its child's: only the ends are new.
        let mut done = (0, 0);
        for (l, &n) in nodes.iter().enumerate() {
            let (start, len) = tree.run[n as usize];
            let end = start + len;
            let fresh = if l == 0 { (start..end).chain(0..0) } else { (start..done.0).chain(done.1..end) };
            for k in fresh {
                level[tree.order[k as usize] as usize] = l as u16;
            }
            done = (start, end);
        }
        Chain { nodes, level }
    }

    /// Per level: edges that leave the node, sum of their strengths by all signs, and by shape above all.
    fn border_sums(&self, chain: &Chain) -> Vec<[f32; 3]> {
        let levels = chain.nodes.len();
        let mut change = vec![[0.0f64; 3]; levels + 1];
        for b in &self.graph.borders {
            let (x, y) = (chain.level[b.a as usize], chain.level[b.b as usize]);
            let (low, high) = (x.min(y) as usize, (x.max(y) as usize).min(levels));
            if low < high {
                let n = f64::from(b.count);
                let sums = [n, n * f64::from(TREES[1].strength(b)), n * f64::from(TREES[0].strength(b))];
                for k in 0..3 {
                    change[low][k] += sums[k];
                    change[high][k] -= sums[k];
                }
            }
        }
        running(&change[..levels], |a, b| std::array::from_fn(|k| a[k] + b[k]), [0.0; 3])
            .into_iter()
            .map(|s| s.map(|v| v as f32))
            .collect()
    }
}

fn running<T: Copy>(values: &[T], add: impl Fn(T, T) -> T, zero: T) -> Vec<T> {
    let mut sum = zero;
    values
        .iter()
        .map(|&v| {
            sum = add(sum, v);
            sum
        })
        .collect()
}

/// The silhouette of a node in the user's view, in pixels of the small picture.
#[derive(Clone, Copy, Debug, Default)]
struct Outline {
    area: f32,
    /// Steps from a pixel inside to one outside.
    length: f32,
    /// Those of them behind which the depth falls away: an occluding contour.
    free: f32,
    /// Those of them where something nearer covers the node.
    occluded: f32,
    /// Pixels inside along the picture's edge.
    picture_edge: f32,
}

/// Depths that differ by more than this share lie on different surfaces.
const STEP: f32 = 0.02;

/// Outlines of all levels of a chain in one pass: a step between levels a < b belongs to the outlines of a..b.
fn outlines(look: &Look, chain: &Chain) -> Vec<Outline> {
    let (w, h) = (look.width, look.height);
    let levels = chain.nodes.len();
    let mut change = vec![[0i32; 5]; levels + 1];
    let level = |i: usize| match look.patch[i] {
        Look::NOTHING => levels,
        p => (chain.level[p as usize] as usize).min(levels),
    };
    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            let own = level(i);
            if own == levels {
                continue;
            }
            change[own][0] += 1;
            if x == 0 || y == 0 || x + 1 == w || y + 1 == h {
                change[own][4] += 1;
            }
            let near = [(x > 0, i.wrapping_sub(1)), (x + 1 < w, i + 1), (y > 0, i.wrapping_sub(w)), (y + 1 < h, i + w)];
            for (there, j) in near {
                if !there {
                    continue;
                }
                let other = level(j);
                if other > own {
                    let (inside, outside) = (look.depth[i], look.depth[j]);
                    let free = outside.is_nan() || outside > inside * (1.0 + STEP);
                    let occluded = outside < inside * (1.0 - STEP);
                    for (k, yes) in [(1, true), (2, free), (3, occluded)] {
                        change[own][k] += i32::from(yes);
                        change[other][k] -= i32::from(yes);
                    }
                }
            }
        }
    }
    running(&change[..levels], |a, b| std::array::from_fn(|k| a[k] + b[k]), [0; 5])
        .into_iter()
        .map(|s| {
            let [area, length, free, occluded, picture_edge] = s.map(|v| v as f32);
            Outline { area, length, free, occluded, picture_edge }
        })
        .collect()
}

/// How central the clicked pixel is in the node's silhouette: its distance to the outline over the largest one,
/// and that largest one in pixels of the small picture.
/// People click the middle of what they mean.
fn centrality(look: &Look, chain: &Chain, level: u16, pixel: usize) -> (f32, f32) {
    let inside: Vec<bool> =
        look.patch.iter().map(|&p| p != Look::NOTHING && chain.level[p as usize] <= level).collect();
    let distance = inside_distance(&inside, look.width, look.height);
    let most = distance.iter().copied().fold(0.0, f32::max);
    (distance[pixel] / most.max(1.0), most)
}

/// Masses of all nodes of all chains and of their intersections.
struct Overlaps {
    masses: Vec<Vec<f32>>,
    /// For chains t < u: intersection mass of level i of t and level j of u at `i * levels(u) + j`.
    both: Vec<Vec<Vec<f32>>>,
}

impl Overlaps {
    fn new(prepared: &Prepared, chains: &[Chain]) -> Self {
        let masses = chains
            .iter()
            .map(|c| {
                let mut sums = vec![0.0f64; c.nodes.len()];
                for (p, &l) in c.level.iter().enumerate() {
                    if l != OUTSIDE {
                        sums[l as usize] += f64::from(prepared.graph.patches[p].mass);
                    }
                }
                running(&sums, |a, b| a + b, 0.0).into_iter().map(|v| v as f32).collect()
            })
            .collect();
        let both = (0..chains.len())
            .into_par_iter()
            .map(|t| {
                (t + 1..chains.len())
                    .map(|u| {
                        let (n, m) = (chains[t].nodes.len(), chains[u].nodes.len());
                        let mut sums = vec![0.0f64; n * m];
                        for (p, patch) in prepared.graph.patches.iter().enumerate() {
                            let (i, j) = (chains[t].level[p], chains[u].level[p]);
                            if i != OUTSIDE && j != OUTSIDE {
                                sums[i as usize * m + j as usize] += f64::from(patch.mass);
                            }
                        }
                        for i in 0..n {
                            for j in 1..m {
                                sums[i * m + j] += sums[i * m + j - 1];
                            }
                        }
                        for k in m..n * m {
                            sums[k] += sums[k - m];
                        }
                        sums.into_iter().map(|v| v as f32).collect()
                    })
                    .collect()
            })
            .collect();
        Self { masses, both }
    }

    fn mass(&self, t: usize, l: usize) -> f32 {
        self.masses[t][l]
    }

    fn jaccard(&self, a: (usize, usize), b: (usize, usize)) -> f32 {
        let (a, b) = if a.0 <= b.0 { (a, b) } else { (b, a) };
        let (x, y) = (self.mass(a.0, a.1), self.mass(b.0, b.1));
        let both =
            if a.0 == b.0 { x.min(y) } else { self.both[a.0][b.0 - a.0 - 1][a.1 * self.masses[b.0].len() + b.1] };
        both / (x + y - both).max(1e-9)
    }
}
