//! From where a command looks at a capture: options that several commands share.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use splat_core::bounds::robust_bounds;
use splat_core::glam::{Mat3, Vec3};
use splat_core::{Cloud, Pose, View};

use crate::failure::Failure;
use crate::parse;

/// Opening angle of orbit views, in radians: 50 degrees.
const FOV_Y: f32 = 0.872_664_6;
/// Size of orbit views.
const SIZE: (u32, u32) = (1280, 720);

/// `CAMERAS#N`: one camera of a camera file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CameraChoice {
    /// The camera file, or a folder with one.
    pub(crate) path: PathBuf,
    /// Position in the file counting from 0, or the name of a picture; `None` for the first.
    pub(crate) which: Option<String>,
}

impl FromStr for CameraChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (path, which) = match text.rsplit_once('#') {
            Some((path, which)) => (path, Some(which.to_owned())),
            None => (text, None),
        };
        if path.is_empty() || which.as_deref() == Some("") {
            return Err("CAMERAS#N was expected: a camera file and the number of a camera, counted from 0".to_owned());
        }
        Ok(Self { path: PathBuf::from(path), which })
    }
}

/// `YAW,PITCH[,DISTANCE]`: a camera that looks at the middle of the capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Orbit {
    /// Angle about the up axis, in radians; 0 looks along the capture's forward axis.
    pub(crate) yaw: f32,
    /// Angle above the horizon, in radians.
    pub(crate) pitch: f32,
    /// Distance from the middle, in scene units; `None` for one that shows the bulk of the capture.
    pub(crate) distance: Option<f32>,
}

impl Default for Orbit {
    fn default() -> Self {
        Self { yaw: 30f32.to_radians(), pitch: 20f32.to_radians(), distance: None }
    }
}

impl FromStr for Orbit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let v = parse::numbers(text, &[2, 3])?;
        if v[1].abs() > 90.0 {
            return Err("a pitch of -90 to 90 degrees is needed".to_owned());
        }
        if v.get(2).is_some_and(|&d| d <= 0.0) {
            return Err("a distance above 0 is needed".to_owned());
        }
        Ok(Self { yaw: v[0].to_radians(), pitch: v[1].to_radians(), distance: v.get(2).copied() })
    }
}

/// From where: a camera of a file, or an orbit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Standpoint {
    /// A camera of a camera file.
    Camera(CameraChoice),
    /// A camera that looks at the middle of the capture.
    Orbit(Orbit),
}

impl Default for Standpoint {
    fn default() -> Self {
        Self::Orbit(Orbit::default())
    }
}

/// Options about the picture, whatever the standpoint.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct PictureOptions {
    /// Size of the picture [default: the camera's own, 1280x720 for an orbit]
    #[arg(long, value_name = "WxH", value_parser = parse::size, help_heading = "Camera")]
    pub(crate) size: Option<(u32, u32)>,
    /// Direction that is up for an orbit [default: as the file says, else 0,-1,0, the convention of 3DGS training]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true, help_heading = "Camera")]
    pub(crate) up: Option<Vec3>,
    /// Vertical opening angle of an orbit in degrees [default: 50]
    #[arg(long, value_name = "DEGREES", value_parser = parse::opening, help_heading = "Camera")]
    pub(crate) fov: Option<f32>,
    /// Nothing nearer than this is drawn, in scene units [default: 0.01]
    #[arg(long, value_name = "DEPTH", value_parser = parse::positive, help_heading = "Camera")]
    pub(crate) near: Option<f32>,
}

/// Options for one view.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct CameraOptions {
    /// Look through camera N (from 0, or a picture's name) of a camera file: cameras.json, transforms.json or COLMAP
    #[arg(long, value_name = "CAMERAS#N", help_heading = "Camera")]
    pub(crate) camera: Option<CameraChoice>,
    /// Look at the middle from this yaw and pitch in degrees and distance in scene units [default: 30,20]
    #[arg(
        long,
        value_name = "YAW,PITCH[,DIST]",
        allow_hyphen_values = true,
        conflicts_with = "camera",
        help_heading = "Camera"
    )]
    pub(crate) orbit: Option<Orbit>,
    #[command(flatten)]
    pub(crate) picture: PictureOptions,
}

