//! Nearest neighbours of the means: a k-d tree, and the neighbour lists of all Gaussians.

use glam::Vec3;
use rayon::prelude::*;

/// Stands for "no neighbour" in [`Neighbours::of`].
pub const NO_NEIGHBOUR: u32 = u32::MAX;

/// Points of a leaf, at most: small enough to scan, large enough that the tree stays shallow.
const LEAF: usize = 12;
/// Subtrees above this size are built and searched on several threads.
const PARALLEL: usize = 1 << 14;

/// A balanced k-d tree over points. Points that are not finite are left out.
#[derive(Clone, Debug)]
pub struct KdTree {
    /// Points in leaf order.
    points: Vec<Vec3>,
    /// Their positions in the input.
    ids: Vec<u32>,
    /// Inner nodes of a complete binary tree (children of i at 2 i + 1 and 2 i + 2): axis and coordinate of the split.
    splits: Vec<(u8, f32)>,
}

impl KdTree {
    /// A tree over `points`; ids are positions in it.
    pub fn new(points: &[Vec3]) -> Self {
        let mut entries: Vec<(Vec3, u32)> =
            points.iter().zip(0..).filter(|(p, _)| p.is_finite()).map(|(&p, i)| (p, i)).collect();
        let mut splits = Vec::new();
        for (node, split) in build(&mut entries, 0) {
            if splits.len() <= node {
                splits.resize(node + 1, (0, 0.0));
            }
            splits[node] = split;
        }
        Self { points: entries.iter().map(|e| e.0).collect(), ids: entries.iter().map(|e| e.1).collect(), splits }
    }

    /// Number of points in the tree.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether the tree has no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The `k` points nearest to `point`, nearest first, as (id, distance). Points at one distance come in the tree's
    /// order, which depends on nothing but the input.
    pub fn nearest(&self, point: Vec3, k: usize) -> Vec<(u32, f32)> {
        let mut best = Best::new(k);
        if k > 0 && point.is_finite() {
            self.search(0..self.points.len(), 0, point, usize::MAX, &mut best);
        }
        best.found.iter().map(|&(d, at)| (self.ids[at as usize], d.sqrt())).collect()
    }

    /// Ids of all points within `radius` of `point` (the rim included), rising.
    pub fn within(&self, point: Vec3, radius: f32) -> Vec<u32> {
        let mut out = Vec::new();
        if radius >= 0.0 && point.is_finite() {
            self.collect(0..self.points.len(), 0, point, radius, &mut out);
        }
        out.sort_unstable();
        out
    }

    fn search(&self, range: std::ops::Range<usize>, node: usize, p: Vec3, but: usize, best: &mut Best) {
        let n = range.len();
        if n <= LEAF {
            for at in range {
                let d = self.points[at].distance_squared(p);
                if d < best.worst && at != but {
                    best.insert(d, at as u32);
                }
            }
            return;
        }
        let (axis, value) = self.splits[node];
        let half = range.start + n / 2;
        let d = p[axis as usize] - value;
        let (low, high) = ((range.start..half, 2 * node + 1), (half..range.end, 2 * node + 2));
        let (first, second) = if d < 0.0 { (low, high) } else { (high, low) };
        self.search(first.0, first.1, p, but, best);
        // Strict, so that a heap of equal points is not searched to its end.
        if d * d < best.worst {
            self.search(second.0, second.1, p, but, best);
        }
    }

    fn collect(&self, range: std::ops::Range<usize>, node: usize, p: Vec3, r: f32, out: &mut Vec<u32>) {
        let n = range.len();
        if n <= LEAF {
            out.extend(range.filter(|&at| self.points[at].distance_squared(p) <= r * r).map(|at| self.ids[at]));
            return;
        }
        let (axis, value) = self.splits[node];
        let half = range.start + n / 2;
        let d = p[axis as usize] - value;
        if d <= r {
            self.collect(range.start..half, 2 * node + 1, p, r, out);
        }
        if d >= -r {
            self.collect(half..range.end, 2 * node + 2, p, r, out);
        }
    }
}

/// Halves by the median of the widest axis, down to leaves; gives the splits with their node numbers.
fn build(entries: &mut [(Vec3, u32)], node: usize) -> Vec<(usize, (u8, f32))> {
    let n = entries.len();
    if n <= LEAF {
        // In order of id, so that ties are found in that order.
        entries.sort_unstable_by_key(|e| e.1);
        return Vec::new();
    }
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for (p, _) in entries.iter() {
        min = min.min(*p);
        max = max.max(*p);
    }
    let axis = (max - min).max_position();
    let half = n / 2;
    // Ids part equal coordinates: the order is one, whatever the selection algorithm does.
    let (_, middle, _) =
        entries.select_nth_unstable_by(half, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let mut splits = vec![(node, (axis as u8, middle.0[axis]))];
    let (low, high) = entries.split_at_mut(half);
    let (mut left, mut right) = if n > PARALLEL {
        rayon::join(|| build(low, 2 * node + 1), || build(high, 2 * node + 2))
    } else {
        (build(low, 2 * node + 1), build(high, 2 * node + 2))
    };
    splits.append(&mut left);
    splits.append(&mut right);
    splits
}

/// The best k so far, nearest first.
struct Best {
    found: Vec<(f32, u32)>,
    k: usize,
    worst: f32,
}

impl Best {
    fn new(k: usize) -> Self {
        Self { found: Vec::with_capacity(k + 1), k, worst: f32::INFINITY }
    }

    fn insert(&mut self, d: f32, at: u32) {
        let mut place = self.found.len();
        while place > 0 && self.found[place - 1].0 > d {
            place -= 1;
        }
        if self.found.len() == self.k {
            self.found.pop();
        }
        self.found.insert(place, (d, at));
        if self.found.len() == self.k {
            self.worst = self.found[self.k - 1].0;
        }
    }
}

/// The nearest other Gaussians of every Gaussian, by distance of the means.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbours {
    k: usize,
    ids: Vec<u32>,
    distances: Vec<f32>,
}

