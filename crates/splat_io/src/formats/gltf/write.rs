//! A GLB with 32-bit floats in every attribute.

use std::io::Write;

use glam::Vec3;
use rayon::prelude::*;
use serde_json::{Value, json};
use splat_core::{Cloud, sh};

use super::super::shared::{finite_or, unit_byte, usual_losses, wxyz};
use super::buffers::{BIN_CHUNK, CHUNK_HEADER, GLB_HEADER, GLB_MAGIC, JSON_CHUNK};
use super::json::EXTENSION;
use crate::WriteError;
use crate::format::Written;

/// Highest degree that the extension defines.
const MAX_DEGREE: u8 = 3;
/// Gaussians encoded at a time.
const BLOCK: usize = 1 << 16;

/// One attribute.
struct Attribute {
    name: String,
    kind: Kind,
}

#[derive(Clone, Copy)]
enum Kind {
    Position,
    /// Colour for programs without the extension.
    Fallback,
    Rotation,
    Scale,
    Opacity,
    Harmonic(usize),
}

impl Kind {
    /// Type of the accessor, its component type, whether normalised, bytes.
    fn layout(self) -> (&'static str, u32, bool, usize) {
        match self {
            Self::Position | Self::Scale | Self::Harmonic(_) => ("VEC3", 5126, false, 12),
            Self::Rotation => ("VEC4", 5126, false, 16),
            Self::Opacity => ("SCALAR", 5126, false, 4),
            Self::Fallback => ("VEC4", 5121, true, 4),
        }
    }

    fn encode(self, cloud: &Cloud, i: usize, out: &mut [u8]) {
        let floats = |values: &[f32], out: &mut [u8]| {
            for (out, v) in out.as_chunks_mut::<4>().0.iter_mut().zip(values) {
                *out = finite_or(*v, 0.0).to_le_bytes();
            }
        };
        let alpha = if cloud.drawable(i) { cloud.opacity(i) } else { 0.0 };
        match self {
            Self::Position => floats(&cloud.means()[i].to_array(), out),
            Self::Scale => floats(&cloud.scale(i).to_array(), out),
            Self::Opacity => floats(&[alpha], out),
            Self::Harmonic(k) => floats(&cloud.sh_of(i)[3 * k..3 * k + 3], out),
            Self::Rotation => {
                let ([w, x, y, z], _) = wxyz(cloud.rotations()[i]);
                floats(&[x, y, z, w], out);
            }
            Self::Fallback => {
                let linear = cloud.base_color(i).to_array().map(|c| unit_byte(linear_of_srgb(c)));
                out[..3].copy_from_slice(&linear);
                out[3] = unit_byte(alpha);
            }
        }
    }
}

