//! `cameras.json` as the INRIA trainer writes it: a list of pictures with camera-to-world rotations (rows) and centres.

use serde::{Deserialize, Serialize};
use splat_core::glam::{Mat3, Vec3};
use splat_core::{DEFAULT_NEAR, Intrinsics, Pose, Projection, View};

use super::{Cameras, NamedView};
use crate::{ReadError, SourceName};

#[derive(Deserialize, Serialize)]
struct Entry {
    #[serde(default)]
    id: Option<u32>,
    #[serde(default)]
    img_name: Option<String>,
    width: u32,
    height: u32,
    position: [f32; 3],
    rotation: [[f32; 3]; 3],
    fx: f32,
    fy: f32,
    // Not written by the trainer, whose principal point is the middle; some tools add them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cx: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cy: Option<f32>,
}

pub(super) fn read(bytes: &[u8], name: &SourceName) -> Result<Cameras, ReadError> {
    let entries: Vec<Entry> = serde_json::from_slice(bytes)
        .map_err(|e| ReadError::malformed("the list of cameras", "INRIA's cameras.json", e.to_string(), name))?;
    let mut views = Vec::with_capacity(entries.len());
    for (index, e) in entries.into_iter().enumerate() {
        let view = View {
            width: e.width,
            height: e.height,
            intrinsics: Intrinsics {
                fx: e.fx,
                fy: e.fy,
                cx: e.cx.unwrap_or(0.5 * e.width as f32),
                cy: e.cy.unwrap_or(0.5 * e.height as f32),
            },
            projection: Projection::Perspective,
            pose: Pose {
                // The file has rows, glam columns.
                world_from_view: Mat3::from_cols_array_2d(&e.rotation).transpose(),
                position: Vec3::from(e.position),
            },
            near: DEFAULT_NEAR,
        };
        let picture = e.img_name.unwrap_or_else(|| format!("{index:05}"));
        view.check().map_err(|error| {
            ReadError::malformed(format!("camera {index} (`{picture}`)"), "a usable camera", error.to_string(), name)
        })?;
        views.push(NamedView { id: e.id.unwrap_or(index as u32), name: picture, view });
    }
    Ok(Cameras { format: "inria", views, notes: Vec::new() })
}
