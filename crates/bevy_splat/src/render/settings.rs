//! What a user may set about drawing, and what drawing reports.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bevy::color::Srgba;
use bevy::ecs::prelude::*;
use bevy::math::UVec2;
use bevy::prelude::{ReflectComponent, ReflectDefault, ReflectResource};
use bevy::reflect::Reflect;

/// Which back end draws. May be changed while the app runs.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Resource, Default)]
pub enum SplatBackend {
    /// The CPU on adapters that are one themselves (`DeviceType::Cpu`: servers, continuous integration) and where the
    /// graphics device lacks what the GPU back end needs; the GPU everywhere else.
    #[default]
    Auto,
    /// Always the CPU. Where meshes are in view it waits for their depth, within the frame.
    Cpu,
    /// The GPU; the CPU, after one warning, if the device lacks what it takes.
    Gpu,
}

/// How a camera draws splats. Every `Camera3d` draws them; this component is only needed to set something.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default)]
pub struct SplatCamera {
    /// When splats are drawn.
    pub order: SplatOrder,
    /// Whether splats write depth.
    pub depth: SplatDepth,
    /// What is known of the picture that splats are drawn over.
    pub background: SplatBackground,
    /// A line around what is selected, if any.
    pub outline: Option<SplatOutline>,
}

/// When splats are drawn in a camera's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub enum SplatOrder {
    /// After opaque meshes and before transparent ones, which may then stand before or behind splats.
    ///
    /// With `Hdr` and a `Tonemapping` other than `None`, tone mapping changes the splats' colours too: they are those
    /// of a screen, not of a scene.
    #[default]
    BeforeTransparent,
    /// After tone mapping, over everything but the meshes nearer than the splats: colours come out exactly as trained,
    /// with `Hdr` too. Transparent meshes are then behind all splats; no depth is written.
    AfterTonemapping,
}

/// Whether splats write the depth at which they become half opaque, merged with that of meshes: what is drawn later,
/// and depth of field, then sees them as surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub enum SplatDepth {
    /// Where something transparent is drawn after them.
    #[default]
    Auto,
    /// In every frame, for passes of the user's own and for effects that read depth.
    Always,
    /// Transparent things behind splats are drawn over them.
    Never,
}

/// What is known of the picture that splats are drawn over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub enum SplatBackground {
    /// The clear colour alone, unless Bevy's own phases (meshes, the skybox, an earlier camera) drew something.
    #[default]
    Auto,
    /// Anything: set it if a pass of your own, or Bevy's atmosphere, draws before the splats without being among those.
    Read,
}

/// A line along the border of the selected Gaussians, over everything.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct SplatOutline {
    /// Its colour and opacity.
    pub color: Srgba,
    /// Its width, in physical pixels, 1 to 8.
    pub width_px: u32,
}

impl Default for SplatOutline {
    fn default() -> Self {
        Self { color: Srgba::new(1.0, 0.6, 0.1, 1.0), width_px: 2 }
    }
}

/// What drawing splats took in the last frame that was finished: one entry for each camera that saw any, in the order
/// of drawing. In the main world; the frame is one or two behind.
#[derive(Resource, Clone, Debug, Default)]
pub struct SplatRenderStats {
    /// One for each camera.
    pub views: Vec<SplatViewStats>,
    /// Clouds on the graphics device, each counted once however often it is drawn.
    pub gpu_clouds: usize,
    /// Cameras for which working memory is kept.
    pub kept_views: usize,
}

/// What drawing splats took for one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatViewStats {
    /// The camera.
    pub camera: Entity,
    /// The back end that drew: never [`SplatBackend::Auto`].
    pub backend: SplatBackend,
    /// Pixels drawn.
    pub size: UVec2,
    /// Splats entities in view.
    pub instances: usize,
    /// Their Gaussians, hidden ones included.
    pub gaussians: usize,
    /// Whether the picture of the frame before was taken again, because nothing had changed.
    pub reused: bool,
    /// Whether depth, and perhaps colour, was read back from the graphics device.
    pub read_back: bool,
    /// Time of the render thread for this camera's splats, waiting included.
    pub time: Duration,
}

/// The way of the numbers from the render world.
#[derive(Resource, Clone, Default)]
pub(super) struct StatsChannel(Arc<Mutex<Option<SplatRenderStats>>>);

impl StatsChannel {
    pub(super) fn send(&self, stats: SplatRenderStats) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(stats);
    }
}

/// Takes over what the render world reported.
pub(super) fn receive_stats(channel: Res<StatsChannel>, mut stats: ResMut<SplatRenderStats>) {
    if let Some(new) = channel.0.lock().unwrap_or_else(PoisonError::into_inner).take() {
        *stats = new;
    }
}
