//! [`extrapolate`]: values for nodes that no active cell has.

use glam::{IVec3, UVec3};
use splat_core::deform::Cage;

/// Rounds of relaxation; what is left after them is a soft tail far from the part.
const ROUNDS: usize = 64;

/// Continues values from the `known` nodes to the others: a harmonic field, bounded by the known values.
///
/// `values`: `node * width + k`.
pub(super) fn extrapolate(cage: &Cage, known: &[bool], width: usize, values: &mut [f64]) {
    let order = by_distance(cage, known);
    let neighbours: Vec<Vec<usize>> = order.iter().map(|&node| beside(cage, node)).collect();
    let mut done = known.to_vec();
    let mut mean = vec![0.0; width];
    let mut set = |node: usize, from: &mut dyn Iterator<Item = usize>, values: &mut [f64]| {
        mean.fill(0.0);
        let mut count = 0.0;
        for other in from {
            mean.iter_mut().zip(&values[other * width..]).for_each(|(sum, value)| *sum += value);
            count += 1.0;
        }
        if count > 0.0 {
            values[node * width..(node + 1) * width]
                .iter_mut()
                .zip(&mean)
                .for_each(|(value, sum)| *value = sum / count);
        }
    };
    for (&node, around) in order.iter().zip(&neighbours) {
        set(node, &mut around.iter().copied().filter(|&other| done[other]), values);
        done[node] = true;
    }
    for _ in 0..ROUNDS {
        for (&node, around) in order.iter().zip(&neighbours) {
            set(node, &mut around.iter().copied(), values);
        }
    }
}

/// The nodes that are not known, nearest to known ones first.
fn by_distance(cage: &Cage, known: &[bool]) -> Vec<usize> {
    let mut seen = known.to_vec();
    let mut last: Vec<usize> = (0..known.len()).filter(|&node| known[node]).collect();
    let mut order = Vec::new();
    while !last.is_empty() {
        let mut next = Vec::new();
        for node in last {
            for other in beside(cage, node) {
                if !seen[other] {
                    seen[other] = true;
                    next.push(other);
                }
            }
        }
        next.sort_unstable();
        order.extend_from_slice(&next);
        last = next;
    }
    order
}

/// The up to six nodes one step away.
fn beside(cage: &Cage, node: usize) -> Vec<usize> {
    let (nodes, at) = (cage.nodes().as_ivec3(), cage.node_at(node).as_ivec3());
    [IVec3::X, IVec3::Y, IVec3::Z]
        .into_iter()
        .flat_map(|step| [at - step, at + step])
        .filter(|other| other.cmpge(IVec3::ZERO).all() && other.cmplt(nodes).all())
        .map(|other: IVec3| cage.node_index(other.as_uvec3() as UVec3))
        .collect()
}
