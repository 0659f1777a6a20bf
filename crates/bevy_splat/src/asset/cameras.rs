//! [`SplatCameras`]: the cameras that a capture's pictures were taken with.

use bevy::asset::{Asset, AssetLoader, LoadContext, io::Reader};
use bevy::camera::PerspectiveProjection;
use bevy::prelude::*;
use splat_core::View;
use splat_io::cameras::{self, NamedView};
use splat_io::{ReadError, SourceName};

use super::beside::read_with_beside;

/// The cameras of a capture, from a file of INRIA's (`cameras.json`), of nerfstudio's (`transforms.json`) or of COLMAP
/// (`images.bin`, `images.txt`): `asset_server.load::<SplatCameras>("room/cameras.json")`.
///
/// Their poses are in the capture's own space, as its Gaussians are.
#[derive(Asset, TypePath, Clone, Debug, Default)]
pub struct SplatCameras {
    /// In the order of the file.
    pub views: Vec<NamedView>,
    /// Sentences about anything that was not taken over (lens distortion).
    pub notes: Vec<String>,
}

impl SplatCameras {
    /// Where Bevy's camera stands to see what `view` saw of a capture that stands at `capture`.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_splat::prelude::*;
    /// fn stand_where_the_first_picture_was_taken(
    ///     cameras: Res<Assets<SplatCameras>>,
    ///     captures: Query<&Transform, With<Splats>>,
    ///     mut eyes: Query<(&mut Transform, &mut Projection), (With<Camera3d>, Without<Splats>)>,
    /// ) {
    ///     let Some(first) = cameras.iter().find_map(|(_, cameras)| cameras.views.first()) else { return };
    ///     for capture in &captures {
    ///         for (mut eye, mut projection) in &mut eyes {
    ///             *eye = SplatCameras::transform(&first.view, capture);
    ///             *projection = SplatCameras::projection(&first.view).into();
    ///         }
    ///     }
    /// }
    /// # bevy::ecs::system::assert_is_system(stand_where_the_first_picture_was_taken);
    /// ```
    pub fn transform(view: &View, capture: &Transform) -> Transform {
        let axes = view.pose.world_from_view;
        // A view's axes are right, down, forward; Bevy's right, up, back.
        let axes = Mat3::from_cols(axes.x_axis, -axes.y_axis, -axes.z_axis);
        Transform {
            translation: capture.transform_point(view.pose.position),
            rotation: (capture.rotation * Quat::from_mat3(&axes)).normalize(),
            scale: Vec3::ONE,
        }
    }

    /// The opening angle of a view, as Bevy's projection. What a picture's principal point is off its middle is left out.
    pub fn projection(view: &View) -> PerspectiveProjection {
        PerspectiveProjection {
            fov: view.fov_y(),
            aspect_ratio: view.width as f32 / view.height as f32,
            ..PerspectiveProjection::default()
        }
    }
}

/// Loads [`SplatCameras`]. It has no endings of its own: the asset's type decides.
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct SplatCamerasLoader;

impl AssetLoader for SplatCamerasLoader {
    type Asset = SplatCameras;
    type Settings = ();
    type Error = ReadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<SplatCameras, ReadError> {
        let name = SourceName::from(context.path().to_string().as_str());
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(ReadError::io(&name))?;
        let read = read_with_beside(context, |files| cameras::read_with(&bytes, &name, files)).await?;
        Ok(SplatCameras { views: read.views, notes: read.notes })
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Affine3A;
    use splat_core::Pose;

    use super::*;
    use crate::UPRIGHT;

    #[test]
    fn bevys_camera_sees_a_point_where_the_view_saw_it() {
        let pose = Pose::look_at(Vec3::new(1.0, -2.0, -5.0), Vec3::new(0.3, 0.1, 0.0), Vec3::NEG_Y);
        let view = View::perspective(pose, 0.9, 64, 48);
        let capture = UPRIGHT.with_translation(Vec3::new(3.0, 4.0, 5.0)).with_scale(Vec3::splat(2.0));
        let eye: Affine3A = SplatCameras::transform(&view, &capture).compute_affine();
        let projection = SplatCameras::projection(&view);
        let clip_from_view =
            Mat4::perspective_infinite_reverse_rh(projection.fov, projection.aspect_ratio, projection.near);
        for point in [Vec3::ZERO, Vec3::new(0.5, -0.7, 1.0), Vec3::new(-0.4, 0.2, -1.5)] {
            let seen = clip_from_view.project_point3(eye.inverse().transform_point3(capture.transform_point(point)));
            let pixel = Vec2::new(32.0 + 32.0 * seen.x, 24.0 - 24.0 * seen.y);
            assert!(pixel.distance(view.project(point).unwrap().0) < 1e-3);
        }
    }
}
