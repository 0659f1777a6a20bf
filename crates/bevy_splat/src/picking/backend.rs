//! From pointers to hits.

use std::sync::Arc;

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Camera, Camera3d, RenderTarget};
use bevy::log::warn_once;
use bevy::picking::Pickable;
use bevy::picking::backend::ray::{RayId, RayMap};
use bevy::picking::backend::{HitData, PointerHits};
use bevy::picking::pointer::{PointerId, PointerLocation};
use bevy::prelude::*;
use splat_core::{PartId, View};
use splat_raster::pick::{PickIndex, PickQuery, pick};
use splat_raster::{Instance, Scene};

use super::{SplatHit, SplatPartHandle, SplatPickIndices};
use crate::SplatParts;
use crate::parts::PartsLookup;
use crate::placed::{Ids, PlacedSplats};
use crate::render::{view_from_camera, view_pixel};

/// Entities that let pointers through are hit one behind the other, at most so many.
const MOST_HITS: usize = 8;

type Eye<'a> = (Entity, &'a Camera, &'a RenderTarget, &'a GlobalTransform, Option<&'a RenderLayers>);

/// Sends the hits of every pointer over every camera.
#[expect(clippy::too_many_arguments, reason = "each is one thing of Bevy's that a hit depends on")]
pub(super) fn update_hits(
    rays: Res<RayMap>,
    pointers: Query<(&PointerId, &PointerLocation)>,
    cameras: Query<Eye, With<Camera3d>>,
    splats: PlacedSplats,
    indices: Res<SplatPickIndices>,
    pickables: Query<&Pickable>,
    handles: Handles,
    mut hits: MessageWriter<PointerHits>,
) {
    for (id, pixel, ray) in looks(&rays, &pointers, &cameras) {
        let Ok((_, camera, _, place, layers)) = cameras.get(id.camera) else { continue };
        let Some(view) = view_from_camera(camera, place) else { continue };
        let pixel = match pixel {
            Some(pixel) => pixel,
            // A ray that somebody else made, such as one through a screen in the scene.
            None => match view.project(ray.get_point(1.0)) {
                Some((pixel, _)) => pixel,
                None => continue,
            },
        };
        let hoverable = |entity: &Entity| pickables.get(*entity).map_or(true, |p| p.is_hoverable);
        let mut scene = Picked::default();
        for entity in splats.seen_on(layers).into_iter().filter(hoverable) {
            if let (Some(instance), Some((asset, cloud))) =
                (splats.instance(entity, Ids::OfSubset), splats.cloud(entity))
            {
                scene.entities.push(entity);
                scene.indices.push(indices.get(asset, cloud));
                scene.scene.instances.push(instance);
            }
        }
        let mut picks = Vec::new();
        while picks.len() < MOST_HITS
            && let Some((hit, position, normal)) = scene.first(&view, pixel, &splats)
        {
            let part = handles.part_of(&hit);
            let entity = handles.stand_in(hit.splats, part).unwrap_or(hit.splats);
            let depth = (position - ray.origin).dot(*ray.direction);
            let hit = SplatHit { part, ..hit };
            picks.push((entity, HitData::new_with_extra(id.camera, depth, Some(position), Some(normal), hit)));
            if pickables.get(entity).is_ok_and(|p| !p.should_block_lower) {
                scene.remove(hit.splats);
            } else {
                break;
            }
        }
        if !picks.is_empty() {
            hits.write(PointerHits::new(id.pointer, picks, camera.order as f32));
        }
    }
}

/// Every pointer over every camera: the pixel of the camera's view, if the pointer's location says it, and the ray.
fn looks(
    rays: &RayMap,
    pointers: &Query<(&PointerId, &PointerLocation)>,
    cameras: &Query<Eye, With<Camera3d>>,
) -> Vec<(RayId, Option<Vec2>, Ray3d)> {
    let mut looks = Vec::new();
    for (entity, camera, target, place, _) in cameras.iter().filter(|(_, camera, ..)| camera.is_active) {
        for (&pointer, location) in pointers {
            let id = RayId::new(entity, pointer);
            let known = rays.map.get(&id).copied();
            // Bevy makes no rays where there is no primary window, also not for images.
            let inside = |position| camera.logical_viewport_rect().is_some_and(|rect| rect.contains(position));
            let here = location.location().filter(|l| target.normalize(None).as_ref() == Some(&l.target));
            let ray = match (known, here) {
                (Some(ray), _) => Some(ray),
                (None, Some(l)) if inside(l.position) => camera.viewport_to_world(place, l.position).ok(),
                _ => None,
            };
            let Some(ray) = ray else { continue };
            // The location names the pixel exactly; the ray does so up to rounding.
            let own = location.location().filter(|l| camera.viewport_to_world(place, l.position).ok() == Some(ray));
            looks.push((id, own.and_then(|l| view_pixel(camera, l.position)), ray));
        }
    }
    looks
}

/// What can be hit by one pointer.
#[derive(Default)]
struct Picked {
    scene: Scene,
    entities: Vec<Entity>,
    indices: Vec<Option<Arc<PickIndex>>>,
}

impl Picked {
    fn first(&self, view: &View, pixel: Vec2, splats: &PlacedSplats) -> Option<(SplatHit, Vec3, Vec3)> {
        let indices: Vec<Option<&PickIndex>> = self.indices.iter().map(Option::as_deref).collect();
        let found = match pick(&self.scene, &indices, view, PickQuery::at(pixel)) {
            Ok(found) => found?,
            Err(error) => {
                warn_once!("splats cannot be picked: {error}");
                return None;
            }
        };
        let entity = self.entities[found.instance];
        let hit = SplatHit {
            splats: entity,
            gaussian: found.gaussian,
            part: None,
            weight: found.weight,
            view_depth: found.depth,
            locked: splats.locked(entity, found.gaussian),
        };
        Some((hit, found.position, found.normal))
    }

    fn remove(&mut self, entity: Entity) {
        if let Some(k) = self.entities.iter().position(|e| *e == entity) {
            self.entities.remove(k);
            self.indices.remove(k);
            let _: Instance = self.scene.instances.remove(k);
        }
    }
}

/// Finds the entity that stands for a part.
#[derive(bevy::ecs::system::SystemParam)]
pub(super) struct Handles<'w, 's> {
    children: Query<'w, 's, &'static Children>,
    handles: Query<'w, 's, &'static SplatPartHandle>,
    parts: PartsLookup<'w, 's>,
    tables: Query<'w, 's, &'static SplatParts>,
}

impl Handles<'_, '_> {
    fn part_of(&self, hit: &SplatHit) -> Option<PartId> {
        Some(self.parts.part_of(hit.splats, hit.gaussian)?.0)
    }

    /// The child of a capture that stands for a part, or for the part that this belongs to.
    fn stand_in(&self, capture: Entity, part: Option<PartId>) -> Option<Entity> {
        let (children, part) = (self.children.get(capture).ok()?, part?);
        let handle = |part| children.iter().find(|child| self.handles.get(*child).is_ok_and(|handle| handle.0 == part));
        handle(part).or_else(|| handle(self.tables.get(capture).ok()?.get(part)?.parent()?))
    }
}
