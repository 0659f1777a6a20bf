//! The pipelines that put drawn splats over a camera's picture (`composite.wgsl`) and turn depth into limits
//! (`limit.wgsl`), and the textures they read.

use bevy::asset::{AssetServer, Handle, load_embedded_asset};
use bevy::camera::CompositingSpace;
use bevy::color::ColorToComponents;
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT;
use bevy::ecs::prelude::*;
use bevy::math::{IVec2, UVec2, Vec4};
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, texture_depth_2d_multisampled, texture_storage_2d,
    uniform_buffer,
};
use bevy::render::render_resource::encase::UniformBuffer;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource, BlendState,
    Buffer, BufferDescriptor, BufferUsages, CachedComputePipelineId, ColorTargetState, ColorWrites, CommandEncoder,
    CompareFunction, ComputePassDescriptor, ComputePipelineDescriptor, DepthStencilState, Extent3d, FragmentState,
    MultisampleState, PipelineCache, RenderPipelineDescriptor, ShaderStages, ShaderType, SpecializedRenderPipeline,
    StorageTextureAccess, Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureSampleType,
    TextureUsages, TextureView, TextureViewDescriptor, VertexState, WgpuTextureView,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::shader::Shader;
use bevy::utils::default;
use splat_core::Projection;

use super::prepare::Plan;
use super::settings::SplatOutline;
use super::view::CameraView;

/// What the numbers in a colour target mean once the hardware has decoded them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Space {
    Linear,
    /// sRGB-encoded: what splats are made of.
    Encoded,
    Oklab,
}

impl Space {
    pub(super) fn new(format: TextureFormat, compositing: Option<CompositingSpace>) -> Self {
        match compositing {
            _ if format.is_srgb() => Self::Linear,
            Some(CompositingSpace::Srgb) => Self::Encoded,
            Some(CompositingSpace::Oklab) => Self::Oklab,
            Some(CompositingSpace::Linear) | None => Self::Linear,
        }
    }
}

/// What a draw of the composite writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Part {
    /// Colour alone: meshes were taken account of while the splats were drawn.
    Color,
    /// Colour, tested against depth sample by sample.
    TestedColor,
    /// Depth alone, where it is nearer than what is there.
    Depth,
}

/// A variant of the composite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct CompositeKey {
    pub(super) part: Part,
    /// Of the colour target.
    pub(super) format: TextureFormat,
    pub(super) samples: u32,
    pub(super) space: Space,
    /// Whether a copy of the picture so far is read; otherwise it is the clear colour.
    pub(super) backdrop: bool,
    /// Whether the hardware's blending does it: encoded targets that are opaque.
    pub(super) fixed_function: bool,
    pub(super) outline: bool,
}

#[derive(Clone, Copy, Default, ShaderType)]
pub(super) struct CompositeUniform {
    depth_row: Vec4,
    w_row: Vec4,
    intrinsics: Vec4,
    background: Vec4,
    outline: Vec4,
    corner: IVec2,
    size: IVec2,
    outline_width: i32,
    perspective: u32,
}

impl CompositeUniform {
    /// `background`: sRGB-encoded, straight alpha.
    pub(super) fn new(camera: &CameraView, corner: UVec2, background: Vec4, outline: Option<SplatOutline>) -> Self {
        let i = camera.view.intrinsics;
        let outline = outline.unwrap_or(SplatOutline { width_px: 0, ..default() });
        Self {
            depth_row: camera.clip_from_view.row(2),
            w_row: camera.clip_from_view.row(3),
            intrinsics: Vec4::new(i.fx, i.fy, i.cx, i.cy),
            background,
            outline: Vec4::from_array(outline.color.to_f32_array()),
            corner: corner.as_ivec2(),
            size: IVec2::new(camera.view.width as i32, camera.view.height as i32),
            outline_width: outline.width_px.min(8) as i32,
            perspective: u32::from(camera.view.projection == Projection::Perspective),
        }
    }
}

#[derive(Clone, Copy, Default, ShaderType)]
pub(super) struct LimitUniform {
    z_row: Vec4,
    w_row: Vec4,
    corner: IVec2,
    size: IVec2,
}

impl LimitUniform {
    pub(super) fn new(camera: &CameraView, corner: UVec2) -> Self {
        let inverse = camera.view_from_clip();
        Self {
            z_row: inverse.row(2),
            w_row: inverse.row(3),
            corner: corner.as_ivec2(),
            size: IVec2::new(camera.view.width as i32, camera.view.height as i32),
        }
    }
}

