//! `splat select`: Gaussians by shapes drawn over views, by masks and by values, step by step.
//!
//! The order of the options is the order of the work ([`steps`]): every shape starts a step, what follows it says how it is
//! lifted and combined, a camera holds for the shapes after it.

mod shapes;
mod steps;
mod values;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_core::{Mask2d, Neighbours, SelectMode, Selection, View};
use splat_io::{WriteOptions, picture};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Features, Frame, Outputs, Rasterizer, Scene};
use splat_segment::project::lift;

use self::steps::{Act, Step};
use super::Command;
use crate::camera::{self, PictureOptions};
use crate::capture::{Capture, write_selection};
use crate::failure::Failure;
use crate::terminal::{Terminal, gaussians, grouped};
use crate::{paint, parse};

pub(crate) const COMMAND: Command = Command {
    name: "select",
    about: "Select Gaussians by shapes over views, masks and values, step by step",
    examples: "  splat select scene.ply --camera cameras.json#3 --rect 300,200,420,380 --project depth -o chair.npy\n  \
               splat select scene.ply --camera cameras.json#3 --mask a.png --camera cameras.json#9 --mask b.png --mode intersect -o both.npy\n  \
               splat select scene.ply --orbit 0,90 --polygon \"100,80;500,90;420,400\" --value \"opacity<0.1\" --mode subtract -o top.npy\n  \
               splat select scene.ply --brush \"300,200;340,240:15\" --project surface --grow 3 --largest --object chair.ply --rest room.ply\n  \
               splat select scene.ply --from chair.npy --invert -o rest.npy",
    options: |command| steps::arguments(Options::augment_args(command)),
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, &steps::in_order(matches)?, terminal),
};

/// Neighbours of a Gaussian for growing, shrinking and connected pieces.
const NEIGHBOURS: usize = 8;

#[derive(Args, Debug)]
struct Options {
    /// The capture
    file: PathBuf,
    /// Begin with the selection in this .npy file instead of nothing
    #[arg(long, value_name = "NPY")]
    from: Option<PathBuf>,
    /// Write the selection: one byte per Gaussian of the file, 0 or 1
    #[arg(short, long = "out", value_name = "NPY")]
    out: Option<PathBuf>,
    /// Write the selected Gaussians as a capture
    #[arg(long, value_name = "OUT")]
    object: Option<PathBuf>,
    /// Write all others as a capture
    #[arg(long, value_name = "OUT")]
    rest: Option<PathBuf>,
    /// Write the last view with the selection over it
    #[arg(long, value_name = "PNG", value_parser = parse::png)]
    picture: Option<PathBuf>,
    #[command(flatten)]
    view: PictureOptions,
}

#[derive(Serialize)]
struct Report {
    file: String,
    gaussians: usize,
    selected: usize,
    steps: Vec<StepReport>,
    written: Vec<String>,
}

#[derive(Serialize)]
struct StepReport {
    step: String,
    /// Gaussians that the step itself means; none for steps that only change the selection.
    meant: Option<usize>,
    /// Gaussians selected after it.
    selected: usize,
}

fn run(options: &Options, steps: &[Step], terminal: &Terminal) -> Result<(), Failure> {
    if steps.iter().all(|step| matches!(step.act, Act::Stand(_))) && options.from.is_none() {
        return Err(Failure::usage(
            "there is nothing to select by; give a shape (--rect, --polygon, --brush, --mask) or a --value",
        ));
    }
    let capture = Capture::read_and_tell(&options.file, terminal)?;
    let mut work = Work::new(options, &capture)?;
    let working = terminal.progress("selecting", Some(steps.len() as u64));
    let mut told = Vec::new();
    for (k, step) in steps.iter().enumerate() {
        working.at(k as u64);
        let meant = work.take(step)?;
        // Looking from elsewhere selects nothing.
        if !matches!(step.act, Act::Stand(_)) {
            told.push(StepReport { step: step.text.clone(), meant, selected: work.selection.count() });
        }
    }
    drop(working);
    let selected = work.selection.count();
    if selected == 0 {
        terminal.note("nothing is selected; --picture shows the view that the shapes lie over");
    }
    let written = work.write(options, terminal)?;
    if written.is_empty() {
        terminal.note("nothing was written; -o SELECTION.npy, --object, --rest and --picture do that");
    }
    let report = Report {
        file: options.file.display().to_string(),
        gaussians: capture.cloud.len(),
        selected,
        steps: told,
        written,
    };
    terminal.report(&report, || report.text())
}

/// The selection in the making.
struct Work<'a> {
    capture: &'a Capture,
    scene: Scene,
    picture: PictureOptions,
    raster: CpuRasterizer,
    selection: Selection,
    /// Set by the first camera or the first shape.
    view: Option<View>,
    /// Whether some step was combined already.
    begun: bool,
    /// Found by the first step that needs them.
    neighbours: OnceLock<Neighbours>,
}

