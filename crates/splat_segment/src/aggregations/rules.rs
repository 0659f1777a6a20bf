//! Rules that need votes alone.

use splat_core::Selection;
use splat_raster::VOTE_UNIT;

use super::{Aggregated, Aggregation, VotedView, sums};
use crate::votes::{SEEN_TOTAL, VoteSums};

/// Share of a Gaussian's weight that falls into masks, above a threshold.
///
/// `r_i = sum_v sum_p w_i m / sum_v sum_p w_i`, selected iff `r_i > theta`. Score: `r_i`, 0..=1, 0 where unseen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoteShare {
    /// Threshold on the share, 0..=1, 0.5 by convention.
    pub theta: f32,
}

impl VoteShare {
    /// The answer for sums that are already there.
    pub fn decide_sums(&self, sums: &VoteSums) -> Aggregated {
        Aggregated {
            score: (0..sums.len()).map(|i| sums.score(i).unwrap_or(0.0)).collect(),
            selection: sums.above(self.theta),
            seen: sums.seen_set(),
        }
    }
}

impl Aggregation for VoteShare {
    fn name(&self) -> &'static str {
        "votes"
    }

    fn description(&self) -> &'static str {
        "share of a Gaussian's blending weight inside the masks, above theta"
    }

    fn source(&self) -> &'static str {
        "the linear form behind the paper's fit (where pictures are opaque, one gradient step from 0.5 decides alike)"
    }

    fn decide(&self, count: usize, views: &[VotedView<'_>]) -> Option<Aggregated> {
        Some(self.decide_sums(&sums(count, views)))
    }
}

/// The closed form of FlashSplat for one object against the rest.
///
/// The pair (rest, object) of vote sums is divided by its L2 norm; selected iff `object > rest + slackness`.
/// Score: `0.5 + 0.5 (object - rest)`, 0..=1; 0 slackness is the plain majority.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlashSplat {
    /// Added to the rest, -1..=1: negative takes more in, positive less (the method's background bias).
    pub slackness: f32,
}

impl Aggregation for FlashSplat {
    fn name(&self) -> &'static str {
        "flashsplat"
    }

    fn description(&self) -> &'static str {
        "normalised pair of inside and outside weight with a slackness in favour of either"
    }

    fn source(&self) -> &'static str {
        "FlashSplat (Shen, Yang and Wang, ECCV 2024), its optimal assignment with background bias"
    }

    fn decide(&self, count: usize, views: &[VotedView<'_>]) -> Option<Aggregated> {
        let sums = sums(count, views);
        let gap = |i: usize| {
            let object = sums.inside()[i] as f64;
            let rest = sums.total()[i] as f64 - object;
            (object - rest) / object.hypot(rest)
        };
        let selected = |i: usize| sums.seen(i) && gap(i) > f64::from(self.slackness);
        Some(Aggregated {
            score: (0..count).map(|i| if sums.seen(i) { (0.5 + 0.5 * gap(i)) as f32 } else { 0.0 }).collect(),
            selection: Selection::from_fn(count, selected),
            seen: sums.seen_set(),
        })
    }
}

/// Posterior mean of a Beta distribution: `(a + in) / (a + b + total)`, in pixels of blending weight.
///
/// Little evidence stays near the prior. Selected iff above 1/2. Score: the mean, 0..=1; the prior's where unseen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BetaBernoulli {
    /// Pseudo counts (inside, outside), in pixels; (1, 1) by convention.
    pub prior: (f64, f64),
}

impl Aggregation for BetaBernoulli {
    fn name(&self) -> &'static str {
        "beta"
    }

    fn description(&self) -> &'static str {
        "posterior of being inside after counting weight in and out, with a prior that little evidence cannot move far"
    }

    fn source(&self) -> &'static str {
        "B3-Seg (2026), its Beta-Bernoulli update, over all views instead of its greedy choice"
    }

    fn decide(&self, count: usize, views: &[VotedView<'_>]) -> Option<Aggregated> {
        let sums = sums(count, views);
        let mean = |i: usize| {
            let (inside, total) = (sums.inside()[i] as f64 * VOTE_UNIT, sums.total()[i] as f64 * VOTE_UNIT);
            (self.prior.0 + inside) / (self.prior.0 + self.prior.1 + total)
        };
        Some(Aggregated {
            score: (0..count).map(|i| mean(i) as f32).collect(),
            selection: Selection::from_fn(count, |i| sums.seen(i) && mean(i) > 0.5),
            seen: sums.seen_set(),
        })
    }
}

/// Share of the views that see a Gaussian in which most of what is seen of it is inside.
///
/// Counts views, not pixels: a near view weighs as much as a far one. Score: the share, 0..=1, 0 where unseen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewShare {
    /// Least share of views, 0..=1, 0.5 by convention.
    pub theta: f32,
}

impl Aggregation for ViewShare {
    fn name(&self) -> &'static str {
        "views"
    }

    fn description(&self) -> &'static str {
        "share of the views seeing a Gaussian that have most of it inside their mask"
    }

    fn source(&self) -> &'static str {
        "VCAR (2026), its visibility-aware view vote (foreground views over visible views)"
    }

    fn decide(&self, count: usize, views: &[VotedView<'_>]) -> Option<Aggregated> {
        let (mut inside, mut visible) = (vec![0u32; count], vec![0u32; count]);
        for view in views {
            for (i, a, total) in view.votes.iter().filter(|&(_, _, total)| total >= SEEN_TOTAL) {
                visible[i as usize] += view.times;
                inside[i as usize] += if 2 * a > total { view.times } else { 0 };
            }
        }
        let share = |i: usize| f64::from(inside[i]) / f64::from(visible[i].max(1));
        Some(Aggregated {
            score: (0..count).map(|i| share(i) as f32).collect(),
            selection: Selection::from_fn(count, |i| visible[i] > 0 && share(i) >= f64::from(self.theta)),
            seen: Selection::from_fn(count, |i| visible[i] > 0),
        })
    }
}
