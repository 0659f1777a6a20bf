//! CPU time per frame of a capture, for each instruction set and set of outputs, and pictures to look at.
//!
//! `cargo run --release -p splat_raster --example measure -- SCENE.ply CAMERAS.json [WxH] [VIEWS] [PNG FOLDER|-] [CASE] [COPIES]`

#![expect(clippy::print_stdout, reason = "a program")]

use std::sync::Arc;
use std::time::Instant;

use splat_core::bounds::robust_bounds;
use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, Mask2d, Similarity, View};
use splat_raster::cpu::{CpuRasterizer, InstructionSet};
use splat_raster::{Features, Frame, Instance, Outputs, Rasterizer, Scene};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(cameras)) = (arguments.next(), arguments.next()) else {
        println!("usage: measure SCENE.ply CAMERAS.json [WxH] [VIEWS] [PNG FOLDER|-] [CASE] [COPIES]");
        return;
    };
    let size = arguments.next().unwrap_or_else(|| "1280x720".to_owned());
    let (width, height) = size.split_once('x').expect("WxH");
    let (width, height): (u32, u32) = (width.parse().expect("a width"), height.parse().expect("a height"));
    let count: usize = arguments.next().map_or(8, |n| n.parse().expect("a number of views"));
    let folder = arguments.next().filter(|folder| folder != "-");
    let wanted = arguments.next().unwrap_or_default();
    let copies: usize = arguments.next().map_or(1, |n| n.parse().expect("a number of copies"));

    let (cloud, _) = splat_io::read(&file).expect("a splat file");
    let scene = turned_copies(cloud, copies);
    let gaussians = scene.len();
    let views = splat_io::cameras::read(&cameras).expect("a camera file").views;
    let views: Vec<View> = views.iter().map(|v| v.view.resized(width, height)).collect();
    let views: Vec<View> = views.iter().step_by((views.len() / count).max(1)).take(count).copied().collect();
    println!(
        "{gaussians} Gaussians, {} views of {width}x{height}; CPU ms per frame (wall), best of 5 rounds",
        views.len()
    );

    let mask = Mask2d::from_fn(width, height, |x, y| (x / 40 + y / 40) % 2 == 0);
    let masks = [&mask];
    let values = vec![0.5; gaussians * 3];
    let color = Outputs { color: true, ..Outputs::default() };
    let all = Outputs {
        median_depth: true,
        expected_depth: true,
        visibility: Some(1.0 / 255.0),
        first_hits: Some(0.5),
        strongest: true,
        votes: Some(&masks),
        ..color
    };
    let cases = [
        ("color", color),
        ("first hits", Outputs { first_hits: Some(0.5), ..Outputs::default() }),
        ("votes", Outputs { votes: Some(&masks), ..Outputs::default() }),
        ("3 features", Outputs { features: Some(Features { channels: 3, values: &values }), ..Outputs::default() }),
        ("all", all),
    ];
    let mut frame = Frame::default();
    for set in InstructionSet::ALL.into_iter().rev().filter(|set| set.available()) {
        let mut rasterizer = CpuRasterizer::with(set);
        for (name, outputs) in &cases {
            if !format!("{} {name}", set.name()).starts_with(&wanted) {
                continue;
            }
            let mut best = (f64::MAX, f64::MAX, Default::default());
            for _ in 0..5 {
                let (begin, cpu) = (Instant::now(), cpu_seconds());
                let mut busy = [0.0; 4];
                for view in &views {
                    rasterizer.draw(&scene, view, outputs, &mut frame).expect("a frame");
                    for (sum, (_, stage)) in busy.iter_mut().zip(rasterizer.timings().stages()) {
                        *sum += stage.cpu.as_secs_f64() * 1e3 / views.len() as f64;
                    }
                }
                let per_frame = 1e3 / views.len() as f64;
                let cpu = (cpu_seconds() - cpu) * per_frame;
                if cpu < best.0 {
                    best = (cpu, begin.elapsed().as_secs_f64() * per_frame, busy);
                }
            }
            let per_600k = best.0 * 6e5 / gaussians as f64;
            let stages = rasterizer.timings().stages().map(|s| s.0);
            let stages: Vec<String> = stages.iter().zip(best.2).map(|(n, ms)| format!("{n} {ms:.1}")).collect();
            println!(
                "{:9}{name:10} {:6.1} ({:5.1}) {per_600k:6.1} per 600 k: {}",
                set.name(),
                best.0,
                best.1,
                stages.join(" ")
            );
        }
    }
    let mut rasterizer = CpuRasterizer::new();
    for (k, view) in views.iter().enumerate() {
        let Some(folder) = &folder else { break };
        rasterizer.draw(&scene, view, &color, &mut frame).expect("a frame");
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let bytes: Vec<u8> = frame.color.iter().flat_map(|p| [byte(p[0]), byte(p[1]), byte(p[2])]).collect();
        splat_io::picture::write_png_rgb8(format!("{folder}/view_{k:02}.png"), width, height, &bytes).expect("a PNG");
    }
}

/// The capture several times in the same place, each turned about its middle: a scene of any size.
fn turned_copies(cloud: Cloud, copies: usize) -> Scene {
    let center = robust_bounds(&cloud).map_or(Vec3::ZERO, |bounds| bounds.center);
    let cloud = Arc::new(cloud);
    let instances = (0..copies).map(|k| {
        let rotation = Quat::from_rotation_y(k as f32);
        let transform = Similarity { rotation, scale: 1.0, translation: center - rotation * center };
        Instance { transform, ..Instance::new(cloud.clone()) }
    });
    Scene { instances: instances.collect() }
}

/// CPU time of all threads of this process so far.
fn cpu_seconds() -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: a valid place for the answer.
    unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) };
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
