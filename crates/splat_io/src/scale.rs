//! A capture's scale in metres, stored beside files that cannot hold it: `scene.spz.scale.json`.
//!
//! PLY files hold it as a comment ([`Source::metres_per_unit`](splat_core::Source::metres_per_unit)). Beside any file there may be
//! one of JSON with `metres_per_unit` and the `content_hash` of the Gaussians it was measured on: of another file that took the
//! capture's name it says nothing.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use splat_core::Cloud;

use crate::{ReadError, SourceName, WriteError, write_file};

/// A longer file is none of ours.
const LONGEST: u64 = 4096;

/// What a file beside a capture says.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ScaleBeside {
    /// There is no such file.
    Absent,
    /// It was measured on other Gaussians than these.
    Stale,
    /// Metres per scene unit, finite and above 0.
    Metres(f64),
}

#[derive(Serialize, Deserialize)]
struct Content {
    metres_per_unit: f64,
    /// 32 hexadecimal digits.
    content_hash: String,
}

/// Where the scale of a capture's file is kept: the name with `.scale.json` after it.
pub fn beside_path(capture: &Path) -> PathBuf {
    let mut name = capture.as_os_str().to_owned();
    name.push(".scale.json");
    name.into()
}

/// What the file beside a capture says about its scale. `cloud`: as read from the capture.
///
/// # Errors
/// [`ReadError`] if there is such a file that cannot be read or says no scale.
pub fn read_beside(capture: &Path, cloud: &Cloud) -> Result<ScaleBeside, ReadError> {
    let path = beside_path(capture);
    let name = SourceName::from(path.as_path());
    let malformed = |found: String| ReadError::Malformed {
        what: "the scale".to_owned(),
        expected: "{\"metres_per_unit\": a number above 0, \"content_hash\": \"..\"}".to_owned(),
        found,
        path: name.clone(),
    };
    let text = match std::fs::metadata(&path) {
        Ok(about) if about.len() > LONGEST => return Err(malformed(format!("{} bytes", about.len()))),
        Ok(_) => std::fs::read(&path),
        Err(source) => Err(source),
    };
    let text = match text {
        Ok(text) => text,
        Err(source) if source.kind() == ErrorKind::NotFound => return Ok(ScaleBeside::Absent),
        Err(source) => return Err(ReadError::Io { source, path: name }),
    };
    let content: Content = serde_json::from_slice(&text).map_err(|e| malformed(format!("something else ({e})")))?;
    let metres = content.metres_per_unit;
    if !(metres.is_finite() && metres > 0.0) {
        return Err(malformed(format!("{metres}")));
    }
    let fits = content.content_hash.eq_ignore_ascii_case(&format!("{:032x}", cloud.content_hash()));
    Ok(if fits { ScaleBeside::Metres(metres) } else { ScaleBeside::Stale })
}

/// Writes the scale of a capture beside its file; gives the name of what was written. `cloud`: as read from the capture.
///
/// # Errors
/// [`WriteError`] naming the file.
pub fn write_beside(capture: &Path, cloud: &Cloud, metres_per_unit: f64) -> Result<PathBuf, WriteError> {
    let path = beside_path(capture);
    let content = Content { metres_per_unit, content_hash: format!("{:032x}", cloud.content_hash()) };
    let mut text = serde_json::to_string_pretty(&content).map_err(|e| WriteError::Sink(e.into()))?;
    text.push('\n');
    write_file(&path, |sink| sink.write_all(text.as_bytes()).map_err(WriteError::Sink))?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use splat_core::CloudArrays;
    use splat_core::glam::{Quat, Vec3};

    use super::*;

    fn one(x: f32) -> Cloud {
        Cloud::new(CloudArrays {
            means: vec![Vec3::X * x],
            log_scales: vec![Vec3::ZERO],
            rotations: vec![Quat::IDENTITY],
            opacity_logits: vec![1.0],
            sh: vec![0.0; 3],
            ..CloudArrays::default()
        })
        .unwrap()
    }

    #[test]
    fn a_scale_beside_comes_back_to_the_bit_for_the_same_gaussians_only() {
        let folder = std::env::temp_dir().join(format!("splat_io_scale_{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let capture = folder.join("a.spz");
        let cloud = one(1.0);
        assert_eq!(read_beside(&capture, &cloud).unwrap(), ScaleBeside::Absent);
        let metres = 0.1 + 0.2;
        let path = write_beside(&capture, &cloud, metres).unwrap();
        assert_eq!(path, folder.join("a.spz.scale.json"));
        assert_eq!(read_beside(&capture, &cloud).unwrap(), ScaleBeside::Metres(metres));
        assert_eq!(read_beside(&capture, &one(2.0)).unwrap(), ScaleBeside::Stale);
        for bad in ["", "{}", "[1]", "{\"metres_per_unit\": 0, \"content_hash\": \"\"}", &"x".repeat(9000)] {
            std::fs::write(&path, bad).unwrap();
            let error = read_beside(&capture, &cloud).unwrap_err().to_string();
            assert!(error.contains("a.spz.scale.json"), "{error}");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
