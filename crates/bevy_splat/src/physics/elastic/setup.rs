//! From the wish for an elastic part to the body: what is begun when, and what of it is done again when something changes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use splat_core::deform::Cage;
use splat_physics::{Advice, ElasticModel, ElasticSettings, Material, Progress, Solid, SolidSettings};

use super::super::ground::{CaptureGround, StaticCapture};
use super::super::jobs::{Job, JobKind, Watch};
use super::super::material::BodyMaterials;
use super::super::part::{Regions, Source, Sources};
use super::super::status::{
    PartBody, PartPhysicsError, PartPhysicsFailed, PartPhysicsReady, PartPhysicsReport, PartPhysicsStatus,
    PartPhysicsWarning,
};
use super::ElasticPart;
use super::obstacle::ContactSurface;
use super::state::{ElasticState, Made};
use super::surface::RestSurface;
use crate::components::SplatDeformation;

/// What a part without a material is taken for: soft enough that one sees it is elastic.
const FALLBACK: &str = "rubber";
/// How often a second positions are reckoned, as Bevy's fixed step does unless told otherwise.
const RATE: f64 = 64.0;

/// How far an elastic part is, and what its body was made from.
#[derive(Component, Default)]
pub(super) struct ElasticSetup {
    /// What the work that runs, or ran last, was begun for.
    wish: Option<Wish>,
    /// What was told last as the reason why there is no body.
    failed: Option<String>,
    built: Option<Arc<Built>>,
    /// Whether what was built is not in the entity yet.
    due: bool,
}

/// What a body follows from.
#[derive(Clone)]
struct Wish {
    part: ElasticPart,
    source: Source,
    materials: BodyMaterials,
}

/// What the work gives.
pub(super) struct Built {
    solid: Arc<Solid>,
    regions: Regions,
    model: Arc<ElasticModel>,
    surface: Arc<RestSurface>,
    gaussians: usize,
    took: Duration,
    warnings: Vec<PartPhysicsWarning>,
}

/// The work of an elastic part.
pub(super) struct ElasticJob;

impl JobKind for ElasticJob {
    type Output = Built;
}

/// Why an entity cannot be an elastic part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ElasticPartError {
    /// The solver moves parts in the world.
    #[error(
        "the part is a child of {0}: an elastic part moves by itself; remove its ChildOf, or take the part out of its capture"
    )]
    Child(Entity),
}

/// What of a body has to be made anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Anew {
    /// Friction and bounce: nothing of the body.
    Skin,
    /// Masses and stiffness at the samples; the weights stay.
    Model,
    /// Cage and weights; the solid stays.
    Basis,
    Everything,
}

impl Anew {
    fn between(before: &Wish, part: &ElasticPart, source_same: bool, materials: &BodyMaterials) -> Option<Self> {
        let old = &before.part;
        let same_solid = source_same
            && (old.hollow, old.close_bottom) == (part.hollow, part.close_bottom)
            && before.materials.labels == materials.labels;
        if !same_solid {
            return Some(Self::Everything);
        }
        let basis = |p: &ElasticPart| (p.basis, p.handles, p.cage_cells, p.seed);
        let (a, b) = (&before.materials.materials, &materials.materials);
        if basis(old) != basis(part) || !same_but_for_a_factor(a, b) {
            return Some(Self::Basis);
        }
        let bulk = |m: &Material| (m.density, m.youngs_modulus, m.damping_ratio);
        if old != part || a.iter().map(bulk).ne(b.iter().map(bulk)) {
            return Some(Self::Model);
        }
        (a != b || before.materials.assumed != materials.assumed).then_some(Self::Skin)
    }
}

/// Whether all are stiffer by one factor: the weights, which only see how stiff regions are against each other, stay.
fn same_but_for_a_factor(a: &[Material], b: &[Material]) -> bool {
    let factor = |(a, b): (&Material, &Material)| f64::from(b.youngs_modulus) / f64::from(a.youngs_modulus);
    let first = a.iter().zip(b).map(factor).next().unwrap_or(1.0);
    a.len() == b.len()
        && a.iter()
            .zip(b)
            .all(|pair| (factor(pair) - first).abs() <= 1e-6 * first && pair.0.poisson_ratio == pair.1.poisson_ratio)
}

/// Tells a [`Watch`] about a part of the work.
struct Told<'a> {
    watch: &'a Watch,
    from: f32,
}

impl Progress for Told<'_> {
    fn report(&self, fraction: f32) {
        self.watch.tell(self.from + (0.95 - self.from) * fraction);
    }

    fn cancelled(&self) -> bool {
        self.watch.cancelled()
    }
}

