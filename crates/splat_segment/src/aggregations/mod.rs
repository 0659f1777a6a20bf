//! Aggregations: rules that turn the masks of many views into a score per Gaussian and a selection.
//!
//! Votes with a threshold ([`VoteShare`]) are what the toolkit uses. The paper's optimisation and the rules of the field
//! are here to be compared with it on the same masks. To add one: a file with `impl Aggregation`, a line in
//! [`AGGREGATIONS`].
//!
//! Nearly all need the same two numbers per Gaussian and view ([`ViewVotes`]) and implement [`Aggregation::decide`] alone;
//! those that compare pictures implement [`Aggregation::run`].

mod adjoint;
mod gradient;
mod rules;
mod sirt;

pub use adjoint::adjoint;
pub use gradient::{GradientLoop, OneStepL1};
pub use rules::{BetaBernoulli, FlashSplat, ViewShare, VoteShare};
pub use sirt::Sirt;

use splat_core::{Mask2d, Selection, View};
use splat_raster::{Rasterizer, Scene};

use crate::votes::{ViewVotes, VoteSums};
use crate::{Run, SegmentError};

/// A mask of a view, as evidence.
#[derive(Clone, Copy, Debug)]
pub struct MaskedView<'a> {
    /// What the mask was made for.
    pub view: &'a View,
    /// Soft mask of the view's size.
    pub mask: &'a Mask2d,
    /// How much each pixel counts, 0..=255; `None` counts all fully.
    pub weight: Option<&'a Mask2d>,
    /// How many times the mask counts, 1 by convention.
    pub times: u32,
}

impl<'a> MaskedView<'a> {
    /// A mask that counts once and everywhere.
    pub fn new(view: &'a View, mask: &'a Mask2d) -> Self {
        Self { view, mask, weight: None, times: 1 }
    }

    /// Its votes: one frame.
    ///
    /// # Errors
    /// As [`ViewVotes::draw`].
    pub fn votes(&self, raster: &mut dyn Rasterizer, scene: &Scene) -> Result<ViewVotes, SegmentError> {
        ViewVotes::draw(raster, scene, self.view, self.mask, self.weight)
    }
}

/// Votes of a mask with what else a rule may need.
#[derive(Clone, Copy, Debug)]
pub struct VotedView<'a> {
    /// The votes.
    pub votes: &'a ViewVotes,
    /// How many times they count.
    pub times: u32,
    /// Pixels of the view.
    pub pixels: u64,
}

/// What an aggregation says.
#[derive(Clone, Debug, PartialEq)]
pub struct Aggregated {
    /// One score per Gaussian; higher is more likely inside. Range and meaning are the rule's.
    pub score: Vec<f32>,
    /// Gaussians the rule takes as inside.
    pub selection: Selection,
    /// Gaussians that some mask says something about; the others are unknown, not outside.
    pub seen: Selection,
}

/// A rule from masks to a selection.
pub trait Aggregation: Sync {
    /// Short name, as in the program's options.
    fn name(&self) -> &'static str;

    /// One sentence for people who choose among rules.
    fn description(&self) -> &'static str;

    /// Where the rule comes from.
    fn source(&self) -> &'static str;

    /// The answer where votes alone decide; `None` for a rule that has to look at pictures.
    ///
    /// `count`: Gaussians of the scene.
    fn decide(&self, count: usize, views: &[VotedView<'_>]) -> Option<Aggregated>;

    /// The answer for these masks.
    ///
    /// # Errors
    /// [`SegmentError::NothingToDo`] without masks, [`SegmentError::Cancelled`], [`SegmentError::Raster`].
    fn run(
        &self,
        scene: &Scene,
        views: &[MaskedView<'_>],
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<Aggregated, SegmentError> {
        let votes = draw_all(scene, views, raster, run)?;
        let voted = voted(views, &votes);
        self.decide(scene.len(), &voted).ok_or(SegmentError::NothingToDo { what: "rule for votes" })
    }
}

/// All rules; the first is the default.
pub static AGGREGATIONS: &[&dyn Aggregation] = &[
    &VoteShare { theta: 0.5 },
    &GradientLoop { epochs: 1, learning_rate: 0.1, start: 0.5 },
    &OneStepL1 { start: 0.48, learning_rate: 0.1 },
    &FlashSplat { slackness: 0.0 },
    &Sirt { iterations: 10 },
    &BetaBernoulli { prior: (1.0, 1.0) },
    &ViewShare { theta: 0.5 },
];

/// A rule by its name.
pub fn aggregation(name: &str) -> Option<&'static dyn Aggregation> {
    AGGREGATIONS.iter().copied().find(|a| a.name() == name)
}

/// Votes of every mask.
fn draw_all(
    scene: &Scene,
    views: &[MaskedView<'_>],
    raster: &mut dyn Rasterizer,
    run: &Run,
) -> Result<Vec<ViewVotes>, SegmentError> {
    if views.is_empty() {
        return Err(SegmentError::NothingToDo { what: "mask" });
    }
    let mut votes = Vec::with_capacity(views.len());
    for (done, view) in views.iter().enumerate() {
        run.step("votes", done, views.len())?;
        votes.push(view.votes(raster, scene)?);
    }
    Ok(votes)
}

fn voted<'a>(views: &[MaskedView<'_>], votes: &'a [ViewVotes]) -> Vec<VotedView<'a>> {
    let pixels = |v: &View| u64::from(v.width) * u64::from(v.height);
    views.iter().zip(votes).map(|(v, votes)| VotedView { votes, times: v.times, pixels: pixels(v.view) }).collect()
}

fn sums(count: usize, views: &[VotedView<'_>]) -> VoteSums {
    let mut sums = VoteSums::new(count);
    for v in views {
        sums.add(v.votes, v.times);
    }
    sums
}
