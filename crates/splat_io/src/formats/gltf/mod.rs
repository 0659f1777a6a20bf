//! glTF 2.0 and GLB with `KHR_gaussian_splatting`, with plain attributes or with SPZ data inside.
//!
//! Every mesh of the default scene that holds Gaussians is read, at its node's place, into one cloud.

mod buffers;
mod json;
mod nodes;
mod read;
mod write;

use std::io::Write;

use splat_core::Cloud;

use crate::format::{Format, ReadReport, Siblings, WriteOptions, Written};
use crate::{ReadError, SourceName, WriteError};

/// The format of Khronos.
#[derive(Clone, Copy, Debug)]
pub struct Gltf;

impl Format for Gltf {
    fn name(&self) -> &'static str {
        "gltf"
    }

    fn description(&self) -> &'static str {
        "glTF and GLB with KHR_gaussian_splatting (GLB is written): full precision, for other engines"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["glb", "gltf"]
    }

    fn sniff(&self, head: &[u8], _file_len: u64) -> bool {
        let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
        let object = text.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
        let has = |key: &[u8]| text.windows(key.len()).any(|w| w == key);
        head.starts_with(&buffers::GLB_MAGIC)
            || (object && (has(b"\"accessors\"") || has(b"\"bufferViews\"") || has(json::EXTENSION.as_bytes())))
    }

    fn read(&self, bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError> {
        let mut report = ReadReport::default();
        let mut arrays = read::read(bytes, name, files, &mut report)?;
        arrays.source.format = "gltf".to_owned();
        Ok((Cloud::new(arrays).map_err(ReadError::cloud(name))?, report))
    }

    fn writable(&self) -> bool {
        true
    }

    /// Scales and opacities are stored linear, so that their logarithms round.
    fn lossy(&self) -> bool {
        true
    }

    fn write(&self, cloud: &Cloud, _: &WriteOptions, sink: &mut dyn Write) -> Result<Written, WriteError> {
        write::write(cloud, sink)
    }
}
