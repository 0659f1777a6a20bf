//! COLMAP sparse models: `cameras` and `images`, as text or binary; points are not read.

mod binary;
mod text;

use std::collections::HashMap;

use glam::{DMat3, DQuat, DVec3};

use super::model::{Pinhole, view};
use super::{CameraFile, CameraFormat, Cameras, NamedView, file_name};
use crate::format::Siblings;
use crate::{ReadError, SourceName, WriteError};

/// A model of three `.bin` files.
#[derive(Clone, Copy, Debug)]
pub struct ColmapBinary;

/// A model of three `.txt` files.
#[derive(Clone, Copy, Debug)]
pub struct ColmapText;

/// Camera models by id: name, focal lengths (1 or 2), parameters in all. The principal point follows the focal lengths,
/// then distortion.
const MODELS: [(&str, usize, usize); 11] = [
    ("SIMPLE_PINHOLE", 1, 3),
    ("PINHOLE", 2, 4),
    ("SIMPLE_RADIAL", 1, 4),
    ("RADIAL", 1, 5),
    ("OPENCV", 2, 8),
    ("OPENCV_FISHEYE", 2, 8),
    ("FULL_OPENCV", 2, 12),
    ("FOV", 2, 5),
    ("SIMPLE_RADIAL_FISHEYE", 1, 4),
    ("RADIAL_FISHEYE", 1, 5),
    ("THIN_PRISM_FISHEYE", 2, 12),
];

/// A lens that pictures refer to.
struct Lens {
    id: u32,
    pinhole: Pinhole,
    distorted: bool,
}

impl Lens {
    fn new(id: u32, model: usize, size: [u64; 2], parameters: &[f64]) -> Self {
        let (name, focal_lengths, _) = MODELS[model];
        let side = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        let p = |i: usize| parameters.get(i).copied().unwrap_or(f64::NAN);
        let pinhole = Pinhole {
            width: side(size[0]),
            height: side(size[1]),
            fx: p(0),
            fy: p(focal_lengths - 1),
            cx: p(focal_lengths),
            cy: p(focal_lengths + 1),
        };
        let bent = parameters.iter().skip(focal_lengths + 2).any(|&k| k != 0.0);
        Self { id, pinhole, distorted: bent || name.contains("FISHEYE") || name == "FOV" }
    }
}

/// A picture as the file has it: world-to-camera rotation (w, x, y, z) and translation.
struct Image {
    id: u32,
    rotation: [f64; 4],
    translation: [f64; 3],
    lens: u32,
    name: String,
}

fn join(lenses: &[Lens], images: Vec<Image>, name: &SourceName) -> Result<Cameras, ReadError> {
    let mut cameras = Cameras::default();
    let mut distorted = 0;
    let mut by_id: HashMap<u32, &Lens> = HashMap::with_capacity(lenses.len());
    for lens in lenses {
        by_id.entry(lens.id).or_insert(lens);
    }
    for image in images {
        let camera = format!("image {} (`{}`)", image.id, image.name);
        let Some(lens) = by_id.get(&image.lens) else {
            let what = format!("the camera of {camera}");
            return Err(ReadError::malformed(what, "an id of the cameras file", image.lens.to_string(), name));
        };
        distorted += usize::from(lens.distorted);
        let [w, x, y, z] = image.rotation;
        let view_from_world = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
        let world_from_view = view_from_world.transpose();
        let position = -(world_from_view * DVec3::from(image.translation));
        let view = view(&lens.pinhole, world_from_view, position, &camera, name)?;
        cameras.views.push(NamedView { id: image.id, name: image.name, view });
    }
    if distorted > 0 {
        cameras.notes.push(format!(
            "lens distortion of {distorted} images was not taken over; use the undistorted model that the trainer used"
        ));
    }
    Ok(cameras)
}

