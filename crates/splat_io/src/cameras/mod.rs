//! Camera files: which pictures a capture was made from, or should be drawn from.

mod inria;

use std::path::Path;

use splat_core::View;

use crate::read::map;
use crate::{ReadError, SourceName};

/// A view with the name and number its file gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedView {
    /// Number in the file (INRIA `id`, COLMAP image id), else the position in the file.
    pub id: u32,
    /// Name of the picture, as in the file.
    pub name: String,
    /// Pose, intrinsics and size.
    pub view: View,
}

/// The views of a camera file.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Cameras {
    /// Short name of the format found.
    pub format: &'static str,
    /// In the order of the file.
    pub views: Vec<NamedView>,
    /// Sentences about anything that was not taken over (lens distortion).
    pub notes: Vec<String>,
}

/// Reads a camera file.
///
/// # Errors
/// [`ReadError`] naming the file, what was expected and what was found.
pub fn read(path: impl AsRef<Path>) -> Result<Cameras, ReadError> {
    let name = SourceName::from(path.as_ref());
    inria::read(&map(path.as_ref(), &name)?, &name)
}
