//! What a body is made from: the Gaussians of an entity, its scale, and which way is up.

use std::sync::Arc;

use bevy::ecs::change_detection::Tick;
use bevy::ecs::system::SystemParam;
use bevy::math::{DQuat, DVec3};
use bevy::prelude::*;
use splat_core::{Cloud, Parts, Selection};

use super::material::{BodyMaterials, Materials};
use super::scale::CaptureScale;
use super::status::PartPhysicsError;
use crate::components::{SplatFlags, SplatParts, SplatSubset};
use crate::{SplatCloud, Splats};

/// How much the axes of a scale may differ, relative to each other, and still be one scale.
const EVEN: f32 = 1e-4;

/// Where an entity stands: a body frame's axes and origin in the world, and metres per unit of its cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) rotation: DQuat,
    /// In metres.
    pub(super) translation: DVec3,
    pub(super) metres_per_unit: f64,
}

impl Place {
    /// The up of the world, along the axes of the cloud.
    pub(super) fn up(&self) -> DVec3 {
        self.rotation.inverse() * DVec3::Y
    }

    /// A point of the world in the body's frame, in metres.
    pub(super) fn body_from_world(&self, point: DVec3) -> DVec3 {
        self.rotation.inverse() * (point - self.translation)
    }

    /// A point of the body's frame, in metres, in the world.
    pub(super) fn world_from_body(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }
}

/// The Gaussians of an entity and what they are measured by, as found in the world.
pub(super) struct SourceRef<'a> {
    cloud: &'a Arc<Cloud>,
    subset: Option<&'a SplatSubset>,
    hidden: &'a Selection,
    /// When the table of parts changed last, if that matters.
    table: Option<Tick>,
    /// Where the entity stands now.
    pub(super) place: Place,
    /// Up along the axes of the cloud: that of the capture, which does not fall over.
    up: DVec3,
    /// Whether somebody told how large the capture is.
    pub(super) scale_known: bool,
}

/// As [`SourceRef`], to keep and to hand to other threads.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) cloud: Arc<Cloud>,
    subset: Option<SplatSubset>,
    hidden: Selection,
    table: Option<Tick>,
    pub(super) metres_per_unit: f64,
    /// Unit vector along the axes of the cloud.
    pub(super) up: DVec3,
}

impl SourceRef<'_> {
    /// Whether `other` was made from the same. Which way is up does not count: bodies turn.
    pub(super) fn same(&self, other: &Source) -> bool {
        Arc::ptr_eq(self.cloud, &other.cloud)
            && self.subset.map(|s| &s.0) == other.subset.as_ref().map(|s| &s.0)
            && *self.hidden == other.hidden
            && self.table == other.table
            && self.place.metres_per_unit == other.metres_per_unit
    }

    /// A copy to keep.
    pub(super) fn to_owned(&self) -> Source {
        Source {
            cloud: self.cloud.clone(),
            subset: self.subset.cloned(),
            hidden: self.hidden.clone(),
            table: self.table,
            metres_per_unit: self.place.metres_per_unit,
            up: self.up,
        }
    }
}

impl Source {
    /// The Gaussians that the entity has, hidden ones included; `None`: all.
    pub(super) fn subset(&self) -> Option<&SplatSubset> {
        self.subset.as_ref()
    }

    /// The Gaussians that are shown, rising.
    pub(super) fn ids(&self) -> Vec<u32> {
        let len = self.cloud.len() as u32;
        let shown = |id: &u32| *id < len && !self.hidden.contains(*id as usize);
        match &self.subset {
            Some(subset) => subset.0.iter().copied().filter(shown).collect(),
            None => (0..len).filter(shown).collect(),
        }
    }
}

/// Which Gaussians have a material of their own.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Regions {
    /// The labels of regions 1, 2, ...: those that some Gaussian of the body has.
    pub(super) labels: Vec<u16>,
    /// The region of each Gaussian, by position in the list of ids; empty where all are of region 0.
    pub(super) of: Vec<u8>,
}

impl Regions {
    /// Where `labels` are in the table among the Gaussians `ids`. More than 255 of them count as region 0.
    pub(super) fn new(ids: &[u32], table: Option<&Parts>, labels: &[u16]) -> Self {
        let Some(table) = table.filter(|_| !labels.is_empty()) else { return Self::default() };
        let label = |&id: &u32| table.part_of(id as usize).map(|part| part.0);
        let mut used: Vec<u16> = ids.iter().filter_map(label).filter(|label| labels.contains(label)).collect();
        used.sort_unstable();
        used.dedup();
        used.truncate(255);
        if used.is_empty() {
            return Self::default();
        }
        let region = |label: u16| used.binary_search(&label).map_or(0, |k| k as u8 + 1);
        let of = ids.iter().map(|id| label(id).map_or(0, region)).collect();
        Self { labels: used, of }
    }

