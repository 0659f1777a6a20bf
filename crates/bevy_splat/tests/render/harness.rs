//! A headless app, pictures of it, and what they should be.

use std::sync::{Arc, LazyLock};

use bevy::camera::{ImageRenderTarget, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::render::error_handler::RenderErrorHandler;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, PipelineCache, PollType, TexelCopyBufferInfo,
    TexelCopyBufferLayout, TextureFormat, TextureUsages,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy::render::{RenderApp, RenderPlugin};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_splat::prelude::*;
use bevy_splat::render::view_from_camera;
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Frame, Outputs, Rasterizer, Scene};

/// Pixels of all pictures.
pub(crate) const SIZE: UVec2 = UVec2::new(96, 64);

/// Whether this machine has a Vulkan device; says so once for each test where not.
pub(crate) fn device() -> bool {
    static FOUND: LazyLock<bool> = LazyLock::new(|| {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::VULKAN,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).is_ok()
    });
    if !*FOUND {
        println!("skipped: no Vulkan device");
    }
    *FOUND
}

/// The back ends to test: set `SPLAT_TEST_BACKEND=cpu` or `gpu` for one of them.
pub(crate) fn backends() -> Vec<SplatBackend> {
    let all = vec![SplatBackend::Cpu, SplatBackend::Gpu];
    match std::env::var("SPLAT_TEST_BACKEND").as_deref() {
        Ok("cpu") => vec![SplatBackend::Cpu],
        Ok("gpu") => vec![SplatBackend::Gpu],
        _ => all,
    }
}

/// An app that draws into pictures.
pub(crate) struct Stage {
    pub(crate) app: App,
}

impl Stage {
    pub(crate) fn new(backend: SplatBackend) -> Self {
        Self::with(backend, RenderPlugin { synchronous_pipeline_compilation: true, ..default() }, false)
    }

    /// `pipelined`: the render world runs a frame behind, on a thread of its own.
    pub(crate) fn with(backend: SplatBackend, render: RenderPlugin, pipelined: bool) -> Self {
        let mut app = App::new();
        let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
        let plugins = DefaultPlugins.set(window).set(render).disable::<WinitPlugin>().disable::<LogPlugin>();
        if pipelined {
            app.add_plugins(plugins);
        } else {
            app.add_plugins(plugins.disable::<PipelinedRenderingPlugin>());
        }
        app.add_plugins((BevySplatPlugins, RenderDiagnosticsPlugin));
        app.insert_resource(backend);
        // Any complaint of wgpu's is a failure.
        app.insert_resource(RenderErrorHandler(|error, _, _| panic!("wgpu: {}", error.description)));
        app.insert_resource(ClearColor(Color::srgb(0.2, 0.3, 0.4)));
        while app.plugins_state() == bevy::app::PluginsState::Adding {
            bevy::tasks::tick_global_task_pools_on_main_thread();
        }
        app.finish();
        app.cleanup();
        Self { app }
    }

