//! Which Gaussians straddle the edge of a selection, and where the edge cuts them.

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use splat_core::{Cloud, Selection, View};
use splat_raster::{Depth, Rasterizer, Scene};

use crate::aggregations::MaskedView;
use crate::distance::distance_to;
use crate::votes::{SEEN_TOTAL, ViewVotes, VoteSums};
use crate::{Run, SegmentError};

/// What counts as straddling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StraddleSettings {
    /// Shares of inside votes between these two are in between; 0.2 and 0.8 by default.
    pub share: (f32, f32),
    /// Standard deviation of the share over views from which on the masks contradict each other; 0.35 by default.
    pub spread: f32,
    /// Share of the views that must see the end of a selected Gaussian outside their mask; 0.15 by default. Low, because a
    /// thing that sticks out shows only against the silhouette.
    pub outside_views: f32,
    /// Share of the views that must see the end of an unselected Gaussian inside their mask; 0.85 by default. High, for the
    /// same reason: what some views see outside is not the object.
    pub inside_views: f32,
    /// An end lies outside a mask from this distance on, in pixels; 1 by default.
    pub margin_px: f32,
    /// Least projected standard deviation along an axis that is worth cutting, in pixels; 0.7 by default.
    pub least_sigma_px: f32,
}

impl Default for StraddleSettings {
    fn default() -> Self {
        Self {
            share: (0.2, 0.8),
            spread: 0.35,
            outside_views: 0.15,
            inside_views: 0.85,
            margin_px: 1.0,
            least_sigma_px: 0.7,
        }
    }
}

/// Where the edge cuts a Gaussian: between `low` and `high` along its axis it is on its own side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// The Gaussian's axis, 0 to 2.
    pub axis: usize,
    /// In standard deviations from the mean, negative or minus infinity.
    pub low: f32,
    /// In standard deviations from the mean, positive or infinity.
    pub high: f32,
}

/// A Gaussian on the edge of a selection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Straddler {
    /// Its id.
    pub id: u32,
    /// Share of inside votes, 0..=1.
    pub share: f32,
    /// Standard deviation of the share over views, 0..=0.5.
    pub spread: f32,
    /// Why it was found: the share is in between.
    pub mixed: bool,
    /// Why it was found: the views contradict each other.
    pub contested: bool,
    /// Why it was found: it reaches over the edge, and where; `None` if no axis of it does, or it is too small to matter.
    pub cut: Option<Cut>,
}

/// A view with what is needed to ask whether a point is inside its mask.
struct Probe<'a> {
    view: &'a View,
    votes: ViewVotes,
    /// Distance to the mask, and to what is not the mask.
    outside: Vec<f32>,
    depth: Vec<f32>,
}

/// What a view says about a point.
enum Answer {
    Inside,
    Outside,
    /// Not in the picture, hidden, on the line itself, or no surface to compare with.
    Nothing,
}

impl Probe<'_> {
    fn ask(&self, point: Vec3, sigma_ray: f32, margin_px: f32) -> Answer {
        let Some((pixel, z)) = self.view.project(point).filter(|(p, _)| self.view.contains(*p)) else {
            return Answer::Nothing;
        };
        let k = pixel.y as usize * self.view.width as usize + pixel.x as usize;
        // Behind what is seen there the mask speaks of something else. No surface at all hides nothing.
        if self.depth[k] < z - (2.0 * sigma_ray + 0.01 * z) {
            return Answer::Nothing;
        }
        match self.outside[k] {
            0.0 => Answer::Inside,
            d if d > margin_px => Answer::Outside,
            _ => Answer::Nothing,
        }
    }
}

/// Positions along an axis at which views are asked, in standard deviations.
const STEPS: [f32; 10] = [0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5];

