//! [`Report`]: what a contender says, and how it fails.

use std::fmt;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::Sample;

/// A part of a frame.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Stage {
    /// What it does.
    pub name: String,
    /// Median over the frames, in milliseconds.
    pub ms: f64,
    /// Least that memory bandwidth allows, in bytes read and written, where that is known.
    #[serde(default)]
    pub bytes: Option<f64>,
}

/// One line of JSON on standard output.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Report {
    /// What drew, in the words of the driver of the device.
    pub device: String,
    /// From the start of the program to the end of the first frame: loading, compiling of shaders, uploading.
    pub first_frame_ms: f64,
    /// What the frames cost.
    pub samples: Vec<Sample>,
    /// Where the time of a frame goes, as far as the contender tells.
    pub stages: Vec<Stage>,
    /// Most memory held by the process, in MiB.
    pub memory_mib: Option<f64>,
}

impl Report {
    /// Tells the driver.
    pub fn print(&self) -> Result<(), Failure> {
        let line = serde_json::to_string(self).map_err(|e| Failure(format!("the report cannot be written: {e}")))?;
        println!("{line}");
        Ok(())
    }
}

/// Why a contender cannot go on, in a sentence.
#[derive(Clone, Debug)]
pub struct Failure(pub String);

impl Failure {
    /// What did not go, why, and with which file.
    pub fn new(what: &str, why: impl fmt::Display, path: &Path) -> Self {
        Self(format!("{what} ({why}): {}", path.display()))
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Failure {}

/// Writes a picture of sRGB-encoded red, green, blue and alpha, row-major from the top left.
///
/// # Errors
/// A sentence with the path.
pub fn write_shot(path: &Path, (width, height): (u32, u32), rgba: &[u8]) -> Result<(), Failure> {
    let fail = |e: &dyn fmt::Display| Failure::new("the picture cannot be written", e, path);
    let file = BufWriter::new(File::create(path).map_err(|e| fail(&e))?);
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(|e| fail(&e))?;
    writer.write_image_data(rgba).map_err(|e| fail(&e))?;
    writer.finish().map_err(|e| fail(&e))
}
