//! A `Splats` entity as the rasteriser sees it: what picking, selecting and segmenting share.

use std::sync::Arc;

use bevy::asset::AssetId;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use splat_core::{Cloud, SelectMode, Selection};
use splat_raster::Instance;

use crate::components::{SplatDeformation, SplatFlags, SplatSubset};
use crate::render::similarity;
use crate::{SplatCloud, Splats};

/// Which of an entity's Gaussians may be named by ids of the whole cloud, and which count through its subset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ids {
    /// Ids are positions in the entity's subset; the cost follows the subset's length.
    OfSubset,
    /// Ids are those of the cloud; what does not belong to the entity is hidden.
    OfCloud,
}

type Components<'a> = (
    Entity,
    &'a Splats,
    &'a GlobalTransform,
    &'a InheritedVisibility,
    &'a SplatFlags,
    Option<&'a SplatSubset>,
    Option<&'a RenderLayers>,
    Option<&'a SplatDeformation>,
);

/// All `Splats` entities whose clouds are loaded.
#[derive(SystemParam)]
pub(crate) struct PlacedSplats<'w, 's> {
    clouds: Res<'w, Assets<SplatCloud>>,
    splats: Query<'w, 's, Components<'static>>,
}

impl PlacedSplats<'_, '_> {
    /// The cloud of an entity, once it is loaded.
    pub(crate) fn cloud(&self, entity: Entity) -> Option<(AssetId<SplatCloud>, &Arc<Cloud>)> {
        let (_, handle, ..) = self.splats.get(entity).ok()?;
        Some((handle.0.id(), &self.clouds.get(&handle.0)?.cloud))
    }

    /// Whether the entity has `Splats` at all, loaded or not.
    pub(crate) fn has(&self, entity: Entity) -> bool {
        self.splats.contains(entity)
    }

    /// Every cloud that an entity shows, each as often as it is shown.
    pub(crate) fn clouds(&self) -> impl Iterator<Item = (AssetId<SplatCloud>, &Arc<Cloud>)> {
        let cloud = |(_, handle, ..): (_, &Splats, _, _, _, _, _, _)| (handle.0.id(), self.clouds.get(&handle.0));
        self.splats.iter().map(cloud).filter_map(|(id, asset)| Some((id, &asset?.cloud)))
    }

    /// Visible entities on a camera's layers, in order of their ids, so that ties of depth fall the same way every time.
    pub(crate) fn seen_on(&self, layers: Option<&RenderLayers>) -> Vec<Entity> {
        let default = RenderLayers::default();
        let camera = layers.unwrap_or(&default);
        let on = |(entity, _, _, visible, _, _, layers, _): (
            _,
            _,
            _,
            &InheritedVisibility,
            _,
            _,
            Option<&RenderLayers>,
            _,
        )| {
            (visible.get() && camera.intersects(layers.unwrap_or(&RenderLayers::default()))).then_some(entity)
        };
        let mut seen: Vec<Entity> = self.splats.iter().filter_map(on).collect();
        seen.sort_unstable();
        seen
    }

    /// The entity as an instance in the world; `None` while it is loading or where its transform cannot be drawn.
    pub(crate) fn instance(&self, entity: Entity, ids: Ids) -> Option<Instance> {
        let (_, handle, transform, _, flags, subset, _, deformation) = self.splats.get(entity).ok()?;
        let cloud = self.clouds.get(&handle.0)?.cloud.clone();
        let subset = fitting(subset, cloud.len());
        let (hidden, subset) = match ids {
            Ids::OfSubset => (lit(&flags.hidden, cloud.len()), subset.map(|ids| ids.0.clone())),
            Ids::OfCloud => (Some(withheld(&[&flags.hidden], subset, cloud.len())).filter(|s| s.count() > 0), None),
        };
        Some(Instance {
            transform: similarity(transform)?,
            hidden: hidden.map(Arc::new),
            subset,
            deformation: deformation.map(|d| d.0.clone()),
            ..Instance::new(cloud)
        })
    }

    /// Gaussians that cannot be selected: hidden, locked, or not the entity's own.
    pub(crate) fn withheld(&self, entity: Entity) -> Option<Selection> {
        let (_, handle, _, _, flags, subset, ..) = self.splats.get(entity).ok()?;
        let len = self.clouds.get(&handle.0)?.cloud.len();
        Some(withheld(&[&flags.hidden, &flags.locked], fitting(subset, len), len))
    }

    /// Whether a Gaussian is locked.
    pub(crate) fn locked(&self, entity: Entity, gaussian: u32) -> bool {
        self.splats.get(entity).is_ok_and(|(_, _, _, _, flags, ..)| flags.locked.contains(gaussian as usize))
    }
}

/// A subset that names Gaussians the cloud does not have is left from another file.
fn fitting(subset: Option<&SplatSubset>, len: usize) -> Option<&SplatSubset> {
    subset.filter(|ids| ids.0.last().is_none_or(|&id| (id as usize) < len))
}

/// Bits that fit the cloud and of which some are set.
fn lit(bits: &Selection, len: usize) -> Option<Selection> {
    (bits.len() == len && bits.count() > 0).then(|| bits.clone())
}

fn withheld(flags: &[&Selection], subset: Option<&SplatSubset>, len: usize) -> Selection {
    let mut out = match subset {
        Some(subset) => {
            let mut others = subset.to_selection(len);
            others.invert();
            others
        }
        None => Selection::none(len),
    };
    for bits in flags.iter().filter(|bits| bits.len() == len) {
        out.apply(SelectMode::Add, bits);
    }
    out
}
