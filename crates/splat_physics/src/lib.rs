//! From 3D Gaussian splats to bodies: solids, masses, elastic parts, collision surfaces. No engine, no GPU, no window.

mod mass;
pub mod world;

pub use mass::MassProperties;
