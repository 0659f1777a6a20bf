//! Asking a method: what it selects for a prompt, and how long that takes.

use std::collections::BTreeMap;
use std::time::Instant;

use splat_core::glam::Vec2;
use splat_core::{Mask2d, SelectMode, Selection, View};
use splat_raster::{Features, Rasterizer, Scene};

use super::bench::{BenchScene, Prompt};
use super::metrics::selection_iou;
use super::score::{EvalMethod, PromptMode};
use super::user::next_click;
use crate::aggregations::MaskedView;
use crate::graph::clicks::ClickState;
use crate::graph::hypotheses::Hypothesis;
use crate::graph::look::Look;
use crate::graph::masks::{MaskCutSettings, outside_in_sight};
use crate::graph::prepared::Prepared;
use crate::project::{Footprint, Lift, lift};
use crate::votes::{ViewVotes, VoteSums};
use crate::{Run, SegmentError};

/// Seconds by stage, in the order in which stages run.
pub(super) type Seconds = Vec<(&'static str, f64)>;

/// What a method selects for a prompt.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    pub(super) selection: Selection,
    pub(super) seconds: Seconds,
}

/// A method with all that it keeps between prompts of one scene.
pub(super) struct Asked<'a> {
    bench: &'a BenchScene,
    scene: Scene,
    method: EvalMethod,
    raster: &'a mut dyn Rasterizer,
    run: &'a Run,
    /// Of the graph alone, with the seconds it took.
    prepared: Option<(Prepared, f64)>,
    /// Views that were clicked in, by camera, with the seconds each took.
    looks: BTreeMap<usize, (Look, f64)>,
}

fn timed<T>(work: impl FnOnce() -> Result<T, SegmentError>) -> Result<(T, f64), SegmentError> {
    let start = Instant::now();
    let result = work()?;
    Ok((result, start.elapsed().as_secs_f64()))
}

/// The middle of a pixel.
fn middle(pixel: [u32; 2]) -> Vec2 {
    Vec2::new(pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5)
}

impl<'a> Asked<'a> {
    /// Prepares the scene if the method needs that.
    pub(super) fn new(
        bench: &'a BenchScene,
        method: EvalMethod,
        raster: &'a mut dyn Rasterizer,
        run: &'a Run,
    ) -> Result<Self, SegmentError> {
        let scene = Scene::of(bench.cloud.clone());
        let prepared = match method {
            EvalMethod::Graph => Some(timed(|| Prepared::new(&scene, &bench.cameras, raster, run))?),
            EvalMethod::Frustum | EvalMethod::Aggregation(_) => None,
        };
        Ok(Self { bench, scene, method, raster, run, prepared, looks: BTreeMap::new() })
    }

    /// The answer to a prompt.
    pub(super) fn answer(&mut self, prompt: &Prompt, mode: PromptMode) -> Result<Answer, SegmentError> {
        let prepare = self.prepared.as_ref().map(|(_, seconds)| ("prepare", *seconds));
        let mut answer = match (mode, self.method) {
            (PromptMode::Click | PromptMode::Best3 | PromptMode::Steps, EvalMethod::Graph) => {
                self.click(prompt, mode)?.0
            }
            (PromptMode::Box, EvalMethod::Graph) => self.boxed(prompt)?,
            (PromptMode::Box, _) => {
                let [x0, y0, x1, y1] = prompt.rectangle;
                let (w, h) = (prompt.mask.width(), prompt.mask.height());
                let filled = Mask2d::from_fn(w, h, |x, y| (x0..=x1).contains(&x) && (y0..=y1).contains(&y));
                self.masked(&[(prompt.camera, &filled)])?
            }
            (PromptMode::Mask, _) => self.masked(&[(prompt.camera, &prompt.mask)])?,
            (PromptMode::Mask3, _) => self.masked(&prompt.masked().collect::<Vec<_>>())?,
            (_, EvalMethod::Frustum | EvalMethod::Aggregation(_)) => {
                return Err(SegmentError::NothingToDo { what: "mask" });
            }
        };
        answer.seconds.splice(0..0, prepare);
        Ok(answer)
    }

