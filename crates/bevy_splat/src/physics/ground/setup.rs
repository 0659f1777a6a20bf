//! From the wish for ground to the ground.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::ecs::lifecycle::Remove;
use bevy::prelude::*;
use splat_core::{SelectMode, Selection};
use splat_physics::{DistanceField, Ground, GroundSettings};

use super::super::jobs::{Job, JobKind, Watch};
use super::super::part::{Source, Sources};
use super::super::status::{
    PartBody, PartPhysicsError, PartPhysicsFailed, PartPhysicsReady, PartPhysicsReport, PartPhysicsStatus,
    PartPhysicsWarning,
};
use super::{CaptureGround, StaticCapture, StaticCaptureCache};
use crate::components::SplatSubset;
use crate::parts::PartOf;

/// What a capture without a material is taken for.
const FALLBACK: &str = "concrete";
/// Cosine of how far up may turn before the ground is made again.
const TURNED: f64 = 1.0 - 1e-8;

/// How far the ground of a capture is, and what it was made from.
#[derive(Component, Default)]
pub(in super::super) struct GroundSetup {
    wish: Option<(StaticCapture, Source)>,
    /// What was told last as the reason why there is none.
    failed: Option<String>,
    made: Option<Made>,
}

/// What the work gives.
#[derive(Clone)]
pub(in super::super) struct Made {
    ground: Arc<Ground>,
    field: Arc<DistanceField>,
    #[cfg(feature = "avian")]
    colliders: Arc<[super::super::avian::ground::Piece]>,
    gaussians: usize,
    metres_per_unit: f64,
    took: Duration,
}

/// The work of a static capture.
pub(in super::super) struct GroundJob;

impl JobKind for GroundJob {
    type Output = Made;
}

/// What work starts from.
struct Work {
    source: Source,
    ids: Vec<u32>,
    removed: Vec<Vec<u32>>,
    settings: GroundSettings,
    cache: StaticCaptureCache,
}

impl Work {
    fn run(&self, watch: &Watch) -> Result<Made, PartPhysicsError> {
        let start = Instant::now();
        let removed: Vec<&[u32]> = self.removed.iter().map(Vec::as_slice).collect();
        let scale = self.source.metres_per_unit;
        let cloud = &self.source.cloud;
        let key = Ground::key(cloud, &self.ids, &removed, scale, &self.settings);
        let make = || Ground::build(cloud, &self.ids, &removed, scale, &self.settings);
        let ground = self.cache.get(key, make).map_err(PartPhysicsError::setup)?;
        watch.tell(0.7);
        if watch.cancelled() {
            return Err(PartPhysicsError::Cancelled);
        }
        let field = Arc::new(ground.field());
        watch.tell(0.8);
        Ok(Made {
            field,
            #[cfg(feature = "avian")]
            colliders: super::super::avian::ground::pieces(&ground, scale, watch),
            gaussians: self.ids.len(),
            metres_per_unit: scale,
            took: start.elapsed(),
            ground,
        })
    }
}

type Captures<'a> = (
    Entity,
    Ref<'a, StaticCapture>,
    &'a mut GroundSetup,
    Option<&'a mut Job<GroundJob>>,
    Option<&'a mut PartPhysicsStatus>,
    Option<&'a CaptureGround>,
);

/// Begins work where the ground is not what it should be.
pub(in super::super) fn start(
    mut commands: Commands,
    mut captures: Query<Captures>,
    sources: Sources,
    parts: Query<(Entity, &SplatSubset), With<PartOf>>,
    cache: Res<StaticCaptureCache>,
    mut failed: MessageWriter<PartPhysicsFailed>,
) {
    for (entity, capture, mut setup, _, status, _) in &mut captures {
        let setup = setup.bypass_change_detection();
        let materials = sources.materials.of(entity, FALLBACK);
        let found = materials.and_then(|_| sources.get(entity, &[]));
        let source = match found {
            Ok(Some(source)) => source,
            Ok(None) => {
                if status.is_none() {
                    commands.entity(entity).insert(PartPhysicsStatus::Pending(0.0));
                }
                continue;
            }
            Err(error) => {
                fail(&mut commands, entity, setup, error, &mut failed);
                continue;
            }
        };
        let up = source.place.up();
        let wished = setup
            .wish
            .as_ref()
            .is_some_and(|(wish, from)| *wish == *capture && source.same(from) && up.dot(from.up) > TURNED);
        if wished {
            continue;
        }
        let mut source = source.to_owned();
        source.up = up;
        let ids = source.ids();
        let removed = removed(entity, &source, &sources, &parts);
        setup.failed = None;
        setup.wish = Some((*capture, source.clone()));
        let settings = GroundSettings {
            source: capture.source.into(),
            voxel: f64::from(capture.voxel),
            cut: capture.cut,
            fill: capture.fill.into(),
            chunk: f64::from(capture.chunk),
            up,
            ..GroundSettings::default()
        };
        let work = Work { source, ids, removed, settings, cache: cache.clone() };
        let job = Job::<GroundJob>::start(move |watch| work.run(watch));
        commands.entity(entity).insert((job, PartPhysicsStatus::Pending(0.0)));
    }
}