/// Layouts and shaders, made anew with every graphics device.
#[derive(Resource)]
pub(super) struct CompositePipelines {
    layout: BindGroupLayoutDescriptor,
    vertex: VertexState,
    shader: Handle<Shader>,
    limit: [(BindGroupLayoutDescriptor, CachedComputePipelineId); 2],
    blank: TextureView,
    blank_buffer: Buffer,
}

/// Makes [`CompositePipelines`]; runs again after the device was lost.
pub(super) fn init_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    assets: Res<AssetServer>,
    fullscreen: Res<FullscreenShader>,
    device: Res<RenderDevice>,
) {
    let float = || texture_2d(TextureSampleType::Float { filterable: false });
    let layout = BindGroupLayoutDescriptor::new(
        "splat_composite",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                uniform_buffer::<CompositeUniform>(false),
                float(),
                float(),
                float(),
                storage_buffer_read_only_sized(false, None),
            ),
        ),
    );
    let shader = load_embedded_asset!(assets.as_ref(), "limit.wgsl");
    let limit = [false, true].map(|multisampled| {
        let depth = if multisampled { texture_depth_2d_multisampled() } else { texture_depth_2d() };
        let layout = BindGroupLayoutDescriptor::new(
            "splat_limit",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    uniform_buffer::<LimitUniform>(false),
                    depth,
                    texture_storage_2d(TextureFormat::R32Float, StorageTextureAccess::WriteOnly),
                ),
            ),
        );
        let id = cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some("splat_limit".into()),
            layout: vec![layout.clone()],
            shader: shader.clone(),
            shader_defs: if multisampled { vec!["MULTISAMPLED".into()] } else { Vec::new() },
            entry_point: Some("main".into()),
            ..default()
        });
        (layout, id)
    });
    let blank = Target::new(
        &device,
        "splat_blank",
        UVec2::ONE,
        TextureFormat::Rgba8Unorm,
        TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
    );
    commands.insert_resource(CompositePipelines {
        layout,
        vertex: fullscreen.to_vertex_state(),
        shader: load_embedded_asset!(assets.as_ref(), "composite.wgsl"),
        limit,
        blank: blank.view,
        blank_buffer: device.create_buffer(&BufferDescriptor {
            label: Some("splat_blank"),
            size: 16,
            usage: BufferUsages::STORAGE,
            mapped_at_creation: false,
        }),
    });
}

impl SpecializedRenderPipeline for CompositePipelines {
    type Key = CompositeKey;

    fn specialize(&self, key: CompositeKey) -> RenderPipelineDescriptor {
        let mut defs = Vec::new();
        match key.space {
            Space::Linear => defs.push("SPACE_LINEAR".into()),
            Space::Oklab => defs.push("SPACE_OKLAB".into()),
            Space::Encoded => {}
        }
        for (on, def) in
            [(key.backdrop, "READ_BACKDROP"), (key.fixed_function, "FIXED_FUNCTION"), (key.outline, "OUTLINE")]
        {
            if on {
                defs.push(def.into());
            }
        }
        let color = ColorTargetState {
            format: key.format,
            blend: key.fixed_function.then_some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
            write_mask: ColorWrites::ALL,
        };
        let depth = |write: bool, compare| DepthStencilState {
            format: CORE_3D_DEPTH_FORMAT,
            depth_write_enabled: Some(write),
            depth_compare: Some(compare),
            stencil: default(),
            bias: default(),
        };
        let (label, entry, targets, depth_stencil) = match key.part {
            Part::Color => ("splat_composite", "color", vec![Some(color)], None),
            Part::TestedColor => (
                "splat_composite_tested",
                "color_tested",
                vec![Some(color)],
                Some(depth(false, CompareFunction::GreaterEqual)),
            ),
            Part::Depth => ("splat_depth", "depth", Vec::new(), Some(depth(true, CompareFunction::GreaterEqual))),
        };
        RenderPipelineDescriptor {
            label: Some(label.into()),
            layout: vec![self.layout.clone()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: defs,
                entry_point: Some(entry.into()),
                targets,
            }),
            depth_stencil,
            multisample: MultisampleState { count: key.samples, ..default() },
            ..default()
        }
    }
}

/// What the composite reads; `None` where its variant reads nothing.
#[derive(Clone, Copy)]
pub(super) struct CompositeInputs<'a> {
    pub(super) splats: Option<&'a WgpuTextureView>,
    pub(super) depth: Option<&'a WgpuTextureView>,
    pub(super) backdrop: Option<&'a WgpuTextureView>,
    pub(super) selected: Option<&'a wgpu::Buffer>,
}

