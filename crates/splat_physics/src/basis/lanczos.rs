//! [`lowest`]: the lowest modes of a pencil, by a block Lanczos method on the inverse.
//!
//! Subspace iteration with all its earlier blocks kept: where that throws a block away after each solution, this looks for the modes
//! in all of them, and needs about a third of the solutions.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par, Side};

use super::pencil::{Factor, Pencil};
use super::start::start;
use super::{BasisError, Progress, random};

/// Columns that are solved for at once for each piece: as many modes of one value are found in it. More at once cost more altogether.
const BLOCK: usize = 8;
/// Residual of `M^-1 K`'s inverse, relative to the eigenvalue, below which a mode is good; its eigenvalue is good to the square.
const GOOD: f64 = 1e-3;
/// The same for modes that only tell where to stop.
const FAIR: f64 = 1e-2;
/// Columns between two looks at what has been found.
const LOOK: usize = 16;
/// Columns that there is room for at first.
const ROOM: usize = 200;
/// A column whose length falls below this part of what it was depends on the others.
const DEPENDENT: f64 = 1e-8;

/// Modes `K w = value M w`, their values rising, `w^T M w = 1`.
pub(super) struct Modes {
    pub(super) values: Vec<f64>,
    /// `rows x modes`.
    pub(super) vectors: Mat<f64>,
    /// Columns solved for.
    pub(super) solutions: usize,
}

/// The `wanted` lowest modes that are orthogonal to `known`, and `more` with less care, or as many as there are.
///
/// `known`: `M`-orthonormal modes of the value 0. `shift`: positive; the factor is that of `K + shift M`.
pub(super) fn lowest(
    pencil: &Pencil,
    factor: &Factor,
    shift: f64,
    known: &Mat<f64>,
    (wanted, more): (usize, usize),
    seed: u64,
    progress: &dyn Progress,
) -> Result<Modes, BasisError> {
    let all = pencil.len() - known.ncols();
    let (careful, wanted) = (wanted.min(all), (wanted + more).min(all));
    let mut space = Space::new(pencil, known);
    let mut solutions = 0;
    let mut draws = 0;
    let (mut looked, mut share) = (0, 0.0_f32);
    let width = (BLOCK * known.ncols().max(1)).min(wanted);
    space.draw(width, seed, &mut draws);
    loop {
        if progress.cancelled() {
            return Err(BasisError::Cancelled);
        }
        let block = space.blocks.last().copied().unwrap_or_default();
        solutions += block.count;
        let image = space.image(factor, block);
        let residual = space.extend(image);
        let found = space.size() - space.next_count();
        let ended = space.next_count() == 0;
        if found >= wanted && (ended || found >= looked + LOOK) {
            looked = found;
            let ritz = space.ritz(&residual)?;
            let good = |k: usize| ritz.residuals[k] <= ritz.values[k] * if k < careful { GOOD } else { FAIR };
            let count = (0..wanted).filter(|&k| good(k)).count();
            if count == wanted || ended {
                return Ok(space.modes(&ritz, wanted, shift, solutions));
            }
            share = share.max(count as f32 / wanted as f32);
            progress.report(0.3 + 0.65 * share);
        }
        if ended {
            // A start that lay in too few modes: go on with another.
            space.draw(width, seed, &mut draws);
            if space.next_count() == 0 {
                return Err(BasisError::Numerical { what: "the modes of the cage did not converge" });
            }
        }
    }
}

#[derive(Clone, Copy, Default)]
struct Block {
    first: usize,
    count: usize,
}

/// The subspace so far: `known` first, then blocks; the last block has not been solved for.
struct Space<'a> {
    pencil: &'a Pencil,
    known: usize,
    /// `M`-orthonormal columns.
    q: Mat<f64>,
    /// `M q`.
    mq: Mat<f64>,
    used: usize,
    blocks: Vec<Block>,
    /// The operator `(K + shift M)^-1 M` on the columns after `known`.
    t: Mat<f64>,
}

/// Approximate modes of the operator.
struct Ritz {
    /// Falling.
    values: Vec<f64>,
    vectors: Mat<f64>,
    residuals: Vec<f64>,
}

