//! `splat simulate`: a part of a capture as a body that falls, bends and comes to rest on what is left.

mod body;
mod film;
mod report;

use std::path::PathBuf;

use clap::{Args, FromArgMatches};
use splat_core::glam::{DVec3, Vec3};
use splat_io::WriteOptions;
use splat_physics::{Material, PRESETS};

use self::body::Body;
use self::film::Film;
use self::report::Report;
use super::Command;
use super::info::short;
use crate::camera::{CameraOptions, up_of};
use crate::capture::Capture;
use crate::failure::Failure;
use crate::parse;
use crate::terminal::{Terminal, gaussians};

pub(crate) const COMMAND: Command = Command {
    name: "simulate",
    about: "Let a part of a capture fall, bend and come to rest on what is left of it",
    examples: "  splat simulate scene.ply --part bear.npy --material plush --lift 0.5 --seconds 2 -o fall\n  \
               splat simulate scene.ply --part bear.npy --material foam_soft --material hat.npy=wood_hard --height 0.3 -o fall\n  \
               splat simulate scene.ply --part bear.npy --material gelatin --camera cameras.json#12 --fps 30 -o fall\n  \
               splat simulate scene.ply --part bear.npy --material gelatin --seconds 3 --frames none -o fall --json",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// The capture
    file: PathBuf,
    /// The part: the Gaussians selected in this .npy file
    #[arg(long, value_name = "NPY")]
    part: PathBuf,
    /// What the part is made of, by name; NPY=NAME: what the Gaussians selected in that file are made of instead
    #[arg(long = "material", value_name = "[NPY=]NAME", value_parser = made_of, required = true)]
    materials: Vec<MadeOf>,
    /// Seconds to simulate
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "2")]
    seconds: f32,
    /// The folder to write: frame_0000.png .., part.ply (the last pose), report.json
    #[arg(short, long = "out", value_name = "DIR")]
    out: PathBuf,
    /// Metres per unit of the capture [default: as kept by `splat scale`, else 1]
    #[arg(long, value_name = "METRES", value_parser = parse::positive, conflicts_with_all = ["length", "height"])]
    metres_per_unit: Option<f32>,
    /// Longest side of the part in metres
    #[arg(long, value_name = "METRES", value_parser = parse::positive, conflicts_with = "height")]
    length: Option<f32>,
    /// Height of the part in metres
    #[arg(long, value_name = "METRES", value_parser = parse::positive)]
    height: Option<f32>,
    /// Lift the part by this many metres first
    #[arg(long, value_name = "METRES", value_parser = parse::number, default_value = "0")]
    lift: f32,
    /// Its velocity at the start in m/s, along the capture's axes
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::vec3, default_value = "0,0,0", allow_hyphen_values = true)]
    velocity: Vec3,
    /// Thickness of its wall in metres, if it is hollow
    #[arg(long, value_name = "METRES", value_parser = parse::positive)]
    hollow: Option<f32>,
    /// Handles of the reduced deformation
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=64), default_value = "16")]
    handles: u16,
    /// What it falls on
    #[arg(long, value_enum, default_value = "auto")]
    ground: body::GroundChoice,
    /// Which frames to draw
    #[arg(long, value_enum, default_value = "all")]
    frames: Frames,
    /// Frames per second
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=240), default_value = "30")]
    fps: u32,
    /// Of everything that is drawn at random
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
    #[command(flatten)]
    camera: CameraOptions,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Frames {
    /// All of them
    All,
    /// The last one
    Last,
    /// None
    None,
}

/// `NAME` or `NPY=NAME`.
#[derive(Clone, Debug)]
struct MadeOf {
    /// Which Gaussians; `None`: the part.
    part: Option<PathBuf>,
    name: &'static str,
    material: Material,
}

fn made_of(text: &str) -> Result<MadeOf, String> {
    let (part, name) = match text.rsplit_once('=') {
        Some((part, name)) => (Some(PathBuf::from(part)), name),
        None => (None, text),
    };
    let preset = PRESETS.iter().find(|p| p.name == name).ok_or_else(|| {
        let names: Vec<&str> = PRESETS.iter().map(|p| p.name).collect();
        format!("there is no material `{name}`; there are {}", names.join(", "))
    })?;
    Ok(MadeOf { part, name: preset.name, material: preset.material })
}

fn seconds(text: &str) -> Result<f32, String> {
    parse::positive(text).and_then(|s| if s <= 600.0 { Ok(s) } else { Err("at most 600 seconds".to_owned()) })
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    if options.materials.iter().filter(|m| m.part.is_none()).count() != 1 {
        return Err(Failure::usage("one --material NAME is needed for the part; others are --material NPY=NAME"));
    }
    let capture = Capture::read_and_tell(&options.file, terminal)?;
    let up = options.camera.picture.up.unwrap_or_else(|| up_of(&capture.cloud));
    // A view that cannot be had is told before work is done.
    let view = options.camera.view(&capture.cloud)?;
    let mut body = Body::build(options, &capture, up, terminal)?;
    std::fs::create_dir_all(&options.out).map_err(|e| {
        Failure::failed(format!("the folder cannot be made ({e}); name another: {}", options.out.display()))
    })?;
    let mut film = Film::new(&capture, &body.part, view, &options.out);
    let mut report = Report::of(options, &capture, &body);

    let frames = (f64::from(options.seconds) * f64::from(options.fps)).round().max(1.0) as u64;
    // Steps of a sixtieth of a second, or a whole part of the time between frames.
    let substeps = 60u32.div_ceil(options.fps).max(1);
    let dt = 1.0 / f64::from(options.fps * substeps);
    let working = terminal.progress("simulating", Some(frames));
    if options.frames == Frames::All {
        film.shoot(&body, 0)?;
    }
    for frame in 1..=frames {
        for _ in 0..substeps {
            body.step(dt, &mut report);
        }
        let wanted = match options.frames {
            Frames::All => true,
            Frames::Last => frame == frames,
            Frames::None => false,
        };
        if wanted {
            film.shoot(&body, frame)?;
        }
        working.at(frame);
    }
    drop(working);
    let pose = body.pose(&capture.cloud)?;
    let path = options.out.join("part.ply");
    splat_io::write(&path, &pose, &WriteOptions::default())?;
    terminal.done(format!("wrote the last pose, {}: {}", gaussians(pose.len()), path.display()));
    report.end(&body, film.count());
    let path = options.out.join("report.json");
    let text = serde_json::to_string_pretty(&report)?;
    splat_io::write_file(&path, |sink| Ok(sink.write_all(text.as_bytes())?))?;
    if film.count() > 0 {
        terminal.done(format!("wrote {} pictures: {}", film.count(), options.out.display()));
    }
    for note in &report.notes {
        terminal.note(note);
    }
    terminal.report(&report, || report.text())
}

/// A vector for reports.
fn triple(v: DVec3) -> [f64; 3] {
    v.to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_are_names_with_or_without_a_part() {
        let name = PRESETS[0].name;
        assert_eq!(made_of(name).unwrap().part, None);
        let nested = made_of(&format!("a=b/hat.npy={name}")).unwrap();
        assert_eq!((nested.part, nested.name), (Some(PathBuf::from("a=b/hat.npy")), name));
        for bad in ["", "hat.npy=", "unobtainium", "hat.npy=unobtainium"] {
            assert!(made_of(bad).unwrap_err().contains(name), "{bad}");
        }
        assert!(seconds("0").is_err() && seconds("601").is_err() && seconds("nan").is_err() && seconds("2.5").is_ok());
    }
}
