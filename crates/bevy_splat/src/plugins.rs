//! [`BevySplatPlugins`]: all plugins of this crate.

use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;

use crate::components::SplatTintPlugin;
use crate::render::SplatRenderPlugin;

/// All plugins of this crate, each of which can be left out.
#[derive(Default)]
pub struct BevySplatPlugins;

impl PluginGroup for BevySplatPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>().add(SplatTintPlugin).add(SplatRenderPlugin)
    }
}
