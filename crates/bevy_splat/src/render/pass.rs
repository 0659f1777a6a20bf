//! The passes in a camera's schedule.

use std::time::Instant;

use bevy::camera::Viewport;
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::math::{URect, UVec2, Vec4};
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{
    Buffer, Extent3d, Origin3d, PipelineCache, RenderPassDescriptor, StoreOp, TexelCopyTextureInfo, TextureAspect,
    TextureUsages, TextureView, WgpuTextureView,
};
use bevy::render::renderer::{FlushCommands, RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::view::{ExtractedView, ViewDepthTexture, ViewTarget};

use super::composite::{CompositeInputs, CompositePipelines, CompositeUniform, Target, write_uniform};
use super::cpu::CpuView;
use super::extract::ExtractedSplats;
use super::gpu::GpuScene;
use super::prepare::{Plan, Route, SplatViews};
use super::read_back::Drawn;
use super::settings::{SplatBackend, SplatOrder, SplatViewStats};

/// Everything a pass takes from the render world.
#[derive(SystemParam)]
pub(super) struct PassParam<'w, 's> {
    views: ResMut<'w, SplatViews>,
    extracted: Res<'w, ExtractedSplats>,
    gpu: Res<'w, GpuScene>,
    pipelines: Res<'w, CompositePipelines>,
    cache: Res<'w, PipelineCache>,
    device: Res<'w, RenderDevice>,
    queue: Res<'w, RenderQueue>,
    flush: FlushCommands<'w>,
    ctx: RenderContext<'w, 's>,
}

type PassView<'a> = (&'a ExtractedView, &'a ExtractedCamera, &'a ViewTarget, &'a ViewDepthTexture);

/// Draws the splats of cameras with [`SplatOrder::BeforeTransparent`].
pub(super) fn draw_before_transparent(view: ViewQuery<PassView<'static>>, param: PassParam) {
    draw(SplatOrder::BeforeTransparent, view, param);
}

/// Draws the splats of cameras with [`SplatOrder::AfterTonemapping`].
pub(super) fn draw_after_tonemapping(view: ViewQuery<PassView<'static>>, param: PassParam) {
    draw(SplatOrder::AfterTonemapping, view, param);
}

fn draw(order: SplatOrder, view: ViewQuery<PassView<'static>>, mut param: PassParam) {
    let (view, _, target, depth) = view.into_inner();
    let camera = view.retained_view_entity.main_entity.id();
    let views = &mut *param.views;
    let Some(state) = views.views.get_mut(&camera) else { return };
    let Some(plan) = state.plan.take_if(|plan| plan.settings.order == order) else { return };
    let start = Instant::now();
    let pass = Pass {
        plan: &plan,
        target,
        depth,
        pipelines: &param.pipelines,
        cache: &param.cache,
        device: &param.device,
        queue: &param.queue,
    };
    let mut stats = SplatViewStats {
        camera,
        backend: plan.backend,
        size: plan.size(),
        instances: plan.entities.len(),
        gaussians: plan.entities.iter().filter_map(|e| param.extracted.entities.get(e)).map(|e| e.len()).sum(),
        reused: false,
        read_back: false,
        time: start.elapsed(),
    };
    match plan.backend {
        SplatBackend::Gpu => {
            if let Some(gpu) = &mut state.gpu {
                gpu.draw(&pass, &param.gpu, &param.extracted, &mut param.ctx);
            }
        }
        SplatBackend::Cpu | SplatBackend::Auto => {
            if let Some(cpu) = &mut state.cpu {
                pass.draw_cpu(cpu, &param.extracted, &mut param.flush, &mut param.ctx, &mut stats);
            }
        }
    }
    stats.time = start.elapsed();
    views.stats.push(stats);
}

/// One camera's pass.
pub(super) struct Pass<'a> {
    pub(super) plan: &'a Plan,
    target: &'a ViewTarget,
    pub(super) depth: &'a ViewDepthTexture,
    pub(super) pipelines: &'a CompositePipelines,
    pub(super) cache: &'a PipelineCache,
    pub(super) device: &'a RenderDevice,
    pub(super) queue: &'a RenderQueue,
}

/// What the composite keeps for a camera.
#[derive(Default)]
pub(super) struct CompositeView {
    uniform: Option<Buffer>,
    backdrop: Option<Target>,
}

