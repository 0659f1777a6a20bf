//! Integrals over the active volume of a cage.

use super::PartCage;
use super::pencil::{LEAST_FILL, element_mass};

/// Mean of the square of each weight over the active volume, with cells counted as full as the modes count them.
///
/// `nodes`: `node * handles + j`.
pub(super) fn mean_squares(cage: &PartCage, handles: usize, nodes: &[f64]) -> Vec<f64> {
    let mass = element_mass();
    let mut sums = vec![0.0; handles];
    let mut volume = 0.0;
    for cell in (0..cage.active.len()).filter(|&cell| cage.active[cell]) {
        let fill = f64::from(cage.fill[cell]).max(LEAST_FILL);
        let corners = cage.cage.corners(cage.cell_at(cell)).map(|node| &nodes[node * handles..(node + 1) * handles]);
        volume += fill;
        for (j, sum) in sums.iter_mut().enumerate() {
            for (a, row) in mass.iter().enumerate() {
                *sum += fill * corners[a][j] * row.iter().zip(&corners).map(|(m, corner)| m * corner[j]).sum::<f64>();
            }
        }
    }
    sums.iter().map(|sum| sum / volume).collect()
}
