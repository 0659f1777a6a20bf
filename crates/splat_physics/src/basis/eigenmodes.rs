//! [`weights`]: the lowest modes of a stiffness-weighted Laplacian on a part's cage.
//!
//! The minimiser of the mean elastic energy of random motions under orthonormality is an eigenproblem with the coefficient
//! `lambda + 4 mu`; a root of it leaves more modes to stiff regions (measured: 32 handles give 0.94..1.00 of a fine FEM's deflection
//! with the square root, 0.80..1.01 without).

use faer::Mat;

use super::extrapolate::extrapolate;
use super::lanczos::{Modes, lowest};
use super::pencil::Pencil;
use super::pieces::pieces;
use super::{BasisError, BasisReport, BasisWeights, PartCage, Progress, cell_means, check_materials, stiffness};
use crate::Material;

/// Modes whose values differ by less than this part belong together.
const DEGENERATE: f64 = 1e-3;
/// Modes beyond the wanted ones that are looked at for partners.
const PARTNERS: usize = 6;
/// Of the least coefficient; in units of cells, well below the first mode's value.
const SHIFT: f64 = 1e-3;

/// `handles`: at least 2, the constant one among them.
pub(super) fn weights(
    cage: &PartCage,
    materials: &[Material],
    handles: usize,
    exponent: f64,
    seed: u64,
    progress: &dyn Progress,
) -> Result<BasisWeights, BasisError> {
    if !(0.0..=1.0).contains(&exponent) {
        return Err(BasisError::Setting { name: "exponent", value: exponent });
    }
    check_materials(cage, materials)?;
    let mut coefficients = cell_means(cage, materials, |material| stiffness(material).powf(exponent))?;
    let (sum, count) =
        coefficients.iter().fold((0.0, 0.0), |(sum, count), &c| (sum + c, count + f64::from(u8::from(c > 0.0))));
    // Rounded, so that a factor common to all moduli does not show in the last bits, which would turn modes of one value.
    coefficients.iter_mut().for_each(|c| *c = f64::from((*c * count / sum) as f32));
    let least = coefficients.iter().copied().filter(|&c| c > 0.0).fold(f64::INFINITY, f64::min);

    progress.report(0.0);
    let pencil = Pencil::new(cage, &coefficients);
    if progress.cancelled() {
        return Err(BasisError::Cancelled);
    }
    let factor = pencil.factor(SHIFT * least)?;
    progress.report(0.3);
    let pieces = Indicators::new(cage, &pencil);
    let wanted = handles - pieces.columns.ncols();
    let modes = lowest(&pencil, &factor, SHIFT * least, &pieces.columns, (wanted, PARTNERS), seed, progress)?;
    let kept = cut(&modes.values, wanted);
    let weights = assemble(cage, &pencil, &pieces, &modes, kept);
    progress.report(1.0);
    let cell = cage.cell();
    let eigenvalues = std::iter::repeat_n(0.0, pieces.columns.ncols() - 1)
        .chain(modes.values[..kept].iter().map(|v| v / (cell * cell)));
    let report = BasisReport {
        handles_wanted: handles,
        pieces: pieces.columns.ncols(),
        eigenvalues: eigenvalues.collect(),
        steps: modes.solutions,
        loss: 0.0,
    };
    Ok(BasisWeights { handles: kept + pieces.columns.ncols(), nodes: weights, report })
}

/// How many modes to keep so that none is parted from one of the same value.
fn cut(values: &[f64], wanted: usize) -> usize {
    let mut kept = wanted.min(values.len());
    while kept > 0 && kept < values.len() && values[kept] - values[kept - 1] < DEGENERATE * values[kept] {
        kept += 1;
    }
    kept
}

/// The modes of the value 0: each piece of the cage by itself.
struct Indicators {
    /// `rows x pieces`, `M`-orthonormal.
    columns: Mat<f64>,
    /// `integral 1`, in cells.
    volume: f64,
}

impl Indicators {
    fn new(cage: &PartCage, pencil: &Pencil) -> Self {
        let pieces = pieces(cage);
        let mut columns = Mat::zeros(pencil.len(), pieces.count);
        for (row, &node) in pencil.node_of_row.iter().enumerate() {
            columns[(row, pieces.of_node[node as usize] as usize)] = 1.0;
        }
        let mut mass = Mat::zeros(pencil.len(), pieces.count);
        pencil.mass_times(columns.as_ref(), mass.as_mut());
        let mut volume = 0.0;
        for piece in 0..pieces.count {
            let own: f64 = (0..pencil.len()).map(|row| columns[(row, piece)] * mass[(row, piece)]).sum();
            volume += own;
            (0..pencil.len()).for_each(|row| columns[(row, piece)] /= own.sqrt());
        }
        Self { columns, volume }
    }
}

/// Weights at all nodes: pieces but the first, modes, the constant.
fn assemble(cage: &PartCage, pencil: &Pencil, pieces: &Indicators, modes: &Modes, kept: usize) -> Vec<f64> {
    let more = pieces.columns.ncols() - 1;
    let handles = more + kept + 1;
    let mut nodes = vec![0.0; cage.cage.node_count() * handles];
    let root = pieces.volume.sqrt();
    let columns = (1..=more).map(|c| pieces.columns.col(c)).chain((0..kept).map(|c| modes.vectors.col(c)));
    for (j, column) in columns.enumerate() {
        let sign = sign(pencil, &column.iter().copied().collect::<Vec<f64>>());
        for (row, &value) in column.iter().enumerate() {
            nodes[pencil.node_of_row[row] as usize * handles + j] = sign * root * value;
        }
    }
    extrapolate(&cage.cage, &cage.active_nodes(), handles, &mut nodes);
    nodes.iter_mut().for_each(|value| *value = f64::from(*value as f32));
    nodes.iter_mut().skip(handles - 1).step_by(handles).for_each(|value| *value = 1.0);
    nodes
}

/// The sign that makes the largest value positive; of values about as large, the one of the first node.
fn sign(pencil: &Pencil, column: &[f64]) -> f64 {
    let most = column.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let large =
        (0..column.len()).filter(|&row| column[row].abs() > 0.99 * most).min_by_key(|&row| pencil.node_of_row[row]);
    large.map_or(1.0, |row| column[row].signum())
}
