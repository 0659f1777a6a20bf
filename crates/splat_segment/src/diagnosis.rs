//! Diagnosis: where masks and result disagree, what is not known, and where a further annotation helps most.

use std::collections::HashSet;

use glam::Vec3;
use splat_core::{Mask2d, Selection, View};
use splat_raster::{Features, Frame, Outputs, Rasterizer, Scene, VOTE_UNIT};

use crate::aggregations::MaskedView;
use crate::boundary::{share_spread, silhouettes};
use crate::distance::distance_to;
use crate::views::{VISIBLE_WEIGHT, within};
use crate::votes::{ViewVotes, VoteSums};
use crate::{Run, SegmentError};

/// How well the mask of a view fits the result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disagreement {
    /// Position of the mask in the list given.
    pub mask: usize,
    /// Intersection over union of the mask and the drawn selection, 0..=1; 1 where both are empty.
    pub iou: f32,
    /// Pixels of the mask that the selection lacks.
    pub missed: u64,
    /// Pixels of the selection that the mask lacks.
    pub extra: u64,
}

/// Compares every mask with the selection drawn in its view (pixels of which it has more than half); worst first.
///
/// # Errors
/// [`SegmentError::Cancelled`], [`SegmentError::Raster`].
pub fn disagreements(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    selection: &Selection,
    masks: &[MaskedView<'_>],
    run: &Run,
) -> Result<Vec<Disagreement>, SegmentError> {
    let views: Vec<View> = masks.iter().map(|m| *m.view).collect();
    let drawn = silhouettes(raster, scene, selection, &views, run)?;
    let mut out = Vec::with_capacity(masks.len());
    for (k, (m, drawn)) in masks.iter().zip(&drawn).enumerate() {
        crate::project::check_size(m.view, m.mask)?;
        let (mut both, mut missed, mut extra) = (0u64, 0, 0);
        for (&a, &b) in m.mask.values().iter().zip(drawn.values()) {
            match (a >= Mask2d::HALF, b >= Mask2d::HALF) {
                (true, true) => both += 1,
                (true, false) => missed += 1,
                (false, true) => extra += 1,
                (false, false) => {}
            }
        }
        let either = both + missed + extra;
        let iou = if either == 0 { 1.0 } else { both as f32 / either as f32 };
        out.push(Disagreement { mask: k, iou, missed, extra });
    }
    out.sort_by(|a, b| a.iou.total_cmp(&b.iou).then(a.mask.cmp(&b.mask)));
    Ok(out)
}

/// How little is known about every Gaussian, 0 (settled) to 1.
///
/// Seen: the larger of `1 - |2r - 1|` for its share r and twice the standard deviation of the share over views. Unseen: 1 if a
/// selected Gaussian lies in the same or a touching cell (a sixth of the selection's radius), else 0.
pub fn uncertainty<'a>(
    scene: &Scene,
    sums: &VoteSums,
    votes: impl Iterator<Item = &'a ViewVotes>,
    selection: &Selection,
) -> Vec<f32> {
    let spread = share_spread(sums.len(), votes);
    let means: Vec<Vec3> = scene.instances.iter().flat_map(|k| (0..k.cloud.len()).map(|i| k.mean(i))).collect();
    let near = near_selected(&means, selection);
    (0..sums.len())
        .map(|i| match sums.score(i) {
            Some(r) => (1.0 - (2.0 * r - 1.0).abs()).max((2.0 * spread[i]).min(1.0)),
            None if near(i) => 1.0,
            None => 0.0,
        })
        .collect()
}

fn near_selected<'a>(means: &'a [Vec3], selection: &Selection) -> impl Fn(usize) -> bool + use<'a> {
    let inside: Vec<Vec3> = selection.iter().map(|i| means[i]).filter(|m| m.is_finite()).collect();
    // Median and 90th percentile, so that a stray Gaussian does not blow the cells up.
    let middle = |mut v: Vec<f32>, share: f32| {
        let k = (v.len().saturating_sub(1) as f32 * share) as usize;
        if v.is_empty() { 0.0 } else { *v.select_nth_unstable_by(k, f32::total_cmp).1 }
    };
    let center = Vec3::from_array(std::array::from_fn(|a| middle(inside.iter().map(|m| m[a]).collect(), 0.5)));
    let radius = middle(inside.iter().map(|m| m.distance(center)).collect(), 0.9);
    let cell = (radius / 6.0).max(1e-9);
    let at = move |m: Vec3| ((m - center) / cell).floor().as_ivec3();
    let cells: HashSet<_> = inside.iter().map(|&m| at(m)).collect();
    move |i| {
        let m = means[i];
        m.is_finite()
            && (0..27).any(|k| cells.contains(&(at(m) + glam::IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1))))
    }
}

/// A view in which an annotation would help.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NextView {
    /// Position among the candidates.
    pub candidate: usize,
    /// Uncertain Gaussians it shows: the sum of `u_i min(1, weight in pixels)`, less where it is much like a view that is
    /// annotated already.
    pub gain: f32,
}

