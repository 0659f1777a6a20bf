//! [`SegmentQueue`]: requests that wait, the one that runs, and what was found out about clouds.

use std::collections::{HashMap, VecDeque};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use splat_core::{Cloud, SelectMode, Selection, View};
use splat_raster::Instance;
use splat_segment::graph::clicks::ClickState;
use splat_segment::graph::prepared::Prepared;
use splat_segment::{Progress, Run};

use super::job::{Answer, Failure, Job, check};
use super::{SegmentCancel, SegmentDone, SegmentFailed, SegmentProgress, SegmentRequest, SegmentStart, SegmentViews};
use crate::placed::{Ids, PlacedSplats};
use crate::render::view_from_camera;
use crate::select::{SelectBy, SelectRequest};
use crate::{SplatCloud, SplatSelection};

/// Requests in order. The first may be running.
#[derive(Resource, Default)]
pub struct SegmentQueue {
    waiting: VecDeque<Waiting>,
    running: Option<Running>,
    prepared: HashMap<AssetId<SplatCloud>, Known>,
    sessions: HashMap<Entity, Session>,
}

impl SegmentQueue {
    /// Requests that are not answered yet.
    pub fn len(&self) -> usize {
        self.waiting.len() + usize::from(self.running.is_some())
    }

    /// Whether all are answered.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A request, and where its camera stood.
struct Waiting {
    request: SegmentRequest,
    /// In the world.
    view: View,
}

struct Running {
    request: SegmentRequest,
    asset: AssetId<SplatCloud>,
    cloud: Weak<Cloud>,
    run: Run,
    progress: Mutex<Receiver<Progress>>,
    task: Task<Result<Answer, Failure>>,
}

/// A cloud taken apart.
struct Known {
    cloud: Weak<Cloud>,
    prepared: Arc<Prepared>,
}

/// The last answer for an entity.
struct Session {
    cloud: Weak<Cloud>,
    state: ClickState,
    /// What was selected before the first of the requests that continue each other, and how it is combined.
    before: Selection,
    mode: SelectMode,
}

/// Takes over new requests.
pub(super) fn enqueue(
    mut requests: MessageReader<SegmentRequest>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    mut queue: ResMut<SegmentQueue>,
    mut failed: MessageWriter<SegmentFailed>,
) {
    for request in requests.read() {
        let view = cameras.get(request.camera).ok().and_then(|(camera, at)| view_from_camera(camera, at));
        match view {
            Some(view) => queue.waiting.push_back(Waiting { request: request.clone(), view }),
            None => {
                let reason = "the request's camera is gone, has no size yet, or draws no splats".into();
                failed.write(SegmentFailed { entity: request.entity, reason });
            }
        }
    }
}

/// Stops what is not wanted any more, and what cannot be finished.
pub(super) fn cancel(
    mut cancels: MessageReader<SegmentCancel>,
    splats: PlacedSplats,
    mut queue: ResMut<SegmentQueue>,
    mut failed: MessageWriter<SegmentFailed>,
) {
    let queue = queue.bypass_change_detection();
    for &SegmentCancel { entity } in cancels.read() {
        queue.waiting.retain(|waiting| {
            let keep = waiting.request.entity != entity;
            if !keep {
                failed.write(SegmentFailed { entity, reason: STOPPED.into() });
            }
            keep
        });
        if let Some(running) = queue.running.take_if(|r| r.request.entity == entity) {
            running.run.cancel();
            running.task.detach();
            failed.write(SegmentFailed { entity, reason: STOPPED.into() });
        }
    }
    let gone = |r: &mut Running| {
        splats.cloud(r.request.entity).is_none_or(|(_, cloud)| Arc::as_ptr(cloud) != r.cloud.as_ptr())
    };
    if let Some(running) = queue.running.take_if(gone) {
        running.run.cancel();
        running.task.detach();
        failed.write(SegmentFailed { entity: running.request.entity, reason: GONE.into() });
    }
}

const STOPPED: &str = "stopped on request; nothing was changed";
const GONE: &str = "the capture was despawned or changed meanwhile; nothing was changed";

/// Finishes what runs, and begins what comes next.
pub(super) fn work(
    splats: PlacedSplats,
    entities: Query<(&GlobalTransform, Option<&SplatSelection>, Option<&SegmentViews>)>,
    mut queue: ResMut<SegmentQueue>,
    mut progress: MessageWriter<SegmentProgress>,
    mut done: MessageWriter<SegmentDone>,
    mut failed: MessageWriter<SegmentFailed>,
    mut select: MessageWriter<SelectRequest>,
) {
    let queue = queue.bypass_change_detection();
    queue.forget(&splats);
    if let Some(running) = &mut queue.running {
        let entity = running.request.entity;
        let reports = running.progress.lock().unwrap_or_else(PoisonError::into_inner);
        // The last says all; earlier ones are stale.
        if let Some(p) = reports.try_iter().last() {
            let fraction = p.done as f32 / p.total.max(1) as f32;
            progress.write(SegmentProgress { entity, stage: p.stage, fraction });
        }
        drop(reports);
        let Some(result) = check_ready(&mut running.task) else { return };
        let Some(running) = queue.running.take() else { return };
        let selected = entities.get(entity).ok().and_then(|(_, selection, _)| selection);
        match queue.learn(running, result, selected) {
            Ok((answer, request)) => {
                select.write(request);
                done.write(answer);
            }
            Err(reason) => {
                failed.write(SegmentFailed { entity, reason });
            }
        }
    }
    while queue.running.is_none() {
        let Some(waiting) = queue.waiting.pop_front() else { return };
        let entity = waiting.request.entity;
        if let Err(reason) = queue.begin(waiting, &splats, &entities) {
            failed.write(SegmentFailed { entity, reason });
        }
    }
}

impl SegmentQueue {
    /// Drops what belongs to clouds and entities that are gone.
    fn forget(&mut self, splats: &PlacedSplats) {
        let alive = |cloud: &Weak<Cloud>| cloud.strong_count() > 0;
        self.prepared.retain(|_, known| alive(&known.cloud));
        self.sessions.retain(|&entity, session| {
            splats.cloud(entity).is_some_and(|(_, cloud)| Arc::as_ptr(cloud) == session.cloud.as_ptr())
        });
    }