impl<'a> Work<'a> {
    fn new(options: &Options, capture: &'a Capture) -> Result<Self, Failure> {
        let selection = match &options.from {
            Some(path) => capture.selection(path)?,
            None => Selection::none(capture.cloud.len()),
        };
        Ok(Self {
            capture,
            scene: Scene::of(capture.cloud.clone()),
            picture: options.view,
            raster: CpuRasterizer::new(),
            selection,
            view: None,
            begun: options.from.is_some(),
            neighbours: OnceLock::new(),
        })
    }

    fn view(&mut self) -> Result<View, Failure> {
        match self.view {
            Some(view) => Ok(view),
            None => {
                let view = camera::view(&camera::Standpoint::default(), &self.picture, &self.capture.cloud)?;
                Ok(*self.view.insert(view))
            }
        }
    }

    fn neighbours(&self) -> &Neighbours {
        self.neighbours.get_or_init(|| Neighbours::build(self.capture.cloud.means(), NEIGHBOURS))
    }

    /// Does one step; gives how many Gaussians it means by itself.
    fn take(&mut self, step: &Step) -> Result<Option<usize>, Failure> {
        let cloud = self.capture.cloud.clone();
        let set = match &step.act {
            Act::Stand(standpoint) => {
                self.view = Some(camera::view(standpoint, &self.picture, &cloud)?);
                return Ok(None);
            }
            Act::Shape(shape, how) => {
                let view = self.view()?;
                let mask = shape.mask(&view)?;
                lift(&mut self.raster, &self.scene, &view, &mask, *how)?
            }
            Act::Value(filter) => filter.select(&cloud)?,
            Act::Grow(times) => {
                self.selection = self.neighbours().grown(&self.selection, *times);
                return Ok(None);
            }
            Act::Shrink(times) => {
                self.selection = self.neighbours().shrunk(&self.selection, *times);
                return Ok(None);
            }
            Act::Largest => {
                self.selection = self.neighbours().largest(&self.selection);
                return Ok(None);
            }
            Act::Invert => {
                self.selection.invert();
                return Ok(None);
            }
        };
        let mode = step.mode.unwrap_or(if self.begun { SelectMode::Add } else { SelectMode::New });
        self.begun = true;
        self.selection.apply(mode, &set);
        Ok(Some(set.count()))
    }

    /// Writes what is asked for; gives the names of the files.
    fn write(&mut self, options: &Options, terminal: &Terminal) -> Result<Vec<String>, Failure> {
        let mut written = Vec::new();
        if let Some(path) = &options.out {
            write_selection(path, &self.selection)?;
            terminal.done(format!("wrote the selection: {}", path.display()));
            written.push(path.display().to_string());
        }
        let mut rest = self.selection.clone();
        rest.invert();
        for (path, selection) in [(&options.object, &self.selection), (&options.rest, &rest)] {
            let Some(path) = path else { continue };
            let part = self.capture.cloud.pick(&selection.ids());
            let done = splat_io::write(path, &part, &WriteOptions::default())?;
            for loss in &done.losses {
                terminal.note(loss);
            }
            terminal.done(format!("wrote {}: {}", gaussians(part.len()), path.display()));
            written.push(path.display().to_string());
        }
        if let Some(path) = &options.picture {
            let view = self.view()?;
            let rgb = overlay(&mut self.raster, &self.capture.cloud, &view, &self.selection)?;
            picture::write_png_rgb8(path, view.width, view.height, &rgb)?;
            terminal.done(format!("wrote {}x{} pixels: {}", view.width, view.height, path.display()));
            written.push(path.display().to_string());
        }
        Ok(written)
    }
}

/// The picture of a view with the selection tinted, in proportion to what is seen of it.
pub(super) fn overlay(
    raster: &mut CpuRasterizer,
    cloud: &Arc<splat_core::Cloud>,
    view: &View,
    selection: &Selection,
) -> Result<Vec<u8>, Failure> {
    const TINT: [u8; 3] = [255, 96, 0];
    let values: Vec<f32> = (0..cloud.len()).map(|i| if selection.contains(i) { 1.0 } else { 0.0 }).collect();
    let outputs =
        Outputs { color: true, features: Some(Features { channels: 1, values: &values }), ..Outputs::default() };
    let mut frame = Frame::default();
    raster.draw(&Scene::of(cloud.clone()), view, &outputs, &mut frame)?;
    let mut rgb = paint::over(&frame.color, [0.0; 3]);
    let seen = frame.features.iter().map(|&w| (w.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
    paint::tint(&mut rgb, &Mask2d::new(view.width, view.height, seen)?, TINT);
    Ok(rgb)
}

impl Report {
    fn text(&self) -> String {
        let step = |s: &StepReport| {
            let meant = s.meant.map_or(String::new(), |n| format!(" means {},", grouped(n)));
            format!("{}:{meant} selected {}\n", s.step, grouped(s.selected))
        };
        let steps: String = self.steps.iter().map(step).collect();
        format!("{steps}{} of {} selected", grouped(self.selected), gaussians(self.gaussians))
    }
}