/// Ranks candidate views by how much uncertainty an annotation there would settle; best first.
///
/// Drawn at a quarter of the size. A view whose Jaccard index with an annotated one is above 0.8 counts less, down to nothing
/// at 1.
///
/// # Errors
/// [`SegmentError::Length`] if there is not one uncertainty per Gaussian, [`SegmentError::Cancelled`], [`SegmentError::Raster`].
pub fn next_views(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    uncertainty: &[f32],
    candidates: &[View],
    annotated: &[View],
    run: &Run,
) -> Result<Vec<NextView>, SegmentError> {
    if uncertainty.len() != scene.len() {
        return Err(SegmentError::Length { what: "uncertainty", found: uncertainty.len(), expected: scene.len() });
    }
    let quarter = |v: &View| within(v, (v.width.max(v.height) / 4).max(64));
    let known = annotated
        .iter()
        .map(|v| raster.visibility(scene, &quarter(v), VISIBLE_WEIGHT))
        .collect::<Result<Vec<_>, _>>()?;
    let mut frame = Frame::default();
    let mut out = Vec::with_capacity(candidates.len());
    for (candidate, view) in candidates.iter().enumerate() {
        run.step("next view", candidate, candidates.len())?;
        let small = quarter(view);
        let outputs = Outputs { votes: Some(&[]), visibility: Some(VISIBLE_WEIGHT), ..Outputs::default() };
        raster.draw(scene, &small, &outputs, &mut frame)?;
        let per_pixel = (f64::from(view.height) / f64::from(small.height)).powi(2) * VOTE_UNIT;
        let shown: f64 = (frame.votes.total.iter().zip(uncertainty))
            .map(|(&t, &u)| f64::from(u) * (t as f64 * per_pixel).min(1.0))
            .sum();
        let alike = known.iter().map(|k| k.jaccard(&frame.visibility)).fold(0.0, f64::max);
        let novelty = ((1.0 - alike) / 0.2).min(1.0);
        out.push(NextView { candidate, gain: (shown * novelty) as f32 });
    }
    out.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.candidate.cmp(&b.candidate)));
    Ok(out)
}

/// A pixel worth clicking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NextClick {
    /// Pixel from the left.
    pub x: u32,
    /// Pixel from the top.
    pub y: u32,
    /// Drawn uncertainty there, 0..=1.
    pub uncertainty: f32,
    /// Pixels of the uncertain patch around it.
    pub area: usize,
}

/// The middle of the largest uncertain patch of a view; `None` if nothing uncertain is seen.
///
/// Patches are connected pixels (by sides) whose drawn uncertainty is above half of the picture's largest. Of the
/// largest one, the pixel with the largest product of uncertainty and distance to the patch's edge.
///
/// # Errors
/// As [`next_views`].
pub fn next_click(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    uncertainty: &[f32],
    view: &View,
) -> Result<Option<NextClick>, SegmentError> {
    let picture = raster.features(scene, view, Features { channels: 1, values: uncertainty })?;
    let largest = picture.iter().copied().fold(0.0, f32::max);
    // The fold above passes over NaN.
    if largest <= 0.02 {
        return Ok(None);
    }
    let width = view.width as usize;
    let patch = largest_patch(width, &picture.iter().map(|&u| u > 0.5 * largest).collect::<Vec<_>>());
    let outside = Mask2d::from_fn(view.width, view.height, |x, y| !patch.contains(&(y as usize * width + x as usize)));
    let depth = distance_to(&outside);
    // A patch that fills the picture has no edge: then every pixel is equally deep.
    let value = |k: usize| picture[k] * depth[k].min(1e6);
    let best = patch.iter().copied().max_by(|&a, &b| value(a).total_cmp(&value(b)).then(b.cmp(&a)));
    Ok(best.map(|k| NextClick {
        x: (k % width) as u32,
        y: (k / width) as u32,
        uncertainty: picture[k].min(1.0),
        area: patch.len(),
    }))
}

/// Pixels of the largest patch connected by sides; the first of equals.
fn largest_patch(width: usize, inside: &[bool]) -> HashSet<usize> {
    let mut left = inside.to_vec();
    let mut best = Vec::new();
    for start in 0..left.len() {
        if !left[start] {
            continue;
        }
        left[start] = false;
        let mut patch = vec![start];
        let mut next = 0;
        while next < patch.len() {
            let k = patch[next];
            next += 1;
            let x = k % width;
            let near = [(x > 0).then(|| k - 1), (x + 1 < width).then(|| k + 1), k.checked_sub(width), Some(k + width)];
            for q in near.into_iter().flatten() {
                if q < left.len() && left[q] {
                    left[q] = false;
                    patch.push(q);
                }
            }
        }
        if patch.len() > best.len() {
            best = patch;
        }
    }
    best.into_iter().collect()
}