    fn begin(
        &mut self,
        Waiting { request, view }: Waiting,
        splats: &PlacedSplats,
        entities: &Query<(&GlobalTransform, Option<&SplatSelection>, Option<&SegmentViews>)>,
    ) -> Result<(), String> {
        let entity = request.entity;
        let (asset, _) =
            splats.cloud(entity).ok_or("the entity shows no capture, or it is not loaded yet: wait for its asset")?;
        let whole = splats.instance(entity, Ids::OfCloud);
        let Instance { cloud, transform, hidden, deformation, .. } =
            whole.ok_or("the entity's transform is not one that splats are drawn with")?;
        let withheld = splats.withheld(entity).unwrap_or_default();
        let last = self.sessions.get(&entity).filter(|_| request.start == SegmentStart::Continue);
        check(&request.prompts, request.start, last.is_some(), &view)?;
        let from_world = transform.inverse();
        let job = Job {
            hidden,
            deformation,
            withheld,
            view: view.moved(&from_world),
            up: transform.rotation_matrix().transpose() * Vec3::Y,
            survey: entities.get(entity).ok().and_then(|(.., views)| views).map(|v| v.0.clone()).unwrap_or_default(),
            prepared: (self.prepared.get(&asset))
                .filter(|known| known.cloud.as_ptr() == Arc::as_ptr(&cloud))
                .map(|known| known.prepared.clone()),
            prompts: request.prompts.clone(),
            last: last.map(|session| session.state.clone()),
            cloud: cloud.clone(),
        };
        let (sender, receiver) = channel();
        let run = Run::with_progress(move |p| {
            // Nobody listens once the request is cancelled.
            let _ = sender.send(p);
        });
        let watched = run.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move { job.run(&watched) });
        let cloud = Arc::downgrade(&cloud);
        self.running = Some(Running { request, asset, cloud, run, progress: Mutex::new(receiver), task });
        Ok(())
    }

    /// Keeps what was found out; what to tell and to ask for.
    fn learn(
        &mut self,
        Running { request, asset, cloud, .. }: Running,
        result: Result<Answer, Failure>,
        selected: Option<&SplatSelection>,
    ) -> Result<(SegmentDone, SelectRequest), String> {
        let prepared = match &result {
            Ok(answer) => Some(answer.prepared.clone()),
            Err(failure) => failure.prepared.clone(),
        };
        if let Some(prepared) = prepared {
            self.prepared.insert(asset, Known { cloud: cloud.clone(), prepared });
        }
        let Answer { state, selection, proposals, steps, .. } = result.map_err(|failure| failure.reason)?;
        let entity = request.entity;
        let continued = self.sessions.remove(&entity).filter(|_| request.start == SegmentStart::Continue);
        let (before, mode) = match continued {
            Some(session) => (session.before, session.mode),
            None => (selected.map(|s| s.0.clone()).unwrap_or_default(), request.mode),
        };
        let mut all = if before.len() == selection.len() { before.clone() } else { Selection::none(selection.len()) };
        all.apply(mode, &selection);
        self.sessions.insert(entity, Session { cloud, state, before, mode });
        let select = SelectRequest { entity, mode: SelectMode::New, by: SelectBy::Set(all) };
        Ok((SegmentDone { entity, selection, proposals, steps }, select))
    }
}
