//! From a [`Task`] to a selection.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;
use splat_core::glam::Vec2;
use splat_core::{Mask2d, SelectMode, Selection, View};
use splat_raster::Scene;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::boundary::silhouettes;
use splat_segment::graph::clicks::{ClickKind, ClickState};
use splat_segment::graph::hypotheses::{Hypotheses, Hypothesis};
use splat_segment::graph::look::Look;
use splat_segment::graph::masks::{MaskCutSettings, outside_in_sight};
use splat_segment::graph::prepared::Prepared;
use splat_segment::presegment::{GuardSettings, PresegmentSettings};
use splat_segment::trackers::TRACKERS;
use splat_segment::views::{PlanKind, TurnaroundSettings, evenly_spaced, turnaround};
use splat_segment::votes::{ViewVotes, VoteSums};
use splat_segment::{Occlusion, Presegmentation, Run, SegmentSettings, Segmentation};

use super::task::{Granularity, Method, Prompt, Shape, Task};
use crate::failure::Failure;

/// A larger thing has at least this many times the object's mass, a part at most this share of it.
const GROUP_MASS: f32 = 1.6;
const PART_MASS: f32 = 0.6;
/// A further point of a stroke is taken every so many pixels.
const STROKE_STEP: f32 = 12.0;

/// What came out.
#[derive(Debug)]
pub(crate) struct Answer {
    /// The object.
    pub(crate) selection: Selection,
    /// What the first click or the box may mean; none for masks.
    pub(crate) offers: Offers,
    /// Things the user should know.
    pub(crate) notes: Vec<String>,
    /// The looks that were drawn, by position in [`Task::views`].
    pub(crate) looks: BTreeMap<usize, Look>,
    /// When the first selection was there, before any correction.
    pub(crate) first: Instant,
}

/// What a first prompt may mean.
#[derive(Debug, Default)]
pub(crate) struct Offers {
    /// Best first.
    pub(crate) proposals: Vec<Offer>,
    /// The granularity wheel, from part to group.
    pub(crate) wheel: Vec<Offer>,
}

/// One thing that may be meant.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Offer {
    /// Gaussians in it.
    pub(crate) gaussians: usize,
    /// Pixels of the preparation's pictures that show it.
    pub(crate) pixels: f32,
    /// Comparable within one prompt only; higher is better.
    pub(crate) score: f32,
    /// Whether this one was taken, before corrections.
    pub(crate) taken: bool,
    #[serde(skip)]
    pub(crate) patches: Selection,
}

/// Answers a task over a capture taken apart.
///
/// # Errors
/// [`Failure::Failed`] in one sentence if a prompt points at nothing or nothing comes out.
pub(crate) fn solve(
    task: &Task,
    scene: &Scene,
    prepared: &Prepared,
    raster: &mut CpuRasterizer,
    run: &Run,
) -> Result<Answer, Failure> {
    task.check()?;
    let mut solver = Solver { task, scene, prepared, raster, run, looks: BTreeMap::new(), notes: Vec::new() };
    for prompt in &task.prompts {
        if !matches!(prompt.shape, Shape::Mask(_)) {
            solver.look(prompt.view)?;
        }
    }
    let (mut state, offers, started_by) = solver.start()?;
    let first = Instant::now();
    for (k, prompt) in task.prompts.iter().enumerate() {
        if started_by != Some(k) {
            solver.correct(&mut state, prompt)?;
        }
    }
    let mut selection = state.selection(prepared);
    if !task.has_mask() && (task.settings.dense_views > 0 || task.settings.method == Method::Votes) {
        // The road of masks, from the picture of what the clicks chose.
        let silhouette = silhouettes(solver.raster, scene, &selection, &task.views[..1], run)?;
        let masks: Vec<(&View, &Mask2d)> = task.views.iter().zip(&silhouette).collect();
        selection = solver.by_masks(&masks)?;
    }
    if selection.count() == 0 {
        return Err(Failure::failed(
            "nothing is left of the object; take a negative click back, or point at it in another view",
        ));
    }
    Ok(Answer { selection, offers, notes: solver.notes, looks: solver.looks, first })
}

struct Solver<'a> {
    task: &'a Task,
    scene: &'a Scene,
    prepared: &'a Prepared,
    raster: &'a mut CpuRasterizer,
    run: &'a Run,
    looks: BTreeMap<usize, Look>,
    notes: Vec<String>,
}