impl CompositePipelines {
    pub(super) fn bind<'a>(
        &'a self,
        device: &RenderDevice,
        cache: &PipelineCache,
        uniform: &Buffer,
        inputs: CompositeInputs<'a>,
    ) -> BindGroup {
        let or_blank = |view: Option<&'a WgpuTextureView>| BindingResource::TextureView(view.unwrap_or(&self.blank));
        device.create_bind_group(
            "splat_composite",
            &cache.get_bind_group_layout(&self.layout),
            &BindGroupEntries::sequential((
                uniform.as_entire_binding(),
                or_blank(inputs.splats),
                or_blank(inputs.depth),
                or_blank(inputs.backdrop),
                inputs.selected.unwrap_or(&*self.blank_buffer).as_entire_binding(),
            )),
        )
    }

    /// Records the limits that a depth texture sets, into `limit`; whether that could be done: not while compiling.
    pub(super) fn encode_limit(
        &self,
        (device, queue, cache): (&RenderDevice, &RenderQueue, &PipelineCache),
        encoder: &mut CommandEncoder,
        plan: &Plan,
        depth: (&TextureView, u32),
        kept: &mut LimitView,
    ) -> bool {
        let (layout, id) = &self.limit[usize::from(depth.1 > 1)];
        let Some(pipeline) = cache.get_compute_pipeline(*id) else { return false };
        let (size, usage) = (plan.size(), TextureUsages::STORAGE_BINDING);
        let usage = usage | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
        let limit = Target::fitting(&mut kept.limit, device, "splat_limit", size, TextureFormat::R32Float, usage);
        let uniform = LimitUniform::new(&plan.camera, plan.corner);
        let uniform = write_uniform(&mut kept.uniform, device, queue, &uniform);
        let group = device.create_bind_group(
            "splat_limit",
            &cache.get_bind_group_layout(layout),
            &BindGroupEntries::sequential((uniform.as_entire_binding(), depth.0, &limit.view)),
        );
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &*group, &[]);
        pass.dispatch_workgroups(size.x.div_ceil(8), size.y.div_ceil(8), 1);
        true
    }
}

/// What a view keeps for its limits.
#[derive(Default)]
pub(super) struct LimitView {
    /// Camera z per pixel.
    pub(super) limit: Option<Target>,
    uniform: Option<Buffer>,
}

/// A texture of a view's own and its view.
pub(super) struct Target {
    pub(super) texture: Texture,
    pub(super) view: TextureView,
}

impl Target {
    pub(super) fn new(
        device: &RenderDevice,
        label: &'static str,
        size: UVec2,
        format: TextureFormat,
        usage: TextureUsages,
    ) -> Self {
        let texture = device.create_texture(&TextureDescriptor {
            label: Some(label),
            size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        });
        let view = texture.create_view(&TextureViewDescriptor::default());
        Self { texture, view }
    }

    /// The texture in `slot`, made anew if it has another size or format.
    pub(super) fn fitting<'a>(
        slot: &'a mut Option<Self>,
        device: &RenderDevice,
        label: &'static str,
        size: UVec2,
        format: TextureFormat,
        usage: TextureUsages,
    ) -> &'a Self {
        let fits =
            |t: &Self| (t.texture.width(), t.texture.height()) == (size.x, size.y) && t.texture.format() == format;
        if !slot.as_ref().is_some_and(fits) {
            *slot = None;
        }
        slot.get_or_insert_with(|| Self::new(device, label, size, format, usage))
    }
}

/// Writes `value` into the buffer in `slot`, made on first use.
pub(super) fn write_uniform<'a, U: ShaderType + bevy::render::render_resource::encase::internal::WriteInto>(
    slot: &'a mut Option<Buffer>,
    device: &RenderDevice,
    queue: &RenderQueue,
    value: &U,
) -> &'a Buffer {
    let mut bytes = UniformBuffer::new(Vec::new());
    // A vector grows: writing to one cannot fail.
    let _ = bytes.write(value);
    let bytes = bytes.into_inner();
    let buffer = slot.get_or_insert_with(|| {
        device.create_buffer(&BufferDescriptor {
            label: Some("splat_uniform"),
            size: bytes.len() as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    });
    queue.write_buffer(buffer, 0, &bytes);
    buffer
}
