//! Draw, pick, select and take apart 3D Gaussian splat captures in Bevy.

pub mod asset;
pub mod components;
pub mod parts;
pub mod picking;
mod plugins;
pub mod prelude;
pub mod render;
pub mod segment;
pub mod select;
mod splats;
#[cfg(test)]
mod testing;
pub mod tools;

pub use asset::SplatCloud;
pub use components::{
    DefaultSplatHighlight, SplatFlags, SplatHighlight, SplatParts, SplatSelection, SplatSubset, SplatTint,
    SplatTintChange,
};
pub use parts::{PartOf, SplatPart, SplatPartCommands};
pub use plugins::BevySplatPlugins;
pub use splats::{Splats, UPRIGHT};