impl<'a> Space<'a> {
    fn new(pencil: &'a Pencil, known: &Mat<f64>) -> Self {
        let mut mq = Mat::zeros(known.nrows(), known.ncols());
        pencil.mass_times(known.as_ref(), mq.as_mut());
        let used = known.ncols();
        let mut q = known.clone();
        q.reserve(pencil.len(), used + ROOM);
        mq.reserve(pencil.len(), used + ROOM);
        Self { pencil, known: used, q, mq, used, blocks: Vec::new(), t: Mat::zeros(0, 0) }
    }

    /// Columns after `known`.
    fn size(&self) -> usize {
        self.used - self.known
    }

    /// Columns of the block that has not been solved for.
    fn next_count(&self) -> usize {
        self.blocks.last().map_or(0, |block| block.count)
    }

    /// Adds a random block.
    fn draw(&mut self, count: usize, seed: u64, draws: &mut u64) {
        *draws += 1;
        let x = if *draws == 1 {
            start(self.pencil, count, seed)
        } else {
            let place = |row, column| (row * count + column) as u64;
            Mat::from_fn(self.pencil.len(), count, |row, column| {
                random::unit(seed, 1 + *draws, place(row, column)) - 0.5
            })
        };
        if self.blocks.last().is_some_and(|block| block.count == 0) {
            self.blocks.pop();
        }
        self.append(x);
    }

    /// The operator on a block.
    fn image(&self, factor: &Factor, block: Block) -> Mat<f64> {
        let mut x = self.mq.subcols(block.first, block.count).to_owned();
        factor.solve(&mut x);
        x
    }

    /// Adds what is new in the image of the last block as the next block; gives the image's coefficients there.
    fn extend(&mut self, mut image: Mat<f64>) -> Mat<f64> {
        let block = self.blocks.last().copied().unwrap_or_default();
        // In exact numbers the image meets the last two blocks only; the rest is rounding, which `append` takes out.
        let from = self.blocks.len().checked_sub(2).map_or(block.first, |k| self.blocks[k].first);
        let count = self.used - from;
        let mut along = Mat::zeros(count, block.count);
        let (q, mq) = (self.q.subcols(from, count), self.mq.subcols(from, count));
        matmul(along.as_mut(), Accum::Replace, mq.transpose(), image.as_ref(), 1.0, Par::Seq);
        matmul(image.as_mut(), Accum::Add, q, along.as_ref(), -1.0, Par::Seq);
        self.grow_t();
        let first = block.first - self.known;
        for column in 0..block.count {
            for row in 0..block.count {
                let (a, b) = (along[(block.first - from + row, column)], along[(block.first - from + column, row)]);
                self.t[(first + row, first + column)] = 0.5 * (a + b);
            }
        }
        let residual = self.append(image);
        self.grow_t();
        let next = self.used - self.known - residual.nrows();
        for row in 0..residual.nrows() {
            for column in 0..block.count {
                self.t[(next + row, first + column)] = residual[(row, column)];
                self.t[(first + column, next + row)] = residual[(row, column)];
            }
        }
        residual
    }

