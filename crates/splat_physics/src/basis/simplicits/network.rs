//! The network: three coordinates in, the weights of the handles and their gradients by the coordinates out, and the way back.
//!
//! Layers are `Linear(3, 64) + ELU`, some `Linear(64, 64) + ELU`, `Linear(64, weights)`. A matrix of the network's numbers has one
//! column for each point four times over: first the values of all points, then their derivatives by x, by y, by z. All four go
//! through the same linear layers, so that the gradients cost three more columns and no other code.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use super::super::random;

/// Neurons of a layer.
pub(super) const WIDTH: usize = 64;
/// Values and three derivatives.
pub(super) const PARTS: usize = 4;

/// How many layers of what size; where their numbers lie among the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Network {
    /// Layers of 64 neurons after the first.
    pub(super) layers: usize,
    /// Weights that come out.
    pub(super) outputs: usize,
}

/// A linear layer: `outputs x inputs` numbers by columns, then `outputs` offsets.
#[derive(Clone, Copy, Debug)]
struct Layer {
    inputs: usize,
    outputs: usize,
    start: usize,
}

impl Layer {
    fn matrix<'a>(&self, parameters: &'a [f32]) -> MatRef<'a, f32> {
        let count = self.inputs * self.outputs;
        MatRef::from_column_major_slice(&parameters[self.start..self.start + count], self.outputs, self.inputs)
    }

    fn offsets<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        let first = self.start + self.inputs * self.outputs;
        &parameters[first..first + self.outputs]
    }

    /// The same places of the gradient.
    fn parts_mut<'a>(&self, gradient: &'a mut [f32]) -> (MatMut<'a, f32>, &'a mut [f32]) {
        let count = self.inputs * self.outputs;
        let (matrix, offsets) = gradient[self.start..self.start + count + self.outputs].split_at_mut(count);
        (MatMut::from_column_major_slice_mut(matrix, self.outputs, self.inputs), offsets)
    }
}

impl Network {
    /// The layers, first to last.
    fn each(&self) -> impl DoubleEndedIterator<Item = Layer> + ExactSizeIterator + use<> {
        let (last, outputs) = (self.layers + 1, self.outputs);
        let first = (3 + 1) * WIDTH;
        (0..self.layers + 2).map(move |k| Layer {
            inputs: if k == 0 { 3 } else { WIDTH },
            outputs: if k == last { outputs } else { WIDTH },
            start: if k == 0 { 0 } else { first + (k - 1) * (WIDTH + 1) * WIDTH },
        })
    }

    /// Number of parameters.
    pub(super) fn len(&self) -> usize {
        (3 + 1) * WIDTH + self.layers * (WIDTH + 1) * WIDTH + (WIDTH + 1) * self.outputs
    }

    /// Parameters to begin with: even in `+-1 / sqrt(inputs)` of each layer.
    pub(super) fn start(&self, seed: u64) -> Vec<f32> {
        let mut parameters = vec![0.0; self.len()];
        for layer in self.each() {
            let bound = 1.0 / (layer.inputs as f64).sqrt();
            let count = (layer.inputs + 1) * layer.outputs;
            for (k, value) in parameters[layer.start..layer.start + count].iter_mut().enumerate() {
                *value = (bound * (2.0 * random::unit(seed, 0, (layer.start + k) as u64) - 1.0)) as f32;
            }
        }
        parameters
    }
}

/// What is kept between the way forth and the way back, for some points.
pub(super) struct Pass {
    network: Network,
    points: usize,
    /// Input of each layer, `inputs x (4 points)`.
    inputs: Vec<Vec<f32>>,
    /// Derivative of each activation, `64 x points`.
    slopes: Vec<Vec<f32>>,
    /// Derivatives of what goes into each activation, `64 x (3 points)`.
    tangents: Vec<Vec<f32>>,
    /// `outputs x (4 points)`.
    pub(super) outputs: Vec<f32>,
    /// Of the loss by the outputs; to be filled in before the way back.
    pub(super) output_gradient: Vec<f32>,
    /// Of the loss by the parameters.
    pub(super) gradient: Vec<f32>,
    scratch: [Vec<f32>; 2],
}

impl Pass {
    pub(super) fn new(network: Network, points: usize) -> Self {
        let wide = |count: usize| vec![0.0; WIDTH * count];
        let hidden = network.layers + 1;
        let mut inputs = vec![vec![0.0; 3 * PARTS * points]];
        inputs.extend((0..hidden).map(|_| wide(PARTS * points)));
        Self {
            network,
            points,
            inputs,
            slopes: (0..hidden).map(|_| wide(points)).collect(),
            tangents: (0..hidden).map(|_| wide(3 * points)).collect(),
            outputs: vec![0.0; network.outputs * PARTS * points],
            output_gradient: vec![0.0; network.outputs * PARTS * points],
            gradient: vec![0.0; network.len()],
            scratch: [wide(PARTS * points), wide(PARTS * points)],
        }
    }

