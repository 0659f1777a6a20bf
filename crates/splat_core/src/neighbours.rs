//! Nearest neighbours of the means: a k-d tree, and the neighbour lists of all Gaussians.
//!
//! Points lie in leaves of 16 as arrays per axis. The points of a leaf search together: one walk over the boxes of the tree, and
//! per leaf met a comparison of 16 points with its box and of those that may gain with its 16 points, in lanes. A squared
//! distance and an id make one integer, so that ties have one order and a search among equal points ends.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

/// Stands for "no neighbour" in [`Neighbours::of`].
pub const NO_NEIGHBOUR: u32 = u32::MAX;

/// Points of a leaf; all leaves but the last are full, so that a leaf is a fixed number of lanes.
const LEAF: usize = 16;
/// Subtrees of more leaves than this are built on several threads.
const PARALLEL_LEAVES: usize = 1 << 10;
/// Leaves whose points one task answers.
const TASK_LEAVES: usize = 64;
/// Deeper than any tree over 2^32 points in leaves of 16.
const STACK: usize = 64;

/// A squared distance and an id as one number, ordered by distance, then by id. Squared distances are not negative, so their
/// bits order as they do.
type Key = u64;

/// Farther than everything that counts: distances that overflow are not found.
const FARTHEST: Key = (f32::INFINITY.to_bits() as u64) << 32;

fn key(squared: f32, id: u32) -> Key {
    u64::from(squared.to_bits()) << 32 | u64::from(id)
}

fn split_key(key: Key) -> (u32, f32) {
    if key >= FARTHEST {
        (NO_NEIGHBOUR, f32::INFINITY)
    } else {
        (key as u32, f32::from_bits((key >> 32) as u32).sqrt())
    }
}

/// What lies below a node of the tree.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: Vec3,
    lowest_id: u32,
    max: Vec3,
}

impl Node {
    const EMPTY: Self = Self { min: Vec3::INFINITY, lowest_id: u32::MAX, max: Vec3::NEG_INFINITY };

    /// At most the key of any point below, seen from any point of the box `min..=max`. Rounding keeps the order, because
    /// every step is the one that [`squared`] takes, on a smaller number.
    #[inline(always)]
    fn bound(&self, min: Vec3, max: Vec3) -> Key {
        let gap = (self.min - max).max(min - self.max).max(Vec3::ZERO);
        key(squared(gap), self.lowest_id)
    }
}

#[inline(always)]
fn squared(d: Vec3) -> f32 {
    d.x * d.x + d.y * d.y + d.z * d.z
}

/// The points of a leaf, an array per axis; infinite beyond the last point.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Leaf {
    axes: [[f32; LEAF]; 3],
    ids: [u32; LEAF],
}

impl Leaf {
    #[inline(always)]
    fn distances(&self, p: Vec3) -> [f32; LEAF] {
        let [xs, ys, zs] = &self.axes;
        std::array::from_fn(|k| squared(Vec3::new(xs[k] - p.x, ys[k] - p.y, zs[k] - p.z)))
    }

    fn point(&self, k: usize) -> Vec3 {
        Vec3::new(self.axes[0][k], self.axes[1][k], self.axes[2][k])
    }
}

/// A balanced k-d tree over points. Points that are not finite are left out.
#[derive(Clone, Debug)]
pub struct KdTree {
    leaves: Vec<Leaf>,
    /// A node, all below its left child, all below its right one.
    nodes: Vec<Node>,
    len: usize,
}

/// A node, and the leaves below it.
#[derive(Clone, Copy)]
struct Place {
    node: u32,
    first: u32,
    count: u32,
}

impl Place {
    #[inline(always)]
    fn children(self) -> (Place, Place) {
        let half = self.count / 2;
        let left = Place { node: self.node + 1, first: self.first, count: half };
        let right = Place { node: self.node + 2 * half, first: self.first + half, count: self.count - half };
        (left, right)
    }
}

impl KdTree {
    /// A tree over `points`; ids are positions in it.
    pub fn new(points: &[Vec3]) -> Self {
        let mut entries: Vec<(Vec3, u32)> =
            points.iter().zip(0..).filter(|(p, _)| p.is_finite()).map(|(&p, i)| (p, i)).collect();
        let len = entries.len();
        let count = len.div_ceil(LEAF);
        let blank = Leaf { axes: [[f32::INFINITY; LEAF]; 3], ids: [NO_NEIGHBOUR; LEAF] };
        let mut leaves = vec![blank; count];
        let mut nodes = vec![Node::EMPTY; (2 * count).saturating_sub(1)];
        if count > 0 {
            build(&mut entries, &mut leaves, &mut nodes);
        }
        Self { leaves, nodes, len }
    }