    /// For [`splat_physics::Solid::build`].
    pub(super) fn by_position(&self) -> Option<&[u8]> {
        (!self.of.is_empty()).then_some(&self.of)
    }

    /// The materials of regions 0, 1, 2, ...
    pub(super) fn materials(&self, all: &BodyMaterials) -> Vec<splat_physics::Material> {
        let listed = |label: &u16| all.labels.iter().position(|l| l == label).map_or(0, |k| k + 1);
        std::iter::once(0).chain(self.labels.iter().map(listed)).map(|k| all.materials[k]).collect()
    }
}

/// Finds what bodies are made from.
#[derive(SystemParam)]
pub(super) struct Sources<'w, 's> {
    clouds: Res<'w, Assets<SplatCloud>>,
    server: Option<Res<'w, AssetServer>>,
    splats: Query<'w, 's, (&'static Splats, Option<&'static SplatFlags>, Option<&'static SplatSubset>)>,
    scales: Query<'w, 's, &'static CaptureScale>,
    tables: Query<'w, 's, Ref<'static, SplatParts>>,
    transforms: Query<'w, 's, &'static Transform>,
    above: Query<'w, 's, &'static ChildOf>,
    pub(super) materials: Materials<'w, 's>,
}

static NONE: std::sync::LazyLock<Selection> = std::sync::LazyLock::new(Selection::default);

impl Sources<'_, '_> {
    /// What a body of an entity is made from; `None` while its capture is loading. `labels`: those that have materials of their
    /// own.
    pub(super) fn get(&self, entity: Entity, labels: &[u16]) -> Result<Option<SourceRef<'_>>, PartPhysicsError> {
        let (splats, flags, subset) = self.splats.get(entity).map_err(|_| PartPhysicsError::NoSplats)?;
        let place = self.place(entity)?;
        let scale_known = self.scale_known(entity)?;
        let Some(cloud) = self.clouds.get(&splats.0) else {
            let state = self.server.as_ref().and_then(|server| server.get_load_state(&splats.0));
            if matches!(state, Some(bevy::asset::LoadState::Failed(_))) {
                return Err(PartPhysicsError::NotLoaded);
            }
            return Ok(None);
        };
        let rests = self.capture_of(entity);
        let up = self.place(rests).map_or(place.up(), |place| place.up());
        let table = self.table(entity).filter(|_| !labels.is_empty()).map(|table| table.last_changed());
        let hidden = flags.map_or(&*NONE, |flags| &flags.hidden);
        Ok(Some(SourceRef { cloud: &cloud.cloud, subset, hidden, table, place, up, scale_known }))
    }

    /// What an entity was taken out of, first of all: the capture; itself where it was not taken out of anything that is left.
    pub(super) fn capture_of(&self, entity: Entity) -> Entity {
        let line = self.materials.line(entity).filter(|&entity| self.splats.contains(entity));
        line.last().unwrap_or(entity)
    }

    /// The table of parts that names an entity's Gaussians.
    pub(super) fn table(&self, entity: Entity) -> Option<Ref<'_, SplatParts>> {
        self.materials.line(entity).find_map(|entity| self.tables.get(entity).ok())
    }

    /// Where an entity stands, from its `Transform` and those above: `GlobalTransform` is a frame old.
    pub(super) fn place(&self, entity: Entity) -> Result<Place, PartPhysicsError> {
        let mut place = Place { rotation: DQuat::IDENTITY, translation: DVec3::ZERO, metres_per_unit: 1.0 };
        let up = |entity: &Entity| self.above.get(*entity).ok().map(ChildOf::parent);
        for entity in std::iter::successors(Some(entity), up) {
            let Ok(transform) = self.transforms.get(entity) else { continue };
            let scale = even(transform)?;
            let rotation = transform.rotation.as_dquat().normalize();
            place.translation = transform.translation.as_dvec3() + rotation * (place.translation * scale);
            place.rotation = rotation * place.rotation;
            place.metres_per_unit *= scale;
        }
        Ok(place)
    }

    /// Whether somebody told how large the capture is that an entity belongs to.
    fn scale_known(&self, entity: Entity) -> Result<bool, PartPhysicsError> {
        let told = self.materials.line(entity).find_map(|entity| self.scales.get(entity).ok()?.metres_per_unit);
        match told {
            Some(scale) if !(scale.is_finite() && scale > 0.0) => Err(PartPhysicsError::BadScale(scale)),
            told => Ok(told.is_some()),
        }
    }
}

/// The scale of a transform.
fn even(transform: &Transform) -> Result<f64, PartPhysicsError> {
    let scale = transform.scale;
    if !transform.is_finite() || !(scale.min_element() > 0.0) || !(transform.rotation.length_squared() > 0.5) {
        return Err(PartPhysicsError::BadTransform);
    }
    if scale.max_element() - scale.min_element() > EVEN * scale.max_element() {
        return Err(PartPhysicsError::NonUniformScale(scale));
    }
    Ok(f64::from(scale.x))
}
