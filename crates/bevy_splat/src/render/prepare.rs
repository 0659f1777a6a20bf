//! What each camera is going to draw in this frame, decided once everything that is drawn before and after is known.

use bevy::camera::{
    Camera3d, Camera3dDepthLoadOp, CameraMainTextureUsages, ClearColor, ClearColorConfig, MainPassResolutionOverride,
};
use bevy::color::ColorToComponents;
use bevy::color::Srgba;
use bevy::core_pipeline::core_3d::{AlphaMask3d, Opaque3d, Transparent3d};
use bevy::core_pipeline::deferred::{AlphaMask3dDeferred, Opaque3dDeferred};
use bevy::core_pipeline::prepass::{AlphaMask3dPrepass, Opaque3dPrepass};
use bevy::core_pipeline::skybox::SkyboxPipelineId;
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::log::warn_once;
use bevy::math::{UVec2, Vec4};
use bevy::render::camera::{ExtractedCamera, TemporalJitter};
use bevy::render::render_phase::{ViewBinnedRenderPhases, ViewSortedRenderPhases};
use bevy::render::render_resource::{
    CachedRenderPipelineId, PipelineCache, SpecializedRenderPipelines, TextureFormat, TextureUsages,
};
use bevy::render::view::{ExtractedView, Msaa, RetainedViewEntity};
use splat_raster::{Instance, Scene};

use super::composite::{CompositeKey, CompositePipelines, Part, Space};
use super::cpu::CpuView;
use super::extract::{ExtractedCameraSplats, ExtractedSplats};
use super::gpu::{GpuScene, GpuView};
use super::settings::{
    SplatBackend, SplatBackground, SplatCamera, SplatDepth, SplatOrder, SplatRenderStats, SplatViewStats, StatsChannel,
};
use super::view::CameraView;

/// Everything kept for cameras, by the camera's main entity.
#[derive(Resource, Default)]
pub(super) struct SplatViews {
    pub(super) views: EntityHashMap<SplatView>,
    /// What this frame's draws reported.
    pub(super) stats: Vec<SplatViewStats>,
}

/// One camera's working memory, and its plan for this frame.
#[derive(Default)]
pub(super) struct SplatView {
    /// `None`: the camera sees no splats in this frame.
    pub(super) plan: Option<Plan>,
    pub(super) cpu: Option<Box<CpuView>>,
    pub(super) gpu: Option<Box<GpuView>>,
}

/// What to draw, and how.
pub(super) struct Plan {
    pub(super) camera: CameraView,
    /// Top left pixel of the viewport in the target.
    pub(super) corner: UVec2,
    pub(super) settings: SplatCamera,
    /// Never `Auto`.
    pub(super) backend: SplatBackend,
    /// Entities in view.
    pub(super) entities: Vec<Entity>,
    pub(super) scene: Scene,
    /// The clear colour, sRGB-encoded, straight alpha; `None` where something else is behind the splats.
    pub(super) clear: Option<Vec4>,
    /// Whether the composite reads a copy of what is behind the splats.
    pub(super) reads_backdrop: bool,
    /// Whether the depth may hold anything.
    pub(super) meshes: bool,
    /// Whether the splats' depth is written.
    pub(super) write_depth: bool,
    pub(super) route: Route,
    /// Pipelines of the composite, where it takes them.
    pub(super) color_pipeline: Option<CachedRenderPipelineId>,
    pub(super) depth_pipeline: Option<CachedRenderPipelineId>,
    /// Whether the colour pipeline tests depth sample by sample.
    pub(super) tested: bool,
    /// Samples of the depth texture.
    pub(super) depth_samples: u32,
    /// Whether colour goes into the multisampled target.
    pub(super) sampled: bool,
}

/// How the splats get into the camera's picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Route {
    /// As finished pixels, copied into the target; `swap`: blue first.
    Copy { swap: bool },
    /// Through the composite's fragment shader.
    Blend,
}

