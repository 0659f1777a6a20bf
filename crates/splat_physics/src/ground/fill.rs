//! Columns, and what is filled.

use std::collections::{BTreeMap, VecDeque};

use glam::{IVec3, UVec3};

use super::Fill;
use super::lattice::{Lattice, PlaceMap, Seen};
use crate::VoxelGrid;

/// Voxels below the lowest surface of each column that are filled in any case.
const SKIRT: i32 = 4;
/// Metres that [`Fill::Floor`] fills.
const FLOOR: f64 = 1.0;
/// Columns that [`Fill::Floor`] closes lie between others that are at most so many voxels apart.
const GAP: i32 = 40;
/// Metres that [`Fill::Exterior`] fills.
const EXTERIOR: f64 = 0.5;
/// Holes of up to twice as many voxels do not let the outside in.
const LEAK: i32 = 2;
/// Voxels that are flooded at most.
const MOST_FLOODED: usize = 400_000_000;
/// Neighbours through faces.
const FACES: [IVec3; 6] = [IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z];

/// Leaves out connected pieces (through faces, edges and corners) of fewer than `least` voxels: floaters.
pub(super) fn without_specks(seen: &mut PlaceMap<Seen>, least: usize) {
    let mut starts: Vec<IVec3> = seen.keys().copied().collect();
    starts.sort_unstable_by_key(|at| (at.z, at.y, at.x));
    let mut visited = PlaceMap::<()>::default();
    for start in starts {
        if visited.insert(start, ()).is_some() {
            continue;
        }
        let mut piece = vec![start];
        let mut next = 0;
        while next < piece.len() {
            let at = piece[next];
            next += 1;
            for k in 0..27 {
                let to = at + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
                if seen.contains_key(&to) && visited.insert(to, ()).is_none() {
                    piece.push(to);
                }
            }
        }
        if piece.len() < least {
            piece.iter().for_each(|at| {
                seen.remove(at);
            });
        }
    }
}

/// The lowest connected run of a column: its lowest voxel, and the height of its highest one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) low: i32,
    /// In voxels; the middle of voxel 0 is 0.
    pub(super) top: f64,
}

/// By (z, x), the lowest run of each column.
pub(super) fn columns(seen: &PlaceMap<Seen>) -> BTreeMap<(i32, i32), Run> {
    let mut all: Vec<IVec3> = seen.keys().copied().collect();
    all.sort_unstable_by_key(|at| (at.z, at.x, at.y));
    let mut out = BTreeMap::new();
    for column in all.chunk_by(|a, b| (a.x, a.z) == (b.x, b.z)) {
        let end = column.windows(2).position(|pair| pair[1].y > pair[0].y + 2).map_or(column.len(), |k| k + 1);
        // A thin sheet spreads over some voxels and is in their middle; a wall ends with its highest.
        let last = &column[end.saturating_sub(3)..end];
        let (mut sum, mut weight) = (0.0, 0.0);
        for at in last {
            let s = &seen[at];
            sum += f64::from(s.weight) * (f64::from(at.y) + f64::from(s.offset.y));
            weight += f64::from(s.weight);
        }
        out.insert((column[0].z, column[0].x), Run { low: column[0].y, top: sum / weight });
    }
    out
}

/// What is solid: all that was seen, what is below the lowest surface of each column, and what is asked for. Whether the
/// exterior could be told, if it was asked for.
pub(super) fn solid(seen: &PlaceMap<Seen>, fill: Fill, voxel: f64) -> (Lattice, bool) {
    let mut solid = Lattice::default();
    seen.keys().for_each(|&at| solid.insert(at));
    let mut columns: BTreeMap<(i32, i32), (i32, i32)> =
        columns(seen).into_iter().map(|(at, run)| (at, (run.low, run.low))).collect();
    if fill == Fill::Floor {
        bridge(&mut columns, |&(z, x)| (x, z));
        bridge(&mut columns, |&at| at);
    }
    let deep = if fill == Fill::Floor { (FLOOR / voxel).ceil() as i32 } else { SKIRT };
    for (&(z, x), &(from, low)) in &columns {
        (low - deep.max(SKIRT)..from.max(low)).for_each(|y| solid.insert(IVec3::new(x, y, z)));
    }
    let told = fill != Fill::Exterior || exterior(seen, voxel, &mut solid);
    (solid, told)
}

