//! Splats in Bevy's main 3D pass.
//!
//! [`SplatRenderPlugin`] draws every `Splats` entity that a `Camera3d` sees. All entities in a camera's view are one
//! scene with one depth order, so that captures pass through each other. Meshes hide splats pixel by pixel and Gaussian
//! by Gaussian; splats hide what is transparent and drawn later through the depth that they write. Colours are blended
//! in display space, as they were trained, and converted once into the camera's target: with or without `Hdr`, MSAA,
//! viewports, render layers, several cameras, into windows and images.
//!
//! Where things are: `view` (cameras to views), `extract` (main world to render world), `prepare` (what each camera is
//! going to draw), `cpu` and `gpu` (the back ends), `read_back` (what the CPU needs of the device), `composite` (over the
//! camera's picture), `pass` (the systems in the camera's schedule).
//!
//! Limits today: one depth per pixel, so transparent meshes inside a soft cloud are before or behind all of it; no
//! shadows, reflections or motion vectors of splats.

mod composite;
mod cpu;
mod extract;
mod gpu;
mod pass;
mod prepare;
mod read_back;
mod selected;
mod settings;
mod view;

pub(crate) use extract::similarity;
pub use settings::{
    SplatBackend, SplatBackground, SplatCamera, SplatDepth, SplatOrder, SplatOutline, SplatRenderStats, SplatViewStats,
};
pub use view::{view_from_camera, view_pixel};

use bevy::app::{App, First, Plugin, PostUpdate};
use bevy::asset::embedded_asset;
use bevy::camera::visibility::VisibilitySystems;
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::core_pipeline::tonemapping::tonemapping;
use bevy::core_pipeline::{Core3d, Core3dSystems};
use bevy::ecs::prelude::*;
use bevy::log::warn_once;
use bevy::render::render_resource::SpecializedRenderPipelines;
use bevy::render::view::prepare_view_targets;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

use self::composite::CompositePipelines;
use self::extract::ExtractedSplats;
use self::gpu::GpuScene;
use self::prepare::SplatViews;
use self::settings::StatsChannel;

/// The plugin's systems in a camera's schedule (`Core3d`), for passes that want to run before or after them.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SplatRenderSystems {
    /// Draws after opaque meshes, before transparent ones.
    BeforeTransparent,
    /// Draws after tone mapping.
    AfterTonemapping,
}

/// Draws splats. Needs Bevy's render plugins, `CorePipelinePlugin` and the asset plugin of this crate.
///
/// Adds [`SplatBackend`] and [`SplatRenderStats`]; cameras may carry [`SplatCamera`]. Where the app has no graphics
/// adapter it warns once and draws nothing; all else in this crate works without it.
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatRenderPlugin;

impl Plugin for SplatRenderPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "composite.wgsl");
        embedded_asset!(app, "limit.wgsl");
        let stats = StatsChannel::default();
        app.init_resource::<SplatBackend>()
            .init_resource::<SplatRenderStats>()
            .insert_resource(stats.clone())
            .register_type::<SplatBackend>()
            .register_type::<SplatCamera>()
            .add_systems(First, settings::receive_stats)
            .add_systems(PostUpdate, extract::calculate_bounds.in_set(VisibilitySystems::CalculateBounds));

        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            warn_once!("no graphics adapter: splats are not drawn; picking, selecting and editing work");
            return;
        };
        render_app
            .insert_resource(stats)
            .init_resource::<ExtractedSplats>()
            .init_resource::<SplatViews>()
            .init_gpu_resource::<SpecializedRenderPipelines<CompositePipelines>>()
            .init_gpu_resource::<GpuScene>()
            .add_systems(RenderStartup, (composite::init_pipelines, prepare::forget_views))
            .add_systems(ExtractSchedule, extract::extract_splats)
            .add_systems(
                Render,
                (
                    prepare::widen_usages.in_set(RenderSystems::PrepareViews).before(prepare_view_targets),
                    (gpu::upload, prepare::plan_views).chain().in_set(RenderSystems::PrepareResources),
                    prepare::send_stats.in_set(RenderSystems::Cleanup),
                ),
            )
            .add_systems(
                Core3d,
                (
                    // The read-back submits what is recorded so far: it has to be there.
                    ApplyDeferred.after(main_opaque_pass_3d).before(SplatRenderSystems::BeforeTransparent),
                    pass::draw_before_transparent.in_set(SplatRenderSystems::BeforeTransparent),
                )
                    .in_set(Core3dSystems::MainPass),
            )
            .add_systems(
                Core3d,
                (
                    ApplyDeferred.after(tonemapping).before(SplatRenderSystems::AfterTonemapping),
                    pass::draw_after_tonemapping.in_set(SplatRenderSystems::AfterTonemapping),
                )
                    .in_set(Core3dSystems::PostProcess),
            )
            .configure_sets(
                Core3d,
                (
                    SplatRenderSystems::BeforeTransparent.after(main_opaque_pass_3d).before(main_transparent_pass_3d),
                    SplatRenderSystems::AfterTonemapping.after(tonemapping),
                ),
            );
    }
}