impl Solver<'_> {
    fn look(&mut self, view: usize) -> Result<(), Failure> {
        if !self.looks.contains_key(&view) {
            let look = Look::draw(self.prepared, self.scene, &self.task.views[view], self.raster)?;
            self.looks.insert(view, look);
        }
        Ok(())
    }

    /// The first selection, what else was offered, and the prompt that is answered by it.
    fn start(&mut self) -> Result<(ClickState, Offers, Option<usize>), Failure> {
        if self.task.has_mask() {
            let task = self.task;
            let masks: Vec<(&View, &Mask2d)> = (task.prompts.iter())
                .filter_map(|p| match &p.shape {
                    Shape::Mask(mask) => Some((&task.views[p.view], mask)),
                    _ => None,
                })
                .collect();
            let selection = self.by_masks(&masks)?;
            return Ok((state_of(self.prepared, &selection), Offers::default(), None));
        }
        let boxed = self.task.prompts.iter().position(|p| matches!(p.shape, Shape::Box(_)));
        let starts = |p: &Prompt| matches!(p.shape, Shape::Click(_, ClickKind::Positive) | Shape::Scribble(_));
        let Some(k) = boxed.or_else(|| self.task.prompts.iter().position(starts)) else {
            return Err(Failure::failed("nothing says what is wanted; point at it by --click X,Y"));
        };
        let prompt = &self.task.prompts[k];
        let look = &self.looks[&prompt.view];
        let (found, patch) = match &prompt.shape {
            Shape::Box(rectangle) => {
                let ranked = self.prepared.object_in_box(look, *rectangle);
                let wheel = in_steps(&ranked);
                let proposals = (0..ranked.len().min(3)).collect();
                (Hypotheses { ranked, proposals, wheel }, None)
            }
            Shape::Click(at, _) => self.at(look, *at)?,
            Shape::Scribble(points) => self.at(look, points[0])?,
            Shape::Mask(_) => (Hypotheses::default(), None),
        };
        let Some(taken) = self.choose(&found)? else {
            return Err(Failure::failed(
                "the box shows nothing of the capture; draw it around something in the picture",
            ));
        };
        let offer = |&n: &usize| self.offer(&found.ranked[n], n == taken);
        let offers = Offers {
            proposals: found.proposals.iter().map(offer).collect(),
            wheel: found.wheel.iter().map(offer).collect(),
        };
        let patches = found.ranked[taken].patches.clone();
        let state = match patch {
            Some(patch) => ClickState::new(patches, patch),
            None => ClickState { patches, ..ClickState::default() },
        };
        // The rest of a stroke still counts.
        let answered = !matches!(prompt.shape, Shape::Scribble(_));
        Ok((state, offers, answered.then_some(k)))
    }

    fn at(&self, look: &Look, at: Vec2) -> Result<(Hypotheses, Option<u32>), Failure> {
        let gaussian = look.gaussian(at).ok_or_else(|| nothing_at(at))?;
        let patch = self.prepared.graph.of[gaussian as usize];
        Ok((self.prepared.hypotheses(look, patch, at), Some(patch)))
    }

    /// Position of what the settings ask for; `None` if there is nothing at all.
    fn choose(&mut self, found: &Hypotheses) -> Result<Option<usize>, Failure> {
        if let Some(step) = self.task.settings.step {
            return match found.wheel.get(step.wrapping_sub(1)) {
                Some(&n) => Ok(Some(n)),
                None => Err(Failure::failed(format!(
                    "the granularity wheel has {} steps here, there is no step {step}; step 1 is the smallest part",
                    found.wheel.len()
                ))),
            };
        }
        let Some(&object) = found.proposals.first() else { return Ok(None) };
        let mass = found.ranked[object].mass;
        let fits = |h: &Hypothesis| match self.task.settings.granularity {
            Granularity::Object => false,
            Granularity::Part => h.mass < PART_MASS * mass,
            Granularity::Group => h.mass > GROUP_MASS * mass,
        };
        let other = found.ranked.iter().position(fits);
        if other.is_none() && self.task.settings.granularity != Granularity::Object {
            self.notes
                .push("the capture offers nothing of that granularity here; the object itself was taken".to_owned());
        }
        Ok(Some(other.unwrap_or(object)))
    }

    fn offer(&self, h: &Hypothesis, taken: bool) -> Offer {
        let gaussians = h.patches.iter().map(|p| self.prepared.graph.patches[p].count as usize).sum();
        Offer { gaussians, pixels: h.mass.round(), score: h.score, taken, patches: h.patches.clone() }
    }

    fn correct(&mut self, state: &mut ClickState, prompt: &Prompt) -> Result<(), Failure> {
        let Some(look) = self.looks.get(&prompt.view) else { return Ok(()) };
        match &prompt.shape {
            Shape::Click(at, kind) => {
                look.gaussian(*at).ok_or_else(|| nothing_at(*at))?;
                state.correct(self.prepared, look, *at, *kind);
            }
            Shape::Scribble(points) => {
                for at in along(points) {
                    let Some(gaussian) = look.gaussian(at) else { continue };
                    if !state.selection(self.prepared).contains(gaussian as usize) {
                        state.correct(self.prepared, look, at, ClickKind::Positive);
                    }
                }
            }
            Shape::Box(_) | Shape::Mask(_) => {}
        }
        Ok(())
    }

    /// What masks say, through dense views if the settings ask for them.
    fn by_masks(&mut self, masks: &[(&View, &Mask2d)]) -> Result<Selection, Failure> {
        let s = &self.task.settings;
        let mut sums = VoteSums::new(self.scene.len());
        let mut excluded = None;
        if s.dense_views > 0 {
            let mut segmentation = self.segmentation(masks)?;
            if let Some(report) = segmentation.track(TRACKERS[0], self.raster, self.run)?
                && segmentation.presegment()?.is_none()
            {
                self.notes.push(format!(
                        "the masks leave out something that other views show as the object ({:?}); nothing was ruled out by them",
                        report.verdict
                    ));
            }
            if s.method == Method::Votes {
                return Ok(segmentation.result(self.raster, self.run)?.selection);
            }
            sums = segmentation.update(self.raster, self.run)?.clone();
        } else {
            for (done, (view, mask)) in masks.iter().enumerate() {
                self.run.step("votes", done, masks.len())?;
                sums.add(&ViewVotes::draw(self.raster, self.scene, view, mask, None)?, 1);
            }
        }
        if s.presegment {
            let mut out = Selection::none(self.scene.len());
            for (view, mask) in masks {
                out.apply(SelectMode::Add, &outside_in_sight(self.scene, view, mask, self.raster)?);
            }
            excluded = Some(out);
        }
        if s.method == Method::Votes {
            let mut selection = sums.above(s.theta);
            if let Some(excluded) = &excluded {
                selection.apply(SelectMode::Subtract, excluded);
            }
            return Ok(selection);
        }
        Ok(self.prepared.object_from_votes(&sums, excluded.as_ref(), &MaskCutSettings::default()))
    }

    /// The masks as annotations, with dense views: of the training cameras where there are any, else around the object.
    fn segmentation(&mut self, masks: &[(&View, &Mask2d)]) -> Result<Segmentation, Failure> {
        let s = &self.task.settings;
        let mut settings = SegmentSettings { theta: s.theta, plan: PlanKind::Unordered, ..SegmentSettings::default() };
        settings.presegmentation = if s.presegment {
            Presegmentation::On(PresegmentSettings::default(), GuardSettings::default())
        } else {
            Presegmentation::Off
        };
        let views: Vec<View> = if self.task.survey_given {
            let chosen = evenly_spaced(self.task.survey.len(), s.dense_views);
            chosen.into_iter().map(|k| self.task.survey[k]).collect()
        } else {
            settings.plan = PlanKind::Ring;
            let (view, mask) = masks[0];
            let round = TurnaroundSettings { count: s.dense_views, ..TurnaroundSettings::default() };
            turnaround(self.raster, self.scene, view, mask, &round, self.run)?.views
        };
        let mut segmentation = Segmentation::new(Arc::new(self.scene.clone()), settings);
        for (view, mask) in masks {
            segmentation.annotate(**view, (*mask).clone(), Occlusion::Unoccluded)?;
        }
        segmentation.set_views(views);
        Ok(segmentation)
    }
}

