//! `splat segment`: a click, a box or a mask takes an object out of a capture.
//!
//! Options become a [`Task`] (here), which [`job`] does: [`solve`] finds the Gaussians, [`pictures`] shows them,
//! [`session`] keeps the task so that `splat replay` can do it again.

pub(crate) mod job;
mod pictures;
pub(crate) mod session;
mod solve;
pub(crate) mod task;

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

use clap::{ArgMatches, Args, FromArgMatches};
use splat_core::glam::Vec2;
use splat_core::{Cloud, View};
use splat_io::picture;
use splat_segment::graph::clicks::ClickKind;

use self::job::Job;
use self::task::{Edge, Granularity, Method, Prompt, Settings, Shape, Task};
use super::Command;
use crate::camera::{self, CameraChoice, CameraOptions, Orbit, Standpoint};
use crate::capture::Capture;
use crate::failure::Failure;
use crate::parse;
use crate::prepare::Keep;
use crate::terminal::Terminal;

pub(crate) const COMMAND: Command = Command {
    name: "segment",
    about: "Take an object out of a capture by clicks, a box or masks",
    examples: "  splat segment scene.ply --camera cameras.json#9 --click 251,462 -o chair\n  \
               splat segment scene.ply --camera cameras.json#9 --click 251,462 --negative 300,80 --click 400,200@12 -o chair\n  \
               splat segment scene.ply --camera cameras.json#9 --box 154,191,357,578 --boundary split -o chair\n  \
               splat segment scene.ply --camera cameras.json#9 --mask a.png --mask b.png@12 --views 24 -o chair\n  \
               splat segment scene.ply --orbit 30,20 --click 640,360 --granularity part --format spz -o seat\n  \
               splat segment scene.ply --orbit 30,20 --click 640,360 --step 4 -o leg",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, matches, terminal),
};

/// Views made up about a capture that has no cameras: on two rings, this many each.
const RING: usize = 8;
/// Their heights above the horizon, in degrees.
const RING_PITCH: [f32; 2] = [12.0, 42.0];
/// Their size.
const RING_SIZE: (u32, u32) = (640, 480);

#[derive(Args, Debug)]
struct Options {
    /// The capture
    file: PathBuf,
    /// The folder for results; it is made if it is not there
    #[arg(short, long = "out", value_name = "DIR")]
    out: PathBuf,
    /// Camera file of the training views [default: the file that --camera names, else views from all around]
    #[arg(long, value_name = "CAMERAS", help_heading = "Camera")]
    cameras: Option<PathBuf>,
    #[command(flatten)]
    camera: CameraOptions,
    /// A pixel of the object; with @N, in camera N of the training views. Clicks count in the order given
    #[arg(long, value_name = "X,Y[@N]", allow_hyphen_values = true, help_heading = "What is meant")]
    click: Vec<At<Pixel>>,
    /// A pixel of something that is not the object
    #[arg(long, value_name = "X,Y[@N]", allow_hyphen_values = true, help_heading = "What is meant")]
    negative: Vec<At<Pixel>>,
    /// A stroke over the object
    #[arg(long, value_name = "X,Y;X,Y;...[@N]", allow_hyphen_values = true, help_heading = "What is meant")]
    scribble: Vec<At<Stroke>>,
    /// A box around the object: left, top, right, bottom
    #[arg(long = "box", value_name = "X0,Y0,X1,Y1[@N]", allow_hyphen_values = true, help_heading = "What is meant")]
    rectangle: Vec<At<Rectangle>>,
    /// The object in white on black, as large as its view
    #[arg(long, value_name = "PNG[@N]", help_heading = "What is meant")]
    mask: Vec<At<PathBuf>>,
    /// How much around a click or in a box is meant
    #[arg(long, value_enum, default_value = "object", help_heading = "What is meant")]
    granularity: Granularity,
    /// Take step K of the granularity wheel instead, from 1 (smallest part) to at most 12 (largest group)
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..=12), help_heading = "What is meant")]
    step: Option<u16>,
    /// Carry masks through this many dense views before deciding
    #[arg(long, value_name = "N", default_value = "0", value_parser = clap::value_parser!(u16).range(0..=1000), help_heading = "Method")]
    views: u16,
    /// What decides in the end [default: graph, or votes if --theta is given]
    #[arg(long, value_enum, help_heading = "Method")]
    method: Option<Method>,
    /// Share of inside votes, 0 to 1, above which a Gaussian is selected [default: 0.5]
    #[arg(long, value_name = "T", value_parser = theta, help_heading = "Method")]
    theta: Option<f32>,
    /// Do not let masks rule out what lies outside them in sight
    #[arg(long, help_heading = "Method")]
    no_presegment: bool,
    /// What happens to Gaussians that reach over the object's edge
    #[arg(long, value_enum, default_value = "keep", help_heading = "Method")]
    boundary: Edge,
    /// Format of the captures written, by its extension
    #[arg(long, value_name = "EXT", default_value = "ply")]
    format: String,
    /// Make no pictures
    #[arg(long)]
    no_pictures: bool,
    /// Neither read nor keep what a capture is prepared to (in the cache folder; SPLAT_CACHE names another)
    #[arg(long)]
    no_cache: bool,
}

