//! Minimum cut of a small graph with integer capacities (Boykov and Kolmogorov 2004: two search trees, orphans adopted).

use std::collections::VecDeque;

const NONE: u32 = u32::MAX;
const TERMINAL: u32 = u32::MAX - 1;
const ORPHAN: u32 = u32::MAX - 2;

#[derive(Clone, Copy)]
struct Arc {
    to: u32,
    /// Next arc of the same tail.
    next: u32,
    residual: i64,
}

/// A graph with a source and a sink; arcs `2 k` and `2 k + 1` are each other's reverse.
pub struct CutGraph {
    arcs: Vec<Arc>,
    first: Vec<u32>,
    /// Positive: residual from the source; negative: residual to the sink.
    terminal: Vec<i64>,
    parent: Vec<u32>,
    sink_side: Vec<bool>,
    active: VecDeque<u32>,
    queued: Vec<bool>,
    orphans: VecDeque<u32>,
    stamp: Vec<u32>,
    distance: Vec<u32>,
    time: u32,
    flow: i64,
}

impl CutGraph {
    /// A graph of `nodes` nodes without edges.
    pub fn new(nodes: usize) -> Self {
        Self {
            arcs: Vec::new(),
            first: vec![NONE; nodes],
            terminal: vec![0; nodes],
            parent: vec![NONE; nodes],
            sink_side: vec![false; nodes],
            active: VecDeque::new(),
            queued: vec![false; nodes],
            orphans: VecDeque::new(),
            stamp: vec![0; nodes],
            distance: vec![0; nodes],
            time: 0,
            flow: 0,
        }
    }

    /// Adds what node `i` costs on either side: `source` if it ends on the sink's side, `sink` if on the source's.
    pub fn add_terminal(&mut self, i: usize, source: i64, sink: i64) {
        let (mut s, mut t) = (source, sink);
        let old = self.terminal[i];
        if old > 0 {
            s += old;
        } else {
            t -= old;
        }
        self.flow += s.min(t);
        self.terminal[i] = s - t;
    }

    /// Adds an edge that costs `capacity` if its ends are parted.
    pub fn add_edge(&mut self, a: usize, b: usize, capacity: i64) {
        for (from, to) in [(a, b), (b, a)] {
            self.arcs.push(Arc { to: to as u32, next: self.first[from], residual: capacity });
            self.first[from] = self.arcs.len() as u32 - 1;
        }
    }

    /// Finds the minimum cut: `true` for nodes on the source's side, and the cut's cost.
    pub fn solve(mut self) -> (Vec<bool>, i64) {
        let nodes = self.first.len();
        for i in 0..nodes {
            if self.terminal[i] != 0 {
                self.sink_side[i] = self.terminal[i] < 0;
                self.parent[i] = TERMINAL;
                self.distance[i] = 1;
                self.activate(i as u32);
            }
        }
        while let Some(&i) = self.active.front() {
            let bridge = if self.parent[i as usize] == NONE { None } else { self.grow(i) };
            match bridge {
                None => {
                    self.active.pop_front();
                    self.queued[i as usize] = false;
                }
                Some(arc) => {
                    self.time += 1;
                    self.augment(arc);
                    while let Some(o) = self.orphans.pop_front() {
                        self.adopt(o);
                    }
                }
            }
        }
        let side = (0..nodes).map(|i| self.parent[i] != NONE && !self.sink_side[i]).collect();
        (side, self.flow)
    }

    fn activate(&mut self, i: u32) {
        if !self.queued[i as usize] {
            self.queued[i as usize] = true;
            self.active.push_back(i);
        }
    }

    /// Residual of an arc in the direction in which flow would pass it from the tail's tree outwards.
    fn outward(&self, arc: u32, sink_side: bool) -> i64 {
        self.arcs[(if sink_side { arc ^ 1 } else { arc }) as usize].residual
    }

    /// Grows the tree at `i`; gives an arc from the source's tree to the sink's where they touch.
    fn grow(&mut self, i: u32) -> Option<u32> {
        let side = self.sink_side[i as usize];
        let mut arc = self.first[i as usize];
        while arc != NONE {
            let Arc { to, next, .. } = self.arcs[arc as usize];
            if self.outward(arc, side) > 0 {
                let t = to as usize;
                if self.parent[t] == NONE {
                    self.parent[t] = arc ^ 1;
                    self.sink_side[t] = side;
                    self.stamp[t] = self.stamp[i as usize];
                    self.distance[t] = self.distance[i as usize] + 1;
                    self.activate(to);
                } else if self.sink_side[t] != side {
                    return Some(if side { arc ^ 1 } else { arc });
                } else if self.stamp[t] <= self.stamp[i as usize] && self.distance[t] > self.distance[i as usize] {
                    self.parent[t] = arc ^ 1;
                    self.stamp[t] = self.stamp[i as usize];
                    self.distance[t] = self.distance[i as usize] + 1;
                }
            }
            arc = next;
        }
        None
    }

