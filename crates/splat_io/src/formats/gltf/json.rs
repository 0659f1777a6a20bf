//! The parts of a glTF document that splats need.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use crate::{ReadError, SourceName};

/// Name of the extension, and prefix of its attributes.
pub(super) const EXTENSION: &str = "KHR_gaussian_splatting";
/// Names under which SPZ data inside glTF has been proposed, the newest first.
const SPZ_NAMES: [&str; 3] = [
    "KHR_gaussian_splatting_compression_spz_2",
    "KHR_gaussian_splatting_compression_spz",
    "KHR_spz_gaussian_splats_compression",
];

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) buffers: Vec<Buffer>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) nodes: Vec<Node>,
    pub(super) scenes: Vec<Scene>,
    pub(super) scene: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) byte_length: u64,
    pub(super) uri: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) sparse: Option<Value>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) primitives: Vec<Primitive>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) extensions: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) mesh: Option<usize>,
    pub(super) children: Vec<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) nodes: Vec<usize>,
}

impl Document {
    pub(super) fn parse(text: &[u8], name: &SourceName) -> Result<Self, ReadError> {
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        serde_json::from_slice(text).map_err(|error| {
            ReadError::malformed("the JSON of the glTF file", "a glTF 2.0 document", error.to_string(), name)
        })
    }
}

impl Primitive {
    /// Whether it holds Gaussians.
    pub(super) fn is_splats(&self) -> bool {
        self.extensions.get(EXTENSION).is_some() || self.spz_view().is_some()
    }

    /// Number of the buffer view with SPZ data, if there is any; the names were nested differently over time.
    pub(super) fn spz_view(&self) -> Option<u64> {
        let nested = self.extensions.get(EXTENSION).and_then(|e| e.get("extensions"));
        let places = [nested, Some(&self.extensions)];
        let found = places.into_iter().flatten().find_map(|place| SPZ_NAMES.iter().find_map(|name| place.get(name)))?;
        found.get("bufferView")?.as_u64()
    }

    /// A text of the extension (`kernel`, `colorSpace`).
    pub(super) fn setting(&self, key: &str) -> Option<&str> {
        self.extensions.get(EXTENSION)?.get(key)?.as_str()
    }

    /// The accessor of an attribute of the extension; early drafts had no prefix but an underscore.
    pub(super) fn attribute(&self, name: &str) -> Option<usize> {
        let prefixed = self.attributes.get(&format!("{EXTENSION}:{name}"));
        prefixed.or_else(|| self.attributes.get(&format!("_{name}"))).copied()
    }
}
