//! The GPU back end: one copy of each cloud on the graphics device, shared by all entities and views.

use bevy::ecs::prelude::*;

use super::settings::SplatBackend;

/// What all views share on the graphics device.
#[derive(Resource)]
pub(super) struct GpuScene;

/// One camera's working memory on the graphics device.
pub(super) struct GpuView;

impl FromWorld for GpuScene {
    fn from_world(_: &mut World) -> Self {
        Self
    }
}

impl GpuScene {
    /// The back end that draws.
    pub(super) fn backend(&self, _: SplatBackend) -> SplatBackend {
        SplatBackend::Cpu
    }

    /// Clouds on the device.
    pub(super) fn clouds(&self) -> usize {
        0
    }
}
