//! Pre-segmentation: what unoccluded annotations rule out before anything is tracked (the paper's section 4.4.6).
//!
//! The paper intersects the frustum projections of all annotations marked unoccluded, as two states. A Gaussian that a
//! picture's edge cuts off then counts as outside, and an object that leaves the picture is lost. Here are three:
//! *out* (some annotation sees its place, and outside the mask), *in* (some annotation has it inside, none outside), *unknown*
//! (behind every such camera or beyond its picture). Tracking goes on with *in* and *unknown*. A [`guard`] looks afterwards
//! whether something was excluded that the tracked masks want.

use std::collections::{HashMap, HashSet};
use std::fmt;

use glam::Vec3;
use rayon::prelude::*;
use splat_core::{Mask2d, Selection, View};
use splat_raster::{Frame, Outputs, Rasterizer, Scene};

use crate::aggregations::MaskedView;
use crate::distance::distance_to;
use crate::project::{Projected, check_size, depth_spread, placed, project};
use crate::votes::VoteSums;
use crate::{Run, SegmentError};

/// What the annotations say about a Gaussian.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Region {
    /// Inside the mask of at least one annotation and outside none.
    In,
    /// Outside the mask of at least one annotation that sees its place.
    Out,
    /// No annotation sees its place.
    Unknown,
    /// Unseen, beyond picture edges that no mask touches, and not connected to anything inside: taken as outside.
    Unconnected,
}

/// How wide a mask is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PresegmentSettings {
    /// Least widening of a mask, in pixels; 2 by default.
    pub margin_px: f32,
    /// Widening as a share of the longer side of the mask's bounding box; 0.01 by default. The larger of the two counts,
    /// and every Gaussian's own projected 1-sigma on top.
    pub margin_share: f32,
    /// A mask touches an edge of the picture within this many pixels; 2 by default.
    pub edge_px: u32,
}

impl Default for PresegmentSettings {
    fn default() -> Self {
        Self { margin_px: 2.0, margin_share: 0.01, edge_px: 2 }
    }
}

/// The state of every Gaussian.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Presegment {
    /// One state per Gaussian of the scene.
    pub regions: Vec<Region>,
    /// What goes on: [`Region::In`] and [`Region::Unknown`].
    pub kept: Selection,
}

impl Presegment {
    /// Number of Gaussians in a state.
    pub fn count(&self, region: Region) -> usize {
        self.regions.iter().filter(|&&r| r == region).count()
    }
}

/// One annotation, prepared.
struct Prepared<'a> {
    view: &'a View,
    /// Distance of every pixel to the mask.
    distance: Vec<f32>,
    margin: f32,
    /// Whether the mask touches the left, top, right, bottom edge.
    touches: [bool; 4],
}

enum Place {
    In,
    Out,
    /// Not in the picture, on a side the mask touches, or behind the camera.
    Open,
    /// Not in the picture, on sides the mask does not touch.
    Beyond,
}

impl<'a> Prepared<'a> {
    fn new(view: &'a View, mask: &Mask2d, settings: &PresegmentSettings) -> Result<Self, SegmentError> {
        check_size(view, mask)?;
        let (w, h) = (mask.width(), mask.height());
        let mut low = (u32::MAX, u32::MAX);
        let mut high = (0, 0);
        for y in 0..h {
            for x in (0..w).filter(|&x| mask.contains(x, y)) {
                low = (low.0.min(x), low.1.min(y));
                high = (high.0.max(x), high.1.max(y));
            }
        }
        let empty = low.0 == u32::MAX;
        let side = if empty { 0 } else { (high.0 - low.0).max(high.1 - low.1) + 1 };
        let e = settings.edge_px;
        let touches = if empty { [false; 4] } else { [low.0 < e, low.1 < e, high.0 + e >= w, high.1 + e >= h] };
        let margin = settings.margin_px.max(settings.margin_share * side as f32);
        Ok(Self { view, distance: distance_to(mask), margin, touches })
    }

    fn place(&self, p: Option<Projected>) -> Place {
        let Some(p) = p else { return Place::Open };
        let (x, y) = (p.center.x, p.center.y);
        let (w, h) = (self.view.width as f32, self.view.height as f32);
        // Its 1-sigma ellipse may still reach into the picture, and into the mask.
        let sigma = larger_sigma(&p.cov);
        if self.view.contains(p.center) {
            let k = y as usize * self.view.width as usize + x as usize;
            return if self.distance[k] <= self.margin + sigma { Place::In } else { Place::Out };
        }
        let beyond = [x < 0.0, y < 0.0, x >= w, y >= h];
        let open = (0..4).any(|side| beyond[side] && self.touches[side]);
        let overhang = (-x).max(x - w).max(-y).max(y - h);
        if open || overhang <= self.margin + sigma { Place::Open } else { Place::Beyond }
    }
}