impl Plan {
    /// Whether the splats' own depth is wanted.
    pub(super) fn needs_depth(&self) -> bool {
        self.write_depth || self.tested
    }

    /// Physical pixels of the viewport.
    pub(super) fn size(&self) -> UVec2 {
        UVec2::new(self.camera.view.width, self.camera.view.height)
    }
}

impl SplatView {
    /// Drops what only an earlier back end needs.
    fn keep_only(&mut self, backend: SplatBackend) {
        match backend {
            SplatBackend::Gpu => self.cpu = None,
            _ => self.gpu = None,
        }
    }
}

/// Lets depth be read, and the CPU's pixels be copied into the target, for every camera: cameras that share a target
/// share its textures only if they agree.
pub(super) fn widen_usages(
    extracted: Res<ExtractedSplats>,
    scene: Res<GpuScene>,
    mut cameras: Query<&mut CameraMainTextureUsages, With<ExtractedCamera>>,
    mut depths: Query<&mut Camera3d, With<ExtractedCamera>>,
) {
    if scene.backend(extracted.backend) == SplatBackend::Cpu {
        for mut usages in &mut cameras {
            if !usages.0.contains(TextureUsages::COPY_DST | TextureUsages::COPY_SRC) {
                usages.0 |= TextureUsages::COPY_DST | TextureUsages::COPY_SRC;
            }
        }
    }
    let read = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
    for mut camera in &mut depths {
        let usages = TextureUsages::from(camera.depth_texture_usages);
        if !usages.contains(read) {
            camera.depth_texture_usages = (usages | read).into();
        }
    }
}

/// What Bevy draws before and after the splats.
#[derive(SystemParam)]
pub(super) struct Phases<'w> {
    opaque: Res<'w, ViewBinnedRenderPhases<Opaque3d>>,
    mask: Res<'w, ViewBinnedRenderPhases<AlphaMask3d>>,
    opaque_prepass: Res<'w, ViewBinnedRenderPhases<Opaque3dPrepass>>,
    mask_prepass: Res<'w, ViewBinnedRenderPhases<AlphaMask3dPrepass>>,
    opaque_deferred: Res<'w, ViewBinnedRenderPhases<Opaque3dDeferred>>,
    mask_deferred: Res<'w, ViewBinnedRenderPhases<AlphaMask3dDeferred>>,
    transparent: Res<'w, ViewSortedRenderPhases<Transparent3d>>,
}

impl Phases<'_> {
    /// Whether anything solid is drawn before the splats.
    fn solid(&self, view: &RetainedViewEntity) -> bool {
        self.opaque.get(view).is_some_and(|p| !p.is_empty())
            || self.mask.get(view).is_some_and(|p| !p.is_empty())
            || self.opaque_prepass.get(view).is_some_and(|p| !p.is_empty())
            || self.mask_prepass.get(view).is_some_and(|p| !p.is_empty())
            || self.opaque_deferred.get(view).is_some_and(|p| !p.is_empty())
            || self.mask_deferred.get(view).is_some_and(|p| !p.is_empty())
    }

    /// Whether anything is drawn after the splats that depth could hide.
    fn transparent(&self, view: &RetainedViewEntity) -> bool {
        self.transparent.get(view).is_some_and(|p| !p.items.is_empty())
    }
}

/// The composite's variants.
#[derive(SystemParam)]
pub(super) struct Composites<'w> {
    cache: Res<'w, PipelineCache>,
    pipelines: Res<'w, CompositePipelines>,
    specialized: ResMut<'w, SpecializedRenderPipelines<CompositePipelines>>,
}

impl Composites<'_> {
    fn specialize(&mut self, key: CompositeKey) -> CachedRenderPipelineId {
        self.specialized.specialize(&self.cache, &self.pipelines, key)
    }
}

type CameraComponents<'a> = (
    &'a ExtractedCamera,
    &'a ExtractedView,
    &'a Msaa,
    &'a Camera3d,
    Has<SkyboxPipelineId>,
    Option<&'a TemporalJitter>,
    Option<&'a MainPassResolutionOverride>,
);

