//! From the wish for a rigid body to the body: what is begun when, and what of it is done again when something changes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::ecs::lifecycle::Remove;
use bevy::math::DVec3;
use bevy::prelude::*;
use splat_physics::{Advice, Shape, ShapeChoice, Solid, SolidSettings, surface_points};

use super::super::ground::{CaptureGround, StaticCapture};
use super::super::jobs::{Job, JobKind, Watch};
use super::super::material::BodyMaterials;
use super::super::part::{Place, Regions, Source, Sources};
use super::super::status::{
    PartBody, PartPhysicsError, PartPhysicsFailed, PartPhysicsReady, PartPhysicsReport, PartPhysicsStatus,
    PartPhysicsWarning,
};
use super::body::{Body, Given, Has, Weight, give, take};
use super::collider::{Fitted, collider};
use super::raise::raise;
use super::{RigidPart, RigidShape};

/// What a part without a material is taken for: as heavy as most things that are captured, which are of wood or partly hollow.
const FALLBACK: &str = "wood_soft";
/// Points of a part's surface that are tried against the ground.
const POINTS: usize = 256;
/// Share of a part's volume that may be left out without a word.
const LEFT_OUT: f64 = 0.01;
/// How many of its voxels a part may be raised.
const RAISED: f64 = 2.0;
/// How much of a voxel a part may stand inside of something: the engine pushes it out unseen.
const CLEAR: f64 = 0.25;
/// How often a second positions are reckoned, as Bevy's fixed step does unless told otherwise.
const RATE: f64 = 64.0;

/// How far a rigid part is, and what its body was made from.
#[derive(Component, Default)]
pub(in super::super) struct RigidSetup {
    /// What the work that runs, or ran last, was begun for.
    wish: Option<Wish>,
    /// What was told last as the reason why there is no body.
    failed: Option<String>,
    made: Option<Arc<Made>>,
    /// What is to be given to the entity, with or without its collider.
    due: Due,
    /// What masses and friction were reckoned from.
    materials: Option<BodyMaterials>,
    given: Given,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Due {
    #[default]
    Nothing,
    Numbers,
    Everything,
}

/// What a solid and its collider follow from.
struct Wish {
    part: RigidPart,
    source: Source,
    labels: Vec<u16>,
}

/// What the work gives.
pub(in super::super) struct Made {
    solid: Solid,
    regions: Regions,
    fitted: Fitted,
    /// Evenly over its surface, in metres, in the body's frame.
    surface: Vec<DVec3>,
    gaussians: usize,
    metres_per_unit: f64,
    took: Duration,
    warnings: Vec<PartPhysicsWarning>,
}

/// The work of a rigid part.
pub(in super::super) struct RigidJob;

impl JobKind for RigidJob {
    type Output = Made;
}

/// Whether two wishes ask for the same solid and collider.
fn same_shape(a: &RigidPart, b: &RigidPart) -> bool {
    RigidPart { linear_damping: 0.0, angular_damping: 0.0, ..*a }
        == RigidPart { linear_damping: 0.0, angular_damping: 0.0, ..*b }
}

/// Solid and collider of a part.
fn make(
    source: &Source,
    ids: &[u32],
    regions: Regions,
    part: &RigidPart,
    watch: &Watch,
) -> Result<Made, PartPhysicsError> {
    let start = Instant::now();
    let settings = SolidSettings {
        voxels: part.voxels,
        cut: part.cut,
        close_bottom: part.close_bottom,
        up: source.up,
        hollow: part.hollow.map(f64::from),
        ..SolidSettings::default()
    };
    let scale = source.metres_per_unit;
    let solid =
        Solid::build(&source.cloud, ids, scale, regions.by_position(), &settings).map_err(PartPhysicsError::setup)?;
    watch.tell(0.6);
    if watch.cancelled() {
        return Err(PartPhysicsError::Cancelled);
    }
    let mut warnings = Vec::new();
    warnings.extend(solid.report.leaked.then_some(PartPhysicsWarning::Open));
    let left_out = solid.report.left_out;
    warnings.extend((left_out > LEFT_OUT).then_some(PartPhysicsWarning::Pieces(left_out)));
    let choice = ShapeChoice::from(part.shape);
    let mut fitted = None;
    // What cannot be had is replaced by what is simpler.
    for choice in [choice, ShapeChoice::Hull, ShapeChoice::Box] {
        fitted = Shape::fit(&solid, choice).ok().and_then(|shape| collider(&shape, scale));
        if fitted.is_some() || watch.cancelled() {
            break;
        }
    }
    if watch.cancelled() {
        return Err(PartPhysicsError::Cancelled);
    }
    let fitted = fitted.ok_or(PartPhysicsError::NoShape)?;
    if part.shape != RigidShape::Auto && fitted.name != part.shape.name() {
        warnings.push(PartPhysicsWarning::Shape { asked: part.shape.name(), used: fitted.name });
    }
    watch.tell(0.95);
    let surface = surface_points(&solid, POINTS, 0);
    let took = start.elapsed();
    Ok(Made { solid, regions, fitted, surface, gaussians: ids.len(), metres_per_unit: scale, took, warnings })
}

type Parts<'a> = (
    Entity,
    Ref<'a, RigidPart>,
    &'a mut RigidSetup,
    Option<&'a mut Job<RigidJob>>,
    Option<&'a mut PartPhysicsStatus>,
    Has,
);

