//! `splat bench`: what loading and drawing a capture costs on this machine.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_core::{Cloud, Mask2d, View};
use splat_raster::{Features, Frame, Outputs, Rasterizer, Scene};

use super::Command;
use crate::backend::{Backend, Drawer};
use crate::camera::{self, CameraOptions, Orbit, Standpoint};
use crate::capture::Capture;
use crate::failure::Failure;
use crate::terminal::{Terminal, gaussians, grouped};

pub(crate) const COMMAND: Command = Command {
    name: "bench",
    about: "Measure loading and drawing a turnaround of 8 views, or all of --camera CAMERAS without #N",
    examples: "  splat bench scene.ply\n  \
               splat bench scene.ply --size 1920x1080 --json\n  \
               splat bench scene.ply --camera cameras.json --rounds 1\n  \
               splat bench scene.ply --threads 1",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

/// Views of the turnaround that is drawn where no camera is named.
const TURNAROUND: u32 = 8;
/// Channels of the features that are drawn with all outputs.
const CHANNELS: usize = 3;

#[derive(Args, Debug)]
struct Options {
    /// The capture
    file: PathBuf,
    /// What draws
    #[arg(long, value_enum, default_value = "cpu")]
    backend: Backend,
    /// How often everything is measured, after one round to warm up
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    #[command(flatten)]
    camera: CameraOptions,
}

#[derive(Serialize)]
struct Report {
    gaussians: usize,
    size: [u32; 2],
    views: usize,
    rounds: u32,
    threads: usize,
    /// Instruction set of the processor, or name of the graphics card.
    drawn_by: String,
    stages: Vec<Stage>,
}

#[derive(Serialize)]
struct Stage {
    name: &'static str,
    median_ms: f64,
    p90_ms: f64,
    /// User and system time of the whole process, all threads together; none where the system does not tell.
    cpu_ms: Option<f64>,
}

/// Wall and processor time of one thing done once, in milliseconds.
#[derive(Clone, Copy)]
struct Sample {
    wall: f64,
    cpu: Option<f64>,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let drawer = Drawer::new(options.backend)?;
    let rounds = options.rounds;
    let working = terminal.progress("loading", Some(u64::from(rounds)));
    let mut load = Vec::new();
    let mut capture = None;
    for round in 0..=rounds {
        working.at(u64::from(round));
        // Freeing the last one is not loading.
        drop(capture.take());
        let (sample, read) = measure(|| splat_io::read(&options.file));
        let (cloud, report) = read?;
        capture = Some(Capture { path: options.file.clone(), cloud: cloud.into(), report });
        // The first round brings the file into memory.
        if round > 0 {
            load.push(sample);
        }
    }
    drop(working);
    let Some(Capture { cloud, .. }) = capture else { return Ok(()) };
    let views = views(options, &cloud)?;
    let scene = Scene::of(cloud);
    let mut stages = vec![Stage::of("load", &load)];
    let mut bench = Bench::new(drawer, &scene, &views, rounds, terminal);
    stages.extend(bench.all()?);
    let report = Report {
        gaussians: scene.len(),
        size: [views[0].width, views[0].height],
        views: views.len(),
        rounds,
        threads: rayon::current_num_threads(),
        drawn_by: bench.raster.name(),
        stages,
    };
    terminal.report(&report, || report.text())
}

fn views(options: &Options, cloud: &Cloud) -> Result<Vec<View>, Failure> {
    let picture = &options.camera.picture;
    match options.camera.standpoint() {
        Some(Standpoint::Camera(choice)) if choice.which.is_none() => {
            let count = splat_io::cameras::read(&choice.path)?.views.len();
            let numbered = |k: usize| {
                let which = camera::CameraChoice { which: Some(k.to_string()), ..choice.clone() };
                camera::view(&Standpoint::Camera(which), picture, cloud)
            };
            // An empty file is told as such.
            (0..count.max(1)).map(numbered).collect()
        }
        Some(standpoint) => Ok(vec![camera::view(&standpoint, picture, cloud)?]),
        None => (0..TURNAROUND)
            .map(|k| {
                let yaw = std::f32::consts::TAU * k as f32 / TURNAROUND as f32;
                camera::view(&Standpoint::Orbit(Orbit { yaw, ..Orbit::default() }), picture, cloud)
            })
            .collect(),
    }
}

struct Bench<'a> {
    raster: Drawer,
    frame: Frame,
    scene: &'a Scene,
    views: &'a [View],
    rounds: u32,
    drawn: u32,
    terminal: &'a Terminal,
}

