//! The GPU back end: one copy of each cloud on the graphics device, shared by all entities and views.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Weak};

use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::log::{warn, warn_once};
use bevy::math::URect;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::renderer::{RenderAdapterInfo, RenderContext, RenderDevice, RenderQueue};
use splat_core::deform::Deformation;
use splat_core::{Cloud, Selection};
use splat_raster::gpu::{
    Gpu, GpuBits, GpuCloud, GpuDeformation, GpuFeatures, GpuFrame, GpuIds, GpuInstance, GpuOptions, GpuRequest, GpuTint,
};

use super::composite::LimitView;
use super::extract::{ExtractedEntity, ExtractedSplats};
use super::pass::{CompositeView, Pass};
use super::prepare::SplatViews;
use super::selected::Selected;
use super::settings::SplatBackend;

/// What all views share on the graphics device; made anew with every device.
#[derive(Resource)]
pub(super) struct GpuScene {
    /// Whether the adapter is a CPU.
    software: bool,
    gpu: State,
    /// By the address of the `Cloud`, which the weak reference keeps from being used again.
    clouds: HashMap<usize, (Weak<Cloud>, Arc<GpuCloud>)>,
    entities: EntityHashMap<EntityBuffers>,
}

/// The compiled stages: made when the GPU back end is first wanted.
enum State {
    Unused,
    Ready(Arc<Gpu>),
    Failed,
}

/// What belongs to one entity: the main world's data and their copies on the device.
#[derive(Default)]
struct EntityBuffers {
    hidden: Copied<Selection, GpuBits>,
    subset: Copied<[u32], GpuIds>,
    tint: Copied<[[u8; 4]], GpuTint>,
    deformation: Copied<Deformation, GpuDeformation>,
}

/// Data of the main world and its copy on the device.
type Copied<T, C> = Option<(Arc<T>, Arc<C>)>;

impl FromWorld for GpuScene {
    fn from_world(world: &mut World) -> Self {
        let info = world.get_resource::<RenderAdapterInfo>();
        Self {
            software: info.is_some_and(|info| info.device_type == wgpu::DeviceType::Cpu),
            gpu: State::Unused,
            clouds: HashMap::new(),
            entities: EntityHashMap::default(),
        }
    }
}

impl GpuScene {
    /// The back end that draws.
    pub(super) fn backend(&self, wish: SplatBackend) -> SplatBackend {
        match (wish, &self.gpu) {
            (SplatBackend::Cpu, _) | (_, State::Failed) => SplatBackend::Cpu,
            (SplatBackend::Auto, _) if self.software => SplatBackend::Cpu,
            _ => SplatBackend::Gpu,
        }
    }

    /// Clouds on the device.
    pub(super) fn clouds(&self) -> usize {
        self.clouds.len()
    }

    /// The compiled stages, if they are in use.
    pub(super) fn gpu(&self) -> Option<&Arc<Gpu>> {
        match &self.gpu {
            State::Ready(gpu) => Some(gpu),
            _ => None,
        }
    }

    /// The entity as the device knows it.
    fn instance(&self, entity: Entity, own: &ExtractedEntity) -> Option<GpuInstance> {
        let (_, cloud) = self.clouds.get(&address(&own.cloud))?;
        let buffers = self.entities.get(&entity)?;
        Some(GpuInstance {
            cloud: cloud.clone(),
            transform: own.transform,
            hidden: buffers.hidden.as_ref().map(|(_, copy)| copy.clone()),
            subset: buffers.subset.as_ref().map(|(_, copy)| copy.clone()),
            tint: buffers.tint.as_ref().map(|(_, copy)| copy.clone()),
            deformation: buffers.deformation.as_ref().map(|(_, copy)| copy.clone()),
        })
    }
}

fn address(cloud: &Arc<Cloud>) -> usize {
    Arc::as_ptr(cloud) as usize
}

