//! [`evaluate`]: a method's answers to all prompts of a scene, scored.

use std::fmt;

use splat_core::{Mask2d, Selection};
use splat_raster::{Features, Rasterizer, Scene};

use super::answer::{Asked, Seconds};
use super::bench::{BenchScene, LabelMap};
use super::metrics::{boundary_iou, mask_iou, selection_iou};
use crate::aggregations::{AGGREGATIONS, Aggregation, aggregation};
use crate::{Run, SegmentError};

/// What is evaluated.
#[derive(Clone, Copy)]
pub enum EvalMethod {
    /// The capture's own structure ([`crate::graph`]): answers every prompt.
    Graph,
    /// Means inside the masks ([`crate::project`]): answers boxes and masks.
    Frustum,
    /// A rule over the masks alone ([`crate::aggregations`]): answers boxes and masks.
    Aggregation(&'static dyn Aggregation),
}

impl EvalMethod {
    /// Its name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Graph => "graph",
            Self::Frustum => "frustum",
            Self::Aggregation(rule) => rule.name(),
        }
    }

    /// The method of a name.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "graph" => Some(Self::Graph),
            "frustum" => Some(Self::Frustum),
            _ => aggregation(name).map(Self::Aggregation),
        }
    }

    /// All names.
    pub fn names() -> impl Iterator<Item = &'static str> {
        ["graph", "frustum"].into_iter().chain(AGGREGATIONS.iter().map(|a| a.name()))
    }

    /// Whether it has an answer to this kind of prompt.
    pub fn answers(self, prompt: PromptMode) -> bool {
        matches!(self, Self::Graph) || matches!(prompt, PromptMode::Box | PromptMode::Mask | PromptMode::Mask3)
    }
}

impl fmt::Debug for EvalMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What a method is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PromptMode {
    /// One click; the first proposal counts.
    Click,
    /// One click; the best of the three proposals counts.
    Best3,
    /// One click; the best step of the granularity wheel counts.
    Steps,
    /// A box around the object.
    Box,
    /// The prompt's mask.
    Mask,
    /// The prompt's mask and those of its two corrections.
    Mask3,
}

impl PromptMode {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Click, Self::Best3, Self::Steps, Self::Box, Self::Mask, Self::Mask3];

    /// Its name in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Click => "click",
            Self::Best3 => "best3",
            Self::Steps => "steps",
            Self::Box => "box",
            Self::Mask => "mask",
            Self::Mask3 => "mask3",
        }
    }
}

/// What [`evaluate`] asks.
#[derive(Clone, Copy, Debug)]
pub struct EvalSettings {
    /// Who answers.
    pub method: EvalMethod,
    /// What the answers are given for.
    pub prompt: PromptMode,
    /// Length of the scripted user's curve, its start included; 0 for none.
    pub clicks: u32,
}

/// One point of the scripted user's curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClickScore {
    /// Clicks given; 1 is the best of the three proposals of the first.
    pub n: u32,
    /// As [`ObjectScore::iou_visible`].
    pub iou_visible: f64,
}

/// Scores of the answer to one prompt, all 0..=1.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectScore {
    /// The object.
    pub label: u8,
    /// Its name.
    pub name: String,
    /// IoU over visible Gaussians.
    pub iou_visible: f64,
    /// The same, each counting its blending weight.
    pub iou_weighted: f64,
    /// IoU of the silhouette (more than half of a pixel's weight, the whole scene drawn) with the label map, pixels that are
    /// not scored left out; mean over the held-back views that show enough of the object, `None` without such a view.
    pub iou_2d: Option<f64>,
    /// Boundary IoU of the same masks.
    pub boundary_iou_2d: Option<f64>,
    /// How much of the object is still to be seen when the answer is taken out of the scene: blending weight of
    /// the object's own Gaussians that are left, per pixel of the object in the label map; mean over the same views. 0 is a
    /// clean removal, about 1 if nothing was removed.
    pub removal_residual: Option<f64>,
    /// The scripted user's curve; empty if not asked for.
    pub clicks: Vec<ClickScore>,
    /// Wall-clock seconds by stage, in the order in which they run: `prepare` (once per scene), then `first_click`, `box`
    /// or `masks` with all drawing they need, and `further_click` (mean, drawing of the clicked view not included).
    pub seconds: Seconds,
}

/// Least number of the object's pixels in a held-back view that is scored.
const ENOUGH_PIXELS: usize = 200;
/// Silhouettes drawn together.
const TOGETHER: usize = 16;