    fn prepared(&self) -> Result<&Prepared, SegmentError> {
        self.prepared.as_ref().map(|(p, _)| p).ok_or(SegmentError::NothingToDo { what: "prepared capture" })
    }

    /// Draws a camera's view for clicks unless that is done; gives the seconds it took then.
    fn look(&mut self, camera: usize) -> Result<f64, SegmentError> {
        if let Some((_, seconds)) = self.looks.get(&camera) {
            return Ok(*seconds);
        }
        let Some((prepared, _)) = &self.prepared else {
            return Err(SegmentError::NothingToDo { what: "prepared capture" });
        };
        let view = &self.bench.cameras[camera];
        let (look, seconds) = timed(|| Look::draw(prepared, &self.scene, view, self.raster))?;
        self.looks.insert(camera, (look, seconds));
        Ok(seconds)
    }

    fn iou(&self, selection: &Selection, label: u8) -> f64 {
        selection_iou(selection, &self.bench.labels, &self.bench.weight, label).visible
    }

    /// The answer to a click, and where corrections start from: nowhere if the click hits nothing.
    fn click(&mut self, prompt: &Prompt, mode: PromptMode) -> Result<(Answer, Option<ClickState>), SegmentError> {
        let drawn = self.look(prompt.camera)?;
        let (prepared, look) = (self.prepared()?, &self.looks[&prompt.camera].0);
        let at = middle(prompt.click);
        let start = Instant::now();
        let Some(gaussian) = look.gaussian(at) else {
            let selection = Selection::none(self.scene.len());
            return Ok((Answer { selection, seconds: vec![("first_click", drawn)] }, None));
        };
        let patch = prepared.graph.of[gaussian as usize];
        let found = prepared.hypotheses(look, patch, at);
        let offered: Vec<&Hypothesis> = match mode {
            PromptMode::Steps => &found.wheel[..],
            PromptMode::Click => &found.proposals[..found.proposals.len().min(1)],
            _ => &found.proposals[..],
        }
        .iter()
        .map(|&k| &found.ranked[k])
        .collect();
        // The user waits for the first; the others are looked at when asked for.
        let first = offered.first().map(|h| prepared.gaussians(&h.patches));
        let seconds = drawn + start.elapsed().as_secs_f64();
        let rest = offered.iter().skip(1).map(|h| prepared.gaussians(&h.patches));
        let best = first
            .into_iter()
            .chain(rest)
            .zip(&offered)
            .map(|(selection, h)| (self.iou(&selection, prompt.label), selection, h))
            .reduce(|best, other| if other.0 > best.0 { other } else { best });
        let (selection, state) = match best {
            Some((_, selection, h)) => (selection, Some(ClickState::new(h.patches.clone(), patch))),
            None => (Selection::none(self.scene.len()), None),
        };
        Ok((Answer { selection, seconds: vec![("first_click", seconds)] }, state))
    }

    fn boxed(&mut self, prompt: &Prompt) -> Result<Answer, SegmentError> {
        let drawn = self.look(prompt.camera)?;
        let (prepared, look) = (self.prepared()?, &self.looks[&prompt.camera].0);
        let start = Instant::now();
        let found = prepared.object_in_box(look, prompt.rectangle);
        let selection = match found.first() {
            Some(best) => prepared.gaussians(&best.patches),
            None => Selection::none(self.scene.len()),
        };
        Ok(Answer { selection, seconds: vec![("box", drawn + start.elapsed().as_secs_f64())] })
    }