/// Lenses and pictures of views, equal lenses once; ids start at 1 as COLMAP's do where those of the views repeat.
fn parts(views: &[NamedView]) -> (Vec<Lens>, Vec<Image>) {
    let mut lenses: Vec<Lens> = Vec::new();
    let mut ids: Vec<u32> = views.iter().map(|v| v.id).collect();
    ids.sort_unstable();
    let unique = ids.windows(2).all(|w| w[0] != w[1]);
    let images = views.iter().enumerate().map(|(index, named)| {
        let (view, i) = (&named.view, &named.view.intrinsics);
        let pinhole = Pinhole {
            width: view.width,
            height: view.height,
            fx: i.fx.into(),
            fy: i.fy.into(),
            cx: i.cx.into(),
            cy: i.cy.into(),
        };
        let lens = lenses.iter().find(|l| l.pinhole == pinhole).map_or(lenses.len() as u32 + 1, |l| l.id);
        if lens as usize > lenses.len() {
            lenses.push(Lens { id: lens, pinhole, distorted: false });
        }
        let view_from_world = view.pose.world_from_view.as_dmat3().transpose();
        let q = DQuat::from_mat3(&view_from_world).normalize();
        let q = if q.w < 0.0 { -q } else { q };
        let translation = -(DMat3::from_quat(q) * view.pose.position.as_dvec3());
        Image {
            id: if unique { named.id } else { index as u32 + 1 },
            rotation: [q.w, q.x, q.y, q.z],
            translation: translation.to_array(),
            lens,
            name: named.name.clone(),
        }
    });
    let images = images.collect();
    (lenses, images)
}

fn is_part(file_name: &str, ending: &str) -> bool {
    let stem = file_name.strip_suffix(ending);
    matches!(stem, Some("cameras" | "images" | "points3D"))
}

/// The bytes of `wanted`: those given if that is the file's name, else from beside it.
fn part<'a>(
    wanted: &str,
    bytes: &'a [u8],
    name: &SourceName,
    files: &dyn Siblings,
) -> Result<std::borrow::Cow<'a, [u8]>, ReadError> {
    if file_name(name) == wanted { Ok(bytes.into()) } else { files.get(wanted).map(Into::into) }
}

impl CameraFormat for ColmapBinary {
    fn name(&self) -> &'static str {
        "colmap"
    }

    fn description(&self) -> &'static str {
        "COLMAP sparse model, binary (a folder with cameras.bin and images.bin)"
    }

    fn file_names(&self) -> &'static [&'static str] {
        &["images.bin"]
    }

    fn sniff(&self, file_name: &str, _bytes: &[u8]) -> bool {
        is_part(file_name, ".bin")
    }

    fn read(&self, bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<Cameras, ReadError> {
        let lenses = binary::lenses(&part("cameras.bin", bytes, name, files)?, &name.sibling("cameras.bin"))?;
        let path = name.sibling("images.bin");
        join(&lenses, binary::images(&part("images.bin", bytes, name, files)?, &path)?, &path)
    }

    fn write(&self, views: &[NamedView]) -> Result<Vec<CameraFile>, WriteError> {
        let (lenses, images) = parts(views);
        Ok(vec![
            CameraFile { name: "images.bin", bytes: binary::write_images(&images) },
            CameraFile { name: "cameras.bin", bytes: binary::write_lenses(&lenses) },
            // Trainers expect the file, a count of zero is enough.
            CameraFile { name: "points3D.bin", bytes: 0u64.to_le_bytes().to_vec() },
        ])
    }
}

impl CameraFormat for ColmapText {
    fn name(&self) -> &'static str {
        "colmap-text"
    }

    fn description(&self) -> &'static str {
        "COLMAP sparse model, text (a folder with cameras.txt and images.txt)"
    }

    fn file_names(&self) -> &'static [&'static str] {
        &["images.txt"]
    }

    fn sniff(&self, file_name: &str, _bytes: &[u8]) -> bool {
        is_part(file_name, ".txt")
    }

    fn read(&self, bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<Cameras, ReadError> {
        let lenses = text::lenses(&part("cameras.txt", bytes, name, files)?, &name.sibling("cameras.txt"))?;
        let path = name.sibling("images.txt");
        join(&lenses, text::images(&part("images.txt", bytes, name, files)?, &path)?, &path)
    }

    fn write(&self, views: &[NamedView]) -> Result<Vec<CameraFile>, WriteError> {
        let (lenses, images) = parts(views);
        if let Some(image) = images.iter().find(|i| i.name.contains(['\n', '\r']) || i.name.is_empty()) {
            return Err(WriteError::CannotHold {
                format: "colmap-text",
                what: format!("the name {:?}", image.name),
                advice: "give the view a name of one line".to_owned(),
            });
        }
        Ok(vec![
            CameraFile { name: "images.txt", bytes: text::write_images(&images) },
            CameraFile { name: "cameras.txt", bytes: text::write_lenses(&lenses) },
            CameraFile { name: "points3D.txt", bytes: b"# no points\n".to_vec() },
        ])
    }
}
