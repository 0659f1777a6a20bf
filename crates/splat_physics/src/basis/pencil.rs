//! The generalised eigenproblem of a cage: stiffness and mass of a scalar field on its active nodes.

use faer::Side;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::prelude::*;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, MatMut, Par};
use glam::{IVec3, UVec3};

use super::{BasisError, PartCage};

/// Least weight of an active cell; what is emptier would leave its nodes to chance.
pub(super) const LEAST_FILL: f64 = 0.05;

/// `K` and `M` in units of cells: sides 1, coefficients relative to their mean.
pub(super) struct Pencil {
    /// Of the cage, along each axis.
    pub(super) nodes: UVec3,
    /// Number of the cage's node, by row.
    pub(super) node_of_row: Vec<u32>,
    /// Upper triangles of `K` and `M`, by columns.
    starts: Vec<u32>,
    rows: Vec<u32>,
    stiffness: Vec<f64>,
    mass: Vec<f64>,
}

impl Pencil {
    /// `coefficients`: of each active cell, positive.
    ///
    /// Rows are in an order that keeps the factor small (nested dissection).
    pub(super) fn new(cage: &PartCage, coefficients: &[f64]) -> Self {
        let active = cage.active_nodes();
        let node_of_row = dissect(cage.cage.nodes(), &active);
        let mut row_of_node = vec![u32::MAX; active.len()];
        for (row, &node) in node_of_row.iter().enumerate() {
            row_of_node[node as usize] = row as u32;
        }
        let (element_stiffness, element_mass) = (element_stiffness(), element_mass());
        // Entries of a node with its 27 neighbours, itself among them.
        let mut stencils = vec![[0.0_f64; 54]; node_of_row.len()];
        for cell in (0..cage.active.len()).filter(|&cell| cage.active[cell]) {
            let corners = cage.cage.corners(cage.cell_at(cell));
            let fill = f64::from(cage.fill[cell]).max(LEAST_FILL);
            for (a, &node) in corners.iter().enumerate() {
                let stencil = &mut stencils[row_of_node[node] as usize];
                for b in 0..8 {
                    let step = |bit: usize| 1 + (b >> bit & 1) - (a >> bit & 1);
                    let at = step(0) + 3 * (step(1) + 3 * step(2));
                    stencil[at] += fill * coefficients[cell] * element_stiffness[a][b];
                    stencil[27 + at] += fill * element_mass[a][b];
                }
            }
        }
        let mut this = Self {
            nodes: cage.cage.nodes(),
            node_of_row,
            starts: vec![0],
            rows: Vec::new(),
            stiffness: Vec::new(),
            mass: Vec::new(),
        };
        let nodes = cage.cage.nodes().as_ivec3();
        let mut column = Vec::new();
        for (at, stencil) in stencils.iter().enumerate() {
            let node = cage.cage.node_at(this.node_of_row[at] as usize).as_ivec3();
            column.clear();
            for k in 0..27 {
                let other = node + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
                if other.cmplt(IVec3::ZERO).any() || other.cmpge(nodes).any() || stencil[27 + k as usize] == 0.0 {
                    continue;
                }
                let row = row_of_node[cage.cage.node_index(other.as_uvec3())];
                if row as usize <= at {
                    column.push((row, stencil[k as usize], stencil[27 + k as usize]));
                }
            }
            column.sort_unstable_by_key(|&(row, ..)| row);
            for &(row, stiffness, mass) in &column {
                this.rows.push(row);
                this.stiffness.push(stiffness);
                this.mass.push(mass);
            }
            this.starts.push(this.rows.len() as u32);
        }
        this
    }

    pub(super) fn len(&self) -> usize {
        self.node_of_row.len()
    }

    /// A row's node, along each axis.
    pub(super) fn place(&self, row: usize) -> UVec3 {
        let (node, n) = (self.node_of_row[row], self.nodes);
        UVec3::new(node % n.x, node / n.x % n.y, node / (n.x * n.y))
    }

    /// `out = M x`, by columns.
    pub(super) fn mass_times(&self, x: MatRef<'_, f64>, out: MatMut<'_, f64>) {
        self.times(&self.mass, x, out);
    }

    /// `out = K x`, by columns.
    #[cfg(test)]
    pub(super) fn stiffness_times(&self, x: MatRef<'_, f64>, out: MatMut<'_, f64>) {
        self.times(&self.stiffness, x, out);
    }