fn nothing_at(at: Vec2) -> Failure {
    Failure::failed(format!(
        "there is nothing at {},{} in this view; click on something that `splat render` shows there",
        at.x.floor(),
        at.y.floor()
    ))
}

/// From part to group, each step clearly larger.
fn in_steps(ranked: &[Hypothesis]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..ranked.len()).collect();
    order.sort_by(|&a, &b| ranked[a].mass.total_cmp(&ranked[b].mass).then(a.cmp(&b)));
    order.truncate(12);
    order
}

/// Whole patches where most of one is selected, single Gaussians where they differ from their patch.
fn state_of(prepared: &Prepared, selection: &Selection) -> ClickState {
    let mut inside = vec![0u32; prepared.patch_count()];
    for i in selection.iter() {
        inside[prepared.graph.of[i] as usize] += 1;
    }
    let patches =
        Selection::from_fn(inside.len(), |p| 2 * u64::from(inside[p]) > u64::from(prepared.graph.patches[p].count));
    let single = (prepared.graph.of.iter().enumerate())
        .map(|(i, &p)| (i, p, selection.contains(i)))
        .filter(|&(_, p, is_in)| patches.contains(p as usize) != is_in)
        .map(|(i, _, is_in)| (i as u32, is_in))
        .collect();
    ClickState { patches, single, settled: Vec::new() }
}

/// Points along a stroke, evenly spaced.
fn along(points: &[Vec2]) -> Vec<Vec2> {
    let mut out: Vec<Vec2> = points.first().copied().into_iter().collect();
    for pair in points.windows(2) {
        let steps = (pair[0].distance(pair[1]) / STROKE_STEP).ceil().max(1.0) as usize;
        out.extend((1..=steps).map(|k| pair[0].lerp(pair[1], k as f32 / steps as f32)));
    }
    out
}
