//! [`Orthonormal`]: independent columns out of dependent ones.

use faer::Mat;

/// Columns whose length falls below this part of what it was are told by the others.
const CUT: f64 = 1e-6;

/// An orthonormal basis of what the columns of a matrix span.
pub(super) struct Orthonormal {
    /// `columns x rank`: the matrix times this has orthonormal columns.
    pub(super) combination: Mat<f64>,
    /// Independent columns.
    pub(super) rank: usize,
}

/// Modified Gram-Schmidt, twice over, pivoted by length; the columns of `first` come first, in their order.
///
/// This is the pivoted QR factorisation of the mass-weighted basis: without it the columns of a network's weights are nearly
/// dependent and Newton's method does not converge.
pub(super) fn orthonormal(mut a: Mat<f64>, first: &[usize]) -> Orthonormal {
    let n = a.ncols();
    let mut k = Mat::<f64>::identity(n, n);
    let lengths: Vec<f64> = (0..n).map(|c| norm(&a, c)).collect();
    let mut left: Vec<usize> = (0..n).filter(|&c| lengths[c] > 0.0).collect();
    let mut done: Vec<usize> = Vec::new();
    while !left.is_empty() {
        let longest = |&(_, &x): &(usize, &usize), &(_, &y): &(usize, &usize)| {
            (norm(&a, x) / lengths[x]).total_cmp(&(norm(&a, y) / lengths[y])).then(y.cmp(&x))
        };
        let forced = first.get(done.len()).and_then(|f| left.iter().position(|c| c == f));
        let Some(at) = forced.or_else(|| left.iter().enumerate().max_by(longest).map(|(at, _)| at)) else { break };
        let c = left.remove(at);
        // Once more against all: what the first pass left is rounding, and rounding grows with the small columns.
        for &d in &done {
            let along = dot(&a, c, d);
            subtract(&mut a, c, d, along);
            subtract(&mut k, c, d, along);
        }
        let length = norm(&a, c);
        if !(length > CUT * lengths[c]) {
            if forced.is_none() {
                break;
            }
            continue;
        }
        scale(&mut a, c, 1.0 / length);
        scale(&mut k, c, 1.0 / length);
        for &d in &left {
            let along = dot(&a, d, c);
            subtract(&mut a, d, c, along);
            subtract(&mut k, d, c, along);
        }
        done.push(c);
    }
    let combination = Mat::from_fn(n, done.len(), |r, c| k[(r, done[c])]);
    Orthonormal { combination, rank: done.len() }
}

fn norm(a: &Mat<f64>, c: usize) -> f64 {
    dot(a, c, c).sqrt()
}

fn dot(a: &Mat<f64>, c: usize, d: usize) -> f64 {
    a.col_as_slice(c).iter().zip(a.col_as_slice(d)).map(|(x, y)| x * y).sum()
}

fn scale(a: &mut Mat<f64>, c: usize, by: f64) {
    a.col_as_slice_mut(c).iter_mut().for_each(|x| *x *= by);
}

/// `a_c -= along * a_d`.
fn subtract(a: &mut Mat<f64>, c: usize, d: usize, along: f64) {
    let other = a.col_as_slice(d).to_vec();
    a.col_as_slice_mut(c).iter_mut().zip(other).for_each(|(x, y)| *x -= along * y);
}
