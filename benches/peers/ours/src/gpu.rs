//! Frames of the rasteriser alone, on the graphics device: recorded, submitted, waited for; nothing is read back.

use std::sync::Arc;

use peer_common::{Failure, Job, Meter, Report, Stage, median, memory_mib};
use splat_raster::gpu::{Gpu, GpuCloud, GpuFrame, GpuInstance, GpuOptions, GpuRasterizer, GpuRequest};
use splat_raster::{Frame, Outputs, Rasterizer};
use wgpu29 as wgpu;

use crate::device::{self, Device};
use crate::failed;
use crate::rasterizer::{scene, shot, view};

/// Names of the stages, in the order of their times.
const STAGES: [&str; 5] = ["project", "compact", "sort", "bin", "blend"];

/// Draws with the GPU back end.
pub(crate) fn run(job: &Job) -> Result<(), Failure> {
    let mut meter = Meter::new(job.warmup);
    let cameras = job.cameras()?;
    let Device { device, queue, name, .. } = device::open()?;
    let options = GpuOptions { timings: job.stages, ..GpuOptions::default() };
    let gpu = Gpu::new(&device, &queue, options).map_err(failed)?;
    let scene = scene(job)?;
    let source = &scene.instances[0];
    let cloud = Arc::new(GpuCloud::new(&gpu, &source.cloud).map_err(failed)?);
    let instances = [GpuInstance::new(cloud.clone())];
    let mut frame = GpuFrame::new(&gpu);
    let request = GpuRequest { color: true, ..GpuRequest::default() };
    let mut times: [Vec<f64>; 5] = Default::default();
    for pose in job.walk()? {
        let view = view(&pose, &cameras, job);
        meter.frame(|| {
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            frame.encode(&gpu, &mut encoder, &instances, &view, &request).map_err(failed)?;
            queue.submit([encoder.finish()]);
            device.poll(wgpu::PollType::wait_indefinitely()).map_err(failed)
        })?;
        // The times of an earlier frame: all frames are alike.
        if let Some(t) = frame.timings() {
            let stages = [t.project, t.compact, t.sort, t.bin, t.blend];
            times.iter_mut().zip(stages).for_each(|(list, t)| list.push(t.as_secs_f64() * 1e3));
        }
    }
    if !frame.is_complete() {
        return Err(Failure("the last frame had no room for all of its splats: warm up longer".to_owned()));
    }
    let least = traffic(&cloud, frame.counts(), job.size);
    if job.shot.is_some() {
        let mut picture = Frame::default();
        let view = view(&cameras.still, &cameras, job);
        let outputs = Outputs { color: true, ..Outputs::default() };
        GpuRasterizer::new(gpu).draw(&scene, &view, &outputs, &mut picture).map_err(failed)?;
        shot(job, &picture)?;
    }
    let stages = STAGES.into_iter().zip(times).zip(least).filter(|((_, times), _)| !times.is_empty());
    Report {
        device: name,
        first_frame_ms: meter.first_frame_ms,
        samples: meter.samples,
        stages: stages
            .map(|((name, times), bytes)| Stage { name: name.to_owned(), ms: median(times), bytes: Some(bytes) })
            .collect(),
        memory_mib: memory_mib(),
    }
    .print()
}

/// Bytes that each stage must read and write at least, whatever its caches do: every array once.
fn traffic(cloud: &GpuCloud, (visible, pairs): (u32, u32), (width, height): (u32, u32)) -> [f64; 5] {
    let (count, visible, pairs) = (cloud.len() as f64, f64::from(visible), f64::from(pairs));
    let tiles = f64::from(width.div_ceil(16)) * f64::from(height.div_ceil(16));
    // Centre, two halves of the shape, colour, depth.
    let record = 8.0 + 8.0 + 8.0 + 8.0 + 4.0;
    // A digit of 8 bits: keys are read to be counted, keys and values read and written to be placed.
    let digit = 4.0 + 8.0 + 8.0;
    let tile_digits = (tiles.log2() / 8.0).ceil();
    [
        cloud.bytes() as f64 + record * count,
        4.0 * count + 8.0 * visible,
        4.0 * digit * visible,
        (4.0 + 8.0 + 16.0) * visible + (8.0 + tile_digits * digit + 4.0) * pairs,
        // Half floats: 8 bytes a pixel.
        (4.0 + 8.0 + 16.0 + 8.0) * pairs + 8.0 * f64::from(width) * f64::from(height),
    ]
}