/// The Gaussians of the cloud that the capture does not have any more, part by part.
fn removed(
    capture: Entity,
    source: &Source,
    sources: &Sources,
    parts: &Query<(Entity, &SplatSubset), With<PartOf>>,
) -> Vec<Vec<u32>> {
    let len = source.cloud.len();
    let Some(own) = source.subset() else { return Vec::new() };
    let mut rest = own.to_selection(len);
    rest.invert();
    let mut removed: Vec<(Entity, Vec<u32>)> = Vec::new();
    for (entity, subset) in parts {
        if sources.capture_of(entity) != capture || subset.0.last().is_some_and(|&id| (id as usize) >= len) {
            continue;
        }
        let mut ids = subset.to_selection(len);
        ids.apply(SelectMode::Intersect, &rest);
        rest.apply(SelectMode::Subtract, &ids);
        removed.push((entity, ids.ids()));
    }
    // Entities come in any order.
    removed.sort_unstable_by_key(|(entity, _)| *entity);
    let mut removed: Vec<Vec<u32>> = removed.into_iter().map(|(_, ids)| ids).collect();
    removed.extend(despawned(&rest, sources, capture));
    removed.retain(|ids| !ids.is_empty());
    removed
}

/// Parts whose entities are gone, by their labels.
fn despawned(rest: &Selection, sources: &Sources, capture: Entity) -> Vec<Vec<u32>> {
    let ids = rest.ids();
    let Some(table) = sources.table(capture) else { return vec![ids] };
    let mut by_label = std::collections::BTreeMap::<Option<u16>, Vec<u32>>::new();
    for id in ids {
        by_label.entry(table.part_of(id as usize).map(|part| part.0)).or_default().push(id);
    }
    by_label.into_values().collect()
}

/// Tells that there is no ground, once, and takes away the one that was.
fn fail(
    commands: &mut Commands,
    entity: Entity,
    setup: &mut GroundSetup,
    error: PartPhysicsError,
    failed: &mut MessageWriter<PartPhysicsFailed>,
) {
    let sentence = error.to_string();
    if setup.failed.as_ref() == Some(&sentence) {
        return;
    }
    *setup = GroundSetup { failed: Some(sentence), ..GroundSetup::default() };
    let status = PartPhysicsStatus::Failed(error.clone());
    commands.entity(entity).remove::<(Job<GroundJob>, CaptureGround)>().insert(status);
    failed.write(PartPhysicsFailed { entity, error });
}

/// Gives captures the ground that was made.
pub(in super::super) fn finish(
    mut commands: Commands,
    mut captures: Query<Captures>,
    sources: Sources,
    mut ready: MessageWriter<PartPhysicsReady>,
    mut failed: MessageWriter<PartPhysicsFailed>,
) {
    for (entity, _, mut setup, job, status, ground) in &mut captures {
        let setup = setup.bypass_change_detection();
        let mut fresh = false;
        if let Some(mut job) = job {
            match job.poll() {
                None => {
                    let fraction = job.fraction();
                    if let Some(mut status) = status
                        && !matches!(*status, PartPhysicsStatus::Pending(before) if before == fraction)
                    {
                        *status = PartPhysicsStatus::Pending(fraction);
                    }
                    continue;
                }
                Some(Ok(made)) => {
                    commands.entity(entity).remove::<Job<GroundJob>>();
                    setup.made = Some(made);
                    fresh = true;
                }
                Some(Err(error)) => {
                    let wish = setup.wish.take();
                    fail(&mut commands, entity, setup, error, &mut failed);
                    // Not again before something changes.
                    setup.wish = wish;
                    continue;
                }
            }
        }
        let Some(made) = &setup.made else { continue };
        let Ok(Some(materials)) = sources.materials.of(entity, FALLBACK) else { continue };
        let material = materials.materials[0];
        let friction = [f64::from(material.friction_dynamic), f64::from(material.friction_static)];
        let restitution = f64::from(material.restitution);
        let same = ground.is_some_and(|ground| ground.friction == friction && ground.restitution == restitution);
        if same && !fresh {
            continue;
        }
        let ground = CaptureGround {
            ground: made.ground.clone(),
            field: made.field.clone(),
            metres_per_unit: made.metres_per_unit,
            friction,
            restitution,
            #[cfg(feature = "avian")]
            colliders: made.colliders.clone(),
        };
        let known = sources.get(entity, &[]).ok().flatten().is_none_or(|source| source.scale_known);
        let mut warnings: Vec<PartPhysicsWarning> = made.ground.notes().map(PartPhysicsWarning::Note).collect();
        warnings.extend((!known).then_some(PartPhysicsWarning::ScaleUnknown));
        warnings.extend(materials.assumed.map(PartPhysicsWarning::MaterialAssumed));
        let report = PartPhysicsReport {
            body: PartBody::Static { surface: made.ground.name(), chunks: made.ground.chunks().len() },
            metres_per_unit: made.metres_per_unit,
            gaussians: made.gaussians,
            volume: 0.0,
            mass: None,
            took: made.took,
            warnings,
        };
        commands.entity(entity).insert((ground, PartPhysicsStatus::Ready(report.clone())));
        ready.write(PartPhysicsReady { entity, report });
    }
}

/// Takes the ground away when a capture is to be none any more.
pub(in super::super) fn forget(removed: On<Remove, StaticCapture>, mut commands: Commands) {
    if let Ok(mut entity) = commands.get_entity(removed.event().entity) {
        entity.try_remove::<(GroundSetup, Job<GroundJob>, CaptureGround, PartPhysicsStatus)>();
    }
}