/// Gaussians of `cloud` on the edge of `selection`, by rising id.
///
/// `views`: masks of the object, in the cloud's own space; two frames each.
///
/// # Errors
/// [`SegmentError::Length`] if the selection is of another cloud, [`SegmentError::Cancelled`], [`SegmentError::Raster`].
pub fn straddlers(
    raster: &mut dyn Rasterizer,
    scene: &Scene,
    cloud: &Cloud,
    selection: &Selection,
    views: &[MaskedView<'_>],
    settings: &StraddleSettings,
    run: &Run,
) -> Result<Vec<Straddler>, SegmentError> {
    let n = cloud.len();
    if selection.len() != n {
        return Err(SegmentError::Length { what: "selection", found: selection.len(), expected: n });
    }
    let mut probes = Vec::with_capacity(views.len());
    let mut sums = VoteSums::new(n);
    for (done, v) in views.iter().enumerate() {
        run.step("boundary", done, views.len())?;
        let votes = v.votes(raster, scene)?;
        sums.add(&votes, 1);
        let depth = raster.depth(scene, v.view, Depth::Median)?;
        probes.push(Probe { view: v.view, votes, outside: distance_to(v.mask), depth });
    }
    let spreads = share_spread(n, probes.iter().map(|p| &p.votes));
    let found = (0..n).into_par_iter().filter_map(|i| {
        let share = sums.score(i).filter(|_| cloud.drawable(i))?;
        let spread = spreads[i];
        let mixed = share > settings.share.0 && share < settings.share.1;
        let contested = spread > settings.spread;
        // Wholly inside and selected: nothing to look at. Unselected ones must have a good part inside: the little that others
        // have there is mostly what shimmers through at a contact.
        let settled = if selection.contains(i) { share >= 0.999 } else { share <= settings.share.0 };
        let cut = if settled { None } else { cut(cloud, i, selection.contains(i), &probes, settings) };
        (mixed || contested || cut.is_some()).then_some(Straddler {
            id: i as u32,
            share,
            spread,
            mixed,
            contested,
            cut,
        })
    });
    Ok(found.collect())
}

/// Standard deviation over views of each Gaussian's share of inside votes, every view weighted by what it sees of it.
pub fn share_spread<'a>(count: usize, votes: impl Iterator<Item = &'a ViewVotes>) -> Vec<f32> {
    let mut sums = vec![[0.0f64; 3]; count];
    for v in votes {
        for (i, inside, total) in v.iter().filter(|v| v.2 >= SEEN_TOTAL) {
            let (r, w) = (inside as f64 / total as f64, total as f64);
            let s = &mut sums[i as usize];
            s[0] += w;
            s[1] += w * r;
            s[2] += w * r * r;
        }
    }
    let spread = |[w, r, rr]: [f64; 3]| if w > 0.0 { (rr / w - (r / w) * (r / w)).max(0.0).sqrt() as f32 } else { 0.0 };
    sums.into_iter().map(spread).collect()
}

/// The axis along which most of a Gaussian reaches over the edge, and where.
fn cut(cloud: &Cloud, i: usize, selected: bool, probes: &[Probe<'_>], settings: &StraddleSettings) -> Option<Cut> {
    let mean = cloud.means()[i];
    let axes = Mat3::from_quat(cloud.rotation(i));
    let scale = cloud.scale(i);
    let seeing: Vec<&Probe<'_>> = probes.iter().filter(|p| p.votes.of(i as u32).1 >= SEEN_TOTAL).collect();
    if seeing.is_empty() {
        return None;
    }
    let mut best: Option<(f32, Cut)> = None;
    for axis in 0..3 {
        let arm = axes.col(axis) * scale[axis];
        let largest = seeing.iter().filter_map(|p| projected_length(p.view, mean, arm)).fold(0.0, f32::max);
        if largest < settings.least_sigma_px {
            continue;
        }
        // Whether the place at t standard deviations is beyond the edge, as most of those views see it that can.
        let beyond = |t: f32| {
            let (mut inside, mut outside) = (0u32, 0u32);
            for p in &seeing {
                let forward = p.view.forward();
                let sigma_ray = (0..3).map(|k| (axes.col(k).dot(forward) * scale[k]).powi(2)).sum::<f32>().sqrt();
                match p.ask(mean + arm * t, sigma_ray, settings.margin_px) {
                    Answer::Inside => inside += 1,
                    Answer::Outside => outside += 1,
                    Answer::Nothing => {}
                }
            }
            let all = (inside + outside) as f32;
            let (against, needed) =
                if selected { (outside, settings.outside_views) } else { (inside, settings.inside_views) };
            all > 0.0 && against > 0 && against as f32 >= needed * all
        };
        if beyond(0.0) {
            // Its very middle is on the other side: that is a question of selection, not of cutting.
            continue;
        }
        let first = |sign: f32| {
            STEPS.iter().copied().find(|&t| beyond(sign * t)).map_or(sign * f32::INFINITY, |t| sign * (t - 0.125))
        };
        let (low, high) = (first(-1.0), first(1.0));
        if low.is_infinite() && high.is_infinite() {
            continue;
        }
        // What reaches over: the tail's share of the Gaussian, times how large it is on screen.
        let tail = |t: f32| if t.is_finite() { (-0.5 * t * t).exp() } else { 0.0 };
        let score = largest * (tail(low) + tail(high));
        if best.is_none_or(|b| score > b.0) {
            best = Some((score, Cut { axis, low, high }));
        }
    }
    best.map(|b| b.1)
}

/// Length of an arm from a mean in the picture, in pixels.
fn projected_length(view: &View, mean: Vec3, arm: Vec3) -> Option<f32> {
    let (a, _) = view.project(mean)?;
    let (b, _) = view.project(mean + arm)?;
    Some(a.distance(b))
}
