//! A tracker without a network: what is known of the Gaussians is drawn in the next view and completed along its edges.

use splat_core::{Mask2d, View};
use splat_raster::{Features, Frame, Outputs, Rasterizer, VOTE_UNIT};

use super::edges::Guide;
use super::{TrackJob, TrackedFrame, Tracker};
use crate::votes::{ViewVotes, VoteSums};
use crate::{Run, SegmentError};

/// Carries masks over by the Gaussians themselves.
///
/// All references vote first. Then view by view: the Gaussians' shares so far are drawn (with how much is known of each),
/// pixels that show unknown Gaussians take the answer of what surrounds them on the same surface (smoothing that stops at edges
/// of colour and depth), and the completed mask votes for the next view. So an object's side, unseen so far, joins
/// the front it continues, and the floor behind it stays out because depth jumps there.
///
/// Exact for what references have seen; guesses for the rest, and says so in [`TrackedFrame::weight`]. References may
/// enter in any order: only the order of the views matters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometric {
    /// How much more a reference's vote counts than a tracked one's.
    pub reference_times: u32,
    /// Weight, in pixels, at which a Gaussian is half known.
    pub half_known_px: f64,
    /// How far the answer spreads where there is no edge, as a share of the picture's diagonal.
    pub reach: f32,
    /// Sum of the differences of red, green, blue and alpha that stops the spreading.
    pub color_step: f32,
}

impl Geometric {
    /// The settings used where none are named.
    pub const DEFAULT: Self = Self { reference_times: 8, half_known_px: 0.5, reach: 0.05, color_step: 0.5 };
}

impl Default for Geometric {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Tracker for Geometric {
    fn name(&self) -> &'static str {
        "geometric"
    }

    fn description(&self) -> &'static str {
        "carries masks over by the Gaussians seen so far and completes them along edges of colour and depth; no network"
    }

    fn track(
        &self,
        job: &TrackJob<'_>,
        raster: &mut dyn Rasterizer,
        run: &Run,
    ) -> Result<Vec<TrackedFrame>, SegmentError> {
        if job.references.is_empty() {
            return Err(SegmentError::NothingToDo { what: "annotation" });
        }
        let total = job.references.len() + job.views.len();
        let mut sums = VoteSums::new(job.scene.len());
        for (done, r) in job.references.iter().enumerate() {
            run.step("track", done, total)?;
            let votes = ViewVotes::draw(raster, job.scene, r.view, r.mask, None)?;
            sums.add(&votes, self.reference_times);
        }
        let mut frame = Frame::default();
        let mut tracked = Vec::with_capacity(job.views.len());
        for (k, view) in job.views.iter().enumerate() {
            run.step("track", job.references.len() + k, total)?;
            let values = self.evidence(&sums);
            let outputs = Outputs {
                color: true,
                median_depth: true,
                features: Some(Features { channels: 2, values: &values }),
                ..Outputs::default()
            };
            raster.draw(job.scene, view, &outputs, &mut frame)?;
            let t = self.complete(view, &frame)?;
            let votes = ViewVotes::draw(raster, job.scene, view, &t.mask, t.weight.as_ref())?;
            sums.add(&votes, 1);
            tracked.push(t);
        }
        Ok(tracked)
    }
}

impl Geometric {
    /// Two channels per Gaussian: share of inside votes times how much is known, and how much is known, 0..=1.
    fn evidence(&self, sums: &VoteSums) -> Vec<f32> {
        let half = self.half_known_px * f64::from(self.reference_times);
        (0..sums.len())
            .flat_map(|i| {
                let total = sums.total()[i] as f64 * VOTE_UNIT;
                let known = total / (total + half);
                let share = if total > 0.0 { sums.inside()[i] as f64 * VOTE_UNIT / total } else { 0.0 };
                [(share * known) as f32, known as f32]
            })
            .collect()
    }

    /// The mask of a view from the picture of what is known.
    fn complete(&self, view: &View, frame: &Frame) -> Result<TrackedFrame, SegmentError> {
        let size = (view.width as usize, view.height as usize);
        let reach_px = (self.reach * (size.0 as f32).hypot(size.1 as f32)).max(2.0);
        // Where the picture is transparent nothing is, and nothing is surely outside.
        let clear = |k: usize| (1.0 - frame.color[k][3]).max(0.0);
        let mut inside: Vec<f32> = frame.features.iter().step_by(2).copied().collect();
        let mut known: Vec<f32> =
            frame.features.iter().skip(1).step_by(2).enumerate().map(|(k, &v)| v + clear(k)).collect();
        let direct = known.clone();
        let share = inside.clone();
        let guide = Guide::new(size, &frame.color, &frame.median_depth, reach_px, self.color_step);
        guide.smooth(&mut [&mut inside, &mut known], reach_px);

        let mut mask = Vec::with_capacity(inside.len());
        let mut weight = Vec::with_capacity(inside.len());
        let (mut resting, mut covered) = (0.0f64, 0usize);
        for k in 0..inside.len() {
            let around = if known[k] > 1e-6 { inside[k] / known[k] } else { 0.0 };
            // What is known of the pixel itself comes first, its surroundings fill the rest.
            let d = direct[k].min(1.0);
            let p = (share[k] + (1.0 - d) * around).clamp(0.0, 1.0);
            // A steep ramp about one half: soft at edges, decided elsewhere.
            let p = ((p - 0.5) * 4.0 + 0.5).clamp(0.0, 1.0);
            let trust = d.max((2.0 * known[k]).min(1.0) * 0.5);
            mask.push((p * 255.0).round() as u8);
            weight.push((trust * 255.0).round() as u8);
            if p >= 0.5 {
                resting += f64::from(d);
                covered += 1;
            }
        }
        let confidence = if covered > 0 { (resting / covered as f64) as f32 } else { 0.0 };
        Ok(TrackedFrame {
            mask: Mask2d::new(view.width, view.height, mask)?,
            weight: Some(Mask2d::new(view.width, view.height, weight)?),
            confidence,
        })
    }
}