fn make(
    wish: &Wish,
    table: Option<&splat_core::Parts>,
    old: Option<(Anew, Arc<Built>)>,
    watch: &Watch,
) -> Result<Built, PartPhysicsError> {
    let start = Instant::now();
    let settings: ElasticSettings = wish.part.settings();
    let ids = wish.source.ids();
    let solid_settings = SolidSettings {
        close_bottom: wish.part.close_bottom,
        up: wish.source.up,
        hollow: wish.part.hollow.map(f64::from),
        ..SolidSettings::default()
    };
    let (solid, regions) = match &old {
        Some((Anew::Skin | Anew::Model | Anew::Basis, old)) => (old.solid.clone(), old.regions.clone()),
        _ => {
            let regions = Regions::new(&ids, table, &wish.materials.labels);
            let unit = wish.source.metres_per_unit;
            let solid = Solid::build(&wish.source.cloud, &ids, unit, regions.by_position(), &solid_settings)
                .map_err(PartPhysicsError::setup)?;
            (Arc::new(solid), regions)
        }
    };
    watch.tell(0.4);
    if watch.cancelled() {
        return Err(PartPhysicsError::Cancelled);
    }
    let materials = regions.materials(&wish.materials);
    let model = match &old {
        Some((Anew::Skin | Anew::Model, old)) => {
            let (cage, weights) = (old.model.cage().clone(), old.model.weights().clone());
            ElasticModel::from_weights(&solid, &materials, &settings, cage, weights)
        }
        _ => ElasticModel::build(&solid, &materials, &settings, &Told { watch, from: 0.4 }),
    };
    let model = model.map_err(PartPhysicsError::setup)?;
    if watch.cancelled() {
        return Err(PartPhysicsError::Cancelled);
    }
    let surface = RestSurface::new(&solid, model.contact_points());
    let mut warnings: Vec<PartPhysicsWarning> =
        solid.report.notes().map(|note| PartPhysicsWarning::Note(note.to_string())).collect();
    if model.handles() < usize::from(settings.handles) && settings.basis != splat_physics::BasisKind::Affine {
        let (has, asked) = (model.handles(), settings.handles);
        warnings
            .push(PartPhysicsWarning::Note(format!("the part has {has} handles, not the {asked} that were asked for")));
    }
    let (low, high) = solid.bounds();
    if let Advice::Rigid(sentence) = wish.materials.materials[0].visible_motion((high - low).max_element(), RATE) {
        warnings.push(PartPhysicsWarning::Note(sentence));
    }
    Ok(Built {
        regions,
        model: Arc::new(model),
        surface: Arc::new(surface),
        gaussians: ids.len(),
        took: start.elapsed(),
        warnings,
        solid,
    })
}

type Parts<'a> = (
    Entity,
    &'a ElasticPart,
    &'a mut ElasticSetup,
    Option<&'a mut Job<ElasticJob>>,
    Option<&'a mut PartPhysicsStatus>,
    Option<&'a mut ElasticState>,
    Option<&'a ChildOf>,
);

/// Begins work where something is wanted that is not there, and ends it where that cannot be.
pub(super) fn start(
    mut commands: Commands,
    mut parts: Query<Parts>,
    sources: Sources,
    mut failed: MessageWriter<PartPhysicsFailed>,
) {
    for (entity, part, mut setup, job, status, state, child) in &mut parts {
        let setup = setup.bypass_change_detection();
        let found = match child {
            Some(child) => Err(PartPhysicsError::setup(ElasticPartError::Child(child.parent()))),
            None => sources.materials.of(entity, FALLBACK).and_then(|materials| {
                let Some(materials) = materials else { return Ok(None) };
                Ok(sources.get(entity, &materials.labels)?.map(|source| (materials, source)))
            }),
        };
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
        let mut anew = Anew::Everything;
        if let Some(wish) = &setup.wish {
            let same = source.same(&wish.source);
            let Some(changed) = Anew::between(wish, part, same, &materials) else { continue };
            if setup.built.is_some() && job.is_none() {
                anew = changed;
            }
        }
        let mut kept = source.to_owned();
        if let Some(before) = &setup.wish
            && sources.capture_of(entity) == entity
        {
            // A body of its own may lie on its side by now: up is what it was.
            kept.up = before.source.up;
        }
        let wish = Wish { part: part.clone(), source: kept, materials };
        setup.failed = None;
        setup.wish = Some(wish.clone());
        if anew == Anew::Skin
            && let (Some(built), Some(mut state)) = (&setup.built, state)
        {
            state.made.skin = skin(built, &wish.materials);
            state.wake();
            continue;
        }
        setup.due = false;
        let table = sources.table(entity).map(|table| table.0.clone()).filter(|_| !wish.materials.labels.is_empty());
        let old = setup.built.clone().map(|built| (anew, built));
        let work = Job::<ElasticJob>::start(move |watch| make(&wish, table.as_ref(), old, watch));
        commands.entity(entity).insert((work, PartPhysicsStatus::Pending(0.0)));
    }
}

/// Tells that there is no body, once, and takes away the one that was.
fn fail(
    commands: &mut Commands,
    entity: Entity,
    setup: &mut ElasticSetup,
    error: PartPhysicsError,
    failed: &mut MessageWriter<PartPhysicsFailed>,
) {
    let sentence = error.to_string();
    if setup.failed.as_ref() == Some(&sentence) {
        return;
    }
    commands
        .entity(entity)
        .remove::<(Job<ElasticJob>, ElasticState, SplatDeformation)>()
        .insert(PartPhysicsStatus::Failed(error.clone()));
    *setup = ElasticSetup { failed: Some(sentence), ..ElasticSetup::default() };
    failed.write(PartPhysicsFailed { entity, error });
}