/// Scores the answers to all prompts of a scene, in their order.
///
/// Deterministic but for the seconds. Cost: one picture per prompt and held-back view, one more for every sixteen
/// prompts, and three per click.
///
/// # Errors
/// As [`BenchScene::check`]; [`SegmentError::NothingToDo`] if the method has no answer to such prompts
/// ([`EvalMethod::answers`]; clicks are for the graph alone); [`SegmentError::Cancelled`].
pub fn evaluate(
    bench: &BenchScene,
    settings: &EvalSettings,
    raster: &mut dyn Rasterizer,
    run: &Run,
) -> Result<Vec<ObjectScore>, SegmentError> {
    bench.check()?;
    let EvalSettings { method, prompt: mode, clicks } = *settings;
    if !method.answers(mode) || (clicks > 0 && !method.answers(PromptMode::Click)) {
        return Err(SegmentError::NothingToDo { what: "mask" });
    }
    if bench.prompts.is_empty() {
        return Ok(Vec::new());
    }
    let mut asked = Asked::new(bench, method, raster, run)?;
    let mut scores = Vec::with_capacity(bench.prompts.len());
    let mut selections = Vec::with_capacity(bench.prompts.len());
    for (done, prompt) in bench.prompts.iter().enumerate() {
        run.step("answers", done, bench.prompts.len())?;
        let answer = asked.answer(prompt, mode)?;
        let iou = selection_iou(&answer.selection, &bench.labels, &bench.weight, prompt.label);
        let mut score = ObjectScore {
            label: prompt.label,
            name: prompt.name.clone(),
            iou_visible: iou.visible,
            iou_weighted: iou.weighted,
            iou_2d: None,
            boundary_iou_2d: None,
            removal_residual: None,
            clicks: Vec::new(),
            seconds: answer.seconds,
        };
        if clicks > 0 {
            let (curve, seconds) = asked.clicks(prompt, clicks)?;
            score.clicks = (1..).zip(curve).map(|(n, iou_visible)| ClickScore { n, iou_visible }).collect();
            score.seconds.extend(seconds.map(|s| ("further_click", s)));
        }
        scores.push(score);
        selections.push(answer.selection);
    }
    drop(asked);
    score_pictures(bench, &selections, &mut scores, raster, run)?;
    Ok(scores)
}

/// Fills in the scores of held-back pictures.
fn score_pictures(
    bench: &BenchScene,
    selections: &[Selection],
    scores: &mut [ObjectScore],
    raster: &mut dyn Rasterizer,
    run: &Run,
) -> Result<(), SegmentError> {
    let scene = Scene::of(bench.cloud.clone());
    let left: Vec<Scene> = selections
        .iter()
        .map(|selection| {
            let mut rest = selection.clone();
            rest.invert();
            Scene::of_selected(bench.cloud.clone(), &rest)
        })
        .collect();
    // Silhouette, boundary, residual and the number of views, per prompt.
    let mut sums = vec![([0.0f64; 3], 0u32); scores.len()];
    for (done, map) in bench.held_back.iter().enumerate() {
        run.step("held-back views", done, bench.held_back.len())?;
        let masks: Vec<Mask2d> = scores.iter().map(|s| map.mask(s.label)).collect();
        let shown: Vec<usize> = (0..scores.len()).filter(|&k| masks[k].count() >= ENOUGH_PIXELS).collect();
        for some in shown.chunks(TOGETHER) {
            let silhouettes = silhouettes(raster, &scene, map, some.iter().map(|&k| &selections[k]).collect())?;
            for (&k, silhouette) in some.iter().zip(&silhouettes) {
                let residual = residual(raster, &left[k], map, &masks[k], &bench.labels, scores[k].label)?;
                let new = [mask_iou(silhouette, &masks[k]), boundary_iou(silhouette, &masks[k]), residual];
                sums[k].0.iter_mut().zip(new).for_each(|(sum, v)| *sum += v);
                sums[k].1 += 1;
            }
        }
    }
    for (score, (sums, views)) in scores.iter_mut().zip(sums).filter(|(_, (_, views))| *views > 0) {
        let [a, b, c] = sums.map(|sum| Some(sum / f64::from(views)));
        (score.iou_2d, score.boundary_iou_2d, score.removal_residual) = (a, b, c);
    }
    Ok(())
}

/// Where each selection has more than half of a pixel's weight, without the pixels that are not scored.
fn silhouettes(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    map: &LabelMap,
    selections: Vec<&Selection>,
) -> Result<Vec<Mask2d>, SegmentError> {
    let channels = selections.len();
    let values: Vec<f32> =
        (0..scene.len()).flat_map(|i| selections.iter().map(move |s| if s.contains(i) { 1.0 } else { 0.0 })).collect();
    let weight = raster.features(scene, &map.view, Features { channels, values: &values })?;
    (0..channels)
        .map(|c| {
            let inside = weight.iter().skip(c).step_by(channels).map(|&w| if w > 0.5 { 255 } else { 0 }).collect();
            let mut mask = Mask2d::new(map.view.width, map.view.height, inside)?;
            map.clear_ignored(&mut mask);
            Ok(mask)
        })
        .collect()
}

/// Mean weight of the label's Gaussians over the pixels of `mask`, in what is left of the scene.
fn residual(
    raster: &mut dyn Rasterizer,
    left: &Scene,
    map: &LabelMap,
    mask: &Mask2d,
    labels: &[u8],
    label: u8,
) -> Result<f64, SegmentError> {
    let values: Vec<f32> = labels.iter().map(|&l| if l == label { 1.0 } else { 0.0 }).collect();
    let weight = raster.features(left, &map.view, Features { channels: 1, values: &values })?;
    let inside = weight.iter().zip(mask.values()).filter(|(_, m)| **m >= Mask2d::HALF);
    let sum: f64 = inside.map(|(w, _)| f64::from(*w)).sum();
    Ok(sum / mask.count().max(1) as f64)
}