    /// Number of points in the tree.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the tree has no points.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Points of a leaf that are points.
    fn filled(&self, leaf: usize) -> usize {
        LEAF.min(self.len - leaf * LEAF)
    }

    /// Calls `visit(leaf, node)` for leaves, near ones first, unless their bound seen from the box `min..=max` has reached the
    /// worst key still wanted: `worst` at first, then what the last visit returned.
    #[inline(always)]
    fn walk(&self, min: Vec3, max: Vec3, mut worst: Key, mut visit: impl FnMut(usize, &Node) -> Key) {
        if self.is_empty() {
            return;
        }
        let center = 0.5 * min + 0.5 * max;
        let mut stack = [(0, Place { node: 0, first: 0, count: 0 }); STACK];
        stack[0].1.count = self.leaves.len() as u32;
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (bound, mut place) = stack[height];
            if bound >= worst {
                continue;
            }
            while place.count > 1 {
                let (left, right) = place.children();
                let (l, r) = (&self.nodes[left.node as usize], &self.nodes[right.node as usize]);
                let (mut a, mut b) = ((l.bound(min, max), left), (r.bound(min, max), right));
                // The left one has the lower ids where points are equal.
                if r.bound(center, center) >> 32 < l.bound(center, center) >> 32 {
                    (a, b) = (b, a);
                }
                if b.0 < worst {
                    stack[height] = b;
                    height += 1;
                }
                place = a.1;
                if a.0 >= worst {
                    place.count = 0;
                }
            }
            if place.count == 1 {
                worst = visit(place.first as usize, &self.nodes[place.node as usize]);
            }
        }
    }

    /// The `k` points nearest to `point`, nearest first, points at one distance by their ids: (id, distance).
    pub fn nearest(&self, point: Vec3, k: usize) -> Vec<(u32, f32)> {
        let k = k.min(self.len);
        let mut best = vec![FARTHEST; k];
        if k > 0 && point.is_finite() {
            self.walk(point, point, FARTHEST, |leaf, _| offer(&mut best, &self.leaves[leaf], point, usize::MAX));
        }
        best.into_iter().filter(|&key| key < FARTHEST).map(split_key).collect()
    }

    /// Ids of all points within `radius` of `point` (the rim included), rising.
    pub fn within(&self, point: Vec3, radius: f32) -> Vec<u32> {
        let mut out = Vec::new();
        if radius >= 0.0 && point.is_finite() {
            let end = key(radius * radius, u32::MAX);
            self.walk(point, point, end, |leaf, _| {
                let leaf = &self.leaves[leaf];
                let near = leaf
                    .distances(point)
                    .into_iter()
                    .zip(leaf.ids)
                    .filter(|&(d, id)| d <= radius * radius && id != NO_NEIGHBOUR);
                out.extend(near.map(|(_, id)| id));
                end
            });
        }
        out.sort_unstable();
        out
    }

    /// Whether any point within `radius` of `point` (the rim included) is `good`; near ones are asked first, none after the first
    /// good one. Ids are positions in the points the tree was made of.
    pub fn any_within(&self, point: Vec3, radius: f32, mut good: impl FnMut(u32) -> bool) -> bool {
        let mut found = false;
        if radius >= 0.0 && point.is_finite() {
            let end = key(radius * radius, u32::MAX);
            self.walk(point, point, end, |leaf, _| {
                let leaf = &self.leaves[leaf];
                let mut near = leaf.distances(point).into_iter().zip(leaf.ids).filter(|near| near.0 <= radius * radius);
                found = near.any(|(_, id)| id != NO_NEIGHBOUR && good(id));
                if found { 0 } else { end }
            });
        }
        found
    }

    /// Writes the nearest others of all points of the leaves `range`, in the tree's order, `k` keys each.
    #[inline(always)]
    fn answer(&self, range: Range<usize>, k: usize, out: &mut [Key]) {
        for (own, out) in range.zip(out.chunks_mut(k * LEAF)) {
            let leaf = &self.leaves[own];
            let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            // The last key of every point; 0 beyond the last point, which then wants nothing.
            let mut last = [0; LEAF];
            out.fill(FARTHEST);
            for (q, best) in out.chunks_exact_mut(k).enumerate() {
                let p = leaf.point(q);
                (min, max) = (min.min(p), max.max(p));
                last[q] = offer(best, leaf, p, q);
            }
            let worst = last.iter().copied().max().unwrap_or(0);
            // All points of a leaf walk the tree together: they need the same leaves, more or less.
            self.walk(min, max, worst, |at, node| {
                if at != own {
                    let other = &self.leaves[at];
                    let mut wanting = wanting(leaf, &last, node);
                    while wanting != 0 {
                        let q = wanting.trailing_zeros() as usize;
                        wanting &= wanting - 1;
                        last[q] = offer(&mut out[q * k..][..k], other, leaf.point(q), usize::MAX);
                    }
                }
                last.iter().copied().max().unwrap_or(0)
            });
        }
    }
}

