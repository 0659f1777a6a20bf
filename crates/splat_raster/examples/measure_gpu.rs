//! Time that the stages of a frame take on this machine's graphics device, for some sets of outputs.
//!
//! `cargo run --release -p splat_raster --features gpu --example measure_gpu -- SCENE.ply CAMERAS.json [WxH] [VIEWS] [ROUNDS] [CASE]`

#![expect(clippy::print_stdout, reason = "a program")]

use std::sync::Arc;
use std::time::Instant;

use splat_core::{Mask2d, View};
use splat_raster::gpu::{Gpu, GpuOptions, GpuRasterizer, GpuTimings};
use splat_raster::{Features, Frame, Outputs, Rasterizer, Scene};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(cameras)) = (arguments.next(), arguments.next()) else {
        println!("usage: measure_gpu SCENE.ply CAMERAS.json [WxH] [VIEWS] [ROUNDS] [CASE]");
        return;
    };
    let size = arguments.next().unwrap_or_else(|| "1280x720".to_owned());
    let (width, height) = size.split_once('x').expect("WxH");
    let (width, height): (u32, u32) = (width.parse().expect("a width"), height.parse().expect("a height"));
    let count: usize = arguments.next().map_or(4, |n| n.parse().expect("a number of views"));
    let rounds: usize = arguments.next().map_or(3, |n| n.parse().expect("a number of rounds"));
    let wanted = arguments.next().unwrap_or_default();

    let (cloud, _) = splat_io::read(&file).expect("a splat file");
    let scene = Scene::of(Arc::new(cloud));
    let views = splat_io::cameras::read(&cameras).expect("a camera file").views;
    let views: Vec<View> = views.iter().map(|v| v.view.resized(width, height)).collect();
    let views: Vec<View> = views.iter().step_by((views.len() / count).max(1)).take(count).copied().collect();
    let gpu = Gpu::headless(GpuOptions { timings: true, ..GpuOptions::default() }).expect("a graphics device");
    let mut rasterizer = GpuRasterizer::new(gpu);
    println!(
        "{}: {} Gaussians, {} views of {width}x{height}; ms per frame, best of {rounds} rounds",
        rasterizer.gpu().name(),
        scene.len(),
        views.len()
    );
    println!("{:<12} project compact    sort     bin   blend   total | wall with read-back", "");

    let mask = Mask2d::from_fn(width, height, |x, y| (x / 40 + y / 40) % 2 == 0);
    let masks = [&mask];
    let values = vec![0.5; scene.len() * 3];
    let color = Outputs { color: true, ..Outputs::default() };
    let features = Outputs { features: Some(Features { channels: 3, values: &values }), ..Outputs::default() };
    let pictures = Outputs { median_depth: true, first_hits: Some(0.5), strongest: true, ..color };
    let cases = [
        ("color", color),
        ("first hits", Outputs { first_hits: Some(0.5), ..Outputs::default() }),
        ("pictures", pictures),
        ("votes", Outputs { votes: Some(&masks), ..Outputs::default() }),
        ("3 features", features),
    ];
    for (name, outputs) in cases {
        if !wanted.is_empty() && wanted != name {
            continue;
        }
        let mut best: Option<([f64; 5], f64)> = None;
        for round in 0..=rounds {
            let (mut stages, mut wall) = ([0.0; 5], 0.0);
            for view in &views {
                // The lists of a view are kept: a hair's breadth makes it another one.
                let mut view = *view;
                if round % 2 == 1 {
                    view.near = view.near.next_up();
                }
                let begin = Instant::now();
                rasterizer.draw(&scene, &view, &outputs, &mut Frame::default()).expect("a frame");
                wall += begin.elapsed().as_secs_f64() * 1e3 / views.len() as f64;
                let t: GpuTimings = rasterizer.timings().unwrap_or_default();
                for (sum, t) in stages.iter_mut().zip([t.project, t.compact, t.sort, t.bin, t.blend]) {
                    *sum += t.as_secs_f64() * 1e3 / views.len() as f64;
                }
            }
            // The first round uploads and makes room.
            if round > 0 && best.is_none_or(|(known, _)| stages.iter().sum::<f64>() < known.iter().sum()) {
                best = Some((stages, wall));
            }
        }
        let (stages, wall) = best.unwrap_or_default();
        let columns: String = stages.iter().map(|ms| format!("{ms:>8.2}")).collect();
        println!("{name:<12}{columns}{:>8.2} | {wall:.2}", stages.iter().sum::<f64>());
    }
}