fn larger_sigma(cov: &[f32; 3]) -> f32 {
    let [a, b, c] = *cov;
    let mid = 0.5 * (a + c);
    (mid + (0.25 * (a - c) * (a - c) + b * b).sqrt()).max(0.0).sqrt()
}

/// Sorts all Gaussians by what `references` say: annotations marked as unoccluded, each a view and its mask.
///
/// Without references everything is unknown, and kept.
///
/// # Errors
/// [`SegmentError::Raster`] if a mask has another size than its view.
pub fn presegment(
    scene: &Scene,
    references: &[(&View, &Mask2d)],
    settings: &PresegmentSettings,
) -> Result<Presegment, SegmentError> {
    let prepared: Vec<Prepared<'_>> =
        references.iter().map(|(view, mask)| Prepared::new(view, mask, settings)).collect::<Result<_, _>>()?;
    let mut regions = Vec::with_capacity(scene.len());
    let mut means = Vec::with_capacity(scene.len());
    for instance in &scene.instances {
        let n = instance.cloud.len();
        means.par_extend((0..n).into_par_iter().map(|i| instance.mean(i)));
        regions.par_extend((0..n).into_par_iter().map(|i| {
            if !instance.cloud.drawable(i) {
                return Region::Unknown;
            }
            let (mean, cov) = placed(instance, i);
            let (mut inside, mut open) = (false, false);
            for p in &prepared {
                match p.place(project(p.view, mean, cov)) {
                    Place::Out => return Region::Out,
                    Place::In => inside = true,
                    Place::Open => open = true,
                    Place::Beyond => {}
                }
            }
            match (inside, open || prepared.is_empty()) {
                (true, _) => Region::In,
                (false, true) => Region::Unknown,
                (false, false) => Region::Unconnected,
            }
        }));
    }
    keep_connected(&means, &mut regions);
    let kept = Selection::from_fn(regions.len(), |i| matches!(regions[i], Region::In | Region::Unknown));
    Ok(Presegment { regions, kept })
}

/// Turns [`Region::Unconnected`] back into [`Region::Unknown`] where a chain of neighbouring cells leads to what is inside.
///
/// Cells are cubes of 1/16 of the extent of what is inside; cells that touch, by a corner even, are neighbours.
fn keep_connected(means: &[Vec3], regions: &mut [Region]) {
    let inside =
        || means.iter().zip(regions.iter()).filter(|(m, r)| **r == Region::In && m.is_finite()).map(|(m, _)| *m);
    let (low, high) = inside().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), m| (low.min(m), high.max(m)));
    let cell = (high - low).max_element() / 16.0;
    if !(cell > 0.0 && cell.is_finite()) {
        return;
    }
    let at = |m: Vec3| ((m - low) / cell).floor().as_ivec3();
    let mut loose: HashMap<_, Vec<usize>> = HashMap::new();
    for (i, m) in means.iter().enumerate().filter(|(i, m)| regions[*i] == Region::Unconnected && m.is_finite()) {
        loose.entry(at(*m)).or_default().push(i);
    }
    let mut front: Vec<_> = inside().map(at).collect::<HashSet<_>>().into_iter().collect();
    // The order in which cells are met does not matter: a cell is either reached or not.
    while let Some(c) = front.pop() {
        for k in 0..27 {
            let near = c + glam::IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
            if let Some(members) = loose.remove(&near) {
                members.into_iter().for_each(|i| regions[i] = Region::Unknown);
                front.push(near);
            }
        }
    }
}

/// When the guard gives pre-segmentation up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardSettings {
    /// Excluded Gaussians that the masks want, as a share of those inside; 0.01 by default.
    pub wanted_share: f32,
    /// Pixels of the masks' outline at which the object goes on into what was excluded, as a share; 0.1 by default.
    pub outline_share: f32,
    /// Masks looked at, evenly spaced; 8 by default.
    pub masks: usize,
    /// Largest difference of a colour channel for "goes on"; 0.15 by default.
    pub color_step: f32,
}

impl Default for GuardSettings {
    fn default() -> Self {
        Self { wanted_share: 0.01, outline_share: 0.1, masks: 8, color_step: 0.15 }
    }
}

