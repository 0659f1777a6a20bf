//! From Bevy's cameras to [`View`]s: the one place where the two conventions meet.
//!
//! Bevy looks along -z with y up and measures in logical pixels of a window; a [`View`] looks along +z with y down and
//! measures in physical pixels of the camera's viewport. Below this file only views exist.

use bevy::camera::Camera;
use bevy::math::{DVec3, Mat3, Mat4, UVec2, Vec2, Vec3, Vec4};
use bevy::transform::components::GlobalTransform;
use splat_core::{Intrinsics, Pose, Projection, View};

/// What a camera sees, in physical pixels of its viewport: pixel (0, 0) is the viewport's top left.
///
/// Perspective cameras may be off centre (sub-views, lens shift); orthographic ones may have a near plane behind them.
/// The camera's entity may be scaled along its own axes. Depths along the view are in world units.
///
/// `None` while the size of the camera's target is not known yet, or where the camera is none that splats can be drawn
/// for: mirrored, sheared, or with a projection that is neither of the two.
pub fn view_from_camera(camera: &Camera, transform: &GlobalTransform) -> Option<View> {
    let size = camera.physical_viewport_size()?;
    Some(CameraView::new(camera.clip_from_view(), transform, size)?.view)
}

/// Pixel of [`view_from_camera`]'s view at a position in logical pixels of the camera's target, such as a cursor's.
///
/// `None` while the size of the camera's target is not known yet.
pub fn view_pixel(camera: &Camera, position: Vec2) -> Option<Vec2> {
    let corner = camera.physical_viewport_rect()?.min.as_vec2();
    Some(position * camera.target_scaling_factor()? - corner)
}

/// A view, and how its camera space becomes Bevy's clip space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CameraView {
    /// What is seen.
    pub(crate) view: View,
    /// From the view's camera space (x right, y down, z forward) to clip space (depth 1 near, 0 far).
    pub(crate) clip_from_view: Mat4,
}

impl CameraView {
    /// `clip_from_view`: Bevy's projection; `size`: physical pixels of the viewport.
    pub(crate) fn new(clip_from_view: Mat4, transform: &GlobalTransform, size: UVec2) -> Option<Self> {
        let (x, y, w) = (clip_from_view.row(0), clip_from_view.row(1), clip_from_view.row(3));
        let projection = if w == Vec4::NEG_Z {
            Projection::Perspective
        } else if w == Vec4::W {
            Projection::Orthographic
        } else {
            return None;
        };
        if x.y != 0.0 || y.x != 0.0 {
            return None;
        }

        // The axes as they are drawn: right, down, forward, each with its own length.
        let axes = Mat3::from(transform.affine().matrix3);
        let (lengths, world_from_view) = straighten(Mat3::from_cols(axes.x_axis, -axes.y_axis, -axes.z_axis))?;

        let half = 0.5 * size.as_vec2();
        let (focal, centre) = match projection {
            Projection::Perspective => {
                (half * Vec2::new(x.x / lengths.x, y.y / lengths.y) * lengths.z, half * Vec2::new(1.0 - x.z, 1.0 + y.z))
            }
            Projection::Orthographic => {
                (half * Vec2::new(x.x / lengths.x, y.y / lengths.y), half * Vec2::new(1.0 + x.w, 1.0 - y.w))
            }
        };

        // Bevy allows orthographic cameras to see what is behind them; here depth starts at 0, so they step back.
        let near = near_plane(clip_from_view) * lengths.z;
        let back = match projection {
            Projection::Perspective => 0.0,
            Projection::Orthographic => near.min(0.0),
        };
        let view = View {
            width: size.x,
            height: size.y,
            intrinsics: Intrinsics { fx: focal.x, fy: focal.y, cx: centre.x, cy: centre.y },
            projection,
            pose: Pose { world_from_view, position: transform.translation() + back * world_from_view.z_axis },
            near: (near - back).max(0.0),
        };
        view.check().ok()?;
        let flip = Mat4::from_cols(
            Vec4::new(1.0 / lengths.x, 0.0, 0.0, 0.0),
            Vec4::new(0.0, -1.0 / lengths.y, 0.0, 0.0),
            Vec4::new(0.0, 0.0, -1.0 / lengths.z, 0.0),
            Vec4::new(0.0, 0.0, -back / lengths.z, 1.0),
        );
        Some(Self { view, clip_from_view: clip_from_view * flip })
    }

    /// From clip space to the view's camera space.
    pub(crate) fn view_from_clip(&self) -> Mat4 {
        // In f64: a far plane at 1e6 leaves f32 few digits for what is near.
        self.clip_from_view.as_dmat4().inverse().as_mat4()
    }
}

/// Lengths of the columns and the rotation they make; `None` if they are not at right angles or mirrored.
fn straighten(axes: Mat3) -> Option<(Vec3, Mat3)> {
    let lengths = Vec3::new(axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length());
    if !(lengths.is_finite() && lengths.min_element() > 1e-12) {
        return None;
    }
    let unit = |axis: Vec3, length: f32| axis / length;
    let rotation =
        Mat3::from_cols(unit(axes.x_axis, lengths.x), unit(axes.y_axis, lengths.y), unit(axes.z_axis, lengths.z));
    let straight = (rotation * rotation.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-3);
    (straight && rotation.determinant() > 0.0).then_some((lengths, rotation))
}

