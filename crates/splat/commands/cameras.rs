//! `splat cameras`: what is in a camera file, and the same cameras in another format.

use std::path::PathBuf;

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_core::{Pose, Similarity, View};
use splat_io::cameras::{self, NamedView};

use super::Command;
use super::info::{point, short};
use crate::failure::Failure;
use crate::moves;
use crate::terminal::Terminal;

pub(crate) const COMMAND: Command = Command {
    name: "cameras",
    about: "List the cameras of a file, or write them in another format",
    examples: "  splat cameras cameras.json\n  \
               splat cameras sparse/0 transforms.json\n  \
               splat cameras cameras.json moved.json --transform 0,180,0",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// cameras.json (INRIA), transforms.json (nerfstudio), a COLMAP model, or a folder with one of them
    input: PathBuf,
    /// Write here: transforms*.json nerfstudio, other .json INRIA, .txt and .bin COLMAP, else a folder with a COLMAP model
    output: Option<PathBuf>,
    /// Move the cameras as `splat convert --transform` moves the Gaussians
    #[arg(long, value_name = "MOVE", allow_hyphen_values = true, long_help = moves::HELP)]
    transform: Option<String>,
}

#[derive(Serialize)]
struct Report {
    input: String,
    output: Option<String>,
    format: &'static str,
    cameras: Vec<Camera>,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct Camera {
    number: usize,
    id: u32,
    name: String,
    width: u32,
    height: u32,
    fov_y_degrees: f32,
    position: [f32; 3],
    forward: [f32; 3],
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let found = cameras::read(&options.input)?;
    let mut views = found.views;
    if let Some(text) = &options.transform {
        let transform = moves::similarity(text)?;
        for named in &mut views {
            named.view = moved(&named.view, &transform);
        }
    }
    if let Some(output) = &options.output {
        cameras::write(output, &views)?;
        terminal.done(format!("wrote {} cameras: {}", views.len(), output.display()));
    }
    let report = Report {
        input: options.input.display().to_string(),
        output: options.output.as_ref().map(|p| p.display().to_string()),
        format: found.format,
        cameras: views.iter().enumerate().map(|(number, named)| Camera::of(number, named)).collect(),
        notes: found.notes,
    };
    for note in &report.notes {
        terminal.note(note);
    }
    if options.output.is_some() && !terminal.json {
        return Ok(());
    }
    terminal.report(&report, || report.text())
}

/// The view of a moved scene that shows the same picture.
fn moved(view: &View, transform: &Similarity) -> View {
    let pose = Pose {
        world_from_view: transform.rotation_matrix() * view.pose.world_from_view,
        position: transform.apply(view.pose.position),
    };
    View { pose, near: view.near * transform.scale, ..*view }
}

impl Camera {
    fn of(number: usize, named: &NamedView) -> Self {
        let view = &named.view;
        Self {
            number,
            id: named.id,
            name: named.name.clone(),
            width: view.width,
            height: view.height,
            fov_y_degrees: view.fov_y().to_degrees(),
            position: view.pose.position.to_array(),
            forward: view.forward().to_array(),
        }
    }
}

impl Report {
    fn text(&self) -> String {
        let line = |c: &Camera| {
            format!(
                "#{:<4} {}  {}x{}, {} degrees high, at {} looking {}\n",
                c.number,
                c.name,
                c.width,
                c.height,
                short(c.fov_y_degrees),
                point(c.position),
                point(c.forward)
            )
        };
        let cameras: String = self.cameras.iter().map(line).collect();
        format!("{} cameras, {}\n{cameras}", self.cameras.len(), self.format)
    }
}