/// Copies what is new to the device and frees what no entity has any more.
pub(super) fn upload(
    mut scene: ResMut<GpuScene>,
    mut views: ResMut<SplatViews>,
    extracted: Res<ExtractedSplats>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let scene = &mut *scene;
    let before = scene.clouds.len();
    let wanted = scene.backend(extracted.backend) == SplatBackend::Gpu && !extracted.entities.is_empty();
    if !wanted {
        scene.clouds.clear();
        scene.entities.clear();
    } else {
        if matches!(scene.gpu, State::Unused) {
            scene.gpu = match Gpu::new(device.wgpu_device(), &queue.0, GpuOptions::default()) {
                Ok(gpu) => State::Ready(Arc::new(gpu)),
                Err(error) => {
                    warn!("splats are drawn by the CPU: {error}");
                    State::Failed
                }
            };
        }
        let State::Ready(gpu) = &scene.gpu else { return };
        let used: HashSet<usize> = extracted.entities.values().map(|e| address(&e.cloud)).collect();
        scene.clouds.retain(|address, _| used.contains(address));
        scene.entities.retain(|entity, _| extracted.entities.contains_key(entity));
        for (entity, own) in &extracted.entities {
            if let Entry::Vacant(entry) = scene.clouds.entry(address(&own.cloud)) {
                match GpuCloud::new(gpu, &own.cloud) {
                    Ok(cloud) => {
                        entry.insert((Arc::downgrade(&own.cloud), Arc::new(cloud)));
                    }
                    Err(error) => warn_once!("a capture is not drawn: {error}"),
                }
            }
            let buffers = scene.entities.entry(*entity).or_default();
            copy(&mut buffers.hidden, &own.hidden, |bits| GpuBits::new(gpu, bits));
            copy(&mut buffers.subset, &own.subset, |ids| GpuIds::new(gpu, ids.clone()));
            copy(&mut buffers.tint, &own.tint, |tint| GpuTint::new(gpu, tint));
            // The next pose goes where the last one was: no memory is taken and nothing is bound anew.
            let last = buffers.deformation.as_ref().map(|(_, copy)| copy.clone());
            copy(&mut buffers.deformation, &own.deformation, |pose| match last {
                Some(last) => last.next(gpu, pose),
                None => GpuDeformation::new(gpu, pose),
            });
        }
    }
    if scene.clouds.len() < before {
        // Frames hold what they drew last: those that draw again let go of it by themselves.
        for view in views.views.values_mut() {
            view.gpu.iter_mut().for_each(|gpu| gpu.stale = true);
        }
    }
}

/// Makes the copy in `slot` that of `value`, anew only if it is another.
fn copy<T: ?Sized, C>(slot: &mut Copied<T, C>, value: &Option<Arc<T>>, make: impl FnOnce(&Arc<T>) -> C) {
    match value {
        None => *slot = None,
        Some(value) if slot.as_ref().is_some_and(|(old, _)| Arc::ptr_eq(old, value)) => {}
        Some(value) => *slot = Some((value.clone(), Arc::new(make(value)))),
    }
}

/// One camera's working memory on the graphics device.
pub(super) struct GpuView {
    frame: GpuFrame,
    limit: LimitView,
    selected: Selected,
    features: Option<GpuFeatures>,
    composite: CompositeView,
    /// Whether the last frame may hold a cloud that is gone.
    pub(super) stale: bool,
}

impl GpuView {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self {
            frame: GpuFrame::new(gpu),
            limit: LimitView::default(),
            selected: Selected::default(),
            features: None,
            composite: CompositeView::default(),
            stale: false,
        }
    }

    /// Records the splats' frame and the composite.
    pub(super) fn draw(&mut self, pass: &Pass, scene: &GpuScene, extracted: &ExtractedSplats, ctx: &mut RenderContext) {
        let (plan, Some(gpu)) = (pass.plan, scene.gpu()) else { return };
        self.stale = false;
        let mut instances = Vec::with_capacity(plan.entities.len());
        for entity in &plan.entities {
            let instance = extracted.entities.get(entity).and_then(|own| scene.instance(*entity, own));
            instances.extend(instance);
        }
        if plan.meshes {
            let depth = (pass.depth.view(), pass.depth.texture.sample_count());
            let with = (pass.device, pass.queue, pass.cache);
            if !pass.pipelines.encode_limit(with, ctx.command_encoder(), plan, depth, &mut self.limit) {
                return;
            }
        }
        let all = instances.len() == plan.entities.len();
        if plan.settings.outline.is_none() || !all {
            self.selected.forget();
            self.features = None;
        } else {
            match self.selected.update(&plan.entities, &extracted.entities) {
                None => self.features = None,
                Some(false) => {}
                Some(true) => self.features = Some(GpuFeatures::new(gpu, 1, &self.selected.values)),
            }
        }
        let request = GpuRequest {
            color: true,
            median_depth: plan.needs_depth(),
            features: self.features.as_ref(),
            limit: self.limit.limit.as_ref().filter(|_| plan.meshes).map(|limit| &*limit.view),
            ..GpuRequest::default()
        };
        let recorder = ctx.diagnostic_recorder();
        let recorder = recorder.as_deref();
        let span = recorder.time_span(ctx.command_encoder(), "splats/draw");
        let drawn = self.frame.encode(gpu, ctx.command_encoder(), &instances, &plan.camera.view, &request);
        span.end(ctx.command_encoder());
        if let Err(error) = drawn {
            warn_once!("splats are not drawn: {error}");
            return;
        }
        let selected = self.features.as_ref().and(self.frame.features());
        pass.composite(
            &mut self.composite,
            self.frame.color_view(),
            self.frame.median_depth_view(),
            selected,
            URect::new(0, 0, plan.size().x, plan.size().y),
            ctx,
        );
    }
}
