//! [`PartCage`]: the cells around a solid that its weights live on.

use glam::{DVec3, UVec3};
use splat_core::deform::Cage;

use super::BasisError;
use crate::Solid;

/// Cells along the longest side, at most: more than any cage of an allowed size has.
const MOST_CELLS: u32 = 4096;
/// A cell counts as touched from this part of its volume on; less is rounding.
const TOUCHED: f64 = 1e-6;
/// A side counts as a whole number of cells up to this part of a cell.
const WHOLE: f64 = 1e-5;

/// How much of what is in a cell belongs to one region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionShare {
    /// Number of the region, which is the number of its material.
    pub region: u8,
    /// Part of the occupied volume, 0..=1; the shares of a cell add up to 1.
    pub share: f32,
}

/// A cage around a solid: which cells are near it, how full they are and of what.
///
/// Lengths in metres in the body's frame. Cells are numbered with x fastest: `x + nx * (y + ny * z)` for `cage.cells`.
#[derive(Clone, Debug, PartialEq)]
pub struct PartCage {
    /// The grid.
    pub cage: Cage,
    /// By cell: whether the solid touches the cell or one of the 26 around it.
    pub active: Vec<bool>,
    /// By cell: occupied part of its volume, 0..=1; 0 in the ring of active cells that only surrounds the solid.
    pub fill: Vec<f32>,
    /// Shares of all active cells, one cell after the other.
    pub(crate) shares: Vec<RegionShare>,
    /// By cell and one more: where its shares begin.
    pub(crate) shares_start: Vec<u32>,
    /// Pieces of active cells that share no node.
    pub(crate) pieces: u32,
}

impl PartCage {
    /// Nodes of a cage, unless told otherwise.
    pub const MOST_NODES: usize = 8000;

    /// Puts a cage around a solid, with cells of its longest side divided by `cells_along`, or by the largest smaller number that
    /// keeps the cage within `max_nodes` nodes.
    ///
    /// A box whose sides are whole numbers of cells is fitted exactly; anything else gets a ring of cells around all that it
    /// touches, so that what sticks out of the solid a little still lies in the cage.
    ///
    /// # Errors
    /// [`BasisError::EmptySolid`], [`BasisError::CellsOutOfRange`], or [`BasisError::TooFewNodes`] if no cage is so small.
    pub fn build(solid: &Solid, cells_along: u32, max_nodes: usize) -> Result<Self, BasisError> {
        if !(1..=MOST_CELLS).contains(&cells_along) {
            return Err(BasisError::CellsOutOfRange { have: cells_along, most: MOST_CELLS });
        }
        let (least, most) = occupied_bounds(solid).ok_or(BasisError::EmptySolid)?;
        let (least, most) = (least.as_dvec3(), most.as_dvec3());
        let size = (most - least) * solid.grid.voxel;
        let full = is_full_box(solid, (most - least).as_uvec3());
        let mut smallest = usize::MAX;
        for along in (1..=cells_along).rev() {
            let cell = size.max_element() / f64::from(along);
            let fit = Fit::new(size, cell, full);
            let nodes = (fit.cells + UVec3::ONE).as_u64vec3().element_product();
            let nodes = usize::try_from(nodes).unwrap_or(usize::MAX);
            smallest = smallest.min(nodes);
            if nodes <= max_nodes {
                let least = solid.grid.origin + least * solid.grid.voxel;
                let origin = least + 0.5 * (size - fit.cells.as_dvec3() * cell);
                let cage = Cage { origin: origin.as_vec3(), cell: cell as f32, cells: fit.cells };
                return Ok(Self::fill(solid, cage, origin, cell));
            }
        }
        Err(BasisError::TooFewNodes { have: max_nodes, least: smallest })
    }

