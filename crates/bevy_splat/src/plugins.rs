//! [`BevySplatPlugins`]: all plugins of this crate.

use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;

use crate::asset::SplatAssetPlugin;
use crate::components::SplatHighlightPlugin;
use crate::orient::SplatOrientPlugin;
use crate::parts::SplatPartsPlugin;
#[cfg(feature = "physics")]
use crate::physics::SplatPhysicsPlugin;
use crate::picking::SplatPickingPlugin;
use crate::render::SplatRenderPlugin;
use crate::segment::SplatSegmentPlugin;
use crate::select::SplatSelectPlugin;
use crate::tools::SplatToolsPlugin;

/// All plugins of this crate. To add one is one line.
///
/// | plugin | what it adds |
/// |---|---|
/// | [`SplatAssetPlugin`] | loading, saving, hot reload; the others need it |
/// | [`SplatRenderPlugin`] | drawing; needs Bevy's render plugins |
/// | [`SplatHighlightPlugin`] | colours of the selection and of parts |
/// | [`SplatPartsPlugin`] | messages of `extract_part` and `restore_part`, memory of despawned parts |
/// | [`SplatPickingPlugin`] | the Gaussian under a pointer, for `bevy_picking` |
/// | [`SplatSelectPlugin`] | selecting by messages |
/// | [`SplatToolsPlugin`] | rectangle, lasso and brush; needs [`SplatSelectPlugin`] |
/// | [`SplatOrientPlugin`] | captures upright and in metres, by messages |
/// | `SplatPhysicsPlugin` | bodies of parts (feature `physics`); needs [`SplatPartsPlugin`] |
/// | [`SplatSegmentPlugin`] | one click to a whole object, in the background; needs [`SplatSelectPlugin`] |
///
/// Without a window or a device leave drawing out: `BevySplatPlugins.build().disable::<SplatRenderPlugin>()`.
#[derive(Clone, Copy, Debug, Default)]
pub struct BevySplatPlugins;

impl PluginGroup for BevySplatPlugins {
    fn build(self) -> PluginGroupBuilder {
        let group = PluginGroupBuilder::start::<Self>()
            .add(SplatAssetPlugin)
            .add(SplatRenderPlugin)
            .add(SplatHighlightPlugin)
            .add(SplatPartsPlugin)
            .add(SplatPickingPlugin)
            .add(SplatSelectPlugin)
            .add(SplatToolsPlugin)
            .add(SplatOrientPlugin)
            .add(SplatSegmentPlugin);
        #[cfg(feature = "physics")]
        let group = group.add(SplatPhysicsPlugin);
        group
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn all_but_drawing_run_without_a_device() {
        let mut app = App::new();
        let plugins = BevySplatPlugins.build().disable::<SplatRenderPlugin>();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), plugins));
        testing::spawn(&mut app, 5);
        app.update();
        app.update();
    }
}
