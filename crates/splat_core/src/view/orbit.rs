//! Views about a scene, and views of a scene that was moved.

use glam::{Mat3, Vec3};

use super::{Pose, Projection, View};
use crate::{Similarity, bounds::RobustBounds};

/// From where a view on a sphere about the middle of a scene looks at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Angle about `up`, in radians. At 0 the camera looks along the scene's +z, where `up` is not along z.
    pub yaw: f32,
    /// Height above the horizon, in radians: half pi looks straight down.
    pub pitch: f32,
    /// Distance from the middle in scene units; `None`: so far that the bulk fills the picture.
    pub distance: Option<f32>,
    /// Direction to the top of the picture, in the scene. Need not be of unit length.
    pub up: Vec3,
    /// Vertical opening angle, in radians.
    pub fov_y: f32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl Default for Orbit {
    /// From the front, at the height of the middle; y down, as captures are trained; 50 degrees; 1280x720.
    fn default() -> Self {
        let fov_y = 50f32.to_radians();
        Self { yaw: 0.0, pitch: 0.0, distance: None, up: Vec3::NEG_Y, fov_y, width: 1280, height: 720 }
    }
}

impl View {
    /// A perspective view that looks at the middle of the box of `bounds`.
    ///
    /// Without a distance every corner of the box is in the picture, with a rim of a twentieth. The near plane follows the distance,
    /// so that a capture of a coin is not cut.
    pub fn orbit(bounds: &RobustBounds, orbit: &Orbit) -> Self {
        let center = 0.5 * (bounds.min + bounds.max);
        let frame = horizon(orbit.up);
        let (sin_yaw, cos_yaw) = orbit.yaw.sin_cos();
        let (sin_pitch, cos_pitch) = orbit.pitch.sin_cos();
        let eye = frame * Vec3::new(cos_pitch * sin_yaw, sin_pitch, cos_pitch * cos_yaw);
        // Turns with the pitch, so that it is never along the line of sight.
        let top = frame * Vec3::new(-sin_pitch * sin_yaw, cos_pitch, -sin_pitch * cos_yaw);
        let pose = Pose::look_at(center + eye, center, top);
        let distance = orbit.distance.unwrap_or_else(|| {
            let view_from_world = pose.world_from_view.transpose();
            let tan_y = 0.95 * (0.5 * orbit.fov_y).tan();
            let tan_x = tan_y * orbit.width as f32 / orbit.height as f32;
            let needed = corners(bounds).map(|corner| {
                let c = view_from_world * (corner - center);
                (c.x.abs() / tan_x).max(c.y.abs() / tan_y) - c.z
            });
            needed.into_iter().fold(1e-6, f32::max)
        });
        let pose = Pose { position: center + distance * eye, ..pose };
        let view = Self::perspective(pose, orbit.fov_y, orbit.width, orbit.height);
        Self { near: view.near.min(1e-3 * distance), ..view }
    }

    /// The view that sees a scene moved by `by` as this one sees the scene: every pixel stays, depths scale with the scene.
    pub fn moved(&self, by: &Similarity) -> Self {
        let mut view = *self;
        view.pose.position = by.apply(self.pose.position);
        view.pose.world_from_view = by.rotation_matrix() * self.pose.world_from_view;
        view.near *= by.scale;
        if self.projection == Projection::Orthographic {
            view.intrinsics.fx /= by.scale;
            view.intrinsics.fy /= by.scale;
        }
        view
    }
}

fn corners(bounds: &RobustBounds) -> [Vec3; 8] {
    std::array::from_fn(|k| {
        let pick = |axis: usize| if k >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        Vec3::new(pick(0), pick(1), pick(2))
    })
}