    /// A cage from its fields, or `None` if they do not fit each other. `cage` has a place and cells, and not too many.
    pub(crate) fn from_parts(
        cage: Cage,
        active: Vec<bool>,
        fill: Vec<f32>,
        shares_start: Vec<u32>,
        shares: Vec<RegionShare>,
    ) -> Option<Self> {
        let count = cage.cells.as_u64vec3().element_product();
        let as_many =
            active.len() as u64 == count && fill.len() as u64 == count && shares_start.len() as u64 == count + 1;
        if !as_many || shares_start[0] != 0 || shares_start.last() != Some(&u32::try_from(shares.len()).ok()?) {
            return None;
        }
        let rising = shares_start.windows(2).all(|pair| pair[0] <= pair[1]);
        let filled =
            active.iter().zip(&fill).all(|(&active, part)| (0.0..=1.0).contains(part) && (active || *part == 0.0));
        // Only active cells are made of something.
        let shared = active.iter().zip(shares_start.windows(2)).all(|(&active, pair)| active == (pair[0] < pair[1]));
        if !(rising && filled && shared && active.contains(&true)) {
            return None;
        }
        let mut this = Self { cage, active, fill, shares, shares_start, pieces: 0 };
        this.pieces = super::pieces::pieces(&this).count as u32;
        Some(this)
    }

    /// Number of a cell.
    pub fn cell_index(&self, cell: UVec3) -> usize {
        let n = self.cage.cells;
        cell.x as usize + n.x as usize * (cell.y as usize + n.y as usize * cell.z as usize)
    }

    /// The cell of a number.
    pub fn cell_at(&self, index: usize) -> UVec3 {
        let (nx, ny) = (self.cage.cells.x as usize, self.cage.cells.y as usize);
        UVec3::new((index % nx) as u32, (index / nx % ny) as u32, (index / (nx * ny)) as u32)
    }

    /// What an active cell is made of, by rising region; a ring cell is made of what its neighbours are. Empty for other cells.
    pub fn regions(&self, cell: usize) -> &[RegionShare] {
        &self.shares[self.shares_start[cell] as usize..self.shares_start[cell + 1] as usize]
    }

    /// Pieces of the cage that share no node.
    pub fn pieces(&self) -> usize {
        self.pieces as usize
    }

    /// Side of a cell, in metres.
    pub fn cell(&self) -> f64 {
        f64::from(self.cage.cell)
    }

    /// Place of a node at rest, in metres in the body's frame.
    pub fn node_position(&self, node: usize) -> DVec3 {
        self.cage.origin.as_dvec3() + self.cage.node_at(node).as_dvec3() * self.cell()
    }

    /// By node: whether an active cell has it as a corner.
    pub fn active_nodes(&self) -> Vec<bool> {
        let mut nodes = vec![false; self.cage.node_count()];
        for cell in (0..self.active.len()).filter(|&cell| self.active[cell]) {
            for corner in self.cage.corners(self.cell_at(cell)) {
                nodes[corner] = true;
            }
        }
        nodes
    }

    fn fill(solid: &Solid, cage: Cage, origin: DVec3, cell: f64) -> Self {
        let parts = region_parts(solid, &cage, origin, cell);
        let count = cage.cell_count();
        let mut occupied = vec![0.0; count];
        for &(cell, _, part) in &parts {
            occupied[cell] += part;
        }
        let touched: Vec<bool> = occupied.iter().map(|&part| part > TOUCHED).collect();
        let exact = occupied.iter().all(|&part| part > 1.0 - WHOLE);
        let mut this = Self {
            cage,
            active: touched.clone(),
            fill: occupied.iter().map(|&part| if part > TOUCHED { part.min(1.0) as f32 } else { 0.0 }).collect(),
            shares: Vec::new(),
            shares_start: Vec::new(),
            pieces: 0,
        };
        if !exact {
            for cell in (0..count).filter(|&cell| touched[cell]) {
                this.around(cell).for_each(|k| this.active[k] = true);
            }
        }
        this.share(&parts, &touched);
        this.pieces = super::pieces::pieces(&this).count as u32;
        this
    }

