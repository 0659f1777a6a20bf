//! Requests, in order: read, answered on another thread, applied.

use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use splat_core::orient::three_points;
use splat_core::{SelectMode, Selection};

use super::find::{Found, Job, Wanted};
use super::place::Placed;
use super::{OrientBy, OrientError, OrientFailed, OrientRequest, Oriented};
use crate::{SplatCloud, SplatSelection, SplatSubset, Splats};

/// Requests whose answers are being looked for.
#[derive(Resource, Default)]
pub struct OrientQueue(Vec<(Entity, Waiting)>);

enum Waiting {
    Points([Vec3; 3]),
    Search(Task<Result<Found, OrientError>>),
}

impl OrientQueue {
    /// How many requests wait.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether none does.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

type Captures<'w, 's> = Query<'w, 's, (&'static Splats, Option<&'static SplatSelection>, Option<&'static SplatSubset>)>;

/// What counts of a capture: what is selected of it, else what it shows (`None`: everything), and which of the two.
pub(super) fn counted(
    len: usize,
    selection: Option<&SplatSelection>,
    subset: Option<&SplatSubset>,
) -> (Option<Selection>, bool) {
    let shown = subset.filter(|s| s.0.last().is_none_or(|&id| (id as usize) < len)).map(|s| s.to_selection(len));
    let mut selected = selection.map(|s| s.0.clone()).filter(|s| s.len() == len && s.count() > 0);
    if let (Some(selected), Some(shown)) = (&mut selected, &shown) {
        selected.apply(SelectMode::Intersect, shown);
    }
    match selected.filter(|s| s.count() > 0) {
        Some(selected) => (Some(selected), true),
        None => (shown, false),
    }
}

/// Begins the search for each request.
pub(super) fn enqueue(
    mut requests: MessageReader<OrientRequest>,
    mut failed: MessageWriter<OrientFailed>,
    mut queue: ResMut<OrientQueue>,
    clouds: Res<Assets<SplatCloud>>,
    captures: Captures,
    placed: Placed,
) {
    for &OrientRequest { capture, by } in requests.read() {
        let wanted = match by {
            OrientBy::Points(points) => {
                queue.0.push((capture, Waiting::Points(points)));
                continue;
            }
            OrientBy::Selection { axes } => Wanted::Axes(axes),
            OrientBy::Floor => Wanted::Plane,
        };
        let job = || {
            let (Splats(handle), selection, subset) = captures.get(capture).map_err(|_| OrientError::NoCapture)?;
            let cloud = clouds.get(handle).ok_or(OrientError::Loading)?.cloud.clone();
            let up = placed.of(capture)?.rotation.conjugate() * Vec3::Y;
            let (of, chosen) = counted(cloud.len(), selection, subset);
            Ok(Job { cloud, of, chosen, up, wanted })
        };
        match job() {
            Ok(job) => {
                let task = AsyncComputeTaskPool::get().spawn(async move { job.run() });
                queue.0.push((capture, Waiting::Search(task)));
            }
            Err(error) => {
                failed.write(OrientFailed { capture, error });
            }
        }
    }
}

/// Turns captures whose answers are there, in the order of the requests.
pub(super) fn finish(
    mut queue: ResMut<OrientQueue>,
    mut placed: Placed,
    mut oriented: MessageWriter<Oriented>,
    mut failed: MessageWriter<OrientFailed>,
) {
    while let Some((capture, waiting)) = queue.0.first_mut() {
        let capture = *capture;
        let motion = match waiting {
            Waiting::Points(points) => {
                // What a capture's own space is does not matter: the points are the world's.
                placed.of(capture).and_then(|_| Ok((three_points(*points, Vec3::Y, Vec3::Y)?, Vec::new())))
            }
            Waiting::Search(task) => match check_ready(task) {
                None => return,
                Some(found) => placed.of(capture).and_then(|at| found?.motion(&at)),
            },
        };
        queue.0.remove(0);
        let done = motion.and_then(|(motion, open)| Ok((placed.carry(capture, &motion)?, open)));
        match done {
            Ok((before, ambiguities)) => {
                oriented.write(Oriented { capture, before, ambiguities });
            }
            Err(error) => {
                failed.write(OrientFailed { capture, error });
            }
        }
    }
}