/// Which points of a leaf may find something nearer than their `last` below `node`: a bit each.
#[inline(always)]
fn wanting(leaf: &Leaf, last: &[Key; LEAF], node: &Node) -> u32 {
    let gap = |axis: usize, k: usize| {
        let p = leaf.axes[axis][k];
        (node.min[axis] - p).max(p - node.max[axis]).max(0.0)
    };
    let gaps: [f32; LEAF] = std::array::from_fn(|k| squared(Vec3::new(gap(0, k), gap(1, k), gap(2, k))));
    let limits: [f32; LEAF] = std::array::from_fn(|k| f32::from_bits((last[k] >> 32) as u32));
    mask(&gaps, &limits)
}

/// A bit for every lane in which `a <= b`.
#[inline(always)]
fn mask(a: &[f32; LEAF], b: &[f32; LEAF]) -> u32 {
    let mut bits = 0;
    for k in 0..LEAF {
        bits |= u32::from(a[k] <= b[k]) << k;
    }
    bits
}

/// Puts those points of a leaf that are nearer to `p` than the last of the `best`, which rise, into their places there; not the
/// point `but` of the leaf. Returns the last of the `best`.
#[inline(always)]
fn offer(best: &mut [Key], leaf: &Leaf, p: Vec3, but: usize) -> Key {
    let distances = leaf.distances(p);
    let mut last = best[best.len() - 1];
    let mut near = mask(&distances, &[f32::from_bits((last >> 32) as u32); LEAF]);
    if but < LEAF {
        near &= !(1 << but);
    }
    while near != 0 {
        let k = near.trailing_zeros() as usize;
        near &= near - 1;
        let new = key(distances[k], leaf.ids[k]);
        if new < last {
            // Shifts without a branch: what is below `new` stays, the rest moves up by one.
            for j in (1..best.len()).rev() {
                best[j] = best[j].min(best[j - 1].max(new));
            }
            best[0] = best[0].min(new);
            last = best[best.len() - 1];
        }
    }
    last
}

/// Sorts points into leaves by halving at the median of the widest axis; fills in what lies below every node.
fn build(entries: &mut [(Vec3, u32)], leaves: &mut [Leaf], nodes: &mut [Node]) {
    let mut node = Node::EMPTY;
    for (p, id) in entries.iter() {
        node.min = node.min.min(*p);
        node.max = node.max.max(*p);
        node.lowest_id = node.lowest_id.min(*id);
    }
    nodes[0] = node;
    if let [leaf] = leaves {
        for (k, (p, id)) in entries.iter().enumerate() {
            for axis in 0..3 {
                leaf.axes[axis][k] = p[axis];
            }
            leaf.ids[k] = *id;
        }
        return;
    }
    let axis = (node.max - node.min).max_position();
    let half = leaves.len() / 2;
    // Ids part equal coordinates: the order is one, whatever the selection algorithm does.
    entries.select_nth_unstable_by(half * LEAF, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let (low, high) = entries.split_at_mut(half * LEAF);
    let parallel = leaves.len() > PARALLEL_LEAVES;
    let (low_leaves, high_leaves) = leaves.split_at_mut(half);
    let (low_nodes, high_nodes) = nodes[1..].split_at_mut(2 * half - 1);
    let mut left = || build(low, low_leaves, low_nodes);
    let mut right = || build(high, high_leaves, high_nodes);
    if parallel {
        rayon::join(left, right);
    } else {
        left();
        right();
    }
}

/// The nearest other Gaussians of every Gaussian, by distance of the means.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbours {
    count: usize,
    k: usize,
    ids: Vec<u32>,
    distances: Vec<f32>,
}

