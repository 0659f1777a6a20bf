//! A headless Bevy app whose frames are measured, the same for every plugin.
//!
//! Bevy's default plugins without a window, one camera without multisampling and tone mapping that draws into an sRGB image,
//! the clear colour black. Frames are drawn one after the other (no pipelined rendering), and each is waited for on the
//! device: what is measured is the whole frame, not its submission.

use std::path::Path;
use std::time::{Duration, Instant};

use bevy::app::PluginsState;
use bevy::asset::{LoadState, UnapprovedPathMode, UntypedAssetId};
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, PollType, TexelCopyBufferInfo,
    TexelCopyBufferLayout, TextureFormat, TextureUsages,
};
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy::render::{RenderApp, RenderPlugin};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use peer_common::{Failure, Job, Meter, Pose, Report, Stage, median, memory_mib, write_shot};

/// Longest wait for a capture to load.
const PATIENCE: Duration = Duration::from_secs(600);

/// One app with one camera.
pub struct BevyFrame {
    /// The app; not yet finished until [`BevyFrame::run`].
    pub app: App,
    /// The camera.
    pub camera: Entity,
    image: Handle<Image>,
    meter: Meter,
}

impl BevyFrame {
    /// The app with Bevy's plugins, those of `add` and the camera; assets lie in the folder of the job's capture.
    ///
    /// # Errors
    /// A sentence if the job's cameras cannot be read.
    pub fn new(job: &Job, add: impl FnOnce(&mut App)) -> Result<Self, Failure> {
        let meter = Meter::new(job.warmup);
        let cameras = job.cameras()?;
        let folder = job.scene.parent().unwrap_or(Path::new(".")).to_string_lossy().into_owned();
        let mut app = App::new();
        app.add_plugins(
            DefaultPlugins
                .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
                .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
                .set(AssetPlugin { file_path: folder, unapproved_path_mode: UnapprovedPathMode::Allow, ..default() })
                .disable::<WinitPlugin>()
                .disable::<PipelinedRenderingPlugin>(),
        );
        app.insert_resource(ClearColor(Color::BLACK));
        if job.stages {
            app.add_plugins(RenderDiagnosticsPlugin);
        }
        add(&mut app);
        let started = Instant::now();
        while app.plugins_state() == PluginsState::Adding && started.elapsed() < PATIENCE {
            bevy::tasks::tick_global_task_pools_on_main_thread();
        }
        app.finish();
        app.cleanup();

        let (width, height) = job.size;
        let mut image = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        let projection = PerspectiveProjection {
            fov: cameras.fov_y,
            aspect_ratio: width as f32 / height as f32,
            near: cameras.near,
            far: cameras.far,
            near_clip_plane: Vec4::new(0.0, 0.0, -1.0, -cameras.near),
        };
        let camera = app.world_mut().spawn((
            Camera3d::default(),
            RenderTarget::Image(image.clone().into()),
            Projection::Perspective(projection),
            Msaa::Off,
            Tonemapping::None,
            transform(&cameras.still),
        ));
        let camera = camera.id();
        Ok(Self { app, camera, image, meter })
    }