/// What the guard found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardReport {
    /// Excluded Gaussians whose votes in the full scene are above theta.
    pub wanted: usize,
    /// Gaussians inside.
    pub inside: usize,
    /// Share of the masks' outline at which colour and surface go on into an excluded Gaussian, 0..=1.
    pub outline: f32,
    /// What follows.
    pub verdict: Verdict,
}

/// Whether pre-segmentation may stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// Nothing speaks against it.
    Keep,
    /// Masks want excluded Gaussians: redo without it.
    WantedExcluded,
    /// The object seems to go on where it was cut: redo without it.
    CutOff,
}

impl fmt::Display for GuardReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.verdict {
            Verdict::Keep => write!(
                f,
                "pre-segmentation holds: {} Gaussians inside, {} excluded ones are wanted",
                self.inside, self.wanted
            ),
            Verdict::WantedExcluded => write!(
                f,
                "pre-segmentation was given up: the masks want {} Gaussians it excluded ({} are inside); mark the annotation as occluded if something stands in front",
                self.wanted, self.inside
            ),
            Verdict::CutOff => write!(
                f,
                "pre-segmentation was given up: along {:.0} % of the masks' outline the object goes on into what it excluded",
                self.outline * 100.0
            ),
        }
    }
}

/// Compares masks with what `p` excluded, in the full scene.
///
/// `views`: tracked masks and annotations that did not decide the exclusion. `theta`: threshold of the votes.
///
/// # Errors
/// [`SegmentError::Cancelled`], [`SegmentError::Raster`].
pub fn guard(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    p: &Presegment,
    views: &[MaskedView<'_>],
    theta: f32,
    settings: &GuardSettings,
    run: &Run,
) -> Result<GuardReport, SegmentError> {
    let mut sums = VoteSums::new(scene.len());
    let mut frame = Frame::default();
    let (mut outline, mut goes_on) = (0usize, 0usize);
    let chosen = crate::views::evenly_spaced(views.len(), settings.masks);
    for (done, &k) in chosen.iter().enumerate() {
        run.step("guard", done, chosen.len())?;
        let v = &views[k];
        sums.add(&v.votes(raster, scene)?, v.times);
        let outputs = Outputs { color: true, median_depth: true, first_hits: Some(0.5), ..Outputs::default() };
        raster.draw(scene, v.view, &outputs, &mut frame)?;
        let (o, g) = follow_outline(p, v, &frame, settings.color_step);
        outline += o;
        goes_on += g;
    }
    let out = |i: usize| matches!(p.regions[i], Region::Out | Region::Unconnected);
    let above = sums.above(theta);
    let wanted = above.iter().filter(|&i| out(i)).count();
    let inside = p.count(Region::In);
    let share = goes_on as f32 / outline.max(1) as f32;
    let verdict = if wanted as f32 > settings.wanted_share * inside as f32 {
        Verdict::WantedExcluded
    } else if share > settings.outline_share {
        Verdict::CutOff
    } else {
        Verdict::Keep
    };
    Ok(GuardReport { wanted, inside, outline: share, verdict })
}

/// Pixels of the mask's outline, and those beyond which an excluded Gaussian of like colour lies on the same surface.
fn follow_outline(p: &Presegment, v: &MaskedView<'_>, frame: &Frame, color_step: f32) -> (usize, usize) {
    let (w, h) = (v.view.width as usize, v.view.height as usize);
    let slope = depth_spread(w, h, &frame.median_depth);
    let inside = |k: usize| v.mask.values()[k] >= Mask2d::HALF;
    let excluded = |k: usize| {
        let id = frame.first_hits[k];
        id != Frame::NO_ID && matches!(p.regions[id as usize], Region::Out | Region::Unconnected)
    };
    let (mut outline, mut goes_on) = (0, 0);
    for k in (0..w * h).filter(|&k| inside(k)) {
        let (x, y) = (k % w, k / w);
        let near = [(x > 0, 1, false), (x + 1 < w, 1, true), (y > 0, w, false), (y + 1 < h, w, true)];
        let mut beyond =
            near.into_iter().filter(|n| n.0).map(|(_, d, up)| if up { k + d } else { k - d }).filter(|&q| !inside(q));
        let mut found = false;
        let continues = beyond.any(|q| {
            found = true;
            let color = (0..3).all(|c| (frame.color[k][c] - frame.color[q][c]).abs() < color_step);
            let (a, b) = (frame.median_depth[k], frame.median_depth[q]);
            color && excluded(q) && !excluded(k) && (a - b).abs() <= 0.005 * a + 2.0 * slope[k].min(slope[q])
        });
        outline += usize::from(found);
        goes_on += usize::from(continues);
    }
    (outline, goes_on)
}
