//! [`PhysicsMaterial`]: what a part is made of, by name, as an asset, or as numbers; [`PartMaterial`], [`PartMaterials`]: which
//! part is made of what.

mod file;

use std::collections::BTreeMap;

use bevy::asset::{Asset, AssetServer, Assets, LoadState};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use splat_core::PartId;
use splat_physics::{Material, MaterialError, PRESETS};

use super::status::PartPhysicsError;
use crate::parts::{PartOf, SplatPart};

pub use file::{PhysicsMaterialError, PhysicsMaterialLoader};

/// What something is made of, in SI units.
///
/// From code: [`preset`](Self::preset), or a value with its fields. From a file `red_rubber.material.ron`, by
/// `asset_server.load("red_rubber.material.ron")`:
///
/// ```ron
/// // All fields, or a preset and what differs from it.
/// (preset: "rubber", density: 950.0, friction_static: 0.9)
/// ```
///
/// A change of the asset reaches the bodies made of it: friction and the like at once, masses anew, the rest where it is
/// needed.
#[derive(Asset, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhysicsMaterial {
    /// In kg/m^3, above 0.
    pub density: f32,
    /// Young's modulus in Pa, above 0: how hard it is to stretch.
    pub youngs_modulus: f32,
    /// Poisson's ratio, 0 to below 0.5: how much thinner it becomes when stretched.
    pub poisson_ratio: f32,
    /// Coefficient of friction at rest, 0 or more.
    pub friction_static: f32,
    /// Coefficient of friction when sliding, 0 or more.
    pub friction_dynamic: f32,
    /// How much of its speed it keeps when it bounces, 0 to 1.
    pub restitution: f32,
    /// Share of critical damping of its slowest oscillation, 0 or more.
    pub damping_ratio: f32,
}

impl PhysicsMaterial {
    /// A material by its name in [`splat_physics::PRESETS`]: `rubber`, `wood_soft`, `steel`, ...
    pub fn preset(name: &str) -> Option<Self> {
        Material::preset(name).map(Self::from)
    }

    /// Whether every number is in its range.
    ///
    /// # Errors
    /// Which one is not.
    pub fn check(&self) -> Result<(), MaterialError> {
        Material::from(*self).check()
    }
}

impl From<Material> for PhysicsMaterial {
    fn from(m: Material) -> Self {
        Self {
            density: m.density,
            youngs_modulus: m.youngs_modulus,
            poisson_ratio: m.poisson_ratio,
            friction_static: m.friction_static,
            friction_dynamic: m.friction_dynamic,
            restitution: m.restitution,
            damping_ratio: m.damping_ratio,
        }
    }
}

impl From<PhysicsMaterial> for Material {
    fn from(m: PhysicsMaterial) -> Self {
        Self {
            density: m.density,
            youngs_modulus: m.youngs_modulus,
            poisson_ratio: m.poisson_ratio,
            friction_static: m.friction_static,
            friction_dynamic: m.friction_dynamic,
            restitution: m.restitution,
            damping_ratio: m.damping_ratio,
        }
    }
}

/// What a part, or a capture that stands still, is made of.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::prelude::*;
/// # fn system(mut commands: Commands, part: Single<Entity, With<SplatPart>>, assets: Res<AssetServer>) {
/// commands.entity(*part).insert(PartMaterial::preset("rubber"));
/// commands.entity(*part).insert(PartMaterial::from(assets.load("red_rubber.material.ron")));
/// # }
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub enum PartMaterial {
    /// A preset by its name; see [`PhysicsMaterial::preset`].
    Preset(String),
    /// An asset.
    Asset(Handle<PhysicsMaterial>),
    /// Numbers.
    Value(PhysicsMaterial),
}

impl PartMaterial {
    /// A preset by its name. A name that does not exist is told by the part's
    /// [`PartPhysicsStatus`](super::PartPhysicsStatus).
    pub fn preset(name: impl Into<String>) -> Self {
        Self::Preset(name.into())
    }
}

impl From<Handle<PhysicsMaterial>> for PartMaterial {
    fn from(handle: Handle<PhysicsMaterial>) -> Self {
        Self::Asset(handle)
    }
}

impl From<PhysicsMaterial> for PartMaterial {
    fn from(material: PhysicsMaterial) -> Self {
        Self::Value(material)
    }
}

/// Materials by label of [`SplatParts`](crate::SplatParts), on the entity of a part or on the capture.
///
/// The Gaussians of one body whose labels are listed have these materials, the others that of the body: a doll's hair may be
/// softer than its head. A part without a [`PartMaterial`] of its own has the one listed for it, by itself or by what it
/// was taken out of.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct PartMaterials(pub BTreeMap<u16, PartMaterial>);

