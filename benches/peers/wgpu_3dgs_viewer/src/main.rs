//! wgpu-3dgs-viewer 0.8 as a contender: its viewer, an image for a target, every frame waited for.

use std::process::ExitCode;

use clap::Parser;
use glam33::camera::rh::proj::directx::perspective;
use glam33::{Mat3, Mat4, Quat, UVec2, Vec3};
use peer_common::{Failure, Job, Meter, Pose, Report, Stage, median, memory_mib, write_shot};
use wgpu_3dgs_viewer::core::{GaussianDisplayMode, GaussianMaxStdDev, GaussianShDegree, Gaussians, GaussiansSource};
use wgpu_3dgs_viewer::{CameraTrait, Viewer};
use wgpu30 as wgpu;

/// Draws a capture with wgpu-3dgs-viewer and reports what the frames cost
#[derive(Parser)]
struct Options {
    #[command(flatten)]
    job: Job,
    /// How far splats reach, in standard deviations; the viewer also widens them by it: only at 2.83 (the root of 8) are
    /// they as wide as they should be
    #[arg(long, default_value_t = 3.0)]
    reach: f32,
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

/// A display's format without an sRGB encoding: colours are blended as they are stored, which is what captures are trained with.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Marks before and after each of preprocess, sort and draw.
const MARKS: u32 = 4;

fn run(options: &Options) -> Result<(), Failure> {
    let job = &options.job;
    let mut meter = Meter::new(job.warmup);
    let cameras = job.cameras()?;
    let (device, queue, name) = device()?;
    let gaussians = Gaussians::read_from_file(&job.scene, GaussiansSource::Ply)
        .map_err(|e| Failure::new("the capture cannot be read", e, &job.scene))?;
    let mut viewer: Viewer =
        Viewer::new(&device, FORMAT, &gaussians).map_err(|e| Failure(format!("the viewer cannot be made: {e}")))?;
    drop(gaussians);
    viewer.update_model_transform(&queue, Vec3::ZERO, Quat::IDENTITY, Vec3::ONE);
    let degree = GaussianShDegree::new(3).ok_or_else(|| Failure("degree 3 is not known".to_owned()))?;
    let reach =
        GaussianMaxStdDev::new(options.reach).ok_or_else(|| Failure("a reach of 0 to 3 was expected".to_owned()))?;
    viewer.update_gaussian_transform(&queue, 1.0, GaussianDisplayMode::Splat, degree, false, reach);

    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("target"),
        size: wgpu::Extent3d { width: job.size.0, height: job.size.1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let target_view = target.create_view(&wgpu::TextureViewDescriptor::default());
    let marks = if job.stages { Marks::new(&device, &queue) } else { Marks(None) };
    let mut stages: [Vec<f64>; 3] = Default::default();
    for pose in job.walk()? {
        let eye = Eye { pose, fov_y: cameras.fov_y, near: cameras.near, far: cameras.far };
        meter.frame(|| {
            viewer.update_camera(&queue, &eye, UVec2::from(job.size));
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            // What `Viewer::render` does, with marks between.
            marks.set(&mut encoder, 0);
            viewer.preprocessor.preprocess(&mut encoder, viewer.gaussians_buffer.len() as u32);
            marks.set(&mut encoder, 1);
            viewer.radix_sorter.sort(&mut encoder, &viewer.radix_sort_indirect_args_buffer);
            marks.set(&mut encoder, 2);
            viewer.renderer.render(&mut encoder, &target_view, &viewer.indirect_args_buffer);
            marks.set(&mut encoder, 3);
            marks.resolve(&mut encoder);
            queue.submit([encoder.finish()]);
            wait(&device)
        })?;
        if let Some(times) = marks.read(&device)? {
            times.into_iter().zip(&mut stages).for_each(|(time, stage)| stage.push(time));
        }
    }
    if let Some(path) = &job.shot {
        write_shot(path, job.size, &read_back(&device, &queue, &target, job.size)?)?;
    }
    let stages = ["preprocess", "sort", "draw"].into_iter().zip(stages).filter(|(_, times)| !times.is_empty());
    Report {
        device: name,
        first_frame_ms: meter.first_frame_ms,
        samples: meter.samples,
        stages: stages.map(|(name, times)| Stage { name: name.to_owned(), ms: median(times), bytes: None }).collect(),
        memory_mib: memory_mib(),
    }
    .print()
}

fn device() -> Result<(wgpu::Device, wgpu::Queue, String), Failure> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    }))
    .map_err(|e| Failure(format!("there is no device to draw with: {e}")))?;
    let info = adapter.get_info();
    let marks = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        label: None,
        required_features: adapter.features() & marks,
        required_limits: adapter.limits(),
        ..Default::default()
    }))
    .map_err(|e| Failure(format!("the device cannot be opened: {e}")))?;
    Ok((device, queue, format!("{} ({:?}, {} {})", info.name, info.backend, info.driver, info.driver_info)))
}