/// Right, up and back as columns: back is the scene's -z where up allows it.
fn horizon(up: Vec3) -> Mat3 {
    let up = up.try_normalize().unwrap_or(Vec3::NEG_Y);
    let level = |axis: Vec3| axis.reject_from_normalized(up);
    let back = [Vec3::NEG_Z, Vec3::NEG_Y, Vec3::X].into_iter().map(level).find(|v| v.length() > 0.5);
    let back = back.unwrap_or_else(|| up.any_orthonormal_vector()).normalize();
    Mat3::from_cols(up.cross(back), up, back)
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec2};

    use super::*;

    fn bounds() -> RobustBounds {
        RobustBounds {
            center: Vec3::new(1.2, 0.4, 3.0),
            min: Vec3::new(-1.0, -2.0, 1.0),
            max: Vec3::new(4.0, 1.0, 4.0),
            radius: 3.0,
        }
    }

    #[test]
    fn orbits_see_the_whole_box_with_up_on_top() {
        let b = bounds();
        for up in [Vec3::NEG_Y, Vec3::Y, Vec3::Z, Vec3::NEG_Z, Vec3::new(0.3, -2.0, 0.7)] {
            for pitch in [-90.0f32, -30.0, 0.0, 55.0, 90.0] {
                for (yaw, width, height) in [(0.0, 64, 48), (2.5, 30, 90)] {
                    let orbit = Orbit { yaw, pitch: pitch.to_radians(), up, width, height, ..Orbit::default() };
                    let view = View::orbit(&b, &orbit);
                    view.check().unwrap();
                    let pixels = corners(&b).map(|corner| view.project(corner).unwrap().0);
                    assert!(pixels.iter().all(|&p| view.contains(p)), "{orbit:?}");
                    let rim = pixels.iter().map(|p| {
                        let far = (*p / Vec2::new(width as f32, height as f32) - 0.5).abs().max_element();
                        (0.475 - far).abs()
                    });
                    assert!(rim.fold(1.0, f32::min) < 1e-3, "one corner at the rim: {orbit:?}");
                    let middle = view.project(0.5 * (b.min + b.max)).unwrap().0;
                    assert!(middle.distance(0.5 * Vec2::new(width as f32, height as f32)) < 1e-2);
                    if pitch.abs() < 80.0 {
                        let above = view.project(0.5 * (b.min + b.max) + 0.2 * up.normalize()).unwrap().0;
                        assert!(above.y < middle.y && (above.x - middle.x).abs() < 1e-2);
                    }
                }
            }
        }
    }

    #[test]
    fn distances_are_kept_and_the_front_looks_along_z() {
        let view = View::orbit(&bounds(), &Orbit { distance: Some(7.0), ..Orbit::default() });
        assert!(view.forward().distance(Vec3::Z) < 1e-6);
        assert!((view.pose.position.distance(Vec3::new(1.5, -0.5, 2.5)) - 7.0).abs() < 1e-5);
        let flat = RobustBounds { min: Vec3::ONE, max: Vec3::ONE, ..bounds() };
        View::orbit(&flat, &Orbit::default()).check().unwrap();
        View::orbit(&bounds(), &Orbit { up: Vec3::ZERO, ..Orbit::default() }).check().unwrap();
    }

    #[test]
    fn a_moved_view_sees_a_moved_scene_as_before() {
        let rotation = Quat::from_euler(glam::EulerRot::YXZ, 1.9, -0.4, 2.2);
        let by = Similarity { rotation, scale: 3.5, translation: Vec3::new(-8.0, 2.0, 0.3) };
        let perspective = View::orbit(&bounds(), &Orbit { yaw: 0.7, pitch: 0.3, ..Orbit::default() });
        let orthographic = View { projection: Projection::Orthographic, ..perspective };
        for view in [perspective, orthographic] {
            let moved = view.moved(&by);
            for p in corners(&bounds()) {
                let ((a, za), (b, zb)) = (view.project(p).unwrap(), moved.project(by.apply(p)).unwrap());
                assert!(a.distance(b) < 1e-2 && (3.5 * za - zb).abs() < 1e-3, "{a} {b}");
            }
            assert!((moved.near - 3.5 * view.near).abs() < 1e-9);
            assert_eq!(view.moved(&Similarity::IDENTITY), view);
        }
    }
}
