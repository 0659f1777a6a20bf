//! From [`SelectBy`] to a set.

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Camera, Camera3d};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use splat_core::{Children, SelectMode, Selection, View, similar};
use splat_raster::Scene;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::project::{Lift, lift};

use super::{SelectBy, SelectError, Shape2d};
use crate::parts::PartsLookup;
use crate::placed::{Ids, PlacedSplats};
use crate::render::view_from_camera;

/// Pixels of a picture that is drawn for its depth or its hits; larger ones are drawn smaller.
const MOST_PIXELS: f32 = 1_048_576.0;

/// What decides which Gaussians a request means.
#[derive(SystemParam)]
pub(super) struct Chooser<'w, 's> {
    splats: PlacedSplats<'w, 's>,
    cameras: Query<'w, 's, (&'static Camera, &'static GlobalTransform, Option<&'static RenderLayers>), With<Camera3d>>,
    parts: PartsLookup<'w, 's>,
}

impl Chooser<'_, '_> {
    /// The set without what cannot be selected. `selected`: what is, in this cloud.
    pub(super) fn set(
        &self,
        entity: Entity,
        selected: &Selection,
        by: &SelectBy,
        raster: &mut CpuRasterizer,
    ) -> Result<Selection, SelectError> {
        let (_, cloud) = self.splats.cloud(entity).ok_or(SelectError::NotLoaded(entity))?;
        let len = cloud.len();
        let mut set = match by {
            SelectBy::Set(set) if set.len() == len => set.clone(),
            SelectBy::Set(set) => return Err(SelectError::Length { expected: len, found: set.len() }),
            SelectBy::All => Selection::all(len),
            SelectBy::Nothing => Selection::none(len),
            SelectBy::Inverse => {
                let mut set = selected.clone();
                set.invert();
                set
            }
            SelectBy::Part(part) => {
                let table = self.parts.table(entity).map(|(_, parts)| parts);
                let parts = table.filter(|parts| parts.get(*part).is_some() && parts.len() == len);
                parts.ok_or(SelectError::UnknownPart { entity, part: *part })?.selection_of(*part, Children::With)
            }
            SelectBy::Similar(likeness) => similar(cloud, selected, likeness),
            SelectBy::Criterion(criterion) => criterion.select(cloud),
            SelectBy::Frustum { camera, shape, footprint } => {
                self.lifted(entity, *camera, shape, Lift::Frustum(*footprint), raster)?
            }
            SelectBy::Depth { camera, shape, footprint, tolerance } => {
                self.lifted(entity, *camera, shape, Lift::Depth(*footprint, *tolerance), raster)?
            }
            SelectBy::Surface { camera, shape } => self.lifted(entity, *camera, shape, Lift::Surface(0.5), raster)?,
        };
        if let Some(withheld) = self.splats.withheld(entity) {
            set.apply(SelectMode::Subtract, &withheld);
        }
        Ok(set)
    }

    /// Gaussians of a cloud once it is loaded.
    pub(super) fn len(&self, entity: Entity) -> Result<usize, SelectError> {
        if !self.splats.has(entity) {
            return Err(SelectError::NotSplats(entity));
        }
        self.splats.cloud(entity).map(|(_, cloud)| cloud.len()).ok_or(SelectError::NotLoaded(entity))
    }

    fn lifted(
        &self,
        entity: Entity,
        camera: Entity,
        shape: &Shape2d,
        how: Lift,
        raster: &mut CpuRasterizer,
    ) -> Result<Selection, SelectError> {
        let eye = self.cameras.get(camera).ok();
        let (camera, place, layers) = eye.ok_or(SelectError::NoView(camera))?;
        let view = view_from_camera(camera, place).ok_or(SelectError::NoView(entity))?;
        let instance = |entity| self.splats.instance(entity, Ids::OfCloud);
        let own = instance(entity).ok_or(SelectError::Transform(entity))?;
        let len = own.len();
        let mut scene = Scene { instances: vec![own] };
        let drawn = matches!(how, Lift::Depth(..) | Lift::Surface(_));
        // What is seen depends on all that is in the picture; a sweep goes through everything.
        if drawn {
            scene
                .instances
                .extend(self.splats.seen_on(layers).into_iter().filter(|e| *e != entity).filter_map(instance));
        }
        let mask = shape.mask(view.width, view.height);
        let pixels = view.width as f32 * view.height as f32;
        let (view, mask) = if drawn && pixels > MOST_PIXELS {
            let view = smaller(&view, (MOST_PIXELS / pixels).sqrt());
            (view, mask.resized(view.width, view.height))
        } else {
            (view, mask)
        };
        let set = lift(raster, &scene, &view, &mask, how)?;
        // The first instance has the first ids.
        Ok(Selection::from_fn_parallel(len, |i| set.contains(i)))
    }
}

/// The same view in a picture of fewer pixels.
fn smaller(view: &View, factor: f32) -> View {
    let size = |pixels: u32| ((pixels as f32 * factor).round() as u32).max(1);
    let mut small = View { width: size(view.width), height: size(view.height), ..*view };
    let (x, y) = (small.width as f32 / view.width as f32, small.height as f32 / view.height as f32);
    small.intrinsics.fx *= x;
    small.intrinsics.cx *= x;
    small.intrinsics.fy *= y;
    small.intrinsics.cy *= y;
    small
}

#[cfg(test)]
mod tests {
    use splat_core::Pose;

    use super::*;

    #[test]
    fn a_smaller_picture_shows_the_same() {
        let view =
            View::perspective(Pose::look_at(Vec3::new(0.0, 0.0, -4.0), Vec3::ZERO, Vec3::NEG_Y), 0.9, 1921, 1080);
        let small = smaller(&view, 0.5);
        assert_eq!((small.width, small.height), (961, 540));
        for point in [Vec3::ZERO, Vec3::new(1.0, -0.7, 0.5), Vec3::new(-1.3, 0.2, 2.0)] {
            let (a, b) = (view.project(point).unwrap().0, small.project(point).unwrap().0);
            let scale = Vec2::new(961.0 / 1921.0, 0.5);
            assert!((a * scale).distance(b) < 1e-2, "{a} {b}");
        }
    }
}
