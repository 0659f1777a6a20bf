//! What is drawn, and from where.

use std::f32::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use peer_common::{Cameras, Failure, Pose};
use splat_core::bounds::{RobustBounds, robust_bounds};
use splat_core::glam::{Mat3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays, Orbit, View, sh};
use splat_io::WriteOptions;

/// Degree of the files that contenders read: some expect every coefficient.
const DEGREE: u8 = 3;
/// Coefficients per channel at that degree.
const COEFFICIENTS: usize = 16;
/// Standpoints of a path, then it begins anew.
const STEPS: usize = 720;
/// Turn between two frames, in radians: half a degree, enough to change the order of many Gaussians.
const STEP: f32 = PI / 360.0;
/// The generated cloud has Gaussians of the sizes below when it has as many as this; more are smaller, so that the
/// picture stays as full.
const SIZED_FOR: f32 = 100_000.0;

/// A shell and a floor: two thirds of the Gaussians on a unit sphere, one third on the plane under it; the same bits for
/// the same count.
pub(crate) fn generated(count: usize) -> Result<Cloud, Failure> {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let shrink = (SIZED_FOR / count.max(1) as f32).sqrt();
    let (smallest, largest) = ((0.008 * shrink).ln(), (0.03 * shrink).ln());
    let mut arrays = CloudArrays { sh_degree: DEGREE, ..CloudArrays::default() };
    for k in 0..count {
        let direction = random.direction();
        let on_floor = k % 3 == 2;
        let mean = if on_floor {
            // y points down in captures.
            Vec3::new(random.between(-2.0, 2.0), 1.0, random.between(-2.0, 2.0))
        } else {
            direction
        };
        arrays.means.push(mean);
        arrays.log_scales.push(Vec3::from_array(std::array::from_fn(|_| random.between(smallest, largest))));
        arrays.rotations.push(random.rotation());
        arrays.opacity_logits.push(random.between(-2.0, 4.0));
        let wave = |axis: usize| 0.5 + 0.4 * (5.0 * mean[axis] + axis as f32).sin();
        arrays.sh.extend((0..3).map(|channel| (wave(channel) - 0.5) / sh::C0));
        arrays.sh.extend((3..3 * COEFFICIENTS).map(|_| random.between(-0.06, 0.06)));
    }
    Cloud::new(arrays).map_err(|e| Failure(e.to_string()))
}

/// Writes what contenders read.
pub(crate) fn write(cloud: &Cloud, path: &Path) -> Result<(), Failure> {
    splat_io::write(path, cloud, &WriteOptions::default()).map(|_| ()).map_err(|e| Failure(e.to_string()))
}

/// Reads a capture of any format, and the PLY file that stands for it: all contenders read the same bytes.
pub(crate) fn read(file: &Path, out: &Path) -> Result<(Cloud, PathBuf), Failure> {
    let (cloud, _) = splat_io::read(file).map_err(|e| Failure(e.to_string()))?;
    let cloud = cloud.with_sh_degree(DEGREE).map_err(|e| Failure(e.to_string()))?;
    let mut arrays = cloud.into_arrays();
    arrays.extras.clear();
    arrays.source = Default::default();
    let cloud = Cloud::new(arrays).map_err(|e| Failure(e.to_string()))?;
    let path = out.join("scene.ply");
    write(&cloud, &path)?;
    Ok((cloud, path))
}

/// A file's name, or its folder's where all captures have the same.
pub(crate) fn name(file: &Path) -> String {
    let folder = file.parent().and_then(Path::file_name).unwrap_or_default();
    match file.file_stem().unwrap_or_default().to_string_lossy() {
        stem if stem.starts_with("scene") && !folder.is_empty() => folder.to_string_lossy().into_owned(),
        stem => stem.into_owned(),
    }
}

