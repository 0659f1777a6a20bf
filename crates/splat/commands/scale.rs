//! `splat scale`: how many metres a unit of a capture is.

use std::path::PathBuf;

use clap::{ArgGroup, Args, FromArgMatches};
use serde::Serialize;
use splat_core::glam::{Vec2, Vec3};
use splat_core::orient::extent_along;
use splat_core::{Cloud, CloudArrays, Similarity};
use splat_io::WriteOptions;
use splat_raster::Scene;
use splat_raster::pick::{PickIndex, PickQuery};

use super::Command;
use super::info::{point, short};
use crate::camera::{CameraOptions, up_of};
use crate::capture::Capture;
use crate::failure::Failure;
use crate::parse;
use crate::places::{self, Places};
use crate::terminal::{Terminal, gaussians};

pub(crate) const COMMAND: Command = Command {
    name: "scale",
    about: "Tell how many metres a unit of a capture is, from a known length or height",
    examples: "  splat scale scene.ply --length 0.42 --points \"0.1,1.2,3;0.9,1.2,3\" --store\n  \
               splat scale scene.ply --length 2.0 --points 1204,88310 -o metres.ply\n  \
               splat scale scene.ply --length 0.8 --pixels \"412,300;640,310\" --camera cameras.json#12 -o metres.ply\n  \
               splat scale scene.ply --height 0.5 --part chair.npy --json\n  \
               splat scale scene.ply --metres-per-unit 0.31 --store",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
#[command(group = ArgGroup::new("how").required(true).args(["length", "height", "metres_per_unit"]))]
struct Options {
    /// The capture
    file: PathBuf,
    /// Write the capture in metres here: one unit is one metre
    #[arg(short, long = "out", value_name = "OUT")]
    out: Option<PathBuf>,
    /// Leave the capture as it is and keep its scale in FILE.scale.json, where every command finds it
    #[arg(long)]
    store: bool,
    /// Distance of two places in metres
    #[arg(long, value_name = "METRES", value_parser = parse::positive, allow_negative_numbers = true, requires = "places")]
    length: Option<f32>,
    /// The two places: coordinates X,Y,Z;X,Y,Z or Gaussians ID,ID
    #[arg(long, value_name = "PLACES", value_parser = places::two, allow_hyphen_values = true, group = "places", requires = "length")]
    points: Option<Places>,
    /// The two places: pixels X,Y;X,Y of the view that --camera or --orbit names
    #[arg(long, value_name = "X,Y;X,Y", value_parser = pixels, group = "places", requires = "length")]
    pixels: Option<[Vec2; 2]>,
    /// Height in metres of the part, or of the whole capture
    #[arg(long, value_name = "METRES", value_parser = parse::positive, allow_negative_numbers = true)]
    height: Option<f32>,
    /// The part: the Gaussians selected in this .npy file
    #[arg(long, value_name = "NPY", requires = "height")]
    part: Option<PathBuf>,
    /// The scale itself
    #[arg(long, value_name = "METRES", value_parser = parse::positive, allow_negative_numbers = true)]
    metres_per_unit: Option<f32>,
    #[command(flatten)]
    camera: CameraOptions,
}

fn pixels(text: &str) -> Result<[Vec2; 2], String> {
    parse::points(text)?.try_into().map_err(|_| "two pixels were expected: X,Y;X,Y".to_owned())
}

#[derive(Serialize)]
struct Report {
    file: String,
    output: Option<String>,
    stored: Option<String>,
    metres_per_unit: f64,
    /// What it was before, where somebody had said.
    before: Option<f64>,
    /// Between what was measured, in scene units.
    points: Option<[[f32; 3]; 2]>,
    /// What was measured, in scene units and in metres.
    units: Option<f64>,
    metres: Option<f64>,
    /// Sentences about what should be looked at again.
    doubts: Vec<String>,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    if options.pixels.is_some() && options.camera.standpoint().is_none() {
        return Err(Failure::usage("--pixels are of a view; name it with --camera or --orbit"));
    }
    let capture = Capture::read_and_tell(&options.file, terminal)?;
    let cloud = &*capture.cloud;
    let mut report = Report {
        file: options.file.display().to_string(),
        output: None,
        stored: None,
        metres_per_unit: f64::from(options.metres_per_unit.unwrap_or(1.0)),
        before: cloud.source().metres_per_unit(),
        points: None,
        units: None,
        metres: None,
        doubts: Vec::new(),
    };
    let measured = if let Some(metres) = options.length {
        let [a, b] = ends(options, &capture)?;
        report.points = Some([a.to_array(), b.to_array()]);
        Some((f64::from(a.distance(b)), metres))
    } else if let Some(metres) = options.height {
        Some((height(options, &capture)?, metres))
    } else {
        None
    };
    if let Some((units, metres)) = measured {
        report.metres_per_unit = f64::from(metres) / units;
        (report.units, report.metres) = (Some(units), Some(f64::from(metres)));
    }
    let scale = report.metres_per_unit;
    // What is scaled by it must stay within single precision.
    if !(1e-6..=1e6).contains(&scale) {
        return Err(Failure::failed(format!(
            "one unit would be {scale:e} metres, which is no capture; take places that lie further apart"
        )));
    }
    if !(1e-3..=1e4).contains(&scale) {
        report.doubts.push(format!("one unit would be {} metres; look at the places again", short(scale as f32)));
    }
    if let Some(before) = report.before.filter(|b| (b / scale - 1.0).abs() > 0.05) {
        report.doubts.push(format!("the file said {} metres per unit before", short(before as f32)));
    }
    if options.store {
        let path = splat_io::scale::write_beside(&options.file, cloud, scale)?;
        terminal.done(format!("kept {} metres per unit: {}", short(scale as f32), path.display()));
        report.stored = Some(path.display().to_string());
    }
    if let Some(out) = &options.out {
        write(out, cloud, scale, terminal)?;
        report.output = Some(out.display().to_string());
    }
    for doubt in &report.doubts {
        terminal.note(doubt);
    }
    if !options.store && options.out.is_none() && !terminal.json {
        terminal.note("nothing was written; --store keeps the scale, -o writes the capture in metres");
    }
    terminal.report(&report, || report.text())
}

/// The two places, in scene units.
fn ends(options: &Options, capture: &Capture) -> Result<[Vec3; 2], Failure> {
    let found = match (&options.points, options.pixels) {
        (Some(places), _) => places.in_cloud(&capture.cloud)?,
        (None, Some(pixels)) => picked(options, capture, pixels)?,
        (None, None) => Vec::new(),
    };
    let [a, b] = found[..] else {
        return Err(Failure::usage("--length is the distance of two places; name them with --points or --pixels"));
    };
    if a.distance(b) > 0.0 && a.distance(b).is_finite() {
        Ok([a, b])
    } else {
        Err(Failure::failed("the two places are the same; take two that lie apart"))
    }
}

/// What is seen at two pixels.
fn picked(options: &Options, capture: &Capture, pixels: [Vec2; 2]) -> Result<Vec<Vec3>, Failure> {
    let view = options.camera.view(&capture.cloud)?;
    let index = PickIndex::new(&capture.cloud);
    let scene = Scene::of(capture.cloud.clone());
    let at = |pixel: Vec2| {
        if !view.contains(pixel) {
            return Err(Failure::usage(format!(
                "the pixel {},{} is outside the picture of {} x {} pixels",
                pixel.x, pixel.y, view.width, view.height
            )));
        }
        let hit = splat_raster::pick::pick(&scene, &[Some(&index)], &view, PickQuery::at(pixel))?;
        hit.map(|hit| hit.position).ok_or_else(|| {
            Failure::failed(format!("there is nothing solid at the pixel {},{}; take another", pixel.x, pixel.y))
        })
    };
    pixels.into_iter().map(at).collect()
}

/// Extent of the part along up, in scene units.
fn height(options: &Options, capture: &Capture) -> Result<f64, Failure> {
    let part = options.part.as_deref().map(|path| capture.selection(path)).transpose()?;
    if part.as_ref().is_some_and(|p| p.count() == 0) {
        return Err(Failure::failed("the part is empty; select what is as high as --height says"));
    }
    let up = options.camera.picture.up.unwrap_or_else(|| up_of(&capture.cloud));
    let (low, high) = extent_along(&capture.cloud, part.as_ref(), up).ok_or_else(|| {
        Failure::failed("no Gaussian of it can be drawn, so it has no height; `splat check` tells why")
    })?;
    let units = f64::from(high - low);
    if units > 0.0 { Ok(units) } else { Err(Failure::failed("it has no height at all; select more of it")) }
}

/// Writes the capture in metres, and that it is in metres.
fn write(out: &std::path::Path, cloud: &Cloud, scale: f64, terminal: &Terminal) -> Result<(), Failure> {
    let scaled = cloud.transformed(&Similarity { scale: scale as f32, ..Similarity::IDENTITY });
    let mut arrays: CloudArrays = scaled.into_arrays();
    arrays.source.set_metres_per_unit(Some(1.0));
    let cloud = Cloud::new(arrays)?;
    let written = splat_io::write(out, &cloud, &WriteOptions::default())?;
    for loss in &written.losses {
        terminal.note(loss);
    }
    terminal.done(format!("wrote {} in metres: {}", gaussians(cloud.len()), out.display()));
    let kept = splat_io::format_of_name(&out.to_string_lossy()).is_some_and(|f| f.name().ends_with("ply"));
    if !kept {
        // Other formats have no comments, and most round what they keep: it is the file that is described.
        let (read, _) = splat_io::read(out)?;
        let path = splat_io::scale::write_beside(out, &read, 1.0)?;
        terminal.done(format!("kept its scale: {}", path.display()));
    }
    Ok(())
}

impl Report {
    fn text(&self) -> String {
        let mut lines = Vec::new();
        if let Some([a, b]) = self.points {
            lines.push(format!("between     {} and {}", point(a), point(b)));
        }
        if let (Some(units), Some(metres)) = (self.units, self.metres) {
            lines.push(format!("measured    {} units are {} m", short(units as f32), short(metres as f32)));
        }
        lines.push(format!("scale       {} metres per unit", short(self.metres_per_unit as f32)));
        lines.join("\n")
    }
}
