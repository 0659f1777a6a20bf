//! The merge tree: every node is a thing that somebody could mean by a click.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use glam::Vec3;

use super::patches::{Border, PatchGraph};

/// One node: a patch (a leaf) or the union of two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// The node this one became part of; itself at a root.
    pub parent: u32,
    /// The two nodes it is made of; `u32::MAX` twice at a leaf.
    pub children: [u32; 2],
    /// Cost at which its children were joined, never below theirs; 0 at a leaf.
    pub height: f32,
    /// Gaussians in it.
    pub count: u32,
    /// Sum of the patches' masses, in pixels.
    pub mass: f32,
    /// Edges of the neighbour graph that leave it.
    pub border: u32,
    /// Sum of their strengths.
    pub border_sum: f32,
    /// Lower corner of the patch centres in it.
    pub min: Vec3,
    /// Upper corner of the patch centres in it.
    pub max: Vec3,
}

/// Binary merge tree over patches: nodes `0..patches` are the leaves, parents come after their children.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MergeTree {
    /// All nodes.
    pub nodes: Vec<Node>,
    /// Number of leaves.
    pub leaves: usize,
    /// Leaves in an order in which every node is a contiguous run.
    pub order: Vec<u32>,
    /// Per node, where its run begins in [`MergeTree::order`] and how long it is.
    pub run: Vec<(u32, u32)>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Shared {
    count: u32,
    sum: f32,
}

/// What a tree takes for a strong border, and what it joins first. Different captures, and different things in one, are
/// told apart by different signs: so several trees are grown over the same patches ([`TREES`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeSettings {
    /// Weight of the colour difference.
    pub color: f32,
    /// Share of the colour term left where the surface runs on smoothly.
    pub color_on_smooth: f32,
    /// The pattern's difference bounds the colour difference, times this: a pattern of dots is one thing.
    pub pattern: f32,
    /// Weight of the bend of a concave border.
    pub concave: f32,
    /// Weight of the bend of a convex border.
    pub convex: f32,
    /// Weight of the mean dissimilarity of the edges across.
    pub edge: f32,
    /// Exponent of the smaller mass's share of everything: small things join first.
    pub mass_power: f32,
    /// Exponent of the smaller border over the shared one: what is enclosed joins first.
    pub enclosure_power: f32,
}

/// The trees grown over every capture.
pub const TREES: [TreeSettings; 6] = [
    TreeSettings {
        color: 0.5,
        color_on_smooth: 0.2,
        pattern: 1.0,
        concave: 2.0,
        convex: 0.1,
        edge: 0.3,
        mass_power: 0.25,
        enclosure_power: 0.3,
    },
    TreeSettings {
        color: 0.5,
        color_on_smooth: 0.2,
        pattern: 1.0,
        concave: 2.0,
        convex: 0.1,
        edge: 1.0,
        mass_power: 0.25,
        enclosure_power: 0.3,
    },
    TreeSettings {
        color: 0.1,
        color_on_smooth: 0.2,
        pattern: 1.0,
        concave: 3.0,
        convex: 0.1,
        edge: 0.1,
        mass_power: 0.25,
        enclosure_power: 0.3,
    },
    TreeSettings {
        color: 0.5,
        color_on_smooth: 0.2,
        pattern: 1.5,
        concave: 2.0,
        convex: 0.1,
        edge: 0.3,
        mass_power: 0.4,
        enclosure_power: 1.0,
    },
    TreeSettings {
        color: 0.0,
        color_on_smooth: 0.2,
        pattern: 1.0,
        concave: 0.0,
        convex: 0.1,
        edge: 1.0,
        mass_power: 0.25,
        enclosure_power: 0.3,
    },
    TreeSettings {
        color: 1.0,
        color_on_smooth: 0.6,
        pattern: 2.0,
        concave: 1.0,
        convex: 0.05,
        edge: 1.0,
        mass_power: 0.25,
        enclosure_power: 0.3,
    },
];

impl TreeSettings {
    /// How strong a border is, 0 (none) to about 8.
    pub fn strength(&self, b: &Border) -> f32 {
        let color = b.color.min(b.pattern * self.pattern) * (1.0 - (1.0 - self.color_on_smooth) * b.smooth);
        let bend = if b.bend > 0.0 { b.bend * self.concave } else { -b.bend * self.convex };
        self.color * color + bend + self.edge * b.edge
    }
}