impl CameraOptions {
    /// Where the user wants to stand; `None` if that was left open.
    pub(crate) fn standpoint(&self) -> Option<Standpoint> {
        self.camera.clone().map(Standpoint::Camera).or(self.orbit.map(Standpoint::Orbit))
    }

    /// The view that the user asks for.
    ///
    /// # Errors
    /// As [`view`].
    pub(crate) fn view(&self, cloud: &Cloud) -> Result<View, Failure> {
        view(&self.standpoint().unwrap_or_default(), &self.picture, cloud)
    }
}

/// The view from a standpoint.
///
/// # Errors
/// [`Failure::Failed`] if the camera file cannot be read, [`Failure::Usage`] if it has no such camera.
pub(crate) fn view(standpoint: &Standpoint, picture: &PictureOptions, cloud: &Cloud) -> Result<View, Failure> {
    let mut view = match standpoint {
        Standpoint::Camera(choice) => {
            let view = camera_of_file(choice)?;
            picture.size.map_or(view, |(width, height)| view.resized(width, height))
        }
        Standpoint::Orbit(orbit) => {
            let (width, height) = picture.size.unwrap_or(SIZE);
            orbit_view(cloud, orbit, picture.up.unwrap_or_else(|| up_of(cloud)), picture.fov, width, height)
        }
    };
    if let Some(near) = picture.near {
        view.near = near;
    }
    view.check()?;
    Ok(view)
}

fn camera_of_file(choice: &CameraChoice) -> Result<View, Failure> {
    let cameras = splat_io::cameras::read(&choice.path)?;
    let which = choice.which.as_deref().unwrap_or("0");
    let number = which.parse::<usize>().ok().and_then(|n| cameras.views.get(n));
    let stem = |name: &str| name.rsplit_once('.').map_or(name.to_owned(), |(stem, _)| stem.to_owned());
    let named = || cameras.views.iter().find(|v| v.name == which || stem(&v.name) == which);
    match number.or_else(named) {
        Some(found) => Ok(found.view),
        None if cameras.views.is_empty() => {
            Err(Failure::failed(format!("the camera file has no cameras; name another: {}", choice.path.display())))
        }
        None => Err(Failure::usage(format!(
            "there is no camera `{which}`; the file has cameras 0 to {}: {}",
            cameras.views.len() - 1,
            choice.path.display()
        ))),
    }
}

/// The up direction of a capture: what its file says about its axes, else -y.
pub(crate) fn up_of(cloud: &Cloud) -> Vec3 {
    // Three letters, one per axis: where +X, +Y and +Z point.
    for (letter, axis) in cloud.source().axes.chars().zip(Vec3::AXES) {
        match letter {
            'U' => return axis,
            'D' => return -axis,
            _ => {}
        }
    }
    Vec3::NEG_Y
}

/// A view on a sphere about the middle of the capture.
pub(crate) fn orbit_view(cloud: &Cloud, orbit: &Orbit, up: Vec3, fov: Option<f32>, width: u32, height: u32) -> View {
    let (min, max) = robust_bounds(cloud).map_or((Vec3::NEG_ONE, Vec3::ONE), |b| (b.min, b.max));
    let center = 0.5 * (min + max);
    let fov_y = fov.unwrap_or(FOV_Y);
    let frame = horizon(up);
    let (sin_yaw, cos_yaw) = orbit.yaw.sin_cos();
    let (sin_pitch, cos_pitch) = orbit.pitch.sin_cos();
    // Right, up and back of the camera's horizon.
    let eye = frame * Vec3::new(cos_pitch * sin_yaw, sin_pitch, cos_pitch * cos_yaw);
    // At the poles the picture's top is where the horizon's forward (from above) would be.
    let top = frame * Vec3::new(-sin_pitch * sin_yaw, cos_pitch, -sin_pitch * cos_yaw);
    let pose = Pose::look_at(center + eye, center, top);
    let distance = orbit.distance.unwrap_or_else(|| {
        // Every corner of the bulk's box inside the picture, with a rim of a twentieth.
        let axes = pose.world_from_view.transpose();
        let tan_y = 0.95 * (0.5 * fov_y).tan();
        let tan_x = tan_y * width as f32 / height as f32;
        let corners =
            (0..8).map(|k| Vec3::new([min.x, max.x][k & 1], [min.y, max.y][k >> 1 & 1], [min.z, max.z][k >> 2]));
        let needed = corners.map(|corner| {
            let c = axes * (corner - center);
            (c.x.abs() / tan_x).max(c.y.abs() / tan_y) - c.z
        });
        needed.fold(1e-6, f32::max)
    });
    let pose = Pose { position: center + distance * eye, ..pose };
    let view = View::perspective(pose, fov_y, width, height);
    // A near plane fit for the scene's size: a capture of a coin is not cut, one of a town has no fog in the lens.
    View { near: view.near.min(1e-3 * distance), ..view }
}