    /// The answer to masks of some cameras.
    fn masked(&mut self, masks: &[(usize, &Mask2d)]) -> Result<Answer, SegmentError> {
        let views: Vec<MaskedView<'_>> =
            masks.iter().map(|&(camera, mask)| MaskedView::new(&self.bench.cameras[camera], mask)).collect();
        let (scene, raster) = (&self.scene, &mut *self.raster);
        let (selection, seconds) = timed(|| match (self.method, &self.prepared) {
            (EvalMethod::Aggregation(rule), _) => Ok(rule.run(scene, &views, raster, self.run)?.selection),
            (EvalMethod::Graph, Some((prepared, _))) => {
                let mut sums = VoteSums::new(scene.len());
                let mut excluded = Selection::none(scene.len());
                for v in &views {
                    sums.add(&ViewVotes::draw(raster, scene, v.view, v.mask, None)?, 1);
                    excluded.apply(SelectMode::Add, &outside_in_sight(scene, v.view, v.mask, raster)?);
                }
                Ok(prepared.object_from_votes(&sums, Some(&excluded), &MaskCutSettings::default()))
            }
            _ => {
                // What all masks have in their sweep.
                let mut inside = Selection::all(scene.len());
                for v in &views {
                    let swept = lift(raster, scene, v.view, v.mask, Lift::Frustum(Footprint::Center))?;
                    inside.apply(SelectMode::Intersect, &swept);
                }
                Ok(inside)
            }
        })?;
        Ok(Answer { selection, seconds: vec![("masks", seconds)] })
    }

    /// IoU after 1 to `clicks` clicks of the scripted user, the first being the best of the proposals, and the mean seconds
    /// of a further one if there was any.
    pub(super) fn clicks(&mut self, prompt: &Prompt, clicks: u32) -> Result<(Vec<f64>, Option<f64>), SegmentError> {
        let (answer, state) = self.click(prompt, PromptMode::Best3)?;
        let mut curve = vec![self.iou(&answer.selection, prompt.label)];
        let mut selection = answer.selection;
        let mut state = state.unwrap_or_else(|| ClickState {
            patches: Selection::none(self.prepared.as_ref().map_or(0, |(p, _)| p.patch_count())),
            ..ClickState::default()
        });
        let (mut total, mut given) = (0.0, 0u32);
        for _ in 1..clicks {
            let views: Vec<(usize, &Mask2d)> = prompt.masked().collect();
            let mut shown = Vec::with_capacity(views.len());
            for &(camera, _) in &views {
                shown.push(silhouette(self.raster, &self.scene, &self.bench.cameras[camera], &selection)?);
            }
            let pairs: Vec<(&Mask2d, &Mask2d)> = views.iter().map(|&(_, wanted)| wanted).zip(&shown).collect();
            // Nothing left to correct: further clicks would change nothing.
            if let Some(click) = next_click(&pairs) {
                let camera = views[click.view].0;
                // A user sees the view before clicking in it: drawing it is not part of the answer.
                self.look(camera)?;
                let (prepared, look) = (self.prepared()?, &self.looks[&camera].0);
                let start = Instant::now();
                state.correct(prepared, look, middle(click.pixel), click.kind);
                selection = state.selection(prepared);
                total += start.elapsed().as_secs_f64();
                given += 1;
            }
            curve.push(self.iou(&selection, prompt.label));
        }
        Ok((curve, (given > 0).then(|| total / f64::from(given))))
    }
}

/// Where a selection has more than half of the weight of a pixel, drawn with everything in front of it.
fn silhouette(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    view: &View,
    selection: &Selection,
) -> Result<Mask2d, SegmentError> {
    let values: Vec<f32> = (0..scene.len()).map(|i| if selection.contains(i) { 1.0 } else { 0.0 }).collect();
    let weight = raster.features(scene, view, Features { channels: 1, values: &values })?;
    let inside = weight.iter().map(|&w| if w > 0.5 { 255 } else { 0 }).collect();
    Ok(Mask2d::new(view.width, view.height, inside)?)
}
