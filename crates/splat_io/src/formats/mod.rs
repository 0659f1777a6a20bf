//! One file (or folder) per format; [`FORMATS`] lists them.

pub mod compressed_ply;
mod flip;
pub mod gltf;
mod half;
pub mod ksplat;
mod limit;
mod morton;
pub mod ply;
mod shared;
pub mod sog;
pub mod splat;
pub mod spz;
mod turn;

use crate::format::Format;

/// Every format, in the order in which content tests are tried: those with a magic number first, the weakest test last.
pub static FORMATS: &[&dyn Format] = &[
    &ply::Ply,
    &compressed_ply::CompressedPly,
    &gltf::Gltf,
    &spz::Spz,
    &sog::Sog,
    &ksplat::Ksplat,
    // Any file of whole records could pass this test: it stays last.
    &splat::Splat,
];