/// Right, up and back as columns: back is the capture's -z where up allows it, so that yaw 0 looks along +z.
fn horizon(up: Vec3) -> Mat3 {
    let back = [Vec3::NEG_Z, Vec3::NEG_Y, Vec3::X]
        .into_iter()
        .map(|axis| axis.reject_from_normalized(up))
        .find(|v| v.length() > 0.5)
        .unwrap_or_else(|| up.any_orthonormal_vector())
        .normalize();
    Mat3::from_cols(up.cross(back), up, back)
}

#[cfg(test)]
mod tests {
    use splat_core::CloudArrays;
    use splat_core::glam::{Quat, Vec2};

    use super::*;

    fn dots(means: &[Vec3]) -> Cloud {
        let n = means.len();
        Cloud::new(CloudArrays {
            means: means.to_vec(),
            log_scales: vec![Vec3::splat(-3.0); n],
            rotations: vec![Quat::IDENTITY; n],
            opacity_logits: vec![2.0; n],
            sh: vec![0.0; 3 * n],
            ..CloudArrays::default()
        })
        .unwrap()
    }

    #[test]
    fn an_orbit_looks_at_the_middle_with_up_on_top_whatever_up_is() {
        let cloud = dots(&[Vec3::new(-1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 2.0, 3.0)]);
        for up in [Vec3::NEG_Y, Vec3::Y, Vec3::Z, Vec3::X, Vec3::new(1.0, 2.0, 3.0).normalize()] {
            for pitch in [-90.0f32, -30.0, 0.0, 45.0, 90.0] {
                let orbit = Orbit { yaw: 0.7, pitch: pitch.to_radians(), distance: None };
                let view = orbit_view(&cloud, &orbit, up, None, 64, 48);
                let (middle, _) = view.project(Vec3::new(0.0, 2.0, 3.0)).unwrap();
                assert!(middle.distance(Vec2::new(32.0, 24.0)) < 0.01, "{up} {pitch} {middle}");
                let higher = view.pose.position - Vec3::new(0.0, 2.0, 3.0);
                assert!((higher.normalize().dot(up) - pitch.to_radians().sin()).abs() < 1e-4, "{up} {pitch}");
                assert!(-view.pose.world_from_view.y_axis.dot(up) >= -1e-4, "{up} {pitch}");
            }
        }
        let ahead = orbit_view(&cloud, &Orbit { yaw: 0.0, pitch: 0.0, distance: None }, Vec3::NEG_Y, None, 64, 48);
        assert!(ahead.forward().distance(Vec3::Z) < 1e-5 && ahead.pose.world_from_view.x_axis.distance(Vec3::X) < 1e-5);
    }

    #[test]
    fn a_camera_choice_takes_the_last_hash() {
        let choice: CameraChoice = "a#b/cameras.json#12".parse().unwrap();
        assert_eq!(choice, CameraChoice { path: "a#b/cameras.json".into(), which: Some("12".to_owned()) });
        assert!("#1".parse::<CameraChoice>().is_err() && "a#".parse::<CameraChoice>().is_err());
    }
}
