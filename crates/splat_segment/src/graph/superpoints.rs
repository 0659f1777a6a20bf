//! Superpoints: small patches that belong to one thing (Felzenszwalb and Huttenlocher 2004, on the neighbour graph).

use rayon::prelude::*;

use super::edges::Edge;

/// Parameters of the merging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuperpointSettings {
    /// Scale `k`: a patch of n Gaussians tolerates a step of `k / n` beyond its own largest inner one.
    pub k: f32,
    /// Patches below this many Gaussians join their most alike neighbour.
    pub min_size: u32,
}

impl Default for SuperpointSettings {
    fn default() -> Self {
        Self { k: 0.8, min_size: 10 }
    }
}

/// Labels 0.. per Gaussian in order of first appearance, and their count.
pub fn superpoints(count: usize, edges: &[Edge], settings: &SuperpointSettings) -> (Vec<u32>, usize) {
    let order = order_by_dissimilarity(edges);
    let mut sets = DisjointSets::new(count);
    // Per root: its largest inner edge plus k / size, the most that the next edge may be.
    let mut limit = vec![settings.k; count];
    // Edges that did not join their ends the first time; all others lie inside a patch for good.
    let mut between = Vec::new();
    for &e in &order {
        let edge = edges[e as usize];
        let (a, b) = (sets.find(edge.a), sets.find(edge.b));
        if a == b {
            continue;
        }
        if edge.d <= limit[a as usize].min(limit[b as usize]) {
            let root = sets.union(a, b) as usize;
            limit[root] = edge.d + settings.k / sets.size[root] as f32;
        } else {
            between.push(e);
        }
    }
    for &e in &between {
        let edge = edges[e as usize];
        let (a, b) = (sets.find(edge.a), sets.find(edge.b));
        if a != b && sets.size[a as usize].min(sets.size[b as usize]) < settings.min_size {
            sets.union(a, b);
        }
    }
    sets.labels()
}

/// Positions of the edges by rising dissimilarity, ties by position.
fn order_by_dissimilarity(edges: &[Edge]) -> Vec<u32> {
    // The bits of a float that is not negative rise with its value.
    let mut keys: Vec<u64> =
        edges.par_iter().enumerate().map(|(i, e)| u64::from(e.d.max(0.0).to_bits()) << 32 | i as u64).collect();
    keys.par_sort_unstable();
    keys.into_par_iter().map(|k| k as u32).collect()
}

/// Union-find with sizes; the lower root wins ties, so that results do not depend on anything but the input.
#[derive(Clone, Debug)]
pub(super) struct DisjointSets {
    parent: Vec<u32>,
    pub(super) size: Vec<u32>,
}

impl DisjointSets {
    pub(super) fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect(), size: vec![1; count] }
    }

    pub(super) fn find(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            let up = self.parent[self.parent[i as usize] as usize];
            self.parent[i as usize] = up;
            i = up;
        }
        i
    }

    /// Joins two roots and gives the new one.
    pub(super) fn union(&mut self, a: u32, b: u32) -> u32 {
        let (sa, sb) = (self.size[a as usize], self.size[b as usize]);
        let (root, child) = if sa > sb || (sa == sb && a < b) { (a, b) } else { (b, a) };
        self.parent[child as usize] = root;
        self.size[root as usize] = sa + sb;
        root
    }

    pub(super) fn labels(&mut self) -> (Vec<u32>, usize) {
        let mut name = vec![u32::MAX; self.parent.len()];
        let mut count = 0;
        let labels = (0..self.parent.len() as u32)
            .map(|i| {
                let root = self.find(i) as usize;
                if name[root] == u32::MAX {
                    name[root] = count;
                    count += 1;
                }
                name[root]
            })
            .collect();
        (labels, count as usize)
    }
}