    /// Fills in the outputs for some points.
    pub(super) fn forth(&mut self, parameters: &[f32], points: &[[f32; 3]]) {
        let columns = PARTS * self.points;
        let first = &mut self.inputs[0];
        first.fill(0.0);
        for (k, point) in points.iter().enumerate() {
            first[3 * k..3 * k + 3].copy_from_slice(point);
            (0..3).for_each(|axis| first[3 * ((1 + axis) * self.points + k) + axis] = 1.0);
        }
        let hidden = self.network.layers + 1;
        for (k, layer) in self.network.each().enumerate() {
            let (before, after) = self.inputs.split_at_mut(k + 1);
            let input = MatRef::from_column_major_slice(&before[k], layer.inputs, columns);
            let out = if k < hidden { &mut after[0] } else { &mut self.outputs };
            let target = MatMut::from_column_major_slice_mut(out, layer.outputs, columns);
            matmul(target, Accum::Replace, layer.matrix(parameters), input, 1.0, Par::Seq);
            let offsets = layer.offsets(parameters);
            for column in out[..layer.outputs * self.points].chunks_exact_mut(layer.outputs) {
                column.iter_mut().zip(offsets).for_each(|(value, offset)| *value += offset);
            }
            if k < hidden {
                activate(out, &mut self.slopes[k], &mut self.tangents[k]);
            }
        }
    }

    /// Fills in the gradient by the parameters from that by the outputs.
    pub(super) fn back(&mut self, parameters: &[f32]) {
        let columns = PARTS * self.points;
        let hidden = self.network.layers + 1;
        let [here, next] = &mut self.scratch;
        for (k, layer) in self.network.each().enumerate().rev() {
            let own: &[f32] = if k == hidden {
                &self.output_gradient
            } else {
                inactivate(here, &self.slopes[k], &self.tangents[k]);
                here
            };
            let own = &own[..layer.outputs * columns];
            let of_out = MatRef::from_column_major_slice(own, layer.outputs, columns);
            let input = MatRef::from_column_major_slice(&self.inputs[k], layer.inputs, columns);
            let (matrix, offsets) = layer.parts_mut(&mut self.gradient);
            matmul(matrix, Accum::Replace, of_out, input.transpose(), 1.0, Par::Seq);
            offsets.fill(0.0);
            for column in own[..layer.outputs * self.points].chunks_exact(layer.outputs) {
                offsets.iter_mut().zip(column).for_each(|(sum, value)| *sum += value);
            }
            if k > 0 {
                let target = MatMut::from_column_major_slice_mut(next, layer.inputs, columns);
                matmul(target, Accum::Replace, layer.matrix(parameters).transpose(), of_out, 1.0, Par::Seq);
                std::mem::swap(here, next);
            }
        }
    }
}

/// ELU on values, its slope on derivatives; keeps the slopes and the derivatives from before.
fn activate(all: &mut [f32], slopes: &mut [f32], tangents: &mut [f32]) {
    let (values, derivatives) = all.split_at_mut(slopes.len());
    tangents.copy_from_slice(derivatives);
    for (value, slope) in values.iter_mut().zip(slopes.iter_mut()) {
        let power = exp(value.min(0.0));
        *slope = if *value > 0.0 { 1.0 } else { power };
        *value = if *value > 0.0 { *value } else { power - 1.0 };
    }
    for part in derivatives.chunks_exact_mut(slopes.len()) {
        part.iter_mut().zip(slopes.iter()).for_each(|(value, slope)| *value *= slope);
    }
}

/// The gradient by what went into the activations, from that by what came out.
fn inactivate(all: &mut [f32], slopes: &[f32], tangents: &[f32]) {
    let n = slopes.len();
    let (values, derivatives) = all.split_at_mut(n);
    let (dx, rest) = derivatives.split_at_mut(n);
    let (dy, dz) = rest.split_at_mut(n);
    let (tx, rest) = tangents.split_at(n);
    let (ty, tz) = rest.split_at(n);
    let (tz, dz) = (&tz[..n], &mut dz[..n]);
    for k in 0..n {
        let slope = slopes[k];
        // The curve of the exponential half is its slope; the other half is straight.
        let curve = if slope < 1.0 { slope } else { 0.0 };
        let bend = tx[k] * dx[k] + ty[k] * dy[k] + tz[k] * dz[k];
        values[k] = slope * values[k] + curve * bend;
        dx[k] *= slope;
        dy[k] *= slope;
        dz[k] *= slope;
    }
}

/// The exponential of a number that is not positive, to 2e-7: a polynomial, so that it is computed for many at once and gives the
/// same bits everywhere.
#[inline]
fn exp(x: f32) -> f32 {
    const ROUND: f32 = 12_582_912.0;
    let x = x.max(-80.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let whole = shifted - ROUND;
    // ln 2 in two parts: the first has few bits, so that its products with whole numbers are exact.
    let r = x - whole * 0.693_359_375 + whole * 2.121_944_4e-4;
    let p = 1.0 + r * (1.0 + r * (0.5 + r * (0.166_666_66 + r * (0.041_666_6 + r * (0.008_333_8 + r * 0.001_398)))));
    p * f32::from_bits((shifted.to_bits() << 23).wrapping_add(0x3f80_0000))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_polynomial_is_the_exponential() {
        for k in 0..80_000 {
            let x = -f64::from(k) * 1e-3;
            let ratio = f64::from(exp(x as f32)) / f64::from(x as f32).exp();
            assert!((ratio - 1.0).abs() < 3e-7, "{x} {ratio}");
        }
        assert!(exp(-1e30) < 1e-30);
    }
}