impl MergeTree {
    /// Agglomerates the patches by the cheapest border first.
    pub fn new(graph: &PatchGraph, settings: &TreeSettings) -> Self {
        let leaves = graph.patches.len();
        let total: f32 = graph.patches.iter().map(|p| p.mass).sum::<f32>().max(1e-20);
        let mut nodes: Vec<Node> = graph
            .patches
            .iter()
            .enumerate()
            .map(|(i, p)| Node {
                parent: i as u32,
                children: [u32::MAX; 2],
                height: 0.0,
                count: p.count,
                mass: p.mass,
                border: 0,
                border_sum: 0.0,
                min: p.center,
                max: p.center,
            })
            .collect();
        let mut around: Vec<BTreeMap<u32, Shared>> = vec![BTreeMap::new(); leaves];
        for b in &graph.borders {
            let shared = Shared { count: b.count, sum: settings.strength(b) * b.count as f32 };
            around[b.a as usize].insert(b.b, shared);
            around[b.b as usize].insert(b.a, shared);
            for p in [b.a, b.b] {
                nodes[p as usize].border += b.count;
                nodes[p as usize].border_sum += shared.sum;
            }
        }
        let cost = |nodes: &[Node], a: u32, b: u32, shared: Shared| {
            let (x, y) = (&nodes[a as usize], &nodes[b as usize]);
            let small = if x.mass <= y.mass { x } else { y };
            let enclosure = (small.border as f32 / shared.count as f32).max(0.2);
            shared.sum / shared.count as f32
                * (small.mass / total).max(1e-12).powf(settings.mass_power)
                * enclosure.powf(settings.enclosure_power)
        };
        let key = |c: f32, a: u32, b: u32| Reverse((c.to_bits(), a.min(b), a.max(b)));
        let mut heap = BinaryHeap::new();
        for b in &graph.borders {
            heap.push(key(cost(&nodes, b.a, b.b, around[b.a as usize][&b.b]), b.a, b.b));
        }
        // A node that became part of another is out: entries that name it are stale.
        let mut open = vec![true; leaves];
        while let Some(Reverse((bits, a, b))) = heap.pop() {
            if !(open[a as usize] && open[b as usize]) {
                continue;
            }
            let new = nodes.len() as u32;
            let (mut near, mut far) =
                (std::mem::take(&mut around[a as usize]), std::mem::take(&mut around[b as usize]));
            let shared = near.remove(&b).unwrap_or_default();
            far.remove(&a);
            if near.len() < far.len() {
                std::mem::swap(&mut near, &mut far);
            }
            for (other, s) in far {
                let entry = near.entry(other).or_default();
                entry.count += s.count;
                entry.sum += s.sum;
            }
            let (x, y) = (nodes[a as usize], nodes[b as usize]);
            nodes.push(Node {
                parent: new,
                children: [a, b],
                height: f32::from_bits(bits).max(x.height).max(y.height),
                count: x.count + y.count,
                mass: x.mass + y.mass,
                border: x.border + y.border - 2 * shared.count,
                border_sum: (x.border_sum + y.border_sum - 2.0 * shared.sum).max(0.0),
                min: x.min.min(y.min),
                max: x.max.max(y.max),
            });
            for child in [a, b] {
                nodes[child as usize].parent = new;
                open[child as usize] = false;
            }
            open.push(true);
            for (&other, &s) in &near {
                let map = &mut around[other as usize];
                map.remove(&a);
                map.remove(&b);
                map.insert(new, s);
                heap.push(key(cost(&nodes, new, other, s), new, other));
            }
            around.push(near);
        }
        let mut tree = Self { nodes, leaves, order: Vec::with_capacity(leaves), run: Vec::new() };
        tree.lay_out();
        tree
    }

    pub(super) fn lay_out(&mut self) {
        self.run = vec![(0, 0); self.nodes.len()];
        let roots: Vec<u32> = (0..self.nodes.len() as u32).filter(|&i| self.nodes[i as usize].parent == i).collect();
        let mut stack: Vec<(u32, bool)> = roots.iter().rev().map(|&r| (r, false)).collect();
        while let Some((i, done)) = stack.pop() {
            let node = self.nodes[i as usize];
            if done {
                self.run[i as usize].1 = self.order.len() as u32 - self.run[i as usize].0;
                continue;
            }
            self.run[i as usize].0 = self.order.len() as u32;
            if node.children[0] == u32::MAX {
                self.order.push(i);
                self.run[i as usize].1 = 1;
            } else {
                stack.push((i, true));
                stack.push((node.children[1], false));
                stack.push((node.children[0], false));
            }
        }
    }

    /// Patches below a node.
    pub fn patches(&self, node: u32) -> &[u32] {
        let (start, len) = self.run[node as usize];
        &self.order[start as usize..(start + len) as usize]
    }

    /// The leaf and everything above it, up to its root.
    pub fn ancestors(&self, leaf: u32) -> Vec<u32> {
        let mut chain = vec![leaf];
        let mut i = leaf;
        while self.nodes[i as usize].parent != i {
            i = self.nodes[i as usize].parent;
            chain.push(i);
        }
        chain
    }
}
