//! One file (or folder) per format; [`FORMATS`] lists them.

pub mod ply;

use crate::format::Format;

/// Every format, in the order in which content tests are tried: those with a magic number first, the weakest test last.
pub static FORMATS: &[&dyn Format] = &[&ply::Ply];