    /// A picture to draw into.
    pub(crate) fn canvas(&mut self, format: TextureFormat) -> Handle<Image> {
        let mut image = Image::new_target_texture(SIZE.x, SIZE.y, format, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        self.app.world_mut().resource_mut::<Assets<Image>>().add(image)
    }

    /// A camera at (0, 0, 6) that looks at the origin, without MSAA and tone mapping.
    pub(crate) fn camera(&mut self, canvas: &Handle<Image>, more: impl Bundle) -> Entity {
        let camera = (
            Camera3d::default(),
            RenderTarget::Image(ImageRenderTarget::from(canvas.clone())),
            Msaa::Off,
            Tonemapping::None,
            DebandDither::Disabled,
            Transform::from_xyz(0.0, 0.0, 6.0),
        );
        let camera = self.app.world_mut().spawn(camera).id();
        self.app.world_mut().entity_mut(camera).insert(more);
        camera
    }

    /// A capture in the scene.
    pub(crate) fn splats(&mut self, cloud: &Arc<Cloud>, more: impl Bundle) -> Entity {
        let handle = self.app.world_mut().resource_mut::<Assets<SplatCloud>>().add(SplatCloud::new(cloud.clone()));
        self.app.world_mut().spawn((Splats(handle), Transform::default())).insert(more).id()
    }

    /// One finished frame.
    pub(crate) fn frame(&mut self) {
        self.app.update();
        let device = self.app.world().resource::<RenderDevice>();
        device.poll(PollType::wait_indefinitely()).unwrap();
    }

    /// Frames until every pipeline is compiled, and the picture: red, green, blue, alpha, 0 to 255.
    pub(crate) fn picture(&mut self, canvas: &Handle<Image>, name: &str) -> Vec<[f32; 4]> {
        self.frame();
        for _ in 0..1000 {
            self.frame();
            let cache = self.app.sub_app(RenderApp).world().resource::<PipelineCache>();
            if cache.waiting_pipelines().next().is_none() {
                break;
            }
            // Shaders are read by other threads.
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        self.frame();
        self.read(canvas, name)
    }

    /// The picture as it is.
    pub(crate) fn read(&mut self, canvas: &Handle<Image>, name: &str) -> Vec<[f32; 4]> {
        let world = self.app.sub_app(RenderApp).world();
        let image = world.resource::<RenderAssets<GpuImage>>().get(canvas).expect("the picture is on the device");
        let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
        let format = image.texture.format();
        let pixel = format.block_copy_size(None).unwrap();
        let row = RenderDevice::align_copy_bytes_per_row((SIZE.x * pixel) as usize) as u32;
        let buffer = device.create_buffer(&BufferDescriptor {
            label: None,
            size: u64::from(row * SIZE.y),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
        let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        let to = TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(image.texture.as_image_copy(), to, image.texture.size());
        queue.submit([encoder.finish()]);
        buffer.slice(..).map_async(MapMode::Read, |result| result.unwrap());
        device.poll(PollType::wait_indefinitely()).unwrap();
        let bytes = buffer.slice(..).get_mapped_range();
        let mut pixels = Vec::new();
        for row in bytes.chunks(row as usize) {
            for pixel in row[..(SIZE.x * pixel) as usize].chunks(pixel as usize) {
                pixels.push(decode(format, pixel));
            }
        }
        write_png(name, &pixels);
        pixels
    }

    /// What the camera sees of `scene` according to the CPU rasteriser.
    pub(crate) fn expected(&mut self, camera: Entity, scene: &Scene, limit: Option<&[f32]>) -> Frame {
        let world = self.app.world();
        let view = view_from_camera(world.get(camera).unwrap(), world.get(camera).unwrap()).unwrap();
        let mut frame = Frame::default();
        let outputs = Outputs { color: true, median_depth: true, limit, ..Outputs::default() };
        CpuRasterizer::new().draw(scene, &view, &outputs, &mut frame).unwrap();
        frame
    }
}

/// Bytes of a pixel as 0 to 255, sRGB-encoded.
fn decode(format: TextureFormat, bytes: &[u8]) -> [f32; 4] {
    let bytes4 = || [0, 1, 2, 3].map(|i| f32::from(bytes[i]));
    match format {
        TextureFormat::Rgba8UnormSrgb => bytes4(),
        TextureFormat::Bgra8UnormSrgb => {
            let [b, g, r, a] = bytes4();
            [r, g, b, a]
        }
        TextureFormat::Rgba16Float => {
            let linear = [0, 1, 2, 3].map(|i| half(u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]])));
            let srgb = Srgba::from(LinearRgba::from_f32_array(linear));
            srgb.to_f32_array().map(|v| 255.0 * v.clamp(0.0, 1.0))
        }
        other => panic!("{other:?} is not read"),
    }
}

fn half(bits: u16) -> f32 {
    let (sign, exponent, fraction) = (bits >> 15, i32::from(bits >> 10 & 31), f32::from(bits & 1023) / 1024.0);
    let value = if exponent == 0 { fraction * 2f32.powi(-14) } else { (1.0 + fraction) * 2f32.powi(exponent - 15) };
    if sign == 1 { -value } else { value }
}

/// `C + T * background`, in display space, 0 to 255.
pub(crate) fn over(frame: &Frame, background: impl Fn(usize) -> [f32; 3]) -> Vec<[f32; 4]> {
    let put = |(i, c): (usize, &[f32; 4])| {
        let back = background(i);
        let mix = |k: usize| 255.0 * (c[k] + (1.0 - c[3]) * back[k]).clamp(0.0, 1.0);
        [mix(0), mix(1), mix(2), 255.0]
    };
    frame.color.iter().enumerate().map(put).collect()
}

/// The clear colour.
pub(crate) const CLEAR: [f32; 3] = [0.2, 0.3, 0.4];

/// Fails where two pictures differ by more than `tolerance` of 255 in more than `pixels` pixels.
#[track_caller]
pub(crate) fn assert_near(name: &str, got: &[[f32; 4]], expected: &[[f32; 4]], tolerance: f32, pixels: usize) {
    assert_eq!(got.len(), expected.len());
    let difference = |a: &[f32; 4], b: &[f32; 4]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
    let far: Vec<usize> = (0..got.len()).filter(|&i| !(difference(&got[i], &expected[i]) <= tolerance)).collect();
    if far.len() > pixels {
        write_png(&format!("{name}_got"), got);
        write_png(&format!("{name}_expected"), expected);
        let at = far[far.len() / 2];
        let (x, y) = (at % SIZE.x as usize, at / SIZE.x as usize);
        panic!(
            "{name}: {} pixels differ by more than {tolerance}, such as ({x}, {y}): {:?} for {:?}",
            far.len(),
            got[at],
            expected[at]
        );
    }
}

/// Writes a picture if the user asked for pictures.
pub(crate) fn write_png(name: &str, pixels: &[[f32; 4]]) {
    let Some(folder) = std::env::var_os("SPLAT_PICTURES") else { return };
    let path = std::path::Path::new(&folder).join(format!("{name}.png"));
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, SIZE.x, SIZE.y);
    encoder.set_color(png::ColorType::Rgb);
    let bytes: Vec<u8> = pixels.iter().flat_map(|p| [0, 1, 2].map(|k| p[k].round() as u8)).collect();
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
}