impl<'a> Bench<'a> {
    fn new(raster: Drawer, scene: &'a Scene, views: &'a [View], rounds: u32, terminal: &'a Terminal) -> Self {
        Self { raster, frame: Frame::default(), scene, views, rounds, drawn: 0, terminal }
    }

    fn all(&mut self) -> Result<Vec<Stage>, Failure> {
        let color = Outputs { color: true, ..Outputs::default() };
        let mut inside: [Vec<Sample>; 3] = Default::default();
        let frames = self.frames("color", |_| color, &mut inside)?;
        let names = ["project", "sort", "raster"];
        let mut stages: Vec<Stage> = names.into_iter().zip(&inside).map(|(name, s)| Stage::of(name, s)).collect();
        stages.push(Stage::of("color", &frames));

        let masks: Vec<Mask2d> = self.views.iter().map(disc).collect();
        let masks: Vec<[&Mask2d; 1]> = masks.iter().map(|m| [m]).collect();
        let values = vec![0.5; self.scene.len() * CHANNELS];
        let everything = |k: usize| Outputs {
            color: true,
            median_depth: true,
            expected_depth: true,
            features: Some(Features { channels: CHANNELS, values: &values }),
            visibility: Some(1.0 / 255.0),
            first_hits: Some(0.5),
            strongest: true,
            votes: Some(&masks[k]),
            limit: None,
        };
        stages.push(Stage::of("all_outputs", &self.frames("all outputs", everything, &mut Default::default())?));
        let votes = |k: usize| Outputs { votes: Some(&masks[k]), ..Outputs::default() };
        stages.push(Stage::of("votes", &self.frames("votes", votes, &mut Default::default())?));
        Ok(stages)
    }

    /// Draws all views in every round; one sample per frame, and per frame and stage (project, sort, and the rest).
    fn frames<'o>(
        &mut self,
        label: &str,
        outputs: impl Fn(usize) -> Outputs<'o>,
        inside: &mut [Vec<Sample>; 3],
    ) -> Result<Vec<Sample>, Failure> {
        let count = self.views.len() as u64;
        let working = self.terminal.progress(&format!("drawing {label}"), Some(count * u64::from(self.rounds + 1)));
        let mut samples = Vec::new();
        for round in 0..=self.rounds {
            for k in 0..self.views.len() {
                working.at(u64::from(round) * count + k as u64);
                let mut view = self.views[k];
                // The rasteriser keeps the lists of the last view: a hair's breadth makes it another one.
                self.drawn += 1;
                if self.drawn.is_multiple_of(2) {
                    view.near = view.near.next_up();
                }
                let (sample, drawn) = measure(|| self.raster.draw(self.scene, &view, &outputs(k), &mut self.frame));
                drawn?;
                if round == 0 {
                    continue;
                }
                samples.push(sample);
                let parts = self.raster.parts();
                let busy: f64 = parts.iter().map(|p| p.1).sum();
                for (stage, (wall, own)) in inside.iter_mut().zip(parts) {
                    // The system tells processor time for the whole process only: each stage has its share of the frame's.
                    let share = own / busy.max(1e-12);
                    stage.push(Sample { wall: 1e3 * wall, cpu: sample.cpu.map(|cpu| cpu * share) });
                }
            }
        }
        Ok(samples)
    }
}