/// Puts columns where there are none between two of a row, at heights between theirs. A column is (end, low): filled from below
/// `low` up to `end`.
fn bridge(columns: &mut BTreeMap<(i32, i32), (i32, i32)>, along: impl Fn(&(i32, i32)) -> (i32, i32)) {
    // The key is its own inverse: it swaps, or does not.
    let mut order: Vec<((i32, i32), i32)> = columns.iter().map(|(at, column)| (along(at), column.1)).collect();
    order.sort_unstable();
    for pair in order.windows(2) {
        let [((row, from), low), ((other, to), high)] = [pair[0], pair[1]];
        if row != other || to - from < 2 || to - from > GAP {
            continue;
        }
        for k in from + 1..to {
            let height = low + (high - low) * (k - from) / (to - from);
            columns.entry(along(&(row, k))).or_insert((height + 1, height));
        }
    }
}

/// Fills what the middle of a room does not reach; `false` if it reaches everything.
fn exterior(seen: &PlaceMap<Seen>, voxel: f64, solid: &mut Lattice) -> bool {
    let margin = LEAK + 2;
    let (low, high) = seen.keys().fold((IVec3::MAX, IVec3::MIN), |(l, h), at| (l.min(*at), h.max(*at)));
    let (low, high) = (low - margin, high + margin);
    let size = high - low + 1;
    let grid =
        VoxelGrid { origin: low.as_dvec3(), voxel: 1.0, dims: UVec3::new(size.x as u32, size.y as u32, size.z as u32) };
    if grid.len() > MOST_FLOODED {
        return false;
    }
    let inside_grid = |at: IVec3| at.cmpge(low).all() && at.cmple(high).all();
    let index = |at: IVec3| grid.index((at - low).as_uvec3());
    // Walls, grown by so much that they do not leak.
    let mut wall = vec![false; grid.len()];
    let mut front: VecDeque<(IVec3, i32)> = seen.keys().map(|&at| (at, 0)).collect();
    front.iter().for_each(|(at, _)| wall[index(*at)] = true);
    while let Some((at, steps)) = front.pop_front() {
        for to in FACES.map(|face| at + face) {
            if steps < LEAK && inside_grid(to) && !wall[index(to)] {
                wall[index(to)] = true;
                front.push_back((to, steps + 1));
            }
        }
    }
    // From the free place nearest to the middle: up and down first, as rooms are empty above their furniture.
    let middle = (low + high) / 2;
    let reach = size.max_element();
    let start =
        (0..reach).flat_map(|d| [IVec3::Y * d, IVec3::NEG_Y * d, IVec3::X * d, IVec3::NEG_X * d]).map(|d| middle + d);
    let Some(start) = start.into_iter().find(|&at| inside_grid(at) && !wall[index(at)]) else { return false };
    let mut reached = vec![false; grid.len()];
    reached[index(start)] = true;
    let mut front = VecDeque::from([(start, 0)]);
    while let Some((at, _)) = front.pop_front() {
        if at.cmpeq(low).any() || at.cmpeq(high).any() {
            return false;
        }
        for to in FACES.map(|face| at + face) {
            if !wall[index(to)] && !reached[index(to)] {
                reached[index(to)] = true;
                front.push_back((to, 0));
            }
        }
    }
    // Give back what the walls took from the inside.
    let mut front: VecDeque<(IVec3, i32)> =
        (0..reached.len()).filter(|&v| reached[v]).map(|v| (grid.at(v).as_ivec3() + low, 0)).collect();
    while let Some((at, steps)) = front.pop_front() {
        for to in FACES.map(|face| at + face) {
            if steps < LEAK && inside_grid(to) && !reached[index(to)] && !seen.contains_key(&to) {
                reached[index(to)] = true;
                front.push_back((to, steps + 1));
            }
        }
    }
    let thick = (EXTERIOR / voxel).ceil() as i32;
    let mut starts: Vec<IVec3> = seen.keys().copied().collect();
    starts.sort_unstable_by_key(|at| (at.z, at.y, at.x));
    let mut done = vec![false; grid.len()];
    let mut front: VecDeque<(IVec3, i32)> = starts.into_iter().map(|at| (at, 0)).collect();
    while let Some((at, steps)) = front.pop_front() {
        for to in FACES.map(|face| at + face) {
            if steps < thick && inside_grid(to) && !reached[index(to)] && !done[index(to)] {
                done[index(to)] = true;
                solid.insert(to);
                front.push_back((to, steps + 1));
            }
        }
    }
    true
}