/// A ball of Gaussians of one colour, half transparent at its rim: `count` of them, spread by a fixed pattern.
pub(crate) fn ball(count: usize, radius: f32, color: [f32; 3]) -> Arc<Cloud> {
    let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
    let place = |i: usize| {
        let t = (i as f32 + 0.5) / count as f32;
        let (y, turn) = (1.0 - 2.0 * t, golden * i as f32);
        let r = (1.0 - y * y).sqrt();
        radius * Vec3::new(r * turn.cos(), y, r * turn.sin())
    };
    let sh = color.map(|v| (v - 0.5) / 0.282_094_8);
    // A little pattern, so that a shift or a mirror image shows.
    let shade = |i: usize| sh.map(|v| v + if place(i).x + 0.5 * place(i).y > 0.3 * radius { 0.7 } else { 0.0 });
    let cloud = Cloud::new(CloudArrays {
        means: (0..count).map(place).collect(),
        log_scales: vec![Vec3::splat((2.2 * radius / (count as f32).sqrt()).ln()); count],
        rotations: vec![Quat::IDENTITY; count],
        opacity_logits: (0..count).map(|i| if i % 3 == 0 { 3.0 } else { -0.5 }).collect(),
        sh: (0..count).flat_map(shade).collect(),
        ..CloudArrays::default()
    });
    Arc::new(cloud.unwrap())
}