/// A mask over the middle of a view.
fn disc(view: &View) -> Mask2d {
    let (w, h) = (f64::from(view.width), f64::from(view.height));
    let radius = 0.25 * w.min(h);
    Mask2d::from_fn(view.width, view.height, |x, y| {
        (f64::from(x) + 0.5 - 0.5 * w).hypot(f64::from(y) + 0.5 - 0.5 * h) <= radius
    })
}

fn ms(d: Duration) -> f64 {
    d.as_secs_f64() * 1e3
}

fn measure<T>(work: impl FnOnce() -> T) -> (Sample, T) {
    let (cpu, wall) = (process_time(), Instant::now());
    let result = work();
    let wall = ms(wall.elapsed());
    let cpu = process_time().zip(cpu).map(|(after, before)| ms(after.saturating_sub(before)));
    (Sample { wall, cpu }, result)
}

/// User and system time of this process so far.
#[cfg(unix)]
fn process_time() -> Option<Duration> {
    use rustix::time::{ClockId, clock_gettime};
    let t = clock_gettime(ClockId::ProcessCPUTime);
    Some(Duration::new(t.tv_sec.try_into().ok()?, t.tv_nsec.try_into().ok()?))
}

#[cfg(not(unix))]
fn process_time() -> Option<Duration> {
    None
}

impl Stage {
    fn of(name: &'static str, samples: &[Sample]) -> Self {
        let cpu: Option<Vec<f64>> = samples.iter().map(|s| s.cpu).collect();
        let wall: Vec<f64> = samples.iter().map(|s| s.wall).collect();
        Self {
            name,
            median_ms: micros(quantile(wall.clone(), 0.5)),
            p90_ms: micros(quantile(wall, 0.9)),
            cpu_ms: cpu.map(|cpu| micros(quantile(cpu, 0.5))),
        }
    }
}

/// Milliseconds to the microsecond: more is noise.
fn micros(ms: f64) -> f64 {
    (ms * 1e3).round() / 1e3
}

/// Value below which `share` of the values lie, between values in proportion; 0 of none.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let at = share * values.len().saturating_sub(1) as f64;
    let (low, high) = (at.floor() as usize, at.ceil() as usize);
    match (values.get(low), values.get(high)) {
        (Some(a), Some(b)) => a + (b - a) * at.fract(),
        _ => 0.0,
    }
}

impl Report {
    fn text(&self) -> String {
        let head = format!(
            "{}, {}x{}, views: {}, rounds: {}, threads: {}, {}\n  {:<12} {:>10} {:>10} {:>10}\n",
            gaussians(self.gaussians),
            self.size[0],
            self.size[1],
            self.views,
            self.rounds,
            self.threads,
            self.drawn_by,
            "stage",
            "median ms",
            "p90 ms",
            "cpu ms"
        );
        let line = |s: &Stage| {
            let cpu = s.cpu_ms.map_or("-".to_owned(), |cpu| format!("{cpu:.1}"));
            format!("  {:<12} {:>10.1} {:>10.1} {cpu:>10}\n", s.name, s.median_ms, s.p90_ms)
        };
        let stages: String = self.stages.iter().map(line).collect();
        let rate = |s: &Stage| self.gaussians as f64 / (s.median_ms * 1e-3).max(1e-9);
        let load = self.stages.iter().find(|s| s.name == "load").map(rate).unwrap_or_default();
        format!("{head}{stages}loads {} Gaussians a second\n", grouped(load as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_values_in_proportion() {
        assert_eq!(quantile(vec![3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(quantile(vec![0.0, 10.0], 0.9), 9.0);
        assert_eq!(quantile(Vec::new(), 0.5), 0.0);
    }

    #[test]
    #[cfg(unix)]
    fn processor_time_passes_while_work_is_done() {
        let (sample, sum) = measure(|| (0..3_000_000u64).fold(0u64, |a, b| std::hint::black_box(a ^ b)));
        assert!(std::hint::black_box(sum) < u64::MAX && sample.cpu.unwrap() > 0.0);
    }
}