/// Begins work where something is wanted that is not there, and ends it where that cannot be.
pub(in super::super) fn start(
    mut commands: Commands,
    mut parts: Query<Parts>,
    sources: Sources,
    mut failed: MessageWriter<PartPhysicsFailed>,
) {
    for (entity, part, mut setup, _, status, _) in &mut parts {
        let setup = setup.bypass_change_detection();
        let materials = sources.materials.of(entity, FALLBACK);
        let found = materials.and_then(|materials| {
            let Some(materials) = materials else { return Ok(None) };
            Ok(sources.get(entity, &materials.labels)?.map(|source| (materials, source)))
        });
        let (materials, source) = match found {
            Ok(Some(found)) => found,
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
        let wished = setup.wish.as_ref().is_some_and(|wish| {
            same_shape(&wish.part, &part) && source.same(&wish.source) && wish.labels == materials.labels
        });
        if wished {
            if part.is_changed() && !part.is_added() && setup.made.is_some() {
                setup.due = setup.due.max(Due::Numbers);
            }
            continue;
        }
        let mut source = source.to_owned();
        if let Some(before) = &setup.wish
            && sources.capture_of(entity) == entity
        {
            // A body of its own may lie on its side by now: up is what it was.
            source.up = before.source.up;
        }
        let labels = materials.labels;
        let ids = source.ids();
        let table = sources.table(entity);
        let regions = Regions::new(&ids, table.as_ref().map(|table| &table.0), &labels);
        setup.failed = None;
        setup.due = Due::Nothing;
        let (wanted, from) = (*part, source.clone());
        setup.wish = Some(Wish { part: wanted, source, labels });
        let work = Job::<RigidJob>::start(move |watch| make(&from, &ids, regions, &wanted, watch));
        commands.entity(entity).insert((work, PartPhysicsStatus::Pending(0.0)));
    }
}

/// Tells that there is no body, once, and takes away the one that was.
fn fail(
    commands: &mut Commands,
    entity: Entity,
    setup: &mut RigidSetup,
    error: PartPhysicsError,
    failed: &mut MessageWriter<PartPhysicsFailed>,
) {
    let sentence = error.to_string();
    if setup.failed.as_ref() == Some(&sentence) {
        return;
    }
    let mut entity_commands = commands.entity(entity);
    take(&mut entity_commands, setup.given);
    entity_commands.remove::<Job<RigidJob>>().insert(PartPhysicsStatus::Failed(error.clone()));
    *setup = RigidSetup { failed: Some(sentence), wish: None, ..RigidSetup::default() };
    failed.write(PartPhysicsFailed { entity, error });
}

type Ground<'a> = (Option<&'a CaptureGround>, Option<&'a PartPhysicsStatus>);
type Grounds = (With<StaticCapture>, Without<RigidPart>);

/// Gives entities what the work made, once what they may stand on is there.
#[expect(clippy::too_many_arguments, reason = "one for each kind of thing that is read or written")]
pub(in super::super) fn finish(
    mut commands: Commands,
    mut parts: Query<Parts>,
    sources: Sources,
    grounds: Query<Ground, Grounds>,
    children: Query<(), With<ChildOf>>,
    mut ready: MessageWriter<PartPhysicsReady>,
    mut failed: MessageWriter<PartPhysicsFailed>,
    mut told: Local<bool>,
) {
    for (entity, part, mut setup, job, status, has) in &mut parts {
        let setup = setup.bypass_change_detection();
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
                    commands.entity(entity).remove::<Job<RigidJob>>();
                    setup.made = Some(Arc::new(made));
                    setup.due = Due::Everything;
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
        let Some(made) = setup.made.clone() else { continue };
        // Failures of these were told when they were looked at to begin.
        let Ok(Some(materials)) = sources.materials.of(entity, FALLBACK) else { continue };
        if setup.materials.as_ref() != Some(&materials) {
            setup.due = setup.due.max(Due::Numbers);
        }
        if setup.due == Due::Nothing {
            continue;
        }
        let ground = grounds.get(sources.capture_of(entity)).ok();
        if let Some((_, None | Some(PartPhysicsStatus::Pending(_)))) = ground {
            // It would fall through what it stands on.
            continue;
        }
        let Ok(place) = sources.place(entity) else { continue };
        let all = made.regions.materials(&materials);
        let mass = made.solid.mass_properties(&all);
        let Some(weight) = Weight::new(&mass) else {
            let wish = setup.wish.take();
            fail(&mut commands, entity, setup, PartPhysicsError::NoMass, &mut failed);
            setup.wish = wish;
            continue;
        };
        let anew = setup.due == Due::Everything;
        let body = Body { part: &part, collider: &made.fitted.collider, mass: weight, material: all[0] };
        let mut entity_commands = commands.entity(entity);
        setup.given = give(&mut entity_commands, &has, setup.given, &body, anew);
        setup.materials = Some(materials);
        setup.due = Due::Nothing;

        let mut warnings = warnings(&made, setup.materials.as_ref());
        let scale_known = sources.get(entity, &[]).ok().flatten().is_none_or(|source| source.scale_known);
        if !scale_known {
            warnings.push(PartPhysicsWarning::ScaleUnknown);
            if !std::mem::replace(&mut *told, true) {
                warn!("{entity}: {}", PartPhysicsWarning::ScaleUnknown);
            }
        }
        if anew && let Some((Some(ground), _)) = ground {
            let capture = sources.place(sources.capture_of(entity));
            let stands = capture.map(|capture| stand(&made, &place, ground, &capture));
            if let Ok(stands) = stands {
                if stands.height > 0.0 && !children.contains(entity) {
                    warnings.push(PartPhysicsWarning::Raised(stands.height));
                    let up = Vec3::Y * stands.height as f32;
                    entity_commands.entry::<Transform>().and_modify(move |mut at| at.translation += up);
                }
                if stands.depth > made.solid.grid.voxel {
                    warnings.push(PartPhysicsWarning::Overlaps(stands.depth));
                }
            }
        }
        let report = PartPhysicsReport {
            body: PartBody::Rigid { shape: made.fitted.name, pieces: made.fitted.pieces },
            metres_per_unit: made.metres_per_unit,
            gaussians: made.gaussians,
            volume: made.solid.volume(),
            mass: Some(mass),
            took: made.took,
            warnings,
        };
        commands.entity(entity).insert(PartPhysicsStatus::Ready(report.clone()));
        ready.write(PartPhysicsReady { entity, report });
    }
}

/// What is to be said about a body.
fn warnings(made: &Made, materials: Option<&BodyMaterials>) -> Vec<PartPhysicsWarning> {
    let mut warnings = made.warnings.clone();
    let Some(materials) = materials else { return warnings };
    if let Some(assumed) = materials.assumed {
        warnings.push(PartPhysicsWarning::MaterialAssumed(assumed));
    }
    let (low, high) = made.solid.bounds();
    let length = (high - low).max_element();
    let material = materials.materials[0];
    if material.elastic()
        && let Advice::Elastic(sentence) = material.visible_motion(length, RATE)
    {
        warnings.push(PartPhysicsWarning::Note(sentence));
    }
    warnings
}

/// How a part stands on the ground of a capture.
fn stand(made: &Made, place: &Place, ground: &CaptureGround, capture: &Place) -> super::raise::Raise {
    let voxel = made.solid.grid.voxel;
    let up = capture.up();
    let points: Vec<DVec3> = made.surface.iter().map(|&p| capture.body_from_world(place.world_from_body(p))).collect();
    raise(RAISED * voxel, CLEAR * voxel, |height| {
        let depth = |&point: &DVec3| ground.field.nearest(point + height * up).map_or(0.0, |(gap, _)| -gap);
        points.iter().map(depth).fold(0.0, f64::max)
    })
}

/// Takes away what an entity was given when it is to be no rigid part any more.
pub(in super::super) fn forget(removed: On<Remove, RigidPart>, mut commands: Commands, setups: Query<&RigidSetup>) {
    let entity = removed.event().entity;
    let Ok(setup) = setups.get(entity) else { return };
    let Ok(mut entity) = commands.get_entity(entity) else { return };
    take(&mut entity, setup.given);
    entity.try_remove::<(RigidSetup, Job<RigidJob>, PartPhysicsStatus)>();
}
