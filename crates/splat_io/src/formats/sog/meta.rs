//! `meta.json` of a SOG capture.

use serde::{Deserialize, Serialize};

use crate::{ReadError, SourceName};

/// The whole file; version 1 has no `version` and no codebooks.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(default)]
pub(super) struct Meta {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) version: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) asset: Option<Asset>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) count: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) antialias: Option<bool>,
    pub(super) means: Images,
    pub(super) scales: Images,
    pub(super) quats: Images,
    pub(super) sh0: Images,
    #[serde(rename = "shN", skip_serializing_if = "Option::is_none")]
    pub(super) rest: Option<Palette>,
}

#[derive(Debug, Default, Deserialize, Serialize)]
pub(super) struct Asset {
    #[serde(default)]
    pub(super) generator: String,
}

/// One property, one texel per Gaussian.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(default)]
pub(super) struct Images {
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) shape: Vec<u64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) mins: Vec<f32>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) maxs: Vec<f32>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) codebook: Vec<f32>,
    pub(super) files: Vec<String>,
}

/// Spherical harmonics above degree 0: a palette and an index per Gaussian.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(default)]
pub(super) struct Palette {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) count: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) bands: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mins: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) maxs: Option<f32>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) codebook: Vec<f32>,
    pub(super) files: Vec<String>,
}

impl Meta {
    pub(super) fn parse(text: &[u8], name: &SourceName) -> Result<Self, ReadError> {
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        let meta: Self = serde_json::from_slice(text)
            .map_err(|error| ReadError::malformed("`meta.json`", "that of a SOG capture", error.to_string(), name))?;
        match meta.version {
            None | Some(1 | 2) => Ok(meta),
            Some(version) => Err(ReadError::unsupported(
                format!("SOG version {version}"),
                "versions 1 and 2 are; write it again as version 2",
                name,
            )),
        }
    }

    /// Whether values are indices into codebooks (version 2), not linear (1).
    pub(super) fn has_codebooks(&self) -> bool {
        self.version == Some(2)
    }

    /// Number of Gaussians.
    pub(super) fn count(&self, name: &SourceName) -> Result<usize, ReadError> {
        let count = self.count.or_else(|| self.means.shape.first().copied());
        count.and_then(|n| u32::try_from(n).ok()).map(|n| n as usize).ok_or_else(|| {
            let found = count.map_or_else(|| "missing".to_owned(), |n| n.to_string());
            ReadError::malformed("the number of Gaussians in `meta.json`", "a 32-bit number", found, name)
        })
    }
}

/// Whether a text looks like `meta.json`; only its beginning may be given.
pub(super) fn sniff(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let starts = head.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
    let has = |key: &[u8]| head.windows(key.len()).any(|w| w == key);
    starts && ((has(b"\"means\"") && has(b"\"files\"")) || is_streamed(head))
}

/// Whether a text is `lod-meta.json` of a streamed capture, which lists many captures at several levels of detail.
pub(super) fn is_streamed(text: &[u8]) -> bool {
    let has = |key: &[u8]| text.windows(key.len()).any(|w| w == key);
    has(b"\"lodLevels\"") && has(b"\"tree\"")
}