impl Pass<'_> {
    fn draw_cpu(
        &self,
        cpu: &mut CpuView,
        extracted: &ExtractedSplats,
        flush: &mut FlushCommands,
        ctx: &mut RenderContext,
        stats: &mut SplatViewStats,
    ) {
        let plan = self.plan;
        let copied = matches!(plan.route, Route::Copy { .. });
        let drawn = Drawn {
            color: (copied && plan.clear.is_none()).then(|| self.target.main_texture()),
            depth: plan.meshes.then(|| (&self.depth.texture, self.depth.view())),
        };
        let recorder = ctx.diagnostic_recorder();
        let recorder = recorder.as_deref();
        stats.read_back = drawn.color.is_some() || drawn.depth.is_some();
        if stats.read_back {
            let span = recorder.time_span(ctx.command_encoder(), "splats/read_back");
            let read = cpu.read_back.read(plan, &drawn, self.pipelines, self.cache, (self.device, self.queue), flush);
            span.end(ctx.command_encoder());
            if !read {
                return;
            }
        }
        let span = recorder.time_span(ctx.command_encoder(), "splats/rasterize");
        let reused = cpu.draw(plan, &extracted.entities, stats.read_back, (self.device, self.queue));
        span.end(ctx.command_encoder());
        let Some(reused) = reused else { return };
        stats.reused = reused;
        if copied {
            let span = recorder.time_span(ctx.command_encoder(), "splats/copy");
            cpu.copy_into(self.target.main_texture(), plan, ctx);
            span.end(ctx.command_encoder());
        }
        let touched = if copied { URect::new(0, 0, plan.size().x, plan.size().y) } else { cpu.touched };
        let splats = cpu.splats.as_ref().map(|t| &*t.view);
        let depth = cpu.depth.as_ref().map(|t| &*t.view);
        self.composite(&mut cpu.composite, splats, depth, None, touched, ctx);
    }

    /// Draws what the plan's pipelines write: colour, depth, both or nothing.
    pub(super) fn composite(
        &self,
        kept: &mut CompositeView,
        splats: Option<&WgpuTextureView>,
        depth: Option<&WgpuTextureView>,
        selected: Option<&wgpu::Buffer>,
        touched: URect,
        ctx: &mut RenderContext,
    ) {
        let plan = self.plan;
        if touched.is_empty() || (plan.color_pipeline.is_none() && plan.depth_pipeline.is_none()) {
            return;
        }
        let background = plan.clear.unwrap_or(Vec4::ZERO);
        let outline = plan.settings.outline;
        let uniform = CompositeUniform::new(&plan.camera, plan.corner, background, outline);
        let uniform = write_uniform(&mut kept.uniform, self.device, self.queue, &uniform).clone();
        let recorder = ctx.diagnostic_recorder();
        let recorder = recorder.as_deref();
        let viewport = Viewport { physical_position: plan.corner, physical_size: plan.size(), ..Viewport::default() };
        let scissor = |pass: &mut bevy::render::render_phase::TrackedRenderPass| {
            let (min, size) = (touched.min + plan.corner, touched.size());
            pass.set_camera_viewport(&viewport);
            pass.set_scissor_rect(min.x, min.y, size.x, size.y);
        };
        if let Some(pipeline) = plan.color_pipeline.and_then(|id| self.cache.get_render_pipeline(id)) {
            let backdrop = plan.reads_backdrop.then(|| &**self.copy_backdrop(&mut kept.backdrop, touched, ctx));
            let inputs = CompositeInputs { splats, depth, backdrop, selected };
            let group = self.pipelines.bind(self.device, self.cache, &uniform, inputs);
            let color = match plan.sampled {
                true => self.target.get_color_attachment(),
                false => self.target.get_unsampled_color_attachment(),
            };
            let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
                label: Some("splat_composite"),
                color_attachments: &[Some(color)],
                depth_stencil_attachment: plan.tested.then(|| self.depth.get_attachment(StoreOp::Store)),
                ..RenderPassDescriptor::default()
            });
            let span = recorder.pass_span(&mut pass, "splats/composite");
            scissor(&mut pass);
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
            span.end(&mut pass);
        }
        if let Some(pipeline) = plan.depth_pipeline.and_then(|id| self.cache.get_render_pipeline(id)) {
            let inputs = CompositeInputs { splats: None, depth, backdrop: None, selected: None };
            let group = self.pipelines.bind(self.device, self.cache, &uniform, inputs);
            let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
                label: Some("splat_depth"),
                color_attachments: &[],
                depth_stencil_attachment: Some(self.depth.get_attachment(StoreOp::Store)),
                ..RenderPassDescriptor::default()
            });
            let span = recorder.pass_span(&mut pass, "splats/depth");
            scissor(&mut pass);
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
            span.end(&mut pass);
        }
    }

    /// Records the copy of what is behind the splats: a target cannot be read while it is written.
    fn copy_backdrop<'b>(
        &self,
        slot: &'b mut Option<Target>,
        touched: URect,
        ctx: &mut RenderContext,
    ) -> &'b TextureView {
        let source = self.target.main_texture();
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
        let format = source.format();
        let backdrop = Target::fitting(slot, self.device, "splat_backdrop", self.plan.size(), format, usage);
        let origin = |at: UVec2| Origin3d { x: at.x, y: at.y, z: 0 };
        let side = |texture, at| TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: origin(at),
            aspect: TextureAspect::All,
        };
        let size = touched.size();
        ctx.command_encoder().copy_texture_to_texture(
            side(source, touched.min + self.plan.corner),
            side(&backdrop.texture, touched.min),
            Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        );
        &backdrop.view
    }
}