impl Neighbours {
    /// The `k` nearest others of every mean, exact; the same on any number of threads.
    ///
    /// Cost: 0.7 microseconds a Gaussian, shared by the threads, for k = 12 (`cargo bench -p splat_core`). Heaps of equal means
    /// cost no more than others.
    pub fn build(means: &[Vec3], k: usize) -> Self {
        let tree = KdTree::new(means);
        let mut ids = vec![NO_NEIGHBOUR; means.len() * k];
        let mut distances = vec![f32::INFINITY; means.len() * k];
        if k == 0 {
            return Self { count: means.len(), k, ids, distances };
        }
        // In the tree's order neighbouring queries read the same leaves, which stay in the cache.
        let mut keys = vec![FARTHEST; tree.len() * k];
        keys.par_chunks_mut(TASK_LEAVES * LEAF * k).enumerate().for_each(|(task, out)| {
            let first = task * TASK_LEAVES;
            tree.answer(first..(first + TASK_LEAVES).min(tree.leaves.len()), k, out);
        });
        const NOWHERE: u32 = u32::MAX;
        let mut row_of = vec![NOWHERE; means.len()];
        for (at, leaf) in tree.leaves.iter().enumerate() {
            for (q, &id) in leaf.ids[..tree.filled(at)].iter().enumerate() {
                row_of[id as usize] = (at * LEAF + q) as u32;
            }
        }
        const ROWS: usize = 1 << 10;
        let rows_of_ids =
            ids.par_chunks_mut(k * ROWS).zip(distances.par_chunks_mut(k * ROWS)).zip(row_of.par_chunks(ROWS));
        rows_of_ids.for_each(|((ids, distances), rows)| {
            let lists = ids.chunks_exact_mut(k).zip(distances.chunks_exact_mut(k)).zip(rows);
            for ((ids, distances), &row) in lists.filter(|(_, row)| **row != NOWHERE) {
                let keys = &keys[row as usize * k..][..k];
                for ((id, distance), &key) in ids.iter_mut().zip(distances).zip(keys) {
                    (*id, *distance) = split_key(key);
                }
            }
        });
        Self { count: means.len(), k, ids, distances }
    }

    /// Those neighbours j of i, at a distance, for which `stays(i, j, distance)`; lists stay in order and are filled up with
    /// [`NO_NEIGHBOUR`].
    pub fn filtered(&self, stays: impl Fn(usize, usize, f32) -> bool + Sync) -> Self {
        let mut ids = vec![NO_NEIGHBOUR; self.ids.len()];
        let mut distances = vec![f32::INFINITY; self.ids.len()];
        if self.k > 0 {
            let rows = ids.par_chunks_exact_mut(self.k).zip(distances.par_chunks_exact_mut(self.k)).enumerate();
            rows.with_min_len(1 << 10).for_each(|(i, (ids, distances))| {
                let (from, at) = self.of(i);
                let kept = from.iter().zip(at).filter(|&(&j, &d)| j != NO_NEIGHBOUR && stays(i, j as usize, d));
                for ((id, distance), (j, d)) in ids.iter_mut().zip(distances).zip(kept) {
                    (*id, *distance) = (*j, *d);
                }
            });
        }
        Self { count: self.count, k: self.k, ids, distances }
    }

    /// Neighbours asked for per Gaussian.
    pub fn k(&self) -> usize {
        self.k
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// All lists one after the other, `k` ids for each Gaussian; see [`Neighbours::of`].
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Distances to [`Neighbours::ids`].
    pub fn distances(&self) -> &[f32] {
        &self.distances
    }

    /// Neighbours of Gaussian `i`, nearest first, of equally near ones the lower id first, and their distances in scene units.
    /// Where there are fewer than k others, or the mean is not finite, the rest is [`NO_NEIGHBOUR`] at infinite distance; so are
    /// others so far away that the squared distance overflows (1.8e19 units).
    ///
    /// # Panics
    /// If `i` is not below [`Neighbours::len`].
    pub fn of(&self, i: usize) -> (&[u32], &[f32]) {
        let range = i * self.k..(i + 1) * self.k;
        (&self.ids[range.clone()], &self.distances[range])
    }
}

#[cfg(test)]
mod tests;