/// Plans every camera's frame, and drops the memory of cameras that are gone.
pub(super) fn plan_views(
    mut views: ResMut<SplatViews>,
    extracted: Res<ExtractedSplats>,
    gpu: Res<GpuScene>,
    cameras: Query<CameraComponents>,
    phases: Phases,
    clear_color: Res<ClearColor>,
    mut composites: Composites,
) {
    let views = &mut *views;
    views.stats.clear();
    if extracted.entities.is_empty() {
        views.views.clear();
        return;
    }
    views.views.retain(|camera, _| extracted.cameras.contains_key(camera));
    for view in views.views.values_mut() {
        view.plan = None;
    }
    let backend = gpu.backend(extracted.backend);
    for components in &cameras {
        let (camera, view, msaa, ..) = components;
        let main = view.retained_view_entity.main_entity.id();
        let Some(seen) = extracted.cameras.get(&main) else { continue };
        let Some(mut plan) = plan(components, seen, &extracted, &phases, clear_color.0, backend) else {
            if let Some(view) = views.views.get_mut(&main) {
                view.cpu.iter_mut().for_each(|cpu| cpu.forget());
                view.gpu.take_if(|gpu| gpu.stale);
            }
            continue;
        };
        let samples = if plan.sampled { msaa.samples() } else { 1 };
        let space = Space::new(view.target_format, camera.compositing_space);
        let fixed_function = space == Space::Encoded && opaque(camera, &plan, clear_color.0);
        let key = CompositeKey {
            part: if plan.tested { Part::TestedColor } else { Part::Color },
            format: view.target_format,
            samples,
            space,
            backdrop: plan.clear.is_none() && !fixed_function,
            fixed_function,
            outline: backend == SplatBackend::Gpu && plan.settings.outline.is_some(),
        };
        if plan.route == Route::Blend {
            plan.reads_backdrop = key.backdrop;
            plan.color_pipeline = Some(composites.specialize(key));
        }
        if plan.write_depth {
            let key = CompositeKey {
                part: Part::Depth,
                samples: plan.depth_samples,
                backdrop: false,
                fixed_function: false,
                outline: false,
                space: Space::Encoded,
                format: TextureFormat::Rgba8Unorm,
            };
            plan.depth_pipeline = Some(composites.specialize(key));
        }
        let kept = views.views.entry(main).or_default();
        kept.keep_only(backend);
        match (backend, gpu.gpu()) {
            (SplatBackend::Gpu, Some(gpu)) => {
                kept.gpu.get_or_insert_with(|| Box::new(GpuView::new(gpu)));
            }
            _ => {
                kept.cpu.get_or_insert_default();
            }
        }
        kept.plan = Some(plan);
    }
}

/// Whether what is behind the splats is opaque all over: hardware blending is then exact in encoded targets.
fn opaque(camera: &ExtractedCamera, plan: &Plan, clear: bevy::color::Color) -> bool {
    let cleared = match camera.clear_color {
        ClearColorConfig::Default => Some(clear),
        ClearColorConfig::Custom(color) => Some(color),
        ClearColorConfig::None => None,
    };
    plan.settings.order == SplatOrder::BeforeTransparent && cleared.is_some_and(|color| Srgba::from(color).alpha >= 1.0)
}

