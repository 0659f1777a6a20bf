//! From prompts to patches.

use bevy::math::Vec2;
use splat_core::{Selection, View};
use splat_raster::Scene;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::graph::clicks::{ClickKind, ClickState};
use splat_segment::graph::look::Look;
use splat_segment::graph::prepared::Prepared;

use super::SegmentPrompt;

/// Steps from part to group at most.
const STEPS: usize = 12;

/// What prompts mean; sets are of patches.
pub(super) struct Found {
    pub(super) state: ClickState,
    pub(super) proposals: Vec<Selection>,
    pub(super) steps: Vec<Selection>,
}

/// Answers prompts in one view, going on from `last` where there is one.
pub(super) fn solve(
    prepared: &Prepared,
    scene: &Scene,
    view: &View,
    prompts: &[SegmentPrompt],
    last: Option<ClickState>,
    raster: &mut CpuRasterizer,
) -> Result<Found, String> {
    let look = Look::draw(prepared, scene, view, raster).map_err(|e| e.to_string())?;
    let mut rest = prompts.iter();
    let mut found = match last {
        Some(state) => Found { state, proposals: Vec::new(), steps: Vec::new() },
        None => first(prepared, &look, rest.next())?,
    };
    for prompt in rest {
        let (at, kind) = match *prompt {
            SegmentPrompt::Click(at) => (at, ClickKind::Positive),
            SegmentPrompt::Negative(at) => (at, ClickKind::Negative),
            SegmentPrompt::Box(..) => continue,
        };
        let at = at.floor() + 0.5;
        look.gaussian(at).ok_or_else(|| nothing_at(at))?;
        found.state.correct(prepared, &look, at, kind);
    }
    Ok(found)
}

fn first(prepared: &Prepared, look: &Look, prompt: Option<&SegmentPrompt>) -> Result<Found, String> {
    match prompt {
        Some(&SegmentPrompt::Click(at)) => {
            let at = at.floor() + 0.5;
            let gaussian = look.gaussian(at).ok_or_else(|| nothing_at(at))?;
            let patch = prepared.graph.of[gaussian as usize];
            let all = prepared.hypotheses(look, patch, at);
            let sets = |which: &[usize]| which.iter().map(|&n| all.ranked[n].patches.clone()).collect::<Vec<_>>();
            let (proposals, steps) = (sets(&all.proposals), sets(&all.wheel));
            let object = proposals.first().ok_or_else(|| nothing_at(at))?.clone();
            Ok(Found { state: ClickState::new(object, patch), proposals, steps })
        }
        Some(&SegmentPrompt::Box(a, b)) => {
            let (low, high) = (a.min(b), a.max(b));
            let rectangle = [low.x as u32, low.y as u32, high.x as u32, high.y as u32];
            let ranked = prepared.object_in_box(look, rectangle);
            let object = ranked.first().ok_or("the box shows nothing of the capture; draw it around something")?;
            let state = ClickState { patches: object.patches.clone(), ..ClickState::default() };
            let proposals = ranked.iter().take(3).map(|h| h.patches.clone()).collect();
            let mut by_size: Vec<_> = ranked.iter().collect();
            by_size.sort_by(|a, b| a.mass.total_cmp(&b.mass));
            let steps = by_size.into_iter().take(STEPS).map(|h| h.patches.clone()).collect();
            Ok(Found { state, proposals, steps })
        }
        _ => Err("point at something first".into()),
    }
}

fn nothing_at(at: Vec2) -> String {
    format!("the camera shows nothing of the capture at {}, {}", at.x, at.y)
}
