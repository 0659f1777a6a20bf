//! [`BevySplatPlugins`]: all plugins of this crate.

use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;

use crate::asset::SplatAssetPlugin;
use crate::components::SplatHighlightPlugin;
use crate::parts::SplatPartsPlugin;
use crate::render::SplatRenderPlugin;

/// All plugins of this crate, each of which can be left out.
#[derive(Default)]
pub struct BevySplatPlugins;

impl PluginGroup for BevySplatPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>()
            .add(SplatAssetPlugin)
            .add(SplatHighlightPlugin)
            .add(SplatPartsPlugin)
            .add(SplatRenderPlugin)
    }
}
