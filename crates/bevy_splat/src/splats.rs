//! [`Splats`]: a capture in the scene.

use bevy::asset::{AsAssetId, AssetId};
use bevy::camera::visibility::{self, VisibilityClass};
use bevy::prelude::*;

use crate::asset::SplatCloud;
use crate::components::SplatFlags;

/// Half a turn about x: captures are trained with y down and z forward, Bevy's y points up.
///
/// The default `Transform` of every [`Splats`]; a `Transform` that you give yourself replaces it:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::UPRIGHT;
/// let beside = UPRIGHT.with_translation(Vec3::X * 3.0);
/// // What is below the capture's origin in its own space is above it in Bevy's.
/// assert!(beside.transform_point(Vec3::NEG_Y).distance(Vec3::new(3.0, 1.0, 0.0)) < 1e-6);
/// ```
// The exact half turn: (x, y, z, w) of a quaternion.
pub const UPRIGHT: Transform =
    Transform { translation: Vec3::ZERO, rotation: Quat::from_xyzw(1.0, 0.0, 0.0, 0.0), scale: Vec3::ONE };

/// A capture in the scene: draws the Gaussians of a [`SplatCloud`] at the entity's `Transform`.
///
/// Several entities may share a cloud; it is kept and uploaded once. All splats that a camera sees are drawn in one order of
/// depth. Optional beside it: [`SplatSelection`](crate::SplatSelection), [`SplatParts`](crate::SplatParts),
/// [`SplatSubset`](crate::SplatSubset), [`SplatHighlight`](crate::SplatHighlight).
///
/// The `Transform` is [`UPRIGHT`] unless given. Its scale must be the same along all axes: Gaussians cannot be sheared.
#[derive(Component, FromTemplate, Clone, Debug, Default, Deref, DerefMut, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[require(Transform = UPRIGHT, Visibility, VisibilityClass, SplatFlags)]
#[component(on_add = visibility::add_visibility_class::<Splats>)]
pub struct Splats(pub Handle<SplatCloud>);

impl From<Handle<SplatCloud>> for Splats {
    fn from(handle: Handle<SplatCloud>) -> Self {
        Self(handle)
    }
}

impl AsAssetId for Splats {
    type Asset = SplatCloud;

    fn as_asset_id(&self) -> AssetId<SplatCloud> {
        self.0.id()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upright_is_half_a_turn_about_x() {
        let turn = Transform::from_rotation(Quat::from_rotation_x(std::f32::consts::PI));
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert!(turn.transform_point(axis).distance(UPRIGHT.transform_point(axis)) < 1e-6);
        }
        assert_eq!(UPRIGHT.transform_point(Vec3::new(1.0, 2.0, 3.0)), Vec3::new(1.0, -2.0, -3.0));
    }

    #[test]
    fn a_handle_is_all_it_takes() {
        let mut world = World::new();
        let entity = world.spawn(Splats::default()).id();
        let entity = world.entity(entity);
        assert_eq!(entity.get(), Some(&UPRIGHT));
        assert_eq!(entity.get(), Some(&Visibility::Inherited));
        assert_eq!(entity.get(), Some(&SplatFlags::default()));
        let class = entity.get::<VisibilityClass>().unwrap();
        assert_eq!(class.as_slice(), [std::any::TypeId::of::<Splats>()]);
        let own = Transform::from_xyz(1.0, 2.0, 3.0);
        let entity = world.spawn((Splats::default(), own)).id();
        assert_eq!(world.get(entity), Some(&own));
    }

    #[test]
    fn a_path_is_enough_in_bsn() {
        let (mut app, files) = crate::testing::app_with_files();
        app.add_plugins(bevy::scene::ScenePlugin);
        app.update();
        let mut bytes = Vec::new();
        let format = splat_io::format_named("ply").unwrap();
        splat_io::write_as(format, &crate::testing::cloud(9).cloud, &default(), &mut bytes).unwrap();
        files.insert_asset(std::path::Path::new("room.ply"), bytes);
        let entity = app.world_mut().spawn_scene(bsn! { Splats("room.ply") }).unwrap().id();
        let handle = app.world().get::<Splats>(entity).unwrap().0.clone();
        assert_eq!(crate::testing::finished(&mut app, &handle).unwrap().cloud.len(), 9);
        assert_eq!(app.world().get(entity), Some(&UPRIGHT));
    }
}