fn wait(device: &wgpu::Device) -> Result<(), Failure> {
    let polled = device.poll(wgpu::PollType::wait_indefinitely());
    polled.map(|_| ()).map_err(|e| Failure(format!("the device does not answer: {e}")))
}

/// The camera of the job in the viewer's convention: x right, y up, looking along -z.
struct Eye {
    pose: Pose,
    fov_y: f32,
    near: f32,
    far: f32,
}

impl CameraTrait for Eye {
    fn view(&self) -> Mat4 {
        let [right, down, forward] = [self.pose.right, self.pose.down, self.pose.forward].map(Vec3::from);
        let world_from_view = Mat3::from_cols(right, -down, -forward);
        let view_from_world = Mat4::from_mat3(world_from_view.transpose());
        view_from_world * Mat4::from_translation(-Vec3::from(self.pose.position))
    }

    fn projection(&self, aspect_ratio: f32) -> Mat4 {
        perspective(self.fov_y, aspect_ratio, self.near, self.far)
    }
}

/// Timestamps within a frame, where the device has them.
struct Marks(Option<(wgpu::QuerySet, wgpu::Buffer, wgpu::Buffer, f64)>);

impl Marks {
    fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        let wanted = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS;
        if !device.features().contains(wanted) {
            return Self(None);
        }
        let set = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count: MARKS,
        });
        let buffer = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: u64::from(MARKS) * 8,
                usage,
                mapped_at_creation: false,
            })
        };
        let resolved = buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC);
        let read = buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
        Self(Some((set, resolved, read, f64::from(queue.get_timestamp_period()) * 1e-6)))
    }

    fn set(&self, encoder: &mut wgpu::CommandEncoder, index: u32) {
        if let Some((set, ..)) = &self.0 {
            encoder.write_timestamp(set, index);
        }
    }

    fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some((set, resolved, read, _)) = &self.0 {
            encoder.resolve_query_set(set, 0..MARKS, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, read, 0, u64::from(MARKS) * 8);
        }
    }

    /// Milliseconds between the marks of the frame that was waited for.
    fn read(&self, device: &wgpu::Device) -> Result<Option<[f64; 3]>, Failure> {
        let Some((_, _, read, period)) = &self.0 else { return Ok(None) };
        let bytes = map(device, read)?;
        let ticks: Vec<u64> =
            bytes.chunks_exact(8).filter_map(|b| Some(u64::from_le_bytes(b.try_into().ok()?))).collect();
        Ok(Some([0, 1, 2].map(|k| ticks[k + 1].saturating_sub(ticks[k]) as f64 * period)))
    }
}

fn map(device: &wgpu::Device, buffer: &wgpu::Buffer) -> Result<Vec<u8>, Failure> {
    buffer.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    wait(device)?;
    let range = buffer.slice(..).get_mapped_range().map_err(|e| Failure(format!("a buffer cannot be read: {e}")))?;
    let bytes = range.to_vec();
    drop(range);
    buffer.unmap();
    Ok(bytes)
}

fn read_back(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
    (width, height): (u32, u32),
) -> Result<Vec<u8>, Failure> {
    let row = (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row) * u64::from(height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    let bytes = map(device, &buffer)?;
    Ok(bytes.chunks_exact(row as usize).flat_map(|line| line[..width as usize * 4].to_vec()).collect())
}
