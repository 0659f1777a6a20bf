//! Frames that nobody waits for: room is made later, nothing is redone while nothing moves.

use std::sync::Arc;

use glam::{Mat3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays, Pose, Similarity};

use super::super::context::{Context, GpuOptions};
use super::super::{GpuBits, GpuCloud};
use super::*;

fn gpu(timings: bool) -> Option<Gpu> {
    let context = Context::for_test_with(GpuOptions { timings, ..GpuOptions::default() })?;
    Some(Gpu::from_context(context).unwrap())
}

/// Splats of a size, one behind the other.
fn cloud(gpu: &Gpu, count: usize, size: f32) -> Arc<GpuCloud> {
    let arrays = CloudArrays {
        means: (0..count).map(|i| Vec3::new(0.0, 0.0, 2.0 + i as f32 * 0.01)).collect(),
        log_scales: vec![Vec3::splat(size.ln()); count],
        rotations: vec![Quat::IDENTITY; count],
        opacity_logits: vec![-4.0; count],
        sh: vec![0.5; 3 * count],
        ..CloudArrays::default()
    };
    Arc::new(GpuCloud::new(gpu, &Cloud::new(arrays).unwrap()).unwrap())
}

fn view(width: u32, height: u32) -> View {
    View::perspective(Pose { world_from_view: Mat3::IDENTITY, position: Vec3::ZERO }, 0.9, width, height)
}

/// Records and submits a frame; whether the lists were made.
fn draw(gpu: &Gpu, frame: &mut GpuFrame, instances: &[GpuInstance], view: &View, request: &GpuRequest<'_>) {
    let mut encoder = gpu.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    frame.encode(gpu, &mut encoder, instances, view, request).unwrap();
    gpu.context.queue.submit([encoder.finish()]);
    gpu.context.wait().unwrap();
}

const COLOR: GpuRequest<'static> = GpuRequest {
    color: true,
    median_depth: false,
    expected_depth: false,
    first_hits: None,
    strongest: false,
    visibility: None,
    features: None,
    votes: None,
    limit: None,
};

#[test]
fn room_for_more_pairs_is_made_some_frames_later_without_waiting() {
    let Some(gpu) = gpu(false) else { return };
    let instances = [GpuInstance::new(cloud(&gpu, 400, 50.0))];
    let mut frame = GpuFrame::new(&gpu);
    let view = view(320, 240);
    let mut history = Vec::new();
    for _ in 0..8 {
        draw(&gpu, &mut frame, &instances, &view, &COLOR);
        history.push((frame.is_complete(), frame.counts()));
    }
    // 400 splats over 20 x 15 tiles: 120 000 pairs, where room for 65 536 was made.
    let missing = history.iter().filter(|(complete, _)| !complete).count();
    assert!((1..=3).contains(&missing), "{history:?}");
    assert_eq!(history.last(), Some(&(true, (400, 120_000))));
}

