//! [`Job`]: a request with all that it takes to answer it, apart from the world. Everything is in the cloud's own space, so
//! that what is found out once serves wherever an entity stands.

use std::sync::Arc;

use bevy::math::{Vec2, Vec3};
use splat_core::bounds::robust_bounds;
use splat_core::deform::Deformation;
use splat_core::{Cloud, Orbit, SelectMode, Selection, View};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Instance, Scene};
use splat_segment::Run;
use splat_segment::graph::clicks::ClickState;
use splat_segment::graph::prepared::Prepared;

use super::solve::{Found, solve};
use super::{SegmentPrompt, SegmentStart};

/// Views around a capture in two rings, the upper one between the views of the lower one.
const RING: usize = 8;
/// Heights of the rings above the horizon, in degrees.
const RING_PITCH: [f32; 2] = [12.0, 42.0];

/// A request to be answered on another thread.
pub(super) struct Job {
    pub(super) cloud: Arc<Cloud>,
    /// What the entity does not show.
    pub(super) hidden: Option<Arc<Selection>>,
    /// The pose that the camera sees.
    pub(super) deformation: Option<Arc<Deformation>>,
    /// What cannot be selected of it.
    pub(super) withheld: Selection,
    /// The camera's picture.
    pub(super) view: View,
    /// Up, where nothing else says from where to look.
    pub(super) up: Vec3,
    /// Where the capture can be seen from; may be empty.
    pub(super) survey: Vec<View>,
    /// What is known of the cloud.
    pub(super) prepared: Option<Arc<Prepared>>,
    pub(super) prompts: Vec<SegmentPrompt>,
    /// The last answer for the entity.
    pub(super) last: Option<ClickState>,
}

/// An answer.
pub(super) struct Answer {
    pub(super) prepared: Arc<Prepared>,
    pub(super) state: ClickState,
    /// The object, as far as it may be selected.
    pub(super) selection: Selection,
    pub(super) proposals: Vec<Selection>,
    pub(super) steps: Vec<Selection>,
}

/// How a job ended badly: in a sentence, and what was found out all the same.
pub(super) struct Failure {
    pub(super) reason: String,
    pub(super) prepared: Option<Arc<Prepared>>,
}

impl Job {
    /// Finds the object.
    pub(super) fn run(mut self, run: &Run) -> Result<Answer, Failure> {
        let mut raster = CpuRasterizer::new();
        let prepared = match self.prepared.take() {
            Some(prepared) => prepared,
            None => self.prepare(&mut raster, run).map_err(|reason| Failure { reason, prepared: None })?,
        };
        let fail = |reason: String| Failure { reason, prepared: Some(prepared.clone()) };
        run.step("click", 0, 1).map_err(|e| fail(e.to_string()))?;
        let (hidden, deformation) = (self.hidden.clone(), self.deformation.clone());
        let scene = Scene { instances: vec![Instance { hidden, deformation, ..Instance::new(self.cloud.clone()) }] };
        let found = solve(&prepared, &scene, &self.view, &self.prompts, self.last.take(), &mut raster).map_err(fail)?;
        run.step("click", 1, 1).map_err(|e| fail(e.to_string()))?;
        let Found { state, proposals, steps } = found;
        let shown = |mut set: Selection| {
            set.apply(SelectMode::Subtract, &self.withheld);
            set
        };
        let selection = shown(state.selection(&prepared));
        if selection.count() == 0 {
            return Err(fail("nothing is left of the object that is neither hidden nor locked".into()));
        }
        let all = |sets: Vec<Selection>| sets.into_iter().map(|patches| shown(prepared.gaussians(&patches))).collect();
        let (proposals, steps) = (all(proposals), all(steps));
        Ok(Answer { prepared, state, selection, proposals, steps })
    }

    fn prepare(&mut self, raster: &mut CpuRasterizer, run: &Run) -> Result<Arc<Prepared>, String> {
        let mut views = std::mem::take(&mut self.survey);
        if views.is_empty() {
            views = around(&self.cloud, self.up);
            views.push(self.view);
        }
        // All of the cloud: another entity may show what this one hides.
        let scene = Scene::of(self.cloud.clone());
        Prepared::new(&scene, &views, raster, run).map(Arc::new).map_err(|e| e.to_string())
    }
}

/// Views from all around a capture.
fn around(cloud: &Cloud, up: Vec3) -> Vec<View> {
    let Some(bounds) = robust_bounds(cloud) else { return Vec::new() };
    let turn = std::f32::consts::TAU / RING as f32;
    let mut views = Vec::new();
    for (ring, pitch) in RING_PITCH.into_iter().enumerate() {
        for k in 0..RING {
            let yaw = turn * (k as f32 + 0.5 * ring as f32);
            let orbit = Orbit { yaw, pitch: pitch.to_radians(), up, width: 640, height: 480, ..Orbit::default() };
            views.push(View::orbit(&bounds, &orbit));
        }
    }
    views
}

/// Whether a request is one at all, before any work: the sentence to fail with.
pub(super) fn check(prompts: &[SegmentPrompt], start: SegmentStart, has_last: bool, view: &View) -> Result<(), String> {
    let continues = start == SegmentStart::Continue && has_last;
    match prompts.first() {
        None => return Err("the request has no prompts; point at something".into()),
        Some(SegmentPrompt::Negative(_)) if !continues => {
            return Err("a negative click takes away from an object; point at one first".into());
        }
        _ => {}
    }
    for (k, prompt) in prompts.iter().enumerate() {
        let inside = |at: Vec2| {
            if view.contains(at) {
                return Ok(());
            }
            Err(format!(
                "the prompt at {}, {} lies outside the camera's {}x{} pixels",
                at.x, at.y, view.width, view.height
            ))
        };
        match *prompt {
            SegmentPrompt::Click(at) | SegmentPrompt::Negative(at) => inside(at)?,
            SegmentPrompt::Box(..) if k > 0 || continues => {
                return Err("a box can only be the first prompt for an object".into());
            }
            SegmentPrompt::Box(a, b) => {
                inside(a)?;
                inside(b)?;
            }
        }
    }
    Ok(())
}
