//! `transforms.json` of nerfstudio and instant-ngp: camera-to-world matrices with the axes right, up, back.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::model::{Pinhole, view};
use super::{CameraFile, CameraFormat, Cameras, NamedView};
use crate::format::Siblings;
use crate::{ReadError, SourceName, WriteError};

/// Width and height where neither the file nor its first picture tells: those of the synthetic scenes of NeRF.
const USUAL_SIZE: (u32, u32) = (800, 800);

/// The data format of nerfstudio, instant-ngp and the Blender scenes of NeRF.
#[derive(Clone, Copy, Debug)]
pub struct Nerfstudio;

/// Intrinsics stand at the top, in each frame, or both; the frame's win.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
struct Lens {
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_model: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    w: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    h: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_x: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_y: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cx: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cy: Option<f64>,
    #[serde(skip_serializing)]
    camera_angle_x: Option<f64>,
    #[serde(skip_serializing)]
    camera_angle_y: Option<f64>,
    #[serde(skip_serializing)]
    k1: Option<f64>,
    #[serde(skip_serializing)]
    k2: Option<f64>,
    #[serde(skip_serializing)]
    k3: Option<f64>,
    #[serde(skip_serializing)]
    k4: Option<f64>,
    #[serde(skip_serializing)]
    p1: Option<f64>,
    #[serde(skip_serializing)]
    p2: Option<f64>,
}

impl Lens {
    /// This lens with what it lacks taken from another.
    fn or(&self, other: &Self) -> Self {
        macro_rules! pick {
            ($($field:ident)*) => {
                Self {
                    camera_model: self.camera_model.clone().or_else(|| other.camera_model.clone()),
                    $($field: self.$field.or(other.$field),)*
                }
            };
        }
        pick!(w h fl_x fl_y cx cy camera_angle_x camera_angle_y k1 k2 k3 k4 p1 p2)
    }

    fn distorted(&self) -> bool {
        let model = self.camera_model.as_deref().unwrap_or_default().to_ascii_uppercase();
        let coefficients = [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2];
        model.contains("FISHEYE") || coefficients.iter().any(|k| k.is_some_and(|k| k != 0.0))
    }
}

#[derive(Deserialize, Serialize)]
struct Frame {
    file_path: String,
    #[serde(flatten)]
    lens: Lens,
    transform_matrix: Vec<Vec<f64>>,
}

#[derive(Deserialize, Serialize)]
struct File {
    #[serde(flatten)]
    lens: Lens,
    frames: Vec<Frame>,
    #[serde(default, skip_serializing)]
    applied_transform: Option<serde_json::Value>,
}

impl CameraFormat for Nerfstudio {
    fn name(&self) -> &'static str {
        "nerfstudio"
    }

    fn description(&self) -> &'static str {
        "transforms.json of nerfstudio, instant-ngp and the Blender scenes"
    }

    fn file_names(&self) -> &'static [&'static str] {
        &["transforms.json", "transforms_train.json"]
    }

    fn sniff(&self, _file_name: &str, bytes: &[u8]) -> bool {
        bytes.trim_ascii_start().starts_with(b"{") && bytes.windows(8).any(|w| w == b"\"frames\"")
    }

    fn read(&self, bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<Cameras, ReadError> {
        let file: File = serde_json::from_slice(bytes)
            .map_err(|e| ReadError::malformed("the cameras", "nerfstudio's transforms.json", e.to_string(), name))?;
        let mut cameras = Cameras::default();
        if file.applied_transform.is_some() {
            cameras.notes.push(
                "the cameras stay in nerfstudio's world: `applied_transform` was not undone; a splat trained on the \
                 COLMAP model needs COLMAP's own cameras"
                    .to_owned(),
            );
        }
        let mut size = None;
        let mut distorted = 0;
        for (index, frame) in file.frames.iter().enumerate() {
            let camera = format!("frame {index} (`{}`)", frame.file_path);
            let mut lens = frame.lens.or(&file.lens);
            distorted += usize::from(lens.distorted());
            if lens.w.is_none() || lens.h.is_none() {
                let (w, h) = *size.get_or_insert_with(|| {
                    picture_size(&frame.file_path, files).unwrap_or_else(|| {
                        let (w, h) = USUAL_SIZE;
                        cameras.notes.push(format!("the file names no size of its pictures; {w}x{h} was taken"));
                        USUAL_SIZE
                    })
                });
                (lens.w, lens.h) = (Some(f64::from(w)), Some(f64::from(h)));
            }
            let pinhole = pinhole(&lens, &camera, name)?;
            let (rotation, position) = pose(&frame.transform_matrix, &camera, name)?;
            let view = view(&pinhole, rotation, position, &camera, name)?;
            cameras.views.push(NamedView { id: index as u32, name: frame.file_path.clone(), view });
        }
        if distorted > 0 {
            cameras.notes.push(format!("lens distortion of {distorted} cameras was not taken over"));
        }
        Ok(cameras)
    }

    fn write(&self, views: &[NamedView]) -> Result<Vec<CameraFile>, WriteError> {
        let lens = |named: &NamedView| {
            let (view, i) = (&named.view, &named.view.intrinsics);
            Lens {
                w: Some(f64::from(view.width)),
                h: Some(f64::from(view.height)),
                fl_x: Some(exact(i.fx)),
                fl_y: Some(exact(i.fy)),
                cx: Some(exact(i.cx)),
                cy: Some(exact(i.cy)),
                ..Lens::default()
            }
        };
        let key = |v: &NamedView| (v.view.width, v.view.height, v.view.intrinsics);
        let shared = views.windows(2).all(|w| key(&w[0]) == key(&w[1]));
        let frames = views.iter().map(|named| {
            let m = named.view.pose.world_from_view.to_cols_array_2d();
            let p = named.view.pose.position.to_array();
            // Down and forward become up and back.
            let row = |r: usize| vec![exact(m[0][r]), exact(-m[1][r]), exact(-m[2][r]), exact(p[r])];
            Frame {
                file_path: named.name.clone(),
                lens: if shared { Lens::default() } else { lens(named) },
                transform_matrix: vec![row(0), row(1), row(2), vec![0.0, 0.0, 0.0, 1.0]],
            }
        });
        let top = if shared { views.first().map(lens).unwrap_or_default() } else { Lens::default() };
        let lens = Lens { camera_model: Some("PINHOLE".to_owned()), ..top };
        let file = File { lens, frames: frames.collect(), applied_transform: None };
        let bytes = serde_json::to_vec_pretty(&file).map_err(std::io::Error::from)?;
        Ok(vec![CameraFile { name: "transforms.json", bytes }])
    }
}