type Ground<'a> = (Has<CaptureGround>, Option<&'a PartPhysicsStatus>);
type Grounds = (With<StaticCapture>, Without<ElasticPart>);

/// Gives entities what the work made, once what they may stand on is there.
pub(super) fn finish(
    mut commands: Commands,
    mut parts: Query<(Parts, &Transform)>,
    sources: Sources,
    grounds: Query<Ground, Grounds>,
    mut ready: MessageWriter<PartPhysicsReady>,
    mut failed: MessageWriter<PartPhysicsFailed>,
) {
    for ((entity, _, mut setup, job, status, state, _), place) in &mut parts {
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
                Some(Ok(built)) => {
                    commands.entity(entity).remove::<Job<ElasticJob>>();
                    setup.built = Some(Arc::new(built));
                    setup.due = true;
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
        if !setup.due {
            continue;
        }
        let (Some(built), Some(wish)) = (setup.built.clone(), &setup.wish) else { continue };
        if let Ok((false, None | Some(PartPhysicsStatus::Pending(_)))) = grounds.get(sources.capture_of(entity)) {
            // It would fall through what it stands on.
            continue;
        }
        setup.due = false;
        let unit = wish.source.metres_per_unit;
        let cage = built.model.cage().cage;
        let cage = Cage { origin: cage.origin / unit as f32, cell: cage.cell / unit as f32, cells: cage.cells };
        let skin = skin(&built, &wish.materials);
        let made = Made { metres_per_unit: unit, cage, surface: built.surface.clone(), skin };
        let mut new = ElasticState::new(built.model.clone(), made, *place);
        if let Some(old) = state {
            // What it was bent is lost; where it is and how it moves as a whole is not.
            let (before, rigid) = (old.body.frame(), old.body.rigid_state());
            let scaled = old.metres_per_unit() != unit;
            if !old.frozen && !scaled && before.translation.is_finite() {
                new.body.place(before);
                new.body.kick(rigid.linear_velocity, rigid.angular_velocity);
                new.settle();
            }
            new.drawn = old.drawn;
        }
        commands.entity(entity).insert(new);

        let mut warnings = built.warnings.clone();
        if let Some(assumed) = wish.materials.assumed {
            warnings.push(PartPhysicsWarning::MaterialAssumed(assumed));
        }
        let scale_known = sources.get(entity, &[]).ok().flatten().is_none_or(|source| source.scale_known);
        if !scale_known {
            warnings.push(PartPhysicsWarning::ScaleUnknown);
        }
        let model = &built.model;
        let report = PartPhysicsReport {
            body: PartBody::Elastic { handles: model.handles(), samples: model.samples().len() },
            metres_per_unit: unit,
            gaussians: built.gaussians,
            volume: built.solid.volume(),
            mass: Some(*model.mass()),
            took: built.took,
            warnings,
        };
        commands.entity(entity).insert(PartPhysicsStatus::Ready(report.clone()));
        ready.write(PartPhysicsReady { entity, report });
    }
}

/// How rough and bouncy each contact point is: as the material of the region that is nearest.
fn skin(built: &Built, materials: &BodyMaterials) -> Arc<[ContactSurface]> {
    let materials = built.regions.materials(materials);
    let samples = built.model.samples();
    let surface = |point: &bevy::math::DVec3| {
        let nearest = samples
            .iter()
            .min_by(|a, b| a.position.distance_squared(*point).total_cmp(&b.position.distance_squared(*point)));
        let region = nearest.map_or(0, |sample| usize::from(sample.region));
        let material = materials.get(region).unwrap_or(&materials[0]);
        ContactSurface {
            friction: [f64::from(material.friction_dynamic), f64::from(material.friction_static)],
            restitution: f64::from(material.restitution),
            ..ContactSurface::default()
        }
    };
    built.model.contact_points().iter().map(surface).collect()
}

/// Takes away what an entity was given when it is to be no elastic part any more.
pub(super) fn forget(removed: On<Remove, ElasticPart>, mut commands: Commands) {
    if let Ok(mut entity) = commands.get_entity(removed.event().entity) {
        entity.try_remove::<(ElasticSetup, Job<ElasticJob>, ElasticState, SplatDeformation, PartPhysicsStatus)>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(youngs_modulus: f32) -> Material {
        Material { youngs_modulus, ..Material::preset("rubber").unwrap() }
    }

    #[test]
    fn a_uniform_factor_of_stiffness_keeps_the_weights_and_another_ratio_does_not() {
        let (soft, stiff) = ([material(1e4), material(1e6)], [material(2e4), material(2e6)]);
        assert!(same_but_for_a_factor(&soft, &stiff));
        assert!(!same_but_for_a_factor(&soft, &[material(2e4), material(1e6)]));
        let other = Material { poisson_ratio: 0.1, ..material(1e6) };
        assert!(!same_but_for_a_factor(&soft, &[material(1e4), other]));
        assert!(!same_but_for_a_factor(&soft, &soft[..1]));
    }
}
