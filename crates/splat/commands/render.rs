//! `splat render`: a picture of a capture.

use std::path::PathBuf;

use clap::{Args, FromArgMatches, ValueEnum};
use rayon::prelude::*;
use serde::Serialize;
use splat_core::glam::Vec3;
use splat_core::{Cloud, Projection, View};
use splat_io::picture;
use splat_raster::{Features, Frame, Outputs, Rasterizer, Scene};

use super::Command;
use super::info::{point, short};
use crate::backend::{Backend, Drawer};
use crate::camera::CameraOptions;
use crate::capture::Capture;
use crate::failure::Failure;
use crate::terminal::Terminal;
use crate::{paint, parse};

pub(crate) const COMMAND: Command = Command {
    name: "render",
    about: "Draw a picture: colour, depth, ids, normals or alpha",
    examples: "  splat render scene.ply -o view.png\n  \
               splat render scene.ply -o view.png --camera cameras.json#12\n  \
               splat render scene.ply -o above.png --orbit 45,60 --size 800x800 --background 1,1,1\n  \
               splat render scene.ply -o depth.png --output depth --json\n  \
               splat render scene.ply -o chair.png --selection selection.npy --background none",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// The capture
    file: PathBuf,
    /// The PNG to write
    #[arg(short, long = "out", value_name = "PNG", value_parser = parse::png)]
    out: PathBuf,
    /// What to draw
    #[arg(long, value_enum, default_value = "color")]
    output: Output,
    /// Behind everything: red, green and blue from 0 to 1, or `none` for a transparent picture
    #[arg(long, value_name = "R,G,B", value_parser = background, default_value = "0,0,0")]
    background: Background,
    /// Draw only the Gaussians selected in this .npy file
    #[arg(long, value_name = "NPY")]
    selection: Option<PathBuf>,
    /// What draws
    #[arg(long, value_enum, default_value = "cpu")]
    backend: Backend,
    #[command(flatten)]
    camera: CameraOptions,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Output {
    /// Colours over the background
    Color,
    /// Distance along the view, warm is near, cold is far; the range is printed
    Depth,
    /// The same as 16-bit gray: 0 none, 1 the near and 65535 the far end of the printed range
    Depth16,
    /// Which Gaussian is hit first, in a colour of its own
    Ids,
    /// Directions of surfaces: red right, green up, blue towards the viewer
    Normals,
    /// How much is covered
    Alpha,
}

#[derive(Clone, Copy, Debug)]
enum Background {
    Color([f32; 3]),
    Transparent,
}

fn background(text: &str) -> Result<Background, String> {
    if text == "none" {
        return Ok(Background::Transparent);
    }
    let c = parse::vec3(text)?;
    if c.cmpge(Vec3::ZERO).all() && c.cmple(Vec3::ONE).all() {
        Ok(Background::Color(c.to_array()))
    } else {
        Err("red, green and blue are numbers from 0 to 1".to_owned())
    }
}

#[derive(Serialize)]
struct Report {
    file: String,
    picture: String,
    output: Output,
    width: u32,
    height: u32,
    position: [f32; 3],
    forward: [f32; 3],
    /// Nearest and farthest depth of a depth picture, in scene units.
    depth: Option<(f32, f32)>,
    /// Share of the pixels that are at least half covered.
    covered: f64,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let mut drawer = Drawer::new(options.backend)?;
    let capture = Capture::read_and_tell(&options.file, terminal)?;
    let view = options.camera.view(&capture.cloud)?;
    let scene = match &options.selection {
        Some(path) => Scene::of_selected(capture.cloud.clone(), &capture.selection(path)?),
        None => Scene::of(capture.cloud.clone()),
    };
    let normals = if options.output == Output::Normals { normals(&capture.cloud, &view) } else { Vec::new() };
    let outputs = Outputs {
        color: true,
        median_depth: matches!(options.output, Output::Depth | Output::Depth16),
        first_hits: (options.output == Output::Ids).then_some(0.5),
        features: (options.output == Output::Normals).then_some(Features { channels: 3, values: &normals }),
        ..Outputs::default()
    };
    let mut frame = Frame::default();
    drawer.draw(&scene, &view, &outputs, &mut frame)?;
    let depth = write(options, &frame)?;
    let covered = frame.color.iter().filter(|c| c[3] >= 0.5).count() as f64 / frame.color.len() as f64;
    if frame.color.iter().all(|c| c[3] == 0.0) {
        terminal.note("nothing is in the picture; `splat info` tells where the Gaussians are, --orbit looks at them");
    }
    let report = Report {
        file: options.file.display().to_string(),
        picture: options.out.display().to_string(),
        output: options.output,
        width: view.width,
        height: view.height,
        position: view.pose.position.to_array(),
        forward: view.forward().to_array(),
        depth,
        covered,
    };
    if terminal.json {
        return terminal.report(&report, String::new);
    }
    if let Some((near, far)) = depth {
        terminal.done(format!("depth from {} to {} scene units", short(near), short(far)));
    }
    terminal.done(format!(
        "wrote {}x{} pixels, seen from {}: {}",
        view.width,
        view.height,
        point(report.position),
        report.picture
    ));
    Ok(())
}

/// Writes the picture; gives the range of depths it shows.
fn write(options: &Options, frame: &Frame) -> Result<Option<(f32, f32)>, Failure> {
    let (path, width, height) = (&options.out, frame.width, frame.height);
    let range = paint::range(&frame.median_depth);
    match (options.output, options.background) {
        (Output::Color, Background::Color(background)) => {
            picture::write_png_rgb8(path, width, height, &paint::over(&frame.color, background))?;
        }
        (Output::Color, Background::Transparent) => {
            picture::write_png_rgba8(path, width, height, &paint::cut_out(&frame.color))?;
        }
        (Output::Depth, _) => {
            let colors = paint::depth_colors(&frame.median_depth, range.unwrap_or_default());
            picture::write_png_rgb8(path, width, height, &colors)?;
        }
        (Output::Depth16, _) => {
            let values = paint::depth_16(&frame.median_depth, range.unwrap_or_default());
            picture::write_png_gray16(path, width, height, &values)?;
        }
        (Output::Ids, _) => picture::write_png_rgb8(path, width, height, &paint::id_colors(&frame.first_hits))?,
        (Output::Normals, _) => {
            picture::write_png_rgb8(path, width, height, &paint::normal_colors(&frame.features, &frame.color))?;
        }
        (Output::Alpha, _) => picture::write_png_gray8(path, width, height, &paint::alpha(&frame.color))?,
    }
    Ok(range)
}

/// Three values per Gaussian: its shortest axis in camera space, turned towards the camera; zero where it cannot be drawn.
fn normals(cloud: &Cloud, view: &View) -> Vec<f32> {
    let view_from_world = view.pose.world_from_view.transpose();
    let normal = |i: usize| {
        if !cloud.drawable(i) {
            return Vec3::ZERO;
        }
        let shortest = cloud.log_scales()[i].min_position();
        let normal = view_from_world * (cloud.rotation(i) * Vec3::AXES[shortest]);
        let ray = match view.projection {
            Projection::Perspective => view.to_view(cloud.means()[i]),
            Projection::Orthographic => Vec3::Z,
        };
        if normal.dot(ray) > 0.0 { -normal } else { normal }
    };
    (0..cloud.len()).into_par_iter().flat_map_iter(|i| normal(i).to_array()).collect()
}