/// The shortest decimal number that reads as this float, as a double: `0.1`, not `0.10000000149011612`.
fn exact(v: f32) -> f64 {
    v.to_string().parse().unwrap_or(f64::from(v))
}

fn pinhole(lens: &Lens, camera: &str, name: &SourceName) -> Result<Pinhole, ReadError> {
    let (w, h) = (lens.w.unwrap_or_default(), lens.h.unwrap_or_default());
    let from_angle = |angle: Option<f64>, size: f64| angle.map(|a| 0.5 * size / (0.5 * a).tan());
    let fx = lens.fl_x.or(from_angle(lens.camera_angle_x, w));
    let fy = lens.fl_y.or(from_angle(lens.camera_angle_y, h));
    let (Some(fx), Some(fy)) = (fx.or(fy), fy.or(fx)) else {
        let what = format!("the focal length of {camera}");
        return Err(ReadError::malformed(what, "`fl_x` or `camera_angle_x`", "missing", name));
    };
    let (cx, cy) = (lens.cx.unwrap_or(0.5 * w), lens.cy.unwrap_or(0.5 * h));
    Ok(Pinhole { width: w.round() as u32, height: h.round() as u32, fx, fy, cx, cy })
}

/// Rotation and centre of a camera-to-world matrix of 3 or 4 rows.
fn pose(matrix: &[Vec<f64>], camera: &str, name: &SourceName) -> Result<(DMat3, DVec3), ReadError> {
    let rows: Option<Vec<[f64; 4]>> = matrix.iter().take(3).map(|row| row.first_chunk::<4>().copied()).collect();
    let Some([a, b, c]) = rows.as_deref().and_then(|r| r.first_chunk::<3>()) else {
        let what = format!("`transform_matrix` of {camera}");
        return Err(ReadError::malformed(what, "3 or 4 rows of 4 numbers", format!("{} rows", matrix.len()), name));
    };
    let column = |k: usize| DVec3::new(a[k], b[k], c[k]);
    // Some exporters scale the world and leave the scale in the axes; lengths are not a camera's.
    let axes = DMat3::from_cols(column(0), -column(1), -column(2));
    let scale = axes.determinant().cbrt();
    Ok((axes * (1.0 / scale), column(3)))
}

/// Size of a PNG beside the file, whose name may lack its ending.
fn picture_size(path: &str, files: &dyn Siblings) -> Option<(u32, u32)> {
    let path = path.trim_start_matches("./");
    let bytes = files.get(path).or_else(|_| files.get(&format!("{path}.png"))).ok()?;
    if !bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        return None;
    }
    let side = |at: usize| Some(u32::from_be_bytes(*bytes.get(at..)?.first_chunk()?));
    Some((side(16)?, side(20)?))
}
