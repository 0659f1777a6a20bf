//! [`View`]: what one picture sees.

use glam::{Mat3, Vec2, Vec3};

mod orbit;

pub use orbit::Orbit;

/// Nearest depth drawn where a view does not say otherwise, in scene units.
pub const DEFAULT_NEAR: f32 = 0.01;

/// Focal lengths and principal point, in pixels. The centre of the top left pixel is (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Focal length along x, in pixels (pixels per scene unit for an orthographic view).
    pub fx: f32,
    /// Focal length along y, in pixels (pixels per scene unit for an orthographic view).
    pub fy: f32,
    /// Principal point, x.
    pub cx: f32,
    /// Principal point, y.
    pub cy: f32,
}

/// How camera space becomes pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Projection {
    /// `u = fx x / z + cx`.
    #[default]
    Perspective,
    /// `u = fx x + cx`, for plans and elevations.
    Orthographic,
}

/// Where a camera stands: maps camera space (x right, y down, z forward) to the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Columns are the camera's right, down and forward axes in world space: a proper rotation.
    pub world_from_view: Mat3,
    /// Camera centre in world space.
    pub position: Vec3,
}

/// Why numbers do not make a [`View`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A side of the picture is zero or beyond 32768.
    #[error("a picture of {width}x{height} pixels cannot be drawn; each side may be 1 to 32768")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// A number is NaN or infinite, a focal length is not positive, or the rotation is not a rotation.
    #[error("the camera's {what} is unusable ({value})")]
    Value {
        /// What is wrong.
        what: &'static str,
        /// Its value.
        value: f32,
    },
}

/// Pose, intrinsics and size of one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Focal lengths and principal point.
    pub intrinsics: Intrinsics,
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Where the camera stands.
    pub pose: Pose,
    /// Means at this camera depth or nearer are not drawn, in scene units.
    pub near: f32,
}

impl View {
    /// A perspective view with its principal point in the middle and square pixels.
    ///
    /// `fov_y`: vertical opening angle, in radians.
    pub fn perspective(pose: Pose, fov_y: f32, width: u32, height: u32) -> Self {
        let f = 0.5 * height as f32 / (0.5 * fov_y).tan();
        Self {
            width,
            height,
            intrinsics: Intrinsics { fx: f, fy: f, cx: 0.5 * width as f32, cy: 0.5 * height as f32 },
            projection: Projection::Perspective,
            pose,
            near: DEFAULT_NEAR,
        }
    }

    /// Checks what a file or a user gave: sizes, finite numbers, positive focal lengths, a proper rotation.
    ///
    /// # Errors
    /// [`ViewError`] naming the first thing that is wrong.
    pub fn check(&self) -> Result<(), ViewError> {
        let fits = |n: u32| (1..=32768).contains(&n);
        if !fits(self.width) || !fits(self.height) {
            return Err(ViewError::Size { width: self.width, height: self.height });
        }
        let i = &self.intrinsics;
        for (what, value, good) in [
            ("focal length along x", i.fx, i.fx > 0.0),
            ("focal length along y", i.fy, i.fy > 0.0),
            ("principal point", i.cx + i.cy, true),
            ("near plane", self.near, self.near >= 0.0),
            ("position", self.pose.position.element_sum(), true),
            (
                "rotation (its determinant)",
                self.pose.world_from_view.determinant(),
                (self.pose.world_from_view.determinant() - 1.0).abs() < 0.02,
            ),
        ] {
            if !(value.is_finite() && good) {
                return Err(ViewError::Value { what, value });
            }
        }
        Ok(())
    }

    /// Camera-space position of a world point.
    pub fn to_view(&self, world: Vec3) -> Vec3 {
        self.pose.world_from_view.transpose() * (world - self.pose.position)
    }

    /// Pixel coordinates and camera depth of a world point; `None` at or behind the near plane.
    pub fn project(&self, world: Vec3) -> Option<(Vec2, f32)> {
        let t = self.to_view(world);
        let i = &self.intrinsics;
        let scale = match self.projection {
            Projection::Perspective => 1.0 / t.z,
            Projection::Orthographic => 1.0,
        };
        // NaN fails this comparison.
        (t.z > self.near).then(|| (Vec2::new(i.fx * t.x * scale + i.cx, i.fy * t.y * scale + i.cy), t.z))
    }

    /// World position of the point seen at pixel coordinates `pixel` at camera depth `depth`.
    pub fn unproject(&self, pixel: Vec2, depth: f32) -> Vec3 {
        let i = &self.intrinsics;
        let scale = match self.projection {
            Projection::Perspective => depth,
            Projection::Orthographic => 1.0,
        };
        let t = Vec3::new((pixel.x - i.cx) / i.fx * scale, (pixel.y - i.cy) / i.fy * scale, depth);
        self.pose.world_from_view * t + self.pose.position
    }

    /// Whether pixel coordinates lie inside the picture.
    pub fn contains(&self, pixel: Vec2) -> bool {
        pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < self.width as f32 && pixel.y < self.height as f32
    }

