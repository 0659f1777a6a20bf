//! Superpoints: small patches that belong to one thing (Felzenszwalb and Huttenlocher 2004, on the neighbour graph).

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
    let mut inner = vec![0.0f32; count];
    for &e in &order {
        let e = edges[e as usize];
        let (a, b) = (sets.find(e.a), sets.find(e.b));
        if a == b {
            continue;
        }
        let limit = |s: u32| inner[s as usize] + settings.k / sets.size[s as usize] as f32;
        if e.d <= limit(a).min(limit(b)) {
            let root = sets.union(a, b);
            inner[root as usize] = e.d;
        }
    }
    for &e in &order {
        let e = edges[e as usize];
        let (a, b) = (sets.find(e.a), sets.find(e.b));
        if a != b && sets.size[a as usize].min(sets.size[b as usize]) < settings.min_size {
            sets.union(a, b);
        }
    }
    sets.labels()
}

/// Positions of the edges by rising dissimilarity, ties by position: a stable radix sort of 24-bit keys.
fn order_by_dissimilarity(edges: &[Edge]) -> Vec<u32> {
    // Dissimilarities are below 16: 2^-18 steps keep the order of what matters.
    let keys: Vec<u32> = edges.iter().map(|e| ((e.d.clamp(0.0, 63.9)) * 262_144.0) as u32).collect();
    let mut order: Vec<u32> = (0..edges.len() as u32).collect();
    let mut other = vec![0u32; edges.len()];
    for shift in [0, 12] {
        let mut start = vec![0u32; 4097];
        for &k in &keys {
            start[(k >> shift & 4095) as usize + 1] += 1;
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        for &e in &order {
            let s = &mut start[(keys[e as usize] >> shift & 4095) as usize];
            other[*s as usize] = e;
            *s += 1;
        }
        std::mem::swap(&mut order, &mut other);
    }
    order
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