#[test]
fn stages_before_blending_are_recorded_only_when_something_moved() {
    let Some(gpu) = gpu(true) else { return };
    let cloud = cloud(&gpu, 2000, 0.1);
    let mut instances = vec![GpuInstance::new(cloud.clone())];
    let mut frame = GpuFrame::new(&gpu);
    let mut view = view(100, 80);
    let mut sorted = |instances: &[GpuInstance], view: &View, request: &GpuRequest<'_>| {
        draw(&gpu, &mut frame, instances, view, request);
        // The lists' own word for it: what arrives is of this frame or an earlier one.
        let again = frame.lists.prepare(&gpu.context, &gpu.stages, instances, view, request.color).unwrap();
        assert!(!again, "a frame was just made of this");
        let generation = frame.counts();
        (generation, frame.timings())
    };
    sorted(&instances, &view, &COLOR);
    sorted(&instances, &view, &GpuRequest { median_depth: true, ..COLOR });
    view.near = 0.5;
    sorted(&instances, &view, &COLOR);
    instances[0].transform = Similarity { scale: 2.0, ..Similarity::IDENTITY };
    sorted(&instances, &view, &COLOR);
    let hidden = splat_core::Selection::from_fn(cloud.len(), |i| i % 2 == 0);
    instances[0].hidden = Some(Arc::new(GpuBits::new(&gpu, &hidden)));
    for _ in 0..3 {
        sorted(&instances, &view, &COLOR);
    }
    let ((visible, _), _) = sorted(&instances, &view, &COLOR);
    assert_eq!(visible, 1000, "half are hidden");
    // Once nothing moves, what is timed is blending alone.
    let (_, timings) = sorted(&instances, &view, &COLOR);
    if let Some(timings) = timings {
        assert_eq!((timings.project, timings.sort, timings.bin), Default::default(), "{timings:?}");
    }
    let mut fresh = |instances: &[GpuInstance], view: &View, color: bool| {
        frame.lists.prepare(&gpu.context, &gpu.stages, instances, view, color).unwrap()
    };
    assert!(!fresh(&instances, &view, true) && !fresh(&instances, &view, false));
    instances[0].transform.scale = 1.5;
    assert!(fresh(&instances, &view, true), "an instance was moved");
    view.near = 0.25;
    assert!(fresh(&instances, &view, true), "another view");
    instances.push(GpuInstance::new(cloud));
    assert!(fresh(&instances, &view, true), "another instance");
}

#[test]
fn what_does_not_fit_is_told_and_the_next_frame_is_drawn() {
    let Some(gpu) = gpu(false) else { return };
    let mut frame = GpuFrame::new(&gpu);
    let instances = [GpuInstance::new(cloud(&gpu, 10, 0.5))];
    let view = view(40, 30);
    let features = GpuFeatures::new(&gpu, 2, &[0.0; 7]);
    let masks = GpuMasks::new(&gpu, &[&Mask2d::empty(9, 9)]);
    let short = GpuBits::new(&gpu, &splat_core::Selection::none(9));
    let hidden = [GpuInstance { hidden: Some(Arc::new(short)), ..instances[0].clone() }];
    let mut encoder = gpu.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut refused = |instances: &[GpuInstance], view: &View, request: &GpuRequest<'_>| {
        frame.encode(&gpu, &mut encoder, instances, view, request).unwrap_err()
    };
    let wrong = GpuRequest { features: Some(&features), ..COLOR };
    assert!(matches!(refused(&instances, &view, &wrong), RasterError::Length { what: "features", .. }));
    let wrong = GpuRequest { votes: Some(&masks), ..COLOR };
    assert!(matches!(refused(&instances, &view, &wrong), RasterError::SizeMismatch { .. }));
    assert!(matches!(refused(&hidden, &view, &COLOR), RasterError::Length { what: "hidden", .. }));
    assert!(matches!(refused(&instances, &View { width: 0, ..view }, &COLOR), RasterError::View(_)));
    draw(&gpu, &mut frame, &instances, &view, &COLOR);
    assert_eq!(frame.color().unwrap().width(), 40);
}

#[test]
fn what_is_kept_from_frame_to_frame_serves_no_other_request() {
    let Some(gpu) = gpu(false) else { return };
    // Faint splats, one behind the other: each tau is reached at another one.
    let instances = [GpuInstance::new(cloud(&gpu, 200, 50.0))];
    let view = view(20, 10);
    let mut kept = GpuFrame::new(&gpu);
    let hits = |frame: Option<&mut GpuFrame>, tau: f32| {
        let mut fresh = GpuFrame::new(&gpu);
        let frame = frame.unwrap_or(&mut fresh);
        draw(&gpu, frame, &instances, &view, &GpuRequest { first_hits: Some(tau), ..GpuRequest::default() });
        gpu.context.read::<u32>(frame.first_hits().unwrap(), 200).unwrap()
    };
    let mut seen = std::collections::BTreeSet::new();
    for tau in [0.5, 0.5, 0.1, 0.7, 0.5] {
        let found = hits(Some(&mut kept), tau);
        assert_eq!(found, hits(None, tau), "tau {tau}");
        seen.insert(found[105]);
    }
    assert_eq!(seen.len(), 3, "{seen:?}");
}