impl Neighbours {
    /// The `k` nearest others of every mean, exact; the same on any number of threads.
    ///
    /// Cost: about a microsecond a Gaussian and thread for k = 12.
    pub fn build(means: &[Vec3], k: usize) -> Self {
        let tree = KdTree::new(means);
        let mut ids = vec![NO_NEIGHBOUR; means.len() * k];
        let mut distances = vec![f32::INFINITY; means.len() * k];
        if k == 0 {
            return Self { k, ids, distances };
        }
        // In leaf order neighbouring queries walk the same nodes, which stay in the cache.
        let found: Vec<(Vec<u32>, Vec<f32>)> = (0..tree.len().div_ceil(1024))
            .into_par_iter()
            .map(|block| {
                let range = block * 1024..((block + 1) * 1024).min(tree.len());
                let mut ids = Vec::with_capacity(range.len() * k);
                let mut distances = Vec::with_capacity(range.len() * k);
                let mut best = Best::new(k);
                for at in range {
                    best.found.clear();
                    best.worst = f32::INFINITY;
                    tree.search(0..tree.len(), 0, tree.points[at], at, &mut best);
                    ids.extend(best.found.iter().map(|&(_, at)| tree.ids[at as usize]));
                    ids.extend(std::iter::repeat_n(NO_NEIGHBOUR, k - best.found.len()));
                    distances.extend(best.found.iter().map(|&(d, _)| d.sqrt()));
                    distances.extend(std::iter::repeat_n(f32::INFINITY, k - best.found.len()));
                }
                (ids, distances)
            })
            .collect();
        for (block, (block_ids, block_distances)) in found.iter().enumerate() {
            for (row, (i, d)) in block_ids.chunks_exact(k).zip(block_distances.chunks_exact(k)).enumerate() {
                let to = tree.ids[block * 1024 + row] as usize * k;
                ids[to..to + k].copy_from_slice(i);
                distances[to..to + k].copy_from_slice(d);
            }
        }
        Self { k, ids, distances }
    }

    /// Neighbours asked for per Gaussian.
    pub fn k(&self) -> usize {
        self.k
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        if self.k == 0 { 0 } else { self.ids.len() / self.k }
    }

    /// Whether there are no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Neighbours of Gaussian `i`, nearest first, and their distances in scene units. Where there are fewer than k others,
    /// or the mean is not finite, the rest is [`NO_NEIGHBOUR`] at infinite distance.
    pub fn of(&self, i: usize) -> (&[u32], &[f32]) {
        let range = i * self.k..(i + 1) * self.k;
        (&self.ids[range.clone()], &self.distances[range])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(seed: u64, count: usize) -> Vec<Vec3> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        (0..count).map(|_| Vec3::new(next(), next(), next().powi(3))).collect()
    }

    #[test]
    fn neighbours_are_those_of_a_full_search() {
        for (seed, count, k) in [(1, 2000, 12), (2, 5, 8), (3, 1, 3), (4, 0, 3), (5, 300, 1)] {
            let mut p = points(seed, count);
            if count > 100 {
                p[7] = p[9];
                p[20] = Vec3::splat(1e9);
                p[21] = Vec3::NAN;
            }
            let fast = Neighbours::build(&p, k);
            for i in 0..count {
                let mut slow: Vec<f32> = (0..count)
                    .filter(|&j| j != i && p[j].is_finite() && p[i].is_finite())
                    .map(|j| p[i].distance_squared(p[j]).sqrt())
                    .collect();
                slow.sort_by(f32::total_cmp);
                slow.resize(k.max(slow.len()), f32::INFINITY);
                let (ids, distances) = fast.of(i);
                assert_eq!(distances, &slow[..k], "seed {seed}, point {i}");
                for (&j, &d) in ids.iter().zip(distances) {
                    assert_eq!(j == NO_NEIGHBOUR, d.is_infinite());
                    assert!(j == NO_NEIGHBOUR || p[i].distance_squared(p[j as usize]).sqrt() == d);
                }
            }
        }
    }

    #[test]
    fn many_equal_points_do_not_stall() {
        let p = vec![Vec3::ONE; 100_000];
        let n = Neighbours::build(&p, 12);
        assert!(n.of(77).1.iter().all(|&d| d == 0.0));
        assert!(!n.of(77).0.contains(&77));
    }

    #[test]
    fn a_ball_holds_what_a_full_search_finds() {
        let p = points(9, 1500);
        let tree = KdTree::new(&p);
        for (q, r) in [(Vec3::splat(0.5), 0.2), (Vec3::ZERO, 0.0), (Vec3::ONE, 9.0), (Vec3::NAN, 1.0)] {
            let slow: Vec<u32> = (0..1500).filter(|&i| p[i as usize].distance_squared(q) <= r * r).collect();
            assert_eq!(tree.within(q, r), slow);
        }
        assert_eq!(tree.nearest(p[3], 1), [(3, 0.0)]);
    }

    #[test]
    fn one_thread_finds_what_many_find() {
        let p = points(11, 40_000);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(one.install(|| Neighbours::build(&p, 6)), Neighbours::build(&p, 6));
    }
}