    fn times(&self, values: &[f64], x: MatRef<'_, f64>, mut out: MatMut<'_, f64>) {
        // Eight columns side by side: one pass over the matrix for all, and their numbers in one line of the cache.
        const WIDE: usize = 8;
        let n = self.len();
        let mut from = vec![[0.0_f64; WIDE]; n];
        let mut to = vec![[0.0_f64; WIDE]; n];
        for first in (0..x.ncols()).step_by(WIDE) {
            let width = WIDE.min(x.ncols() - first);
            for c in 0..width {
                let column = x.col(first + c);
                from.iter_mut().zip(column.iter()).for_each(|(row, &value)| row[c] = value);
            }
            to.iter_mut().for_each(|row| *row = [0.0; WIDE]);
            for column in 0..n {
                let own = from[column];
                let mut sum = [0.0; WIDE];
                let entries = self.starts[column] as usize..self.starts[column + 1] as usize;
                for (&row, &value) in self.rows[entries.clone()].iter().zip(&values[entries]) {
                    let row = row as usize;
                    if row == column {
                        (0..WIDE).for_each(|c| sum[c] += value * own[c]);
                    } else {
                        (0..WIDE).for_each(|c| sum[c] += value * from[row][c]);
                        (0..WIDE).for_each(|c| to[row][c] += value * own[c]);
                    }
                }
                (0..WIDE).for_each(|c| to[column][c] += sum[c]);
            }
            for c in 0..width {
                let column = out.rb_mut().col_mut(first + c);
                column.iter_mut().zip(&to).for_each(|(value, row)| *value = row[c]);
            }
        }
    }

    /// Factors `K + shift M`.
    pub(super) fn factor(&self, shift: f64) -> Result<Factor, BasisError> {
        let failed = BasisError::Numerical { what: "the Laplacian of the cage is not positive definite" };
        let n = self.len();
        let values: Vec<f64> = self.stiffness.iter().zip(&self.mass).map(|(k, m)| k + shift * m).collect();
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &self.starts, None, &self.rows);
        let parameters = CholeskySymbolicParams::default();
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Upper, SymmetricOrdering::Identity, parameters)
            .map_err(|_| failed)?;
        let mut values_of_factor = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        symbolic
            .factorize_numeric_llt(
                &mut values_of_factor,
                SparseColMatRef::new(pattern, &values),
                Side::Upper,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|_| failed)?;
        Ok(Factor { symbolic, values: values_of_factor })
    }
}

/// Cholesky's factor of a shifted pencil.
pub(super) struct Factor {
    symbolic: SymbolicCholesky<u32>,
    values: Vec<f64>,
}

impl Factor {
    /// Solves for all columns at once.
    pub(super) fn solve(&self, x: &mut Mat<f64>) {
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(x.ncols(), Par::Seq));
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            x.as_mut(),
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }
}

/// One of the two of a line of length 1, for ends that are the same or not.
fn line(same: f64, other: f64) -> impl Fn(usize, usize) -> f64 {
    move |a, b| if a == b { same } else { other }
}

/// By corners `a`, `b` of a cell: products of what `x`, `y` and `z` of them give.
fn products(of: impl Fn([(usize, usize); 3]) -> f64) -> [[f64; 8]; 8] {
    std::array::from_fn(|a| std::array::from_fn(|b| of([0, 1, 2].map(|axis| (a >> axis & 1, b >> axis & 1)))))
}

/// `integral N_a N_b` of a trilinear cell of side 1.
pub(super) fn element_mass() -> [[f64; 8]; 8] {
    let mass = line(1.0 / 3.0, 1.0 / 6.0);
    products(|[x, y, z]| mass(x.0, x.1) * mass(y.0, y.1) * mass(z.0, z.1))
}

/// `integral grad N_a . grad N_b` of a trilinear cell of side 1.
fn element_stiffness() -> [[f64; 8]; 8] {
    let (mass, slope) = (line(1.0 / 3.0, 1.0 / 6.0), line(1.0, -1.0));
    products(|[x, y, z]| {
        let (mx, my, mz) = (mass(x.0, x.1), mass(y.0, y.1), mass(z.0, z.1));
        slope(x.0, x.1) * my * mz + mx * slope(y.0, y.1) * mz + mx * my * slope(z.0, z.1)
    })
}

/// Active nodes in the order of nested dissection (George 1973): both halves of the grid first, then the plane between them.
fn dissect(nodes: UVec3, active: &[bool]) -> Vec<u32> {
    let mut order = Vec::new();
    dissect_box(nodes, UVec3::ZERO, nodes, active, &mut order);
    order
}

fn dissect_box(nodes: UVec3, low: UVec3, high: UVec3, active: &[bool], order: &mut Vec<u32>) {
    let size = high - low;
    if size.min_element() == 0 {
        return;
    }
    let longest = (0..3).max_by_key(|&axis| size[axis]).unwrap_or(0);
    if size[longest] <= 3 {
        list(nodes, low, high, active, order);
        return;
    }
    let middle = low[longest] + size[longest] / 2;
    for (a, b) in [(low[longest], middle), (middle + 1, high[longest]), (middle, middle + 1)] {
        let (mut from, mut to) = (low, high);
        (from[longest], to[longest]) = (a, b);
        if a == middle {
            // A plane is dense in the factor whatever its order.
            list(nodes, from, to, active, order);
        } else {
            dissect_box(nodes, from, to, active, order);
        }
    }
}

/// Active nodes of a box in the grid's order.
fn list(nodes: UVec3, low: UVec3, high: UVec3, active: &[bool], order: &mut Vec<u32>) {
    for z in low.z..high.z {
        for y in low.y..high.y {
            for x in low.x..high.x {
                let node = x + nodes.x * (y + nodes.y * z);
                if active[node as usize] {
                    order.push(node);
                }
            }
        }
    }
}
