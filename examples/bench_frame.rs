//! What a frame of the plugin costs, and which pass costs it, on this machine.
//!
//! ```sh
//! cargo run --release --example bench_frame -- --gaussians 1000000 --size 1920x1080
//! cargo run --release --example bench_frame -- --scene my_scan.ply --backend cpu --frames 100
//! ```
//!
//! An app without a window; the camera moves in every frame, so that nothing of the last one can be taken again, and every
//! frame is waited for on the device. Times come from two runs of the same frames: the first measures whole frames, the
//! second, which is slower for it, has timestamps around every pass.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bevy::app::PluginsState;
use bevy::asset::UnapprovedPathMode;
use bevy::camera::RenderTarget;
use bevy::camera::primitives::Aabb;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{PollType, TextureFormat};
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_splat::prelude::*;
use clap::{Parser, ValueEnum};

/// Frames before those that count: pipelines are compiled, buffers find their size.
const WARM_UP: usize = 5;

/// Measures frames of the plugin
#[derive(Parser, Debug)]
struct Options {
    /// Gaussians of the generated cloud
    #[arg(long, default_value_t = 100_000)]
    gaussians: usize,
    /// A capture instead of the generated cloud
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Pixels across and down
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x720")]
    size: UVec2,
    /// What draws
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    backend: Backend,
    /// Frames that count
    #[arg(long, default_value_t = 30)]
    frames: usize,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Backend {
    /// As the plugin decides
    Auto,
    /// The processor
    Cpu,
    /// The graphics device
    Gpu,
}

fn main() {
    let options = Options::parse();
    let mut bench = Bench::new(&options, false);
    let device = bench.app.world().resource::<RenderAdapterInfo>().clone();
    say(&format!("{} ({:?}, {} {})", device.name, device.backend, device.driver, device.driver_info));
    let mut times = bench.run(options.frames);
    times.sort_unstable_by(f64::total_cmp);
    if let Some(view) = bench.app.world().resource::<SplatRenderStats>().views.first() {
        say(&format!("{} Gaussians, {}, {:?} back end", view.gaussians, view.size, view.backend));
    }
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    let (median, cpu) = (at(0.5), bench.cpu.map_or(String::new(), |ms| format!(", processor {ms:.2} ms")));
    say(&format!(
        "frame {median:.2} ms, least {:.2}, 9 of 10 under {:.2}{cpu}, {:.0} frames/s",
        at(0.0),
        at(0.9),
        1e3 / median
    ));

    let mut bench = Bench::new(&options, true);
    bench.run(options.frames);
    say("of that, in a run with timestamps, ms (median):");
    for (pass, ms) in bench.passes() {
        say(&format!("  {ms:>9.3}  {pass}"));
    }
}

struct Bench {
    app: App,
    camera: Entity,
    /// Middle of the capture and how far away the camera stands.
    orbit: (Vec3, f32),
    /// User and system time of the process per frame, all threads together, in milliseconds.
    cpu: Option<f64>,
}

impl Bench {
    fn new(options: &Options, timestamps: bool) -> Self {
        let mut app = App::new();
        app.add_plugins(
            DefaultPlugins
                .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
                .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() })
                .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
                .disable::<WinitPlugin>()
                .disable::<bevy::log::LogPlugin>()
                .disable::<PipelinedRenderingPlugin>(),
        );
        app.add_plugins(BevySplatPlugins).insert_resource(match options.backend {
            Backend::Auto => SplatBackend::Auto,
            Backend::Cpu => SplatBackend::Cpu,
            Backend::Gpu => SplatBackend::Gpu,
        });
        if timestamps {
            app.add_plugins(RenderDiagnosticsPlugin);
        }
        while app.plugins_state() == PluginsState::Adding {
            bevy::tasks::tick_global_task_pools_on_main_thread();
        }
        app.finish();
        app.cleanup();