impl PartMaterials {
    /// The same with a material for one more label.
    pub fn with(mut self, part: PartId, material: impl Into<PartMaterial>) -> Self {
        self.0.insert(part.0, material.into());
        self
    }

    /// The material listed for a label.
    pub fn get(&self, part: PartId) -> Option<&PartMaterial> {
        self.0.get(&part.0)
    }
}

/// Longest chain of parts taken out of parts that is followed.
const DEEPEST: usize = 64;

/// Finds what entities are made of.
#[derive(SystemParam)]
pub(super) struct Materials<'w, 's> {
    assets: Res<'w, Assets<PhysicsMaterial>>,
    server: Option<Res<'w, AssetServer>>,
    own: Query<'w, 's, &'static PartMaterial>,
    tables: Query<'w, 's, &'static PartMaterials>,
    labels: Query<'w, 's, &'static SplatPart>,
    links: Query<'w, 's, &'static PartOf>,
}

/// The materials of a body: the first is that of Gaussians whose label is not listed.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BodyMaterials {
    /// As [`splat_physics::Solid`] wants them: region by region.
    pub(super) materials: Vec<Material>,
    /// The labels of all regions but the first.
    pub(super) labels: Vec<u16>,
    /// The body's own was not told: this preset was assumed.
    pub(super) assumed: Option<&'static str>,
}

impl Materials<'_, '_> {
    /// The materials of a body, `fallback` (the name of a preset) where nothing says what it is made of; `None` while one is
    /// loading.
    pub(super) fn of(&self, entity: Entity, fallback: &'static str) -> Result<Option<BodyMaterials>, PartPhysicsError> {
        let label = self.labels.get(entity).ok().map(|part| part.0);
        let tables = || self.line(entity).filter_map(|entity| self.tables.get(entity).ok());
        let listed = |label: PartId| tables().find_map(|table| table.get(label));
        let own = self.own.get(entity).ok().or_else(|| label.and_then(listed));
        let (assumed, base) = match own {
            Some(own) => (None, self.value(own)?),
            None => (Some(fallback), Some(preset(fallback)?)),
        };
        let Some(base) = base else { return Ok(None) };
        let mut out = BodyMaterials { materials: vec![base], labels: Vec::new(), assumed };
        let mut regions = BTreeMap::new();
        // What is nearer to the entity decides.
        for table in tables() {
            for (&label, material) in &table.0 {
                regions.entry(label).or_insert(material);
            }
        }
        for (region, material) in regions {
            // A part's own label means the part.
            if Some(PartId(region)) == label {
                continue;
            }
            let Some(material) = self.value(material)? else { return Ok(None) };
            out.labels.push(region);
            out.materials.push(material);
        }
        Ok(Some(out))
    }

    /// An entity, and one after the other what it was taken out of.
    pub(super) fn line(&self, entity: Entity) -> impl Iterator<Item = Entity> {
        let next = |&entity: &Entity| self.links.get(entity).ok().map(|link| link.0);
        std::iter::successors(Some(entity), next).take(DEEPEST)
    }

    /// The numbers, within their ranges; `None` while they are loading.
    fn value(&self, material: &PartMaterial) -> Result<Option<Material>, PartPhysicsError> {
        let material = match material {
            PartMaterial::Preset(name) => preset(name)?,
            PartMaterial::Value(value) => Material::from(*value),
            PartMaterial::Asset(handle) => match self.assets.get(handle) {
                Some(value) => Material::from(*value),
                None => {
                    let state = self.server.as_ref().and_then(|server| server.get_load_state(handle));
                    let Some(LoadState::Failed(error)) = state else { return Ok(None) };
                    return Err(PartPhysicsError::MaterialNotLoaded(error.to_string()));
                }
            },
        };
        material.check().map_err(|error| PartPhysicsError::Material(std::sync::Arc::new(error)))?;
        Ok(Some(material))
    }
}

fn preset(name: &str) -> Result<Material, PartPhysicsError> {
    Material::preset(name).ok_or_else(|| PartPhysicsError::UnknownMaterial { name: name.to_owned(), known: known() })
}

/// The names of all presets.
fn known() -> String {
    PRESETS.iter().map(|preset| preset.name).collect::<Vec<_>>().join(", ")
}

/// Adds the asset and its loader.
pub(super) fn plugin(app: &mut App) {
    app.init_asset::<PhysicsMaterial>()
        .register_asset_reflect::<PhysicsMaterial>()
        .register_asset_loader(PhysicsMaterialLoader)
        .register_type::<(PartMaterial, PartMaterials)>();
}

#[cfg(test)]
mod tests;