/// Colour as meshes store it (IEC 61966-2-1), clamped.
fn linear_of_srgb(c: f32) -> f32 {
    let c = c.clamp(0.0, 1.0);
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

fn attributes(degree: u8) -> Vec<Attribute> {
    let own = |name: &str, kind: Kind| Attribute { name: format!("{EXTENSION}:{name}"), kind };
    let mut attributes = vec![
        Attribute { name: "POSITION".to_owned(), kind: Kind::Position },
        Attribute { name: "COLOR_0".to_owned(), kind: Kind::Fallback },
        own("ROTATION", Kind::Rotation),
        own("SCALE", Kind::Scale),
        own("OPACITY", Kind::Opacity),
    ];
    for l in 0..=usize::from(degree) {
        for n in 0..=2 * l {
            attributes.push(own(&format!("SH_DEGREE_{l}_COEF_{n}"), Kind::Harmonic(l * l + n)));
        }
    }
    attributes
}

pub(super) fn write(cloud: &Cloud, sink: &mut dyn Write) -> Result<Written, WriteError> {
    let mut losses = usual_losses(cloud, MAX_DEGREE);
    if cloud.source().antialiased {
        losses.push("glTF cannot say that the capture was trained with antialiasing".to_owned());
    }
    let count = cloud.len();
    let attributes = attributes(cloud.sh_degree().min(MAX_DEGREE));
    let body: u64 = attributes.iter().map(|a| (a.kind.layout().3 * count) as u64).sum();
    let mut text = serde_json::to_vec(&document(cloud, &attributes, body)).map_err(std::io::Error::other)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    // Every attribute has whole words.
    let length = (GLB_HEADER + 2 * CHUNK_HEADER + text.len()) as u64 + body;
    let Ok(length_word) = u32::try_from(length) else {
        return Err(WriteError::CannotHold {
            format: "gltf",
            what: format!("{count} Gaussians in one file of at most 4 GiB"),
            advice: "split the capture, leave out spherical harmonics, or write .ply".to_owned(),
        });
    };
    let mut header = Vec::with_capacity(text.len() + 64);
    header.extend(GLB_MAGIC);
    header.extend(2u32.to_le_bytes());
    header.extend(length_word.to_le_bytes());
    header.extend((text.len() as u32).to_le_bytes());
    header.extend(JSON_CHUNK);
    header.extend(&text);
    header.extend((body as u32).to_le_bytes());
    header.extend(BIN_CHUNK);
    sink.write_all(&header)?;
    let mut buffer = Vec::new();
    for attribute in &attributes {
        let size = attribute.kind.layout().3;
        for first in (0..count).step_by(BLOCK) {
            buffer.resize(size * BLOCK.min(count - first), 0);
            let records = buffer.par_chunks_exact_mut(size).with_min_len(1 << 12).enumerate();
            records.for_each(|(k, out)| attribute.kind.encode(cloud, first + k, out));
            sink.write_all(&buffer)?;
        }
    }
    Ok(Written { bytes: length, losses, order: None })
}

fn document(cloud: &Cloud, attributes: &[Attribute], body: u64) -> Value {
    let count = cloud.len();
    let empty = (Vec3::ZERO, Vec3::ZERO);
    let finite = |m: &Vec3| m.to_array().map(|v| finite_or(v, 0.0)).into();
    let (low, high) = cloud
        .means()
        .iter()
        .map(finite)
        .fold(None, |range, m: Vec3| {
            range.map_or(Some((m, m)), |(low, high): (Vec3, Vec3)| Some((low.min(m), high.max(m))))
        })
        .unwrap_or(empty);
    let (mut views, mut accessors, mut names) = (Vec::new(), Vec::new(), serde_json::Map::new());
    let mut at = 0;
    for (number, attribute) in attributes.iter().enumerate() {
        let (shape, component, normalized, size) = attribute.kind.layout();
        let length = size * count;
        let mut accessor = json!({"componentType": component, "count": count, "type": shape});
        // Views may not be empty; a cloud without Gaussians has none.
        if count > 0 {
            views.push(json!({"buffer": 0, "byteOffset": at, "byteLength": length, "target": 34962}));
            accessor["bufferView"] = json!(number);
        }
        if normalized {
            accessor["normalized"] = json!(true);
        }
        if matches!(attribute.kind, Kind::Position) {
            accessor["min"] = json!(low.to_array());
            accessor["max"] = json!(high.to_array());
        }
        accessors.push(accessor);
        names.insert(attribute.name.clone(), json!(number));
        at += length;
    }
    let settings = json!({
        "kernel": "ellipse",
        "colorSpace": "srgb_rec709_display",
        "projection": "perspective",
        "sortingMethod": "cameraDistance",
    });
    let primitive = json!({"attributes": names, "mode": 0, "extensions": {EXTENSION: settings}});
    json!({
        "asset": {"version": "2.0", "generator": concat!("splat_io ", env!("CARGO_PKG_VERSION"))},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        // Half a turn about z makes right, down, forward the left, up, forward of glTF and leaves every value as it is.
        "nodes": [{"mesh": 0, "rotation": [0.0, 0.0, 1.0, 0.0], "name": "splats"}],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [{"byteLength": body}],
        "bufferViews": views,
        "accessors": accessors,
    })
}

/// Coefficients per channel of the highest degree: the attributes above count on it.
const _: () = assert!(MAX_DEGREE < sh::MAX_DEGREE);