/// A walk about the middle of the cloud; or, with `camera` (`CAMERAS#N`), to and fro about a camera of a file.
pub(crate) fn cameras(cloud: &Cloud, camera: Option<&str>, (width, height): (u32, u32)) -> Result<Cameras, Failure> {
    let bounds = robust_bounds(cloud).unwrap_or(RobustBounds {
        center: Vec3::ZERO,
        min: Vec3::NEG_ONE,
        max: Vec3::ONE,
        radius: 1.0,
    });
    let (still, path): (View, Vec<View>) = match camera {
        Some(choice) => {
            let view = of_file(choice)?;
            // The picture swings by some five degrees to each side.
            let swing = |k: usize| 0.1 * (TAU * k as f32 / STEPS as f32 * 8.0).sin();
            (view, (0..STEPS).map(|k| turned(&view, swing(k))).collect())
        }
        None => {
            let orbit = Orbit { pitch: 20f32.to_radians(), width, height, ..Orbit::default() };
            let at = |yaw: f32| View::orbit(&bounds, &Orbit { yaw, ..orbit });
            (at(30f32.to_radians()), (0..STEPS).map(|k| at(30f32.to_radians() + k as f32 * STEP)).collect())
        }
    };
    let reach = (still.pose.position - bounds.center).length() + 100.0 * bounds.radius;
    Ok(Cameras {
        fov_y: still.fov_y(),
        near: still.near,
        far: reach.max(1000.0 * still.near),
        still: pose(&still),
        path: path.iter().map(pose).collect(),
    })
}

fn of_file(choice: &str) -> Result<View, Failure> {
    let (file, number) = choice.rsplit_once('#').unwrap_or((choice, "0"));
    let found = splat_io::cameras::read(file).map_err(|e| Failure(e.to_string()))?;
    let view = number.parse().ok().and_then(|n: usize| found.views.get(n));
    view.map(|v| v.view).ok_or_else(|| Failure(format!("there is no camera {number}: {file}")))
}

/// The view turned about its own vertical axis.
fn turned(view: &View, angle: f32) -> View {
    let mut view = *view;
    view.pose.world_from_view *= Mat3::from_rotation_y(angle);
    view
}

fn pose(view: &View) -> Pose {
    let axes = view.pose.world_from_view;
    Pose {
        position: view.pose.position.to_array(),
        right: axes.x_axis.to_array(),
        down: axes.y_axis.to_array(),
        forward: axes.z_axis.to_array(),
    }
}

/// The still view, its principal point in the middle as engines have it.
pub(crate) fn view(cameras: &Cameras, (width, height): (u32, u32)) -> View {
    let axes = [cameras.still.right, cameras.still.down, cameras.still.forward].map(Vec3::from);
    let pose = splat_core::Pose {
        world_from_view: Mat3::from_cols(axes[0], axes[1], axes[2]),
        position: Vec3::from(cameras.still.position),
    };
    View { near: cameras.near, ..View::perspective(pose, cameras.fov_y, width, height) }
}

/// SplitMix64: the same numbers everywhere.
struct Random(u64);

impl Random {
    /// 0 to below 1.
    fn share(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.share()
    }

    /// Even over the unit sphere.
    fn direction(&mut self) -> Vec3 {
        let (z, angle) = (self.between(-1.0, 1.0), self.between(0.0, TAU));
        let radius = (1.0 - z * z).sqrt();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    }

    /// Even over all rotations (Shoemake).
    fn rotation(&mut self) -> Quat {
        let (u, a, b) = (self.share(), self.between(0.0, TAU), self.between(0.0, TAU));
        let (s, c) = ((1.0 - u).sqrt(), u.sqrt());
        Quat::from_xyzw(s * a.sin(), s * a.cos(), c * b.sin(), c * b.cos())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generated_clouds_are_the_same_every_time() {
        let (a, b) = (generated(300).unwrap(), generated(300).unwrap());
        assert_eq!(a, b);
        assert!(a.means().iter().filter(|m| m.y == 1.0).count() >= 100);
        assert!(a.opacity_logits().iter().all(|v| (-2.0..4.0).contains(v)));
    }

    #[test]
    fn paths_begin_at_the_still_view_and_move() {
        let cloud = generated(3000).unwrap();
        let cameras = cameras(&cloud, None, (64, 36)).unwrap();
        assert_eq!(cameras.path[0], cameras.still);
        assert!(cameras.path.windows(2).all(|p| p[0] != p[1]));
        assert!(cameras.near > 0.0 && cameras.far > cameras.near);
    }
}