fn theta(text: &str) -> Result<f32, String> {
    let v = parse::number(text)?;
    if (0.0..=1.0).contains(&v) { Ok(v) } else { Err("a share of 0 to 1 is needed".to_owned()) }
}

/// A prompt with the view it belongs to: after an `@`, a camera's number, or `CAMERAS#N`; the user's own view if none is named.
#[derive(Clone, Debug, PartialEq)]
struct At<T> {
    what: T,
    view: Option<String>,
}

impl<T: FromStr> FromStr for At<T>
where
    T::Err: std::fmt::Display,
{
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // Names of files may have an `@` too.
        let named = |view: &str| view.contains('#') || view.parse::<usize>().is_ok();
        let (what, view) = match text.rsplit_once('@') {
            Some((what, view)) if named(view) => (what, Some(view.to_owned())),
            _ => (text, None),
        };
        Ok(Self { what: what.parse().map_err(|e: T::Err| e.to_string())?, view })
    }
}

/// `X,Y`: the centre of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pixel(Vec2);

impl FromStr for Pixel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(Self(Vec2::from_slice(&parse::numbers(text, &[2])?).floor() + 0.5))
    }
}

/// `X,Y;X,Y;...`.
#[derive(Clone, Debug, PartialEq)]
struct Stroke(Vec<Vec2>);

impl FromStr for Stroke {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(Self(parse::points(text)?.into_iter().map(|p| p.floor() + 0.5).collect()))
    }
}

/// `X0,Y0,X1,Y1`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rectangle([u32; 4]);

impl FromStr for Rectangle {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let v = parse::numbers(text, &[4])?;
        if v.iter().any(|&x| x < 0.0) {
            return Err("left, top, right, bottom in pixels were expected, counted from 0".to_owned());
        }
        Ok(Self([v[0] as u32, v[1] as u32, v[2] as u32, v[3] as u32]))
    }
}

fn run(options: &Options, matches: &ArgMatches, terminal: &Terminal) -> Result<(), Failure> {
    let began = Instant::now();
    job::writable_format(&options.format)?;
    let settings = options.settings()?;
    let capture = Capture::read_and_tell(&options.file, terminal)?;
    let task = options.task(settings, matches, &capture.cloud)?;
    let job = Job {
        cloud: capture.cloud.clone(),
        file: Some(options.file.display().to_string()),
        task: &task,
        out: &options.out,
        keep: if options.no_cache { Keep::Nothing } else { Keep::InCache },
        began,
    };
    let (report, _) = job::run(&job, terminal)?;
    terminal.report(&report, || report.text())
}

impl Options {
    fn settings(&self) -> Result<Settings, Failure> {
        let method = match (self.method, self.theta) {
            (Some(Method::Graph), Some(_)) => {
                return Err(Failure::usage(
                    "--theta is the threshold of votes; leave it out, or ask for --method votes",
                ));
            }
            (Some(method), _) => method,
            (None, Some(_)) => Method::Votes,
            (None, None) => Method::Graph,
        };
        Ok(Settings {
            granularity: self.granularity,
            step: self.step.map(usize::from),
            method,
            dense_views: usize::from(self.views),
            theta: self.theta.unwrap_or(0.5),
            presegment: !self.no_presegment,
            boundary: self.boundary,
            format: self.format.trim_start_matches('.').to_ascii_lowercase(),
            pictures: !self.no_pictures,
        })
    }

