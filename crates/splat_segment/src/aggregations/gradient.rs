//! The paper's aggregation by optimisation, as printed and as released.

use splat_core::{Mask2d, Selection};
use splat_raster::{Features, Rasterizer, Scene};

use super::{Aggregated, Aggregation, MaskedView, VotedView, adjoint};
use crate::votes::SEEN_TOTAL;
use crate::{Run, SegmentError};

/// The fit the paper prints (section 4.4.3): one channel M per Gaussian, a loop over the views with an L2 loss between
/// masks and `features(M)`, selected iff `M > 0.5`.
///
/// Uses a [`Rasterizer`] through `features` and `votes` (its adjoint) only. The paper names no optimiser; this is Adam with
/// its usual constants (0.9, 0.999). Score: M, about 0..=1; where no view has weight it stays at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientLoop {
    /// Rounds over all views, 1 in the paper.
    pub epochs: u32,
    /// Adam's step.
    pub learning_rate: f32,
    /// M before the first view.
    pub start: f32,
}

impl Aggregation for GradientLoop {
    fn name(&self) -> &'static str {
        "gradient"
    }

    fn description(&self) -> &'static str {
        "optimises one channel per Gaussian against the masks, one Adam step per view"
    }

    fn source(&self) -> &'static str {
        "ArtisanGS (arXiv 2602.10173), section 4.4.3, as printed"
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
        if views.is_empty() {
            return Err(SegmentError::NothingToDo { what: "mask" });
        }
        const DECAY: (f64, f64) = (0.9, 0.999);
        let n = scene.len();
        let mut m = vec![self.start; n];
        let (mut first, mut second) = (vec![0.0f64; n], vec![0.0f64; n]);
        let mut seen = vec![false; n];
        let total = self.epochs as usize * views.len();
        for step in 0..total {
            run.step("fit", step, total)?;
            let v = &views[step % views.len()];
            let picture = raster.features(scene, v.view, Features { channels: 1, values: &m })?;
            let gradient = adjoint(raster, scene, v.view, &residual(v, &picture, |_| 1.0)?)?;
            let correct = |decay: f64| 1.0 - decay.powi(step as i32 + 1);
            for i in 0..n {
                let g = gradient[i] * f64::from(v.times);
                seen[i] |= g != 0.0;
                first[i] = DECAY.0 * first[i] + (1.0 - DECAY.0) * g;
                second[i] = DECAY.1 * second[i] + (1.0 - DECAY.1) * g * g;
                let step = first[i] / correct(DECAY.0) / ((second[i] / correct(DECAY.1)).sqrt() + 1e-8);
                m[i] -= self.learning_rate * step as f32;
            }
        }
        let selection = Selection::from_fn(n, |i| m[i] > 0.5);
        Ok(Aggregated { score: m, selection, seen: Selection::from_fn(n, |i| seen[i]) })
    }
}

/// `(picture - mask) * weight / scale(pixel)` per pixel.
pub(super) fn residual(
    v: &MaskedView<'_>,
    picture: &[f32],
    scale: impl Fn(usize) -> f32,
) -> Result<Vec<f32>, SegmentError> {
    crate::project::check_size(v.view, v.mask)?;
    if let Some(weight) = v.weight {
        crate::project::check_size(v.view, weight)?;
    }
    Ok((0..picture.len())
        .map(|k| {
            let g = v.weight.map_or(1.0, |w| f32::from(w.values()[k]) / 255.0);
            (picture[k] - f32::from(v.mask.values()[k]) / 255.0) * g * scale(k)
        })
        .collect())
}

/// The fit as released: one Adam step on an L1 loss summed over all views, from 0.48.
///
/// Adam's first step is the gradient's sign: `M_i = start + rate * sign(F_i - B_i)`, with F_i and B_i the weight inside and
/// outside the masks, every view divided by its pixels. So: selected iff `F_i > B_i`. Masks are taken as hard here, as there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneStepL1 {
    /// M before the step.
    pub start: f32,
    /// Adam's step.
    pub learning_rate: f32,
}

impl Aggregation for OneStepL1 {
    fn name(&self) -> &'static str {
        "one-step"
    }

    fn description(&self) -> &'static str {
        "sign of the weight inside minus outside, every view divided by its pixels"
    }

    fn source(&self) -> &'static str {
        "the released implementation of ArtisanGS: one Adam step on a summed L1 loss"
    }

    fn decide(&self, count: usize, views: &[VotedView<'_>]) -> Option<Aggregated> {
        let mut balance = vec![0.0f64; count];
        let mut total = vec![0u64; count];
        for view in views {
            let scale = f64::from(view.times) / view.pixels.max(1) as f64;
            for (i, inside, all) in view.votes.iter() {
                balance[i as usize] += (2.0 * inside as f64 - all as f64) * scale;
                total[i as usize] += all;
            }
        }
        let score = balance.iter().map(|&b| {
            let sign = if b > 0.0 {
                1.0
            } else if b < 0.0 {
                -1.0
            } else {
                0.0
            };
            self.start + self.learning_rate * sign
        });
        Some(Aggregated {
            score: score.collect(),
            selection: Selection::from_fn(count, |i| balance[i] > 0.0),
            seen: Selection::from_fn(count, |i| total[i] >= SEEN_TOTAL),
        })
    }

    fn run(
        &self,
        scene: &Scene,
        views: &[MaskedView<'_>],
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<Aggregated, SegmentError> {
        let hard: Vec<Mask2d> = views
            .iter()
            .map(|v| Mask2d::from_fn(v.mask.width(), v.mask.height(), |x, y| v.mask.contains(x, y)))
            .collect();
        let views: Vec<MaskedView<'_>> = views.iter().zip(&hard).map(|(v, mask)| MaskedView { mask, ..*v }).collect();
        let votes = super::draw_all(scene, &views, raster, run)?;
        let voted = super::voted(&views, &votes);
        self.decide(scene.len(), &voted).ok_or(SegmentError::NothingToDo { what: "rule for votes" })
    }
}