    /// Pushes as much as the path through `bridge` takes.
    fn augment(&mut self, bridge: u32) {
        let tail = self.arcs[(bridge ^ 1) as usize].to;
        let head = self.arcs[bridge as usize].to;
        let mut limit = self.arcs[bridge as usize].residual;
        for (start, side) in [(tail, false), (head, true)] {
            let mut i = start;
            loop {
                let up = self.parent[i as usize];
                if up == TERMINAL {
                    limit = limit.min(self.terminal[i as usize].abs());
                    break;
                }
                // `up` runs from the child to its parent; flow runs towards the child on the source's side.
                limit = limit.min(self.arcs[(if side { up } else { up ^ 1 }) as usize].residual);
                i = self.arcs[up as usize].to;
            }
        }
        self.flow += limit;
        self.arcs[bridge as usize].residual -= limit;
        self.arcs[(bridge ^ 1) as usize].residual += limit;
        for (start, side) in [(tail, false), (head, true)] {
            let mut i = start;
            loop {
                let up = self.parent[i as usize];
                if up == TERMINAL {
                    self.terminal[i as usize] += if side { limit } else { -limit };
                    if self.terminal[i as usize] == 0 {
                        self.make_orphan(i);
                    }
                    break;
                }
                let forward = if side { up } else { up ^ 1 };
                self.arcs[forward as usize].residual -= limit;
                self.arcs[(forward ^ 1) as usize].residual += limit;
                let parent = self.arcs[up as usize].to;
                if self.arcs[forward as usize].residual == 0 {
                    self.make_orphan(i);
                }
                i = parent;
            }
        }
    }

    fn make_orphan(&mut self, i: u32) {
        self.parent[i as usize] = ORPHAN;
        self.orphans.push_back(i);
    }

    /// Finds a new parent for an orphan whose root is a terminal, or frees it.
    fn adopt(&mut self, i: u32) {
        let side = self.sink_side[i as usize];
        let mut best = NONE;
        let mut best_distance = u32::MAX;
        let mut arc = self.first[i as usize];
        while arc != NONE {
            let Arc { to, next, .. } = self.arcs[arc as usize];
            // Flow must be able to come from `to` (source's side) or to leave towards it (sink's side).
            let inward = self.arcs[(if side { arc } else { arc ^ 1 }) as usize].residual;
            if inward > 0
                && self.parent[to as usize] != NONE
                && self.sink_side[to as usize] == side
                && let Some(d) = self.root_distance(to)
                && d < best_distance
            {
                best = arc;
                best_distance = d;
            }
            arc = next;
        }
        if best != NONE {
            self.parent[i as usize] = best;
            self.stamp[i as usize] = self.time;
            self.distance[i as usize] = best_distance + 1;
            return;
        }
        self.parent[i as usize] = NONE;
        let mut arc = self.first[i as usize];
        while arc != NONE {
            let Arc { to, next, .. } = self.arcs[arc as usize];
            let t = to as usize;
            if self.parent[t] != NONE && self.sink_side[t] == side {
                let inward = self.arcs[(if side { arc } else { arc ^ 1 }) as usize].residual;
                if inward > 0 {
                    self.activate(to);
                }
                if self.parent[t] == arc ^ 1 {
                    self.make_orphan(to);
                }
            }
            arc = next;
        }
    }

    /// Steps from a node to its terminal, `None` where the chain ends at an orphan; marks the chain as known.
    fn root_distance(&mut self, start: u32) -> Option<u32> {
        let mut steps = 0;
        let mut i = start;
        let total = loop {
            let n = i as usize;
            if self.stamp[n] == self.time && self.parent[n] != ORPHAN {
                break self.distance[n] + steps;
            }
            match self.parent[n] {
                TERMINAL => {
                    self.stamp[n] = self.time;
                    self.distance[n] = 1;
                    break steps + 1;
                }
                ORPHAN | NONE => return None,
                up => i = self.arcs[up as usize].to,
            }
            steps += 1;
        };
        let mut d = total;
        let mut i = start;
        while self.stamp[i as usize] != self.time {
            self.stamp[i as usize] = self.time;
            self.distance[i as usize] = d;
            d -= 1;
            i = self.arcs[self.parent[i as usize] as usize].to;
        }
        Some(total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Lcg(u64);
    impl Lcg {
        fn next(&mut self, below: u64) -> u64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) % below
        }
    }

    #[test]
    fn the_cut_is_the_cheapest_of_all() {
        for seed in 0..400 {
            let mut r = Lcg(seed);
            let n = 2 + r.next(9) as usize;
            let terminals: Vec<(i64, i64)> = (0..n).map(|_| (r.next(20) as i64, r.next(20) as i64)).collect();
            let edges: Vec<(usize, usize, i64)> = (0..r.next(25))
                .map(|_| (r.next(n as u64) as usize, r.next(n as u64) as usize, r.next(12) as i64))
                .filter(|e| e.0 != e.1)
                .collect();
            let mut graph = CutGraph::new(n);
            for (i, t) in terminals.iter().enumerate() {
                graph.add_terminal(i, t.0, t.1);
            }
            for e in &edges {
                graph.add_edge(e.0, e.1, e.2);
            }
            let cost = |side: &dyn Fn(usize) -> bool| {
                let t: i64 = (0..n).map(|i| if side(i) { terminals[i].1 } else { terminals[i].0 }).sum();
                t + edges.iter().filter(|e| side(e.0) != side(e.1)).map(|e| e.2).sum::<i64>()
            };
            let (side, flow) = graph.solve();
            let best = (0..1u32 << n).map(|bits| cost(&|i| bits >> i & 1 == 1)).min().unwrap();
            assert_eq!(flow, best, "seed {seed}");
            assert_eq!(cost(&|i| side[i]), best, "seed {seed}");
        }
    }
}