    /// The name of the job's capture as an asset.
    pub fn asset(job: &Job) -> String {
        job.scene.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Whether an asset has come; the sentence of its loader if it never will.
    ///
    /// # Errors
    /// A sentence if loading failed.
    pub fn loaded(world: &World, asset: impl Into<UntypedAssetId>) -> Result<bool, Failure> {
        let (server, asset) = (world.resource::<AssetServer>(), asset.into());
        match server.get_load_state(asset) {
            Some(LoadState::Failed(why)) => Err(Failure(format!("the capture was not loaded: {why}"))),
            _ => Ok(server.is_loaded_with_dependencies(asset)),
        }
    }

    /// Draws until `ready`, then the frames of the job, and reports.
    ///
    /// # Errors
    /// That of `ready`, and a sentence if the capture never comes, the device fails or the picture cannot be written.
    pub fn run(mut self, job: &Job, mut ready: impl FnMut(&World) -> Result<bool, Failure>) -> Result<(), Failure> {
        let started = Instant::now();
        while !ready(self.app.world())? {
            if started.elapsed() > PATIENCE {
                return Err(Failure::new("the capture was not loaded", "waited for ten minutes", &job.scene));
            }
            self.app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
        for pose in job.walk()? {
            if let Some(mut at) = self.app.world_mut().get_mut::<Transform>(self.camera) {
                *at = transform(&pose);
            }
            let app = &mut self.app;
            self.meter.frame(|| {
                app.update();
                wait(app)
            })?;
        }
        // What the device did in the last frames is known a frame or two later.
        for _ in 0..3 {
            self.app.update();
            wait(&self.app)?;
        }
        if let Some(path) = &job.shot {
            write_shot(path, job.size, &self.picture(job.size)?)?;
        }
        let info = self.app.world().resource::<RenderAdapterInfo>();
        Report {
            device: format!("{} ({:?}, {} {})", info.name, info.backend, info.driver, info.driver_info),
            first_frame_ms: self.meter.first_frame_ms,
            samples: std::mem::take(&mut self.meter.samples),
            stages: self.stages(),
            memory_mib: memory_mib(),
        }
        .print()
    }

    /// Medians of what Bevy and the plugins recorded, device time where there is one: `render/<pass>/elapsed_gpu`.
    fn stages(&self) -> Vec<Stage> {
        let mut stages: Vec<Stage> = self
            .app
            .world()
            .resource::<DiagnosticsStore>()
            .iter()
            .filter(|d| d.path().as_str().contains("/elapsed_"))
            .map(|d| Stage {
                name: d.path().as_str().trim_start_matches("render/").replace("/elapsed_", " "),
                ms: median(d.values().copied().collect()),
                bytes: None,
            })
            .filter(|stage| stage.ms.is_finite())
            .collect();
        stages.sort_by(|a, b| b.ms.total_cmp(&a.ms));
        stages
    }

    /// The picture as it lies on the device.
    fn picture(&self, (width, height): (u32, u32)) -> Result<Vec<u8>, Failure> {
        let render = self.app.sub_app(RenderApp).world();
        let device = self.app.world().resource::<RenderDevice>();
        let images = render.resource::<RenderAssets<GpuImage>>();
        let image = images.get(&self.image).ok_or_else(|| Failure("the picture is not on the device".to_owned()))?;
        let row = (width * 4).next_multiple_of(256);
        let buffer = device.create_buffer(&BufferDescriptor {
            label: None,
            size: u64::from(row) * u64::from(height),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            image.texture.as_image_copy(),
            TexelCopyBufferInfo {
                buffer: &buffer,
                layout: TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            image.texture.size(),
        );
        self.app.world().resource::<RenderQueue>().submit([encoder.finish()]);
        buffer.slice(..).map_async(MapMode::Read, |_| {});
        wait(&self.app)?;
        let bytes = buffer.slice(..).get_mapped_range();
        Ok(bytes.chunks_exact(row as usize).flat_map(|line| line[..width as usize * 4].to_vec()).collect())
    }
}

/// Waits until the device has done what was submitted.
fn wait(app: &App) -> Result<(), Failure> {
    let polled = app.world().resource::<RenderDevice>().wgpu_device().poll(PollType::wait_indefinitely());
    polled.map(|_| ()).map_err(|e| Failure(format!("the device does not answer: {e}")))
}

/// Bevy's cameras look along -z, with y up.
fn transform(pose: &Pose) -> Transform {
    let [right, down, forward] = [pose.right, pose.down, pose.forward].map(Vec3::from);
    let rotation = Quat::from_mat3(&Mat3::from_cols(right, -down, -forward)).normalize();
    Transform::from_translation(Vec3::from(pose.position)).with_rotation(rotation)
}