    /// Makes columns orthonormal to all and among each other, and adds those that are left as a block.
    ///
    /// Gives the coefficients of the columns in the new block.
    fn append(&mut self, mut x: Mat<f64>) -> Mat<f64> {
        let (n, width) = (x.nrows(), x.ncols());
        let mut mx = Mat::zeros(n, width);
        let mut along = Mat::zeros(self.used, width);
        matmul(along.as_mut(), Accum::Replace, self.mq.subcols(0, self.used).transpose(), x.as_ref(), 1.0, Par::Seq);
        matmul(x.as_mut(), Accum::Add, self.q.subcols(0, self.used), along.as_ref(), -1.0, Par::Seq);
        self.pencil.mass_times(x.as_ref(), mx.as_mut());
        let lengths: Vec<f64> =
            (0..width).map(|c| (dot(&x, &mx, c, c).max(0.0) + along.col(c).squared_norm_l2()).sqrt()).collect();
        let mut coefficients = Mat::<f64>::zeros(width, width);
        let mut kept: Vec<usize> = Vec::new();
        for c in 0..width {
            let mut length = dot(&x, &mx, c, c).max(0.0).sqrt();
            // Twice is enough, and once where little is taken out (Kahan).
            for _ in 0..2 {
                let before = length;
                for (k, &d) in kept.iter().enumerate() {
                    let along = dot(&x, &mx, c, d);
                    coefficients[(k, c)] += along;
                    subtract(&mut x, c, d, along);
                    subtract(&mut mx, c, d, along);
                }
                length = dot(&x, &mx, c, c).max(0.0).sqrt();
                if length > 0.7 * before {
                    break;
                }
            }
            if length > DEPENDENT * lengths[c] && length.is_finite() {
                coefficients[(kept.len(), c)] = length;
                scale(&mut x, c, 1.0 / length);
                scale(&mut mx, c, 1.0 / length);
                kept.push(c);
            }
        }
        let first = self.used;
        self.q.resize_with(n, first + kept.len(), |row, column| x[(row, kept[column - first])]);
        self.mq.resize_with(n, first + kept.len(), |row, column| mx[(row, kept[column - first])]);
        self.used += kept.len();
        self.blocks.push(Block { first, count: kept.len() });
        Mat::from_fn(kept.len(), width, |row, column| coefficients[(row, column)])
    }

    fn grow_t(&mut self) {
        let size = self.size();
        self.t.resize_with(size, size, |_, _| 0.0);
    }

    /// `residual`: coefficients of the last solved block's image in the block that has not been solved for.
    fn ritz(&self, residual: &Mat<f64>) -> Result<Ritz, BasisError> {
        let size = self.size() - self.next_count();
        let t = self.t.submatrix(0, 0, size, size);
        let failed = BasisError::Numerical { what: "the eigenvalues of the projected Laplacian did not converge" };
        let eigen = t.self_adjoint_eigen(Side::Lower).map_err(|_| failed)?;
        // Theirs rise.
        let (s, u) = (eigen.S(), eigen.U());
        let values: Vec<f64> = (0..size).rev().map(|k| s.column_vector()[k]).collect();
        let vectors = Mat::from_fn(size, size, |row, column| u[(row, size - 1 - column)]);
        let width = residual.ncols();
        let last = vectors.subrows(size - width, width);
        let left = residual * last;
        let residuals = (0..size).map(|k| left.col(k).norm_l2()).collect();
        Ok(Ritz { values, vectors, residuals })
    }

    fn modes(&self, ritz: &Ritz, wanted: usize, shift: f64, solutions: usize) -> Modes {
        let count = wanted.min(ritz.values.len());
        let size = ritz.vectors.nrows();
        let vectors = self.q.subcols(self.known, size) * ritz.vectors.subcols(0, count);
        Modes { values: ritz.values[..count].iter().map(|value| 1.0 / value - shift).collect(), vectors, solutions }
    }
}

fn dot(a: &Mat<f64>, b: &Mat<f64>, c: usize, d: usize) -> f64 {
    // Four sums, so that the additions need not wait for each other.
    let (a, b) = (a.col_as_slice(c), b.col_as_slice(d));
    let mut sums = [0.0; 4];
    let (fours, rest) = (a.chunks_exact(4).zip(b.chunks_exact(4)), a.len() / 4 * 4);
    for (a, b) in fours {
        (0..4).for_each(|k| sums[k] += a[k] * b[k]);
    }
    a[rest..].iter().zip(&b[rest..]).fold(sums[0] + sums[1] + (sums[2] + sums[3]), |sum, (a, b)| sum + a * b)
}

fn scale(a: &mut Mat<f64>, c: usize, by: f64) {
    a.col_as_slice_mut(c).iter_mut().for_each(|x| *x *= by);
}

/// `a_c -= along * a_d`, for `d` before `c`.
fn subtract(a: &mut Mat<f64>, c: usize, d: usize, along: f64) {
    let (before, from) = a.as_mut().split_at_col_mut(c);
    let (Some(to), Some(other)) = (from.col_mut(0).try_as_col_major_mut(), before.col(d).try_as_col_major()) else {
        return;
    };
    to.as_slice_mut().iter_mut().zip(other.as_slice()).for_each(|(x, y)| *x -= along * y);
}
