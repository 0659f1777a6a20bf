//! Where strain is measured: [`Sample`]s that stand for the volume of a solid.

use glam::{DVec3, UVec3};

use crate::Solid;

/// A point that stands for some volume of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Rest position in the body's frame, in metres.
    pub position: DVec3,
    /// In cubic metres.
    pub volume: f64,
    /// Which of the materials.
    pub region: u8,
}

/// At least this many samples, and as many for each handle: fewer leave motions that cost nothing.
const LEAST: usize = 256;
/// Samples per handle.
const PER_HANDLE: usize = 32;

/// How many samples a body of so many handles needs.
pub(super) fn needed(handles: usize) -> usize {
    (PER_HANDLE * handles).max(LEAST)
}

/// A number that only depends on its arguments, 0..1 (SplitMix64).
fn random(seed: u64, k: u64) -> f64 {
    let mut z = seed.wrapping_add(k.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// About `count` samples, stratified: one for each material in each cell of a coarse grid, moved about by up to
/// half a cell to each side: samples in rows miss what lies between the rows, and parts become too soft.
///
/// Their volumes add up to the solid's.
pub(super) fn samples(solid: &Solid, count: usize, seed: u64) -> Vec<Sample> {
    let (least, most) = solid.bounds();
    let size = (most - least).max(DVec3::splat(solid.grid.voxel));
    let mut side = (solid.volume() / count as f64).cbrt();
    // A cell at the surface is only partly full: smaller cells, until there are enough that hold anything.
    let mut cells = Vec::new();
    for _ in 0..24 {
        cells = occupied_cells(solid, least, size, side);
        if cells.len() >= count || side < solid.grid.voxel {
            break;
        }
        side *= 0.96;
    }
    cells
        .iter()
        .enumerate()
        .map(|(k, cell)| {
            let place = |axis: u64| random(seed, 3 * k as u64 + axis) - 0.5;
            let center = cell.sum / cell.weight;
            let wanted = center + side * DVec3::new(place(0), place(1), place(2));
            let distance = |v: usize| solid.grid.center(v).distance_squared(wanted);
            let nearest = cell.voxels.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            let position = nearest.map_or(center, |v| {
                let half = DVec3::splat(0.5 * solid.grid.voxel);
                wanted.clamp(solid.grid.center(v) - half, solid.grid.center(v) + half)
            });
            Sample { position, volume: cell.weight * solid.grid.voxel.powi(3), region: cell.region }
        })
        .collect()
}

/// What one sample stands for.
struct Cell {
    region: u8,
    weight: f64,
    /// Of voxel centres times weights.
    sum: DVec3,
    voxels: Vec<usize>,
}

/// Cells of about `side` that hold anything, one for each material in them, in rising order.
fn occupied_cells(solid: &Solid, least: DVec3, size: DVec3, side: f64) -> Vec<Cell> {
    let counts = (size / side).round().max(DVec3::ONE).as_uvec3();
    let step = size / counts.as_dvec3();
    let mut order: Vec<(u64, usize)> = solid
        .occupied()
        .map(|v| {
            let at =
                ((solid.grid.center(v) - least) / step).floor().max(DVec3::ZERO).as_uvec3().min(counts - UVec3::ONE);
            let cell =
                u64::from(at.x) + u64::from(counts.x) * (u64::from(at.y) + u64::from(counts.y) * u64::from(at.z));
            (cell * 256 + u64::from(solid.regions[v]), v)
        })
        .collect();
    order.sort_unstable();
    let mut cells: Vec<Cell> = Vec::new();
    let mut last = None;
    for (key, v) in order {
        if last != Some(key) {
            cells.push(Cell { region: (key % 256) as u8, weight: 0.0, sum: DVec3::ZERO, voxels: Vec::new() });
            last = Some(key);
        }
        if let Some(cell) = cells.last_mut() {
            let weight = f64::from(solid.weights[v]);
            cell.weight += weight;
            cell.sum += solid.grid.center(v) * weight;
            cell.voxels.push(v);
        }
    }
    cells.retain(|cell| cell.weight > 0.0);
    cells
}
