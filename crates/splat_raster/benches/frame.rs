//! CPU time of the stages of a frame and of whole frames at 1280x720, threads added up.
//!
//! `cargo bench -p splat_raster`. On a generated cloud, and on the real captures where they are (`SPLAT_SCENES`, else
//! `target/scenes` of the workspace). Eight views in turn per case; figures are per frame.

use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use splat_core::deform::{Cage, Deformation};
use splat_core::glam::{Quat, UVec3, Vec3};
use splat_core::{Cloud, CloudArrays, Mask2d, Pose, View};
use splat_raster::cpu::{CpuRasterizer, InstructionSet, Timings};
use splat_raster::{Features, Frame, Instance, Outputs, Rasterizer, Scene};

const SIZE: (u32, u32) = (1280, 720);
const VIEWS: usize = 8;

/// What is read from the timings of a frame.
type Cost = fn(Timings) -> Duration;

/// A room's worth of Gaussians: walls of a box and a ball in it, discs along the surfaces.
fn generated(count: usize) -> Cloud {
    let mut random = 1u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    };
    let mut a = CloudArrays { sh_degree: 3, ..CloudArrays::default() };
    for i in 0..count {
        let direction = Vec3::new(next(), next(), next()).normalize_or(Vec3::Z);
        let mean = if i % 3 == 0 {
            direction
        } else {
            // Onto the box about the ball, away from the camera's side.
            4.0 * direction / direction.abs().max_element()
        };
        a.means.push(mean);
        a.log_scales.push(Vec3::new(-4.5 + next(), -4.5 + next(), -7.0));
        a.rotations.push(Quat::from_rotation_arc(Vec3::Z, direction));
        a.opacity_logits.push(2.0 + 3.0 * next());
        a.sh.extend((0..48).map(|k| if k < 3 { next() } else { 0.1 * next() }));
    }
    Cloud::new(a).expect("arrays that fit")
}

/// Views around a cloud of this size.
fn turnaround() -> Vec<View> {
    let views = (0..VIEWS).map(|k| {
        let angle = k as f32 / VIEWS as f32 * std::f32::consts::TAU;
        let eye = Vec3::new(3.0 * angle.sin(), -0.5, 3.0 * angle.cos());
        View::perspective(Pose::look_at(eye, Vec3::ZERO, Vec3::NEG_Y), 0.9, SIZE.0, SIZE.1)
    });
    views.collect()
}

/// The real captures that are there, with eight of their cameras.
fn captures() -> Vec<(&'static str, Cloud, Vec<View>)> {
    let folder = std::env::var_os("SPLAT_SCENES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../target/scenes"), PathBuf::from);
    let read = |name| {
        let (cloud, _) = splat_io::read(folder.join(name).join("scene.ply")).ok()?;
        let views = splat_io::cameras::read(folder.join(name).join("cameras.json")).ok()?.views;
        let step = (views.len() / VIEWS).max(1);
        let views = views.iter().step_by(step).take(VIEWS).map(|v| v.view.resized(SIZE.0, SIZE.1)).collect();
        Some((name, cloud, views))
    };
    ["plaza", "desk"].into_iter().filter_map(read).collect()
}

/// The scene of one cloud, twisted by a cage of about 20 cells a side.
fn bent(scene: &Scene) -> Scene {
    let instance = &scene.instances[0];
    let bounds = splat_core::bounds::robust_bounds(&instance.cloud).expect("a cloud to be seen");
    let cell = (bounds.max - bounds.min).max_element().max(1e-3) / 20.0;
    let cells = ((bounds.max - bounds.min) / cell).ceil().as_uvec3().max(UVec3::ONE);
    let cage = Cage { origin: bounds.min, cell, cells };
    let twist = |p: Vec3| Quat::from_rotation_y(0.02 * (p.y - bounds.center.y) / cell) * p;
    let deformation = Some(Arc::new(Deformation::from_fn(cage, twist).expect("finite nodes")));
    Scene { instances: vec![Instance { deformation, ..instance.clone() }] }
}

/// Draws frames and adds up what `cost` reads from their timings.
fn draw(
    rasterizer: &mut CpuRasterizer,
    scene: &Scene,
    views: &[View],
    outputs: &Outputs,
    frames: u64,
    cost: impl Fn(Timings) -> Duration,
) -> Duration {
    let mut frame = Frame::default();
    let mut sum = Duration::ZERO;
    for k in 0..frames {
        rasterizer.draw(scene, &views[k as usize % views.len()], outputs, &mut frame).expect("a frame");
        sum += cost(rasterizer.timings());
    }
    black_box(&frame);
    sum
}

fn frames(criterion: &mut Criterion) {
    let mut scenes = vec![("generated", generated(200_000), turnaround())];
    scenes.extend(captures());
    let mask = Mask2d::from_fn(SIZE.0, SIZE.1, |x, y| (x / 40 + y / 40) % 2 == 0);
    let masks = [&mask];
    for (name, cloud, views) in scenes {
        let scene = Scene::of(Arc::new(cloud));
        let values = vec![0.5; scene.len() * 3];
        let color = Outputs { color: true, ..Outputs::default() };
        let votes = Outputs { votes: Some(&masks), ..Outputs::default() };
        let features = Outputs { features: Some(Features { channels: 3, values: &values }), ..Outputs::default() };
        let all = Outputs {
            median_depth: true,
            expected_depth: true,
            visibility: Some(1.0 / 255.0),
            first_hits: Some(0.5),
            strongest: true,
            votes: Some(&masks),
            ..color
        };
        let whole = |t: Timings| t.stages().iter().map(|s| s.1.cpu).sum();
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10).measurement_time(Duration::from_secs(3)).warm_up_time(Duration::from_millis(500));
        let mut best = CpuRasterizer::new();
        let stages: [(&str, Cost); 4] = [
            ("project", |t| t.project.cpu),
            ("sort", |t| t.sort.cpu),
            ("bin", |t| t.bin.cpu),
            ("raster", |t| t.raster.cpu),
        ];
        for (stage, cost) in stages {
            group.bench_function(stage, |b| b.iter_custom(|n| draw(&mut best, &scene, &views, &color, n, cost)));
        }
        // Bent by a cage, as an elastic part is: places, gradients and rotations for each Gaussian.
        let bent = bent(&scene);
        group.bench_function("project, bent", |b| {
            b.iter_custom(|n| draw(&mut best, &bent, &views, &color, n, |t| t.project.cpu));
        });
        for (case, outputs) in [("color", color), ("features", features), ("votes", votes), ("all outputs", all)] {
            group.bench_function(case, |b| b.iter_custom(|n| draw(&mut best, &scene, &views, &outputs, n, whole)));
        }
        // One view, so that the lists serve again: what a repainted mask costs.
        group.bench_function("votes again", |b| {
            b.iter_custom(|n| draw(&mut best, &scene, &views[..1], &votes, n, whole));
        });
        for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
            let mut rasterizer = CpuRasterizer::with(set);
            group.bench_function(format!("color {}", set.name()), |b| {
                b.iter_custom(|n| draw(&mut rasterizer, &scene, &views, &color, n, whole));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, frames);
criterion_main!(benches);
