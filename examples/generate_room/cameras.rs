//! Where the pictures are taken from, and the way from the room's space to the capture's.

use glam::{DMat3, DVec3, Mat3, Vec3};
use splat_core::{Pose, View};

use crate::bench::NEAR;
use crate::math::{Rng, sin_cos, turn, v};

/// Size of all pictures.
pub(crate) const SIZE: (u32, u32) = (800, 600);
/// Vertical opening angle, in degrees.
const FOV: f64 = 50.0;

/// A camera in the room's space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    /// Where it stands.
    pub(crate) at: DVec3,
    /// Columns: right, down, forward.
    pub(crate) axes: DMat3,
}

impl Camera {
    fn new(at: DVec3, target: DVec3, roll: f64) -> Self {
        let forward = (target - at).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        Self { at, axes: DMat3::from_cols(right, forward.cross(right), forward) * turn(2, roll) }
    }

    /// Whether a place is inside its picture, seen from there.
    pub(crate) fn frames(&self, p: DVec3) -> bool {
        let t = self.axes.transpose() * (p - self.at);
        let (_, half) = half_tan();
        t.z > 0.2 && t.y.abs() < t.z * half && t.x.abs() < t.z * half * f64::from(SIZE.0) / f64::from(SIZE.1)
    }

    /// The camera in the capture's space.
    pub(crate) fn view(&self) -> View {
        let (turned, _) = world();
        let m = turned * self.axes;
        let round =
            |c: DVec3| Vec3::new(round_at(c.x, 1e8) as f32, round_at(c.y, 1e8) as f32, round_at(c.z, 1e8) as f32);
        let at = to_world(self.at);
        let position = Vec3::new(round_at(at.x, 1e6) as f32, round_at(at.y, 1e6) as f32, round_at(at.z, 1e6) as f32);
        let pose =
            Pose { world_from_view: Mat3::from_cols(round(m.x_axis), round(m.y_axis), round(m.z_axis)), position };
        let mut view = View::perspective(pose, 1.0, SIZE.0, SIZE.1);
        let f = round_at(0.5 * f64::from(SIZE.1) / half_tan().1, 1e4) as f32;
        (view.intrinsics.fx, view.intrinsics.fy) = (f, f);
        view.near = NEAR;
        view
    }
}

fn round_at(x: f64, unit: f64) -> f64 {
    (x * unit).round() / unit
}

fn half_tan() -> (f64, f64) {
    let half = FOV * 0.5 * std::f64::consts::PI / 180.0;
    (half, libm::tan(half))
}

/// Rotation and offset from the room's space (y up) to the capture's (y down, a little askew as captures are).
pub(crate) fn world() -> (DMat3, DVec3) {
    let turned = turn(0, 180.0) * turn(2, 1.3) * turn(0, -1.7) * turn(1, 24.0);
    (turned, turned * v(0.1, -0.95, 0.35) + v(0.21, 0.08, -0.13))
}

/// A place of the room in the capture's space.
pub(crate) fn to_world(p: DVec3) -> DVec3 {
    let (turned, offset) = world();
    turned * p + offset
}

/// A place of an orbit about `target`: degrees from +z towards +x, distance, height.
fn orbit(target: DVec3, degrees: f64, far: f64, height: f64) -> DVec3 {
    let (s, c) = sin_cos(degrees * std::f64::consts::PI / 180.0);
    v(target.x + s * far, height, target.z + c * far)
}

/// The 36 cameras of the capture: two wide sweeps and rounds of the furniture.
pub(crate) fn training() -> Vec<Camera> {
    let mut rng = Rng::new(5);
    let mut out = Vec::new();
    let mut sweep = |count: usize, target: DVec3, from: f64, to: f64, far: f64, height: f64| {
        for k in 0..count {
            let t = k as f64 / (count - 1) as f64;
            let wobble = rng.normal3() * 0.05;
            let at = orbit(target, from + (to - from) * t, far + 2.0 * wobble.x, height + wobble.y);
            let look = target + v(wobble.z, wobble.x * 0.6, wobble.y);
            out.push(Camera::new(at, look, rng.range(-1.5, 1.5)));
        }
    };
    sweep(12, v(-0.15, 0.62, -0.25), -12.0, 98.0, 3.55, 1.55);
    sweep(8, v(0.0, 0.45, 0.0), 4.0, 84.0, 3.1, 2.25);
    sweep(6, v(0.85, 0.72, -0.1), -12.0, 104.0, 1.75, 1.42);
    sweep(4, v(-0.75, 0.42, 0.3), 15.0, 80.0, 1.9, 1.25);
    sweep(3, v(0.5, 0.95, -1.8), -20.0, 38.0, 1.9, 1.5);
    sweep(3, v(-0.9, 0.7, -0.6), 12.0, 62.0, 2.3, 1.15);
    out
}

/// Six cameras held back from everything but scoring.
pub(crate) fn held_back() -> Vec<Camera> {
    [
        (v(-0.1, 0.6, -0.2), 8.0, 3.3, 1.8),
        (v(0.0, 0.55, -0.1), 43.0, 3.4, 1.35),
        (v(-0.2, 0.6, -0.2), 80.0, 3.2, 1.9),
        (v(0.8, 0.75, -0.1), 28.0, 1.9, 1.6),
        (v(-0.6, 0.4, 0.3), 55.0, 2.1, 1.5),
        (v(0.45, 0.9, -1.6), 6.0, 2.2, 1.45),
    ]
    .into_iter()
    .map(|(target, degrees, far, height)| Camera::new(orbit(target, degrees, far, height), target, 0.7))
    .collect()
}
