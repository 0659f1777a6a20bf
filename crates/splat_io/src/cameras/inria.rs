//! `cameras.json` as the INRIA trainer writes it: a list of pictures with camera-to-world rotations (rows) and centres.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::model::{Pinhole, view};
use super::{CameraFile, CameraFormat, Cameras, NamedView};
use crate::format::Siblings;
use crate::{ReadError, SourceName, WriteError};

/// The list that lies beside a trained `point_cloud` folder.
#[derive(Clone, Copy, Debug)]
pub struct Inria;

#[derive(Deserialize)]
struct Entry {
    #[serde(default)]
    id: Option<u32>,
    #[serde(default)]
    img_name: Option<String>,
    width: u32,
    height: u32,
    position: [f64; 3],
    rotation: [[f64; 3]; 3],
    fx: f64,
    fy: f64,
    // Not written by the trainer, whose principal point is the middle; some tools add them.
    #[serde(default)]
    cx: Option<f64>,
    #[serde(default)]
    cy: Option<f64>,
}

#[derive(Serialize)]
struct Written<'a> {
    id: u32,
    img_name: &'a str,
    width: u32,
    height: u32,
    position: [f32; 3],
    rotation: [[f32; 3]; 3],
    fy: f32,
    fx: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    cx: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cy: Option<f32>,
}

impl CameraFormat for Inria {
    fn name(&self) -> &'static str {
        "inria"
    }

    fn description(&self) -> &'static str {
        "cameras.json of the INRIA trainer"
    }

    fn file_names(&self) -> &'static [&'static str] {
        &["cameras.json"]
    }

    fn sniff(&self, _file_name: &str, bytes: &[u8]) -> bool {
        bytes.trim_ascii_start().starts_with(b"[")
    }

    fn read(&self, bytes: &[u8], name: &SourceName, _files: &dyn Siblings) -> Result<Cameras, ReadError> {
        let entries: Vec<Entry> = serde_json::from_slice(bytes)
            .map_err(|e| ReadError::malformed("the list of cameras", "INRIA's cameras.json", e.to_string(), name))?;
        let mut views = Vec::with_capacity(entries.len());
        for (index, e) in entries.into_iter().enumerate() {
            let pinhole = Pinhole {
                width: e.width,
                height: e.height,
                fx: e.fx,
                fy: e.fy,
                cx: e.cx.unwrap_or(0.5 * f64::from(e.width)),
                cy: e.cy.unwrap_or(0.5 * f64::from(e.height)),
            };
            let picture = e.img_name.unwrap_or_else(|| format!("{index:05}"));
            let camera = format!("camera {index} (`{picture}`)");
            // The file has rows, glam columns.
            let rotation = DMat3::from_cols_array_2d(&e.rotation).transpose();
            let view = view(&pinhole, rotation, DVec3::from(e.position), &camera, name)?;
            views.push(NamedView { id: e.id.unwrap_or(index as u32), name: picture, view });
        }
        Ok(Cameras { views, ..Cameras::default() })
    }

    fn write(&self, views: &[NamedView]) -> Result<Vec<CameraFile>, WriteError> {
        let entry = |named: &'_ NamedView| {
            let (view, i) = (&named.view, &named.view.intrinsics);
            let off = |c: f32, size: u32| (c != 0.5 * size as f32).then_some(c);
            Written {
                id: named.id,
                img_name: "",
                width: view.width,
                height: view.height,
                position: view.pose.position.to_array(),
                rotation: view.pose.world_from_view.transpose().to_cols_array_2d(),
                fy: i.fy,
                fx: i.fx,
                cx: off(i.cx, view.width),
                cy: off(i.cy, view.height),
            }
        };
        let entries: Vec<Written<'_>> = views.iter().map(|v| Written { img_name: &v.name, ..entry(v) }).collect();
        let bytes = serde_json::to_vec_pretty(&entries).map_err(std::io::Error::from)?;
        Ok(vec![CameraFile { name: "cameras.json", bytes }])
    }
}
