//! [`Points`]: where in a part the energy is measured.

use super::super::{BasisError, PartCage, cell_means, random};
use super::energy::Point;
use crate::Material;

/// Young's modulus that the mean of the part's is brought to, so that the two losses keep their balance for any material.
const MEAN_MODULUS: f64 = 1e5;

/// The occupied volume of a part, to draw from. Lengths are divided by the longest side of what is occupied, the same one along each
/// axis: a scale for each axis would make the energy of long parts another.
pub(super) struct Points {
    /// Of the normalised box, in metres.
    scale: f64,
    /// Least corner of the normalised box, in metres in the body's frame.
    least: glam::DVec3,
    cells: Vec<Cell>,
    /// Side of a cell, in the normalised box.
    side: f64,
    /// In the normalised box.
    pub(super) volume: f64,
}

struct Cell {
    /// Least corner, in the normalised box.
    at: [f64; 3],
    /// Share of the volume up to and with this cell.
    until: f64,
    lambda: f32,
    mu: f32,
}

impl Points {
    pub(super) fn new(cage: &PartCage, materials: &[Material]) -> Result<Self, BasisError> {
        let some = |&cell: &usize| cage.fill[cell] > 0.0;
        let cells: Vec<usize> = (0..cage.fill.len()).filter(some).collect();
        let corner = |cell: usize| cage.cage.origin.as_dvec3() + cage.cell_at(cell).as_dvec3() * cage.cell();
        let least = cells.iter().map(|&cell| corner(cell)).reduce(glam::DVec3::min).ok_or(BasisError::EmptySolid)?;
        let most = cells.iter().map(|&cell| corner(cell)).reduce(glam::DVec3::max).ok_or(BasisError::EmptySolid)?;
        let scale = (most - least).max_element() + cage.cell();
        let modulus = cell_means(cage, materials, |material| f64::from(material.youngs_modulus))?;
        let lambda = cell_means(cage, materials, |material| material.lame().0)?;
        let mu = cell_means(cage, materials, |material| material.lame().1)?;
        let total: f64 = cells.iter().map(|&cell| f64::from(cage.fill[cell])).sum();
        let mean = cells.iter().map(|&cell| f64::from(cage.fill[cell]) * modulus[cell]).sum::<f64>() / total;
        let stiffness = MEAN_MODULUS / mean;
        let mut sum = 0.0;
        let place = |&cell: &usize| {
            sum += f64::from(cage.fill[cell]) / total;
            let at = ((corner(cell) - least) / scale).to_array();
            Cell { at, until: sum, lambda: (lambda[cell] * stiffness) as f32, mu: (mu[cell] * stiffness) as f32 }
        };
        let cells = cells.iter().map(place).collect();
        let side = cage.cell() / scale;
        Ok(Self { scale, least, cells, side, volume: total * side.powi(3) })
    }

    /// Stratified by volume: as evenly spread over the cells as chance allows.
    pub(super) fn draw(&self, count: usize, seed: u64, stream: u64) -> Vec<Point> {
        let random = |k: usize, what: u64| random::unit(seed, stream, 4 * k as u64 + what);
        let point = |k: usize| {
            let wanted = (k as f64 + random(k, 3)) / count as f64;
            let at = self.cells.partition_point(|cell| cell.until < wanted).min(self.cells.len() - 1);
            let cell = &self.cells[at];
            let at = [0, 1, 2].map(|axis| (cell.at[axis] + self.side * random(k, axis as u64)) as f32);
            Point { at, lambda: cell.lambda, mu: cell.mu }
        };
        (0..count).map(point).collect()
    }

    /// A place in the normalised box.
    pub(super) fn normalised(&self, place: glam::DVec3) -> [f32; 3] {
        ((place - self.least) / self.scale).as_vec3().to_array()
    }
}