        let cloud = match &options.scene {
            Some(file) => load(&mut app, file),
            None => app.world_mut().resource_mut::<Assets<SplatCloud>>().add(SplatCloud::new(shell(options.gaussians))),
        };
        let orbit = bounds(&app, &cloud);
        let world = app.world_mut();
        let (w, h) = (options.size.x, options.size.y);
        let image = Image::new_target_texture(w, h, TextureFormat::Rgba8UnormSrgb, None);
        let image = world.resource_mut::<Assets<Image>>().add(image);
        world.spawn(Splats(cloud));
        let camera = world.spawn((
            Camera3d::default(),
            RenderTarget::Image(image.into()),
            Msaa::Off,
            Tonemapping::None,
            Transform::default(),
        ));
        let camera = camera.id();
        Self { app, camera, orbit, cpu: None }
    }

    /// Wall milliseconds of every frame that counts.
    fn run(&mut self, frames: usize) -> Vec<f64> {
        let mut begun = None;
        let mut times = Vec::new();
        for k in 0..WARM_UP + frames.max(1) {
            if k == WARM_UP {
                begun = process_time();
            }
            let (middle, distance) = self.orbit;
            let angle = 0.01 * k as f32;
            let eye = middle + distance * Vec3::new(angle.sin(), 0.4, angle.cos());
            if let Some(mut at) = self.app.world_mut().get_mut::<Transform>(self.camera) {
                *at = Transform::from_translation(eye).looking_at(middle, Vec3::Y);
            }
            let start = Instant::now();
            self.app.update();
            let device = self.app.world().resource::<RenderDevice>().wgpu_device();
            device.poll(PollType::wait_indefinitely()).expect("the device answers");
            if k >= WARM_UP {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
        let spent = process_time().zip(begun).map(|(now, then)| now.saturating_sub(then));
        self.cpu = spent.map(|t| t.as_secs_f64() * 1e3 / times.len() as f64);
        times
    }

    /// Median milliseconds of every pass that Bevy and the plugin recorded, the costliest first: on the device
    /// (`elapsed_gpu`) and for recording it (`elapsed_cpu`, for the CPU back end also drawing itself).
    fn passes(&self) -> Vec<(String, f64)> {
        let store = self.app.world().resource::<DiagnosticsStore>();
        let elapsed = store.iter().filter(|d| d.path().as_str().contains("/elapsed_"));
        let mut passes: Vec<(String, f64)> = elapsed
            .filter_map(|d| {
                let mut values: Vec<f64> = d.values().copied().collect();
                values.sort_unstable_by(f64::total_cmp);
                Some((d.path().as_str().to_owned(), *values.get(values.len() / 2)?))
            })
            .collect();
        passes.sort_by(|a, b| b.1.total_cmp(&a.1));
        passes
    }
}

/// Waits for a capture.
fn load(app: &mut App, file: &std::path::Path) -> Handle<SplatCloud> {
    let path = std::path::absolute(file).unwrap_or_else(|_| file.to_path_buf());
    let cloud: Handle<SplatCloud> = app.world().resource::<AssetServer>().load(path);
    loop {
        app.update();
        match app.world().resource::<AssetServer>().load_state(&cloud) {
            bevy::asset::LoadState::Loaded => return cloud,
            bevy::asset::LoadState::Failed(why) => {
                complain(&why.to_string());
                std::process::exit(1);
            }
            _ => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

/// Middle of a cloud as it stands upright, and a distance from which its bulk is seen.
fn bounds(app: &App, cloud: &Handle<SplatCloud>) -> (Vec3, f32) {
    let cloud = app.world().resource::<Assets<SplatCloud>>().get(cloud);
    let bounds = cloud.and_then(|c| splat_core::bounds::robust_bounds(&c.cloud));
    let bounds = bounds.map(|b| Aabb::from_min_max(b.min, b.max)).unwrap_or_default();
    (UPRIGHT.transform_point(bounds.center.into()), 2.0 * bounds.half_extents.length())
}

/// Gaussians all over a unit sphere, by the golden angle; the more the smaller.
fn shell(count: usize) -> Cloud {
    let scale = (2.0 / (count.max(1) as f32).sqrt()).ln();
    let point = |k: usize| {
        let y = 1.0 - (2 * k + 1) as f32 / count as f32;
        let (sin, cos) = (k as f32 * 2.399_963_2).sin_cos();
        let r = (1.0 - y * y).sqrt();
        Vec3::new(r * sin, y, r * cos)
    };
    let means: Vec<Vec3> = (0..count).map(point).collect();
    let wave = |v: f32| 0.4 * (7.0 * v).sin() / splat_core::sh::C0;
    Cloud::new(CloudArrays {
        log_scales: vec![Vec3::splat(scale); count],
        rotations: vec![Quat::IDENTITY; count],
        opacity_logits: (0..count).map(|k| (k % 7) as f32 - 2.0).collect(),
        sh: means.iter().flat_map(|m| m.to_array().map(wave)).collect(),
        means,
        ..default()
    })
    .expect("arrays of one length")
}

fn size(text: &str) -> Result<UVec2, String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some(UVec2::new(w.parse().ok()?, h.parse().ok()?)));
    sides.filter(|s| s.min_element() > 0).ok_or_else(|| "a size such as 1280x720 was expected".to_owned())
}

/// User and system time of this process so far.
#[cfg(unix)]
fn process_time() -> Option<Duration> {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(Duration::new(t.tv_sec.try_into().ok()?, t.tv_nsec.try_into().ok()?))
}

#[cfg(not(unix))]
fn process_time() -> Option<Duration> {
    None
}

#[expect(clippy::print_stdout, reason = "what a bench is for")]
fn say(text: &str) {
    println!("{text}");
}

#[expect(clippy::print_stderr, reason = "a program's complaint")]
fn complain(text: &str) {
    eprintln!("error: {text}");
}
