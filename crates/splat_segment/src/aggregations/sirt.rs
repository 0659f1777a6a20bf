//! Un-mixing by simultaneous iterative reconstruction.

use splat_core::Selection;
use splat_raster::{Features, Rasterizer, Scene, VOTE_UNIT};

use super::gradient::residual;
use super::{Aggregated, Aggregation, MaskedView, VotedView, adjoint, draw_all, sums, voted};
use crate::{Run, SegmentError};

/// Least squares between masks and `features(M)`, approached by SIRT from the votes' shares.
///
/// `M_i <- M_i + (1 / total_i) sum_v sum_p w_i (m - F) / A`, with F the picture of M and A the opacity there. Its fixed point
/// is the least-squares fit weighted by 1/A: it takes apart Gaussians that share pixels, where votes give both the
/// mixture. Score: M, about 0..=1. Cost: two frames per view and iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sirt {
    /// Rounds over all views, 10 to 50.
    pub iterations: u32,
}

impl Aggregation for Sirt {
    fn name(&self) -> &'static str {
        "sirt"
    }

    fn description(&self) -> &'static str {
        "iterates the votes towards the least-squares fit of all masks, which un-mixes Gaussians that share pixels"
    }

    fn source(&self) -> &'static str {
        "SIRT of tomography (Gilbert 1972), on the linear picture of one channel per Gaussian"
    }

    fn decide(&self, _: usize, _: &[VotedView<'_>]) -> Option<Aggregated> {
        None
    }

    fn run(
        &self,
        scene: &Scene,
        views: &[MaskedView<'_>],
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<Aggregated, SegmentError> {
        let votes = draw_all(scene, views, raster, run)?;
        let sums = sums(scene.len(), &voted(views, &votes));
        drop(votes);
        let n = scene.len();
        // Two channels: M and the constant 1, whose picture is the opacity.
        let mut values: Vec<f32> = (0..n).flat_map(|i| [sums.score(i).unwrap_or(0.0), 1.0]).collect();
        for iteration in 0..self.iterations as usize {
            let mut change = vec![0.0f64; n];
            for (k, v) in views.iter().enumerate() {
                run.step("fit", iteration * views.len() + k, self.iterations as usize * views.len())?;
                let picture = raster.features(scene, v.view, Features { channels: 2, values: &values })?;
                let (m, opacity): (Vec<f32>, Vec<f32>) = picture.chunks_exact(2).map(|c| (c[0], c[1])).unzip();
                // Pixels with next to nothing in them would only blow up rounding.
                let scale = |p: usize| if opacity[p] > 1e-2 { 1.0 / opacity[p] } else { 0.0 };
                let gradient = adjoint(raster, scene, v.view, &residual(v, &m, scale)?)?;
                change.iter_mut().zip(gradient).for_each(|(c, g)| *c -= g * f64::from(v.times));
            }
            for i in (0..n).filter(|&i| sums.seen(i)) {
                values[2 * i] += (change[i] / (sums.total()[i] as f64 * VOTE_UNIT)) as f32;
            }
        }
        let score: Vec<f32> = values.iter().step_by(2).copied().collect();
        let selection = Selection::from_fn(n, |i| sums.seen(i) && score[i] > 0.5);
        Ok(Aggregated { score, selection, seen: sums.seen_set() })
    }
}
