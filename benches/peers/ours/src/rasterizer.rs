//! Frames of the rasteriser alone, on the processor.

use std::sync::Arc;

use glam::{Mat3, Vec3};
use peer_common::{Cameras, Failure, Job, Meter, Pose as JobPose, Report, Stage, median, memory_mib, write_shot};
use splat_core::{Pose, View};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Frame, Outputs, Rasterizer, Scene};

use crate::failed;

/// Draws with the CPU back end.
pub(crate) fn cpu(job: &Job) -> Result<(), Failure> {
    let mut meter = Meter::new(job.warmup);
    let cameras = job.cameras()?;
    let scene = scene(job)?;
    let mut rasterizer = CpuRasterizer::new();
    let mut frame = Frame::default();
    let color = Outputs { color: true, ..Outputs::default() };
    let mut times: [Vec<f64>; 4] = Default::default();
    for pose in job.walk()? {
        let view = view(&pose, &cameras, job);
        meter.frame(|| rasterizer.draw(&scene, &view, &color, &mut frame).map_err(failed))?;
        let t = rasterizer.timings();
        for (list, stage) in times.iter_mut().zip([t.project, t.sort, t.bin, t.raster]) {
            list.push(stage.wall.as_secs_f64() * 1e3);
        }
    }
    shot(job, &frame)?;
    let stages = ["project", "sort", "bin", "raster"].into_iter().zip(times);
    Report {
        device: format!("processor, {:?}", rasterizer.instruction_set()),
        first_frame_ms: meter.first_frame_ms,
        samples: meter.samples,
        stages: stages.map(|(name, ms)| Stage { name: name.to_owned(), ms: median(ms), bytes: None }).collect(),
        memory_mib: memory_mib(),
    }
    .print()
}

/// The capture.
pub(crate) fn scene(job: &Job) -> Result<Scene, Failure> {
    let (cloud, _) = splat_io::read(&job.scene).map_err(failed)?;
    Ok(Scene::of(Arc::new(cloud)))
}

/// The camera of the job.
pub(crate) fn view(pose: &JobPose, cameras: &Cameras, job: &Job) -> View {
    let axes = [pose.right, pose.down, pose.forward].map(Vec3::from);
    let world_from_view = Mat3::from_cols(axes[0], axes[1], axes[2]);
    let pose = Pose { world_from_view, position: Vec3::from(pose.position) };
    View { near: cameras.near, ..View::perspective(pose, cameras.fov_y, job.size.0, job.size.1) }
}

/// The picture over black, where one is wanted.
pub(crate) fn shot(job: &Job, frame: &Frame) -> Result<(), Failure> {
    let Some(path) = &job.shot else { return Ok(()) };
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let rgba: Vec<u8> = frame.color.iter().flat_map(|c| [byte(c[0]), byte(c[1]), byte(c[2]), 255]).collect();
    write_shot(path, job.size, &rgba)
}
