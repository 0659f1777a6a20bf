//! [`Cameras`]: where the camera stands, in numbers that no maths library owns.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::Failure;

/// A camera in the space of the file: unit vectors, x right, y down, z forward.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Pose {
    /// Centre of the camera.
    pub position: [f32; 3],
    /// To the right of the picture.
    pub right: [f32; 3],
    /// To the bottom of the picture.
    pub down: [f32; 3],
    /// Into the picture.
    pub forward: [f32; 3],
}

/// The standpoints of a job.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Cameras {
    /// Vertical opening angle, in radians.
    pub fov_y: f32,
    /// Nothing nearer is drawn, in units of the file.
    pub near: f32,
    /// Nothing beyond need be drawn, for those who must have a far plane.
    pub far: f32,
    /// The view that is compared with the reference.
    pub still: Pose,
    /// One step per frame; begins anew at the end.
    pub path: Vec<Pose>,
}

impl Cameras {
    /// Reads what [`Cameras::write`] wrote.
    ///
    /// # Errors
    /// A sentence with the path.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path).map_err(|e| Failure::new("the cameras cannot be read", e, path))?;
        let cameras: Self =
            serde_json::from_str(&text).map_err(|e| Failure::new("the cameras cannot be understood", e, path))?;
        if cameras.path.is_empty() {
            return Err(Failure(format!("the path has no cameras: {}", path.display())));
        }
        Ok(cameras)
    }

    /// Writes the cameras as JSON.
    ///
    /// # Errors
    /// A sentence with the path.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let text = serde_json::to_string(self).map_err(|e| Failure::new("the cameras cannot be written", e, path))?;
        std::fs::write(path, text).map_err(|e| Failure::new("the cameras cannot be written", e, path))
    }
}