/// Distance along the forward axis at which the projection begins, in its own units; 0 where it has none.
fn near_plane(clip_from_view: Mat4) -> f32 {
    // In f64: for a far plane at 1e6 the difference below would lose the near one.
    let (depth, w) = (clip_from_view.row(2).as_dvec4(), clip_from_view.row(3).as_dvec4());
    let reached = |at: f64| {
        // depth(z) = at * w(z), on the axis.
        let axis = DVec3::new(depth.z - at * w.z, depth.w - at * w.w, 0.0);
        axis.y / axis.x
    };
    // A projection of the user's own may put either end at 1. Ends behind a perspective camera are none.
    let ends = [reached(1.0), reached(0.0)].into_iter().filter(|z| z.is_finite() && (w.w == 1.0 || *z >= 0.0));
    ends.reduce(f64::min).unwrap_or(0.0) as f32
}

#[cfg(test)]
mod tests {
    use bevy::camera::{CameraProjection, OrthographicProjection, PerspectiveProjection, SubCameraView};
    use bevy::math::{Quat, Rect, Vec4Swizzles};
    use bevy::transform::components::Transform;

    use super::*;

    const SIZE: UVec2 = UVec2::new(96, 64);

    /// Bevy's own way from a world point to a pixel and a depth, and the distance along the view.
    fn by_bevy(clip_from_view: Mat4, transform: &GlobalTransform, point: Vec3) -> (Vec2, f32) {
        let local = transform.affine().inverse().transform_point3(point);
        let clip = clip_from_view * local.extend(1.0);
        let ndc = clip.xyz() / clip.w;
        (Vec2::new(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y) * SIZE.as_vec2(), ndc.z)
    }

    fn cameras() -> Vec<(&'static str, Mat4)> {
        let perspective = PerspectiveProjection { aspect_ratio: 1.5, ..PerspectiveProjection::default() };
        let oblique = PerspectiveProjection { near_clip_plane: Vec4::new(0.0, 0.3, -1.0, -0.1), ..perspective.clone() };
        let part = SubCameraView { full_size: UVec2::new(300, 200), offset: Vec2::new(120.0, 30.0), size: SIZE };
        let flat =
            OrthographicProjection { area: Rect::new(-3.0, -1.0, 1.5, 2.0), ..OrthographicProjection::default_3d() };
        let behind = OrthographicProjection { near: -20.0, ..flat.clone() };
        vec![
            ("perspective", perspective.get_clip_from_view()),
            ("perspective with a tilted near plane", oblique.get_clip_from_view()),
            ("part of a perspective", perspective.get_clip_from_view_for_sub(&part)),
            ("orthographic", flat.get_clip_from_view()),
            ("orthographic from behind", behind.get_clip_from_view()),
            ("part of an orthographic", flat.get_clip_from_view_for_sub(&part)),
        ]
    }

    fn places() -> [GlobalTransform; 3] {
        let turned = Transform::from_xyz(1.0, 2.0, 6.0).looking_at(Vec3::new(0.3, 0.5, -0.2), Vec3::new(0.1, 1.0, 0.0));
        [Transform::IDENTITY, turned, turned.with_scale(Vec3::new(2.0, 0.5, 3.0))].map(GlobalTransform::from)
    }

    #[test]
    fn points_fall_on_the_pixels_that_bevy_gives_them() {
        for (name, clip_from_view) in cameras() {
            for place in places() {
                let own = CameraView::new(clip_from_view, &place, SIZE).expect(name);
                for local in [Vec3::new(0.3, -0.2, -2.0), Vec3::new(-1.0, 0.7, -5.0), Vec3::new(0.0, 0.1, -0.9)] {
                    let point = place.transform_point(local);
                    let (pixel, depth) = by_bevy(clip_from_view, &place, point);
                    let (found, z) = own.view.project(point).expect(name);
                    assert!(found.distance(pixel) < 2e-3, "{name}: {found} for {pixel}");
                    let seen = own.view.pose.world_from_view.transpose() * (point - own.view.pose.position);
                    let clip = own.clip_from_view * seen.extend(1.0);
                    assert!((clip.z / clip.w - depth).abs() < 1e-5, "{name}: depth {depth} at {z}");
                    let back = own.view_from_clip() * (clip / clip.w);
                    assert!((back.z / back.w / z - 1.0).abs() < 1e-3, "{name}: z {z} at depth {depth}");
                }
            }
        }
    }

    #[test]
    fn nothing_nearer_than_the_near_plane_is_seen() {
        for (name, clip_from_view) in cameras() {
            let own = CameraView::new(clip_from_view, &GlobalTransform::IDENTITY, SIZE).expect(name);
            for (z, seen) in
                [(-30.0, false), (-10.0, name.ends_with("behind")), (0.05, name.contains("ortho")), (0.2, true)]
            {
                assert_eq!(own.view.project(Vec3::new(0.0, 0.0, -z)).is_some(), seen, "{name} at {z}");
            }
        }
    }

    #[test]
    fn cameras_that_no_view_can_be_are_refused() {
        let clip_from_view = cameras()[0].1;
        let new = |clip, transform: Transform, size| CameraView::new(clip, &transform.into(), size);
        assert!(new(clip_from_view, Transform::IDENTITY, SIZE).is_some());
        assert_eq!(new(clip_from_view, Transform::IDENTITY, UVec2::ZERO), None);
        assert_eq!(new(clip_from_view, Transform::from_scale(Vec3::new(-1.0, 1.0, 1.0)), SIZE), None);
        assert_eq!(new(clip_from_view, Transform::from_scale(Vec3::ZERO), SIZE), None);
        assert_eq!(new(clip_from_view, Transform::from_xyz(f32::NAN, 0.0, 0.0), SIZE), None);
        assert_eq!(new(Mat4::ZERO, Transform::IDENTITY, SIZE), None);
        let turned = Transform::from_rotation(Quat::from_rotation_z(0.4)).to_matrix();
        assert_eq!(new(clip_from_view * turned, Transform::IDENTITY, SIZE), None);
    }
}