    /// The same camera with a picture of another size: focal lengths follow the height, the picture grows or shrinks sideways.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let k = height as f32 / self.height as f32;
        let i = &self.intrinsics;
        let shift = 0.5 * (width as f32 - self.width as f32 * k);
        Self {
            width,
            height,
            intrinsics: Intrinsics { fx: i.fx * k, fy: i.fy * k, cx: i.cx * k + shift, cy: i.cy * k },
            ..*self
        }
    }

    /// Vertical opening angle, in radians.
    pub fn fov_y(&self) -> f32 {
        2.0 * (0.5 * self.height as f32 / self.intrinsics.fy).atan()
    }

    /// Forward direction in world space.
    pub fn forward(&self) -> Vec3 {
        self.pose.world_from_view.z_axis
    }
}

impl Pose {
    /// A camera at `eye` that looks at `target`, with `up` pointing to the top of the picture.
    ///
    /// Where `up` is parallel to the viewing direction, or either is zero, another direction is taken for it.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3) -> Self {
        let forward = (target - eye).try_normalize().unwrap_or(Vec3::Z);
        let mut right = forward.cross(up);
        if right.length() < 1e-5 * up.length().max(1e-20) {
            right = forward.any_orthonormal_vector();
        }
        let right = right.normalize();
        let down = forward.cross(right);
        Self { world_from_view: Mat3::from_cols(right, down, forward), position: eye }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> View {
        View::perspective(Pose::look_at(Vec3::new(1.0, -2.0, -5.0), Vec3::Z, Vec3::NEG_Y), 0.8, 64, 48)
    }

    #[test]
    fn projecting_and_lifting_undo_each_other() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let v = View { projection, ..view() };
            for pixel in [Vec2::new(0.5, 0.5), Vec2::new(40.0, 3.0), Vec2::new(-9.0, 70.0)] {
                let (back, z) = v.project(v.unproject(pixel, 3.0)).unwrap();
                assert!(back.distance(pixel) < 1e-3 && (z - 3.0).abs() < 1e-5);
            }
        }
        assert_eq!(view().to_view(view().pose.position), Vec3::ZERO);
        assert!(view().contains(Vec2::ZERO) && !view().contains(Vec2::new(64.0, 3.0)));
        assert!(!view().contains(Vec2::NAN));
    }

    #[test]
    fn what_is_behind_or_nowhere_is_not_projected() {
        let v = view();
        assert_eq!(v.project(v.pose.position - v.forward()), None);
        assert_eq!(v.project(v.pose.position), None);
        assert_eq!(v.project(v.pose.position + 0.5 * v.near * v.forward()), None);
        assert_eq!(v.project(Vec3::NAN), None);
    }

    #[test]
    fn cameras_look_at_their_target_with_up_on_top() {
        let v = view();
        let (middle, _) = v.project(Vec3::Z).unwrap();
        assert!(middle.distance(Vec2::new(32.0, 24.0)) < 1e-3);
        assert!(v.project(Vec3::Z + 0.1 * Vec3::NEG_Y).unwrap().0.y < 24.0);
        assert!((v.fov_y() - 0.8).abs() < 1e-6);
        for (eye, target, up) in
            [(Vec3::ZERO, Vec3::Y, Vec3::NEG_Y), (Vec3::ZERO, Vec3::ZERO, Vec3::Y), (Vec3::ZERO, Vec3::X, Vec3::ZERO)]
        {
            View { pose: Pose::look_at(eye, target, up), ..v }.check().unwrap();
        }
    }

    #[test]
    fn another_size_keeps_what_is_at_the_middle() {
        let v = view();
        let big = v.resized(200, 96);
        assert!((big.fov_y() - v.fov_y()).abs() < 1e-6);
        assert!(big.project(Vec3::Z).unwrap().0.distance(Vec2::new(100.0, 48.0)) < 1e-3);
        assert_eq!(v.resized(64, 48), v);
    }

    #[test]
    fn numbers_that_make_no_camera_are_named() {
        let v = view();
        v.check().unwrap();
        assert!(matches!(View { width: 0, ..v }.check(), Err(ViewError::Size { .. })));
        assert!(matches!(View { height: 40_000, ..v }.check(), Err(ViewError::Size { .. })));
        let with = |change: fn(&mut View)| {
            let mut v = v;
            change(&mut v);
            v.check().unwrap_err().to_string()
        };
        assert!(with(|v| v.intrinsics.fx = -1.0).contains("focal length along x"));
        assert!(with(|v| v.intrinsics.fy = f32::NAN).contains("focal length along y"));
        assert!(with(|v| v.intrinsics.cx = f32::INFINITY).contains("principal point"));
        assert!(with(|v| v.near = -1.0).contains("near plane"));
        assert!(with(|v| v.pose.position.y = f32::NAN).contains("position"));
        assert!(with(|v| v.pose.world_from_view = -v.pose.world_from_view).contains("rotation"));
    }
}
