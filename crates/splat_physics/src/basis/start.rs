//! [`start`]: where the search for modes begins.

use std::f64::consts::PI;

use faer::Mat;

use super::pencil::Pencil;
use super::random;

/// Cosines along each axis, at most.
const ORDERS: usize = 12;
/// Cosines mixed for each column.
const MIXED: usize = 64;
/// Share of plain chance: what the cosines lack is found by it.
const NOISE: f64 = 0.01;

/// Random mixtures of the lowest modes of a full box, which those of most parts are not far from; a search that begins with them
/// takes about a seventh fewer solutions than one that begins with plain chance.
pub(super) fn start(pencil: &Pencil, count: usize, seed: u64) -> Mat<f64> {
    let sides = pencil.nodes.as_dvec3() - 1.0;
    let mut orders: Vec<(f64, [usize; 3])> = (0..ORDERS.pow(3))
        .map(|k| [k % ORDERS, k / ORDERS % ORDERS, k / (ORDERS * ORDERS)])
        .map(|order| ((0..3).map(|axis| (order[axis] as f64 / sides[axis]).powi(2)).sum(), order))
        .collect();
    orders.sort_by(|a, b| a.0.total_cmp(&b.0));
    orders.truncate(MIXED);
    // By axis: `place * ORDERS + order`.
    let cosines: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let cosine = |k: usize| (PI * (k / ORDERS) as f64 * (k % ORDERS) as f64 / sides[axis]).cos();
        (0..pencil.nodes[axis] as usize * ORDERS).map(cosine).collect()
    });
    let parts: Vec<f64> = (0..MIXED * count).map(|k| random::unit(seed, 1, k as u64) - 0.5).collect();
    let mut mixed = vec![0.0; count];
    let mut x = Mat::zeros(pencil.len(), count);
    for row in 0..pencil.len() {
        let place = pencil.place(row).to_array().map(|at| at as usize * ORDERS);
        mixed.fill(0.0);
        for (&(_, order), parts) in orders.iter().zip(parts.chunks_exact(count)) {
            let product: f64 = (0..3).map(|axis| cosines[axis][place[axis] + order[axis]]).product();
            mixed.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part * product);
        }
        for (column, value) in mixed.iter().enumerate() {
            let noise = random::unit(seed, 2, (row * count + column) as u64) - 0.5;
            x[(row, column)] = value + NOISE * noise;
        }
    }
    x
}