/// One camera's plan; `None` where it sees no splats.
fn plan(
    (camera, view, msaa, camera_3d, skybox, jitter, resolution): <CameraComponents<'_> as bevy::ecs::query::QueryData>::Item<'_, '_>,
    seen: &ExtractedCameraSplats,
    extracted: &ExtractedSplats,
    phases: &Phases,
    clear_color: bevy::color::Color,
    backend: SplatBackend,
) -> Option<Plan> {
    let entities: Vec<Entity> = seen.visible.iter().copied().filter(|e| extracted.entities.contains_key(e)).collect();
    if entities.is_empty() {
        return None;
    }
    let corner = UVec2::new(view.viewport.x, view.viewport.y);
    let size = resolution.map_or(UVec2::new(view.viewport.z, view.viewport.w), |over| over.0);
    // While a window shrinks its cameras' viewports may be those of the frame before.
    let target = camera.physical_target_size.unwrap_or(UVec2::ZERO);
    if (corner + size).cmpgt(target).any() {
        return None;
    }
    let mut clip_from_view = view.clip_from_view;
    if let Some(jitter) = jitter {
        jitter.jitter_projection(&mut clip_from_view, size.as_vec2());
    }
    let Some(view_of_camera) = CameraView::new(clip_from_view, &view.world_from_view, size) else {
        warn_once!(
            "a camera shows no splats: it is mirrored or sheared, or its projection is neither perspective nor orthographic"
        );
        return None;
    };
    let settings = seen.settings.clone();
    let before = settings.order == SplatOrder::BeforeTransparent;
    let transparent = phases.transparent(&view.retained_view_entity);
    let unknown = settings.background == SplatBackground::Read;
    let meshes = unknown
        || phases.solid(&view.retained_view_entity)
        || matches!(camera_3d.depth_load_op, Camera3dDepthLoadOp::Load);
    let cleared = match camera.clear_color {
        ClearColorConfig::Default => Some(clear_color),
        ClearColorConfig::Custom(color) => Some(color),
        ClearColorConfig::None => None,
    };
    let plain = before && !meshes && !skybox && !unknown;
    let clear = cleared.filter(|_| plain).map(|color| Vec4::from_array(Srgba::from(color).to_f32_array()));
    let multisampled = msaa.samples() > 1;
    // What is multisampled is resolved by the next pass that draws into it: if there is none, the resolved picture will do.
    let sampled = before && multisampled && (transparent || clear.is_none() || backend == SplatBackend::Gpu);
    let encoded = Space::new(view.target_format, camera.compositing_space) == Space::Encoded;
    let swap = match view.target_format {
        TextureFormat::Rgba8UnormSrgb => Some(false),
        TextureFormat::Bgra8UnormSrgb => Some(true),
        TextureFormat::Rgba8Unorm if encoded => Some(false),
        TextureFormat::Bgra8Unorm if encoded => Some(true),
        _ => None,
    };
    let route = match swap {
        Some(swap) if backend == SplatBackend::Cpu && !sampled => Route::Copy { swap },
        _ => Route::Blend,
    };
    let write_depth = before
        && match settings.depth {
            SplatDepth::Auto => transparent,
            SplatDepth::Always => true,
            SplatDepth::Never => false,
        };
    let scene = if backend == SplatBackend::Cpu { cpu_scene(&entities, extracted) } else { Scene::default() };
    Some(Plan {
        camera: view_of_camera,
        corner,
        settings,
        backend,
        entities,
        scene,
        clear,
        reads_backdrop: false,
        meshes,
        write_depth,
        route,
        color_pipeline: None,
        depth_pipeline: None,
        tested: sampled && meshes,
        depth_samples: msaa.samples(),
        sampled,
    })
}

/// The entities in view as one scene.
fn cpu_scene(entities: &[Entity], extracted: &ExtractedSplats) -> Scene {
    let instance = |entity| {
        let own = &extracted.entities[entity];
        Instance {
            cloud: own.cloud.clone(),
            transform: own.transform,
            hidden: own.hidden.clone(),
            subset: own.subset.clone(),
            tint: own.tint.clone(),
            deformation: own.deformation.clone(),
        }
    };
    Scene { instances: entities.iter().map(instance).collect() }
}

/// What was kept belongs to a device that is gone.
pub(super) fn forget_views(mut views: ResMut<SplatViews>) {
    views.views.clear();
}

/// Reports the frame to the main world.
pub(super) fn send_stats(mut views: ResMut<SplatViews>, gpu: Res<GpuScene>, channel: Res<StatsChannel>) {
    let kept_views = views.views.len();
    channel.send(SplatRenderStats { views: std::mem::take(&mut views.stats), gpu_clouds: gpu.clouds(), kept_views });
}
