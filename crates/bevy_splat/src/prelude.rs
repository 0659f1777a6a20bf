//! Everything a scene with captures names: `use bevy_splat::prelude::*`.

pub use crate::asset::{SplatAssetPlugin, SplatCameras, SplatCloudSaver, SplatCloudSettings};
pub use crate::components::SplatHighlightPlugin;
pub use crate::parts::{PartExtracted, PartRestored, PartsLookup, SplatPartsPlugin};
pub use crate::render::{
    SplatBackend, SplatBackground, SplatCamera, SplatDepth, SplatOrder, SplatOutline, SplatRenderPlugin,
    SplatRenderStats,
};
pub use crate::{
    BevySplatPlugins, DefaultSplatHighlight, PartOf, SplatCloud, SplatFlags, SplatHighlight, SplatPart,
    SplatPartCommands, SplatParts, SplatSelection, SplatSubset, SplatTint, Splats, UPRIGHT,
};
pub use splat_core::{self, Cloud, CloudArrays, Mask2d, PartId, Parts, SelectMode, Selection, glam};