    /// The cells around one, itself among them, in rising order.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let (n, at) = (self.cage.cells, self.cell_at(cell));
        let (low, high) = (at.saturating_sub(UVec3::ONE), (at + 1).min(n - 1));
        (low.z..=high.z).flat_map(move |z| {
            (low.y..=high.y).flat_map(move |y| {
                (low.x..=high.x).map(move |x| x as usize + n.x as usize * (y as usize + n.y as usize * z as usize))
            })
        })
    }

    /// Fills in the shares from the regions' parts of the touched cells.
    fn share(&mut self, parts: &[(usize, u8, f64)], touched: &[bool]) {
        let mut first = vec![0_usize; touched.len() + 1];
        for &(cell, _, _) in parts {
            first[cell + 1] += 1;
        }
        for cell in 0..touched.len() {
            first[cell + 1] += first[cell];
        }
        self.shares_start.push(0);
        for cell in 0..touched.len() {
            if self.active[cell] {
                let mut sums = [0.0; 256];
                let mut add = |cell: usize| {
                    parts[first[cell]..first[cell + 1]]
                        .iter()
                        .for_each(|&(_, region, part)| sums[usize::from(region)] += part);
                };
                if touched[cell] {
                    add(cell);
                } else {
                    self.around(cell).filter(|&k| touched[k]).for_each(add);
                }
                let total: f64 = sums.iter().sum();
                let some = sums.iter().enumerate().filter(|&(_, &part)| part > 0.0);
                self.shares.extend(some.map(|(k, part)| RegionShare { region: k as u8, share: (part / total) as f32 }));
            }
            self.shares_start.push(self.shares.len() as u32);
        }
    }
}

/// A grid of cells for a box of some size.
struct Fit {
    cells: UVec3,
}

impl Fit {
    /// `full`: the solid fills its bounds.
    fn new(size: DVec3, cell: f64, full: bool) -> Self {
        let along = size / cell;
        let whole = (along - along.round()).abs().max_element() < WHOLE && along.round().min_element() >= 1.0;
        let cells = if full && whole { along.round() } else { (along - WHOLE).ceil().max(DVec3::ONE) + 2.0 };
        Self { cells: cells.as_uvec3() }
    }
}

/// Least voxel and the one after the last, of those with any weight.
fn occupied_bounds(solid: &Solid) -> Option<(UVec3, UVec3)> {
    solid.occupied().map(|voxel| solid.grid.at(voxel)).fold(None, |bounds, at| {
        let (low, high) = bounds.unwrap_or((at, at + 1));
        Some((at.min(low), high.max(at + 1)))
    })
}

fn is_full_box(solid: &Solid, dims: UVec3) -> bool {
    let full = solid.occupied().filter(|&voxel| solid.weights[voxel] == 1.0).count();
    full as u64 == dims.as_u64vec3().element_product()
}

/// The part of a cell's volume that each region occupies, as (cell, region, part) by rising cell and region.
fn region_parts(solid: &Solid, cage: &Cage, origin: DVec3, cell: f64) -> Vec<(usize, u8, f64)> {
    let overlaps: [Vec<Vec<(usize, f64)>>; 3] = std::array::from_fn(|axis| {
        let low = |k: u32| (solid.grid.origin[axis] - origin[axis] + f64::from(k) * solid.grid.voxel) / cell;
        (0..solid.grid.dims[axis]).map(|k| overlaps(low(k), low(k + 1), cage.cells[axis])).collect()
    });
    let (nx, ny) = (cage.cells.x as usize, cage.cells.y as usize);
    let mut parts = Vec::new();
    for voxel in solid.occupied() {
        let (at, weight) = (solid.grid.at(voxel), f64::from(solid.weights[voxel]));
        for &(z, dz) in &overlaps[2][at.z as usize] {
            for &(y, dy) in &overlaps[1][at.y as usize] {
                for &(x, dx) in &overlaps[0][at.x as usize] {
                    parts.push((x + nx * (y + ny * z), solid.regions[voxel], weight * dx * dy * dz));
                }
            }
        }
    }
    // Stable, so that sums are made in the order of the voxels.
    parts.sort_by_key(|&(cell, region, _)| (cell, region));
    parts.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        if same {
            kept.2 += next.2;
        }
        same
    });
    parts
}

/// Cells that the interval `low..high`, in cells, lies in, and how much of it.
fn overlaps(low: f64, high: f64, cells: u32) -> Vec<(usize, f64)> {
    let first = low.floor().max(0.0) as u32;
    let last = (high.ceil().max(0.0) as u32).min(cells);
    (first..last)
        .map(|k| (k as usize, (high.min(f64::from(k + 1)) - low.max(f64::from(k))).max(0.0)))
        .filter(|&(_, length)| length > 0.0)
        .collect()
}