    /// Everything the command line asks for, with files read.
    fn task(&self, settings: Settings, matches: &ArgMatches, cloud: &Cloud) -> Result<Task, Failure> {
        let user = self.camera.view(cloud)?;
        let file = self.cameras.clone().or_else(|| self.camera.camera.as_ref().map(|c| c.path.clone()));
        let mut views =
            Views { file: file.as_deref(), near: self.camera.picture.near, views: vec![user], names: vec![None] };
        let mut prompts: Vec<(usize, Prompt)> = Vec::new();
        let mut add = |index: usize, view: &Option<String>, shape: Shape| {
            prompts.push((index, Prompt { view: views.position(view)?, shape }));
            Ok::<(), Failure>(())
        };
        for (k, at) in in_order(matches, "click", &self.click) {
            add(k, &at.view, Shape::Click(at.what.0, ClickKind::Positive))?;
        }
        for (k, at) in in_order(matches, "negative", &self.negative) {
            add(k, &at.view, Shape::Click(at.what.0, ClickKind::Negative))?;
        }
        for (k, at) in in_order(matches, "scribble", &self.scribble) {
            add(k, &at.view, Shape::Scribble(at.what.0.clone()))?;
        }
        for (k, at) in in_order(matches, "rectangle", &self.rectangle) {
            add(k, &at.view, Shape::Box(at.what.0))?;
        }
        for (k, at) in in_order(matches, "mask", &self.mask) {
            add(k, &at.view, Shape::Mask(picture::read_mask(&at.what)?))?;
        }
        prompts.sort_by_key(|p| p.0);
        let survey = views.training()?;
        let survey_given = !survey.is_empty();
        let mut task = Task {
            views: views.views,
            survey,
            survey_given,
            prompts: prompts.into_iter().map(|p| p.1).collect(),
            settings,
        };
        if !survey_given {
            task.survey = survey_of(cloud, &self.camera);
            task.survey.push(task.views[0]);
        }
        Ok(task)
    }
}

fn in_order<'a, T>(matches: &ArgMatches, name: &str, values: &'a [T]) -> impl Iterator<Item = (usize, &'a T)> {
    let indices: Vec<usize> = matches.indices_of(name).into_iter().flatten().collect();
    indices.into_iter().zip(values)
}

/// The views that prompts name, each once.
struct Views<'a> {
    file: Option<&'a Path>,
    near: Option<f32>,
    views: Vec<View>,
    names: Vec<Option<String>>,
}

impl Views<'_> {
    fn position(&mut self, name: &Option<String>) -> Result<usize, Failure> {
        if let Some(k) = self.names.iter().position(|n| n == name) {
            return Ok(k);
        }
        let text = name.clone().unwrap_or_default();
        let choice: CameraChoice = match (text.contains('#'), self.file) {
            (true, _) => text.parse().map_err(Failure::Usage)?,
            (false, Some(file)) => CameraChoice { path: file.to_path_buf(), which: Some(text.clone()) },
            (false, None) => {
                return Err(Failure::usage(format!(
                    "@{text} names a camera, but no camera file is given; add --cameras CAMERAS"
                )));
            }
        };
        let picture = camera::PictureOptions { near: self.near, ..camera::PictureOptions::default() };
        // The capture matters for orbits only.
        let view = camera::view(&Standpoint::Camera(choice), &picture, &Cloud::default())?;
        self.views.push(view);
        self.names.push(name.clone());
        Ok(self.views.len() - 1)
    }

    /// The training views; empty without a camera file.
    fn training(&self) -> Result<Vec<View>, Failure> {
        let Some(file) = self.file else { return Ok(Vec::new()) };
        let mut views: Vec<View> = splat_io::cameras::read(file)?.views.into_iter().map(|v| v.view).collect();
        if views.is_empty() {
            return Err(Failure::failed(format!("the camera file has no cameras; name another: {}", file.display())));
        }
        for view in &mut views {
            view.near = self.near.unwrap_or(view.near);
            view.check()?;
        }
        Ok(views)
    }
}

/// Views from all around a capture.
fn survey_of(cloud: &Cloud, options: &CameraOptions) -> Vec<View> {
    let up = options.picture.up.unwrap_or_else(|| camera::up_of(cloud));
    let turn = std::f32::consts::TAU / RING as f32;
    let view = |ring: usize, k: usize| {
        // The upper ring stands between the views of the lower one.
        let yaw = turn * (k as f32 + 0.5 * ring as f32);
        let orbit = Orbit { yaw, pitch: RING_PITCH[ring].to_radians(), distance: None };
        camera::orbit_view(cloud, &orbit, up, None, RING_SIZE.0, RING_SIZE.1)
    };
    (0..RING_PITCH.len()).flat_map(|ring| (0..RING).map(move |k| (ring, k))).map(|(ring, k)| view(ring, k)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prompt_names_its_view_after_an_at_sign() {
        let plain: At<Pixel> = "10,20".parse().unwrap();
        assert_eq!(plain, At { what: Pixel(Vec2::new(10.5, 20.5)), view: None });
        let there: At<Pixel> = "10,20@7".parse().unwrap();
        assert_eq!(there.view.as_deref(), Some("7"));
        let elsewhere: At<PathBuf> = "a@b.png@other/cameras.json#3".parse().unwrap();
        assert_eq!((elsewhere.what, elsewhere.view.as_deref()), ("a@b.png".into(), Some("other/cameras.json#3")));
        let odd: At<PathBuf> = "a@2.png".parse().unwrap();
        assert_eq!((odd.what, odd.view), ("a@2.png".into(), None));
        assert!("10".parse::<At<Pixel>>().is_err() && "1,2,3,-4".parse::<At<Rectangle>>().is_err());
    }
}
