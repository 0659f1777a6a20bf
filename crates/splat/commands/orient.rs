//! `splat orient`: turn a capture so that an object or the floor lies along the axes.

use std::path::PathBuf;

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_core::Similarity;
use splat_core::bounds::robust_bounds;
use splat_core::glam::Vec3;
use splat_core::orient::{self, FloorSettings};
use splat_io::WriteOptions;

use super::Command;
use super::info::{point, short};
use crate::camera::up_of;
use crate::capture::Capture;
use crate::failure::Failure;
use crate::moves;
use crate::parse;
use crate::terminal::{Terminal, gaussians};

pub(crate) const COMMAND: Command = Command {
    name: "orient",
    about: "Turn a capture: an object along the axes, or the floor level",
    examples: "  splat orient scene.ply --floor -o level.ply\n  \
               splat orient scene.ply --selection table.npy -o straight.ply\n  \
               splat orient scene.ply --selection table.npy --axes xzy -o straight.ply\n  \
               splat orient scene.ply --floor --json > turn.json\n  \
               splat cameras cameras.json level.json --transform turn.json",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// The capture
    file: PathBuf,
    /// Write the turned capture here; without it the transform is only told
    #[arg(short, long = "out", value_name = "OUT")]
    out: Option<PathBuf>,
    /// Look only at the Gaussians selected in this .npy file; everything is turned
    #[arg(long, value_name = "NPY")]
    selection: Option<PathBuf>,
    /// The axes that the longest, the middle and the shortest direction are laid along [default: the nearest]
    #[arg(long, value_name = "xyz", value_parser = axes, conflicts_with = "floor")]
    axes: Option<Axes>,
    /// Make the plane that everything stands on level, at height 0
    #[arg(long)]
    floor: bool,
    /// Direction that becomes up with --floor [default: as the file says, else 0,-1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    up: Option<Vec3>,
    /// Seed of the search for the floor
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
}

/// A world axis (0 x, 1 y, 2 z) per principal axis.
type Axes = [usize; 3];

fn axes(text: &str) -> Result<Axes, String> {
    let wrong = || "each of x, y and z once was expected, for example xzy".to_owned();
    let found: Option<Vec<usize>> = text.chars().filter(|&c| c != ',').map(|c| "xyz".find(c)).collect();
    let axes: Axes = found.and_then(|f| f.try_into().ok()).ok_or_else(wrong)?;
    let mut sorted = axes;
    sorted.sort_unstable();
    if sorted == [0, 1, 2] { Ok(axes) } else { Err(wrong()) }
}

#[derive(Serialize)]
struct Report {
    file: String,
    output: Option<String>,
    /// Rows, for column vectors: from the input to the turned capture.
    matrix: [[f32; 4]; 4],
    angle_degrees: f32,
    principal: Option<Principal>,
    floor: Option<FloorReport>,
    /// Sentences about what the Gaussians leave open.
    ambiguities: Vec<String>,
}

#[derive(Serialize)]
struct Principal {
    center: [f32; 3],
    axes: [[f32; 3]; 3],
    /// Standard deviations along them, in scene units.
    deviations: [f32; 3],
    flatness: f32,
    gaussians: usize,
}

#[derive(Serialize)]
struct FloorReport {
    normal: [f32; 3],
    offset: f32,
    share: f32,
    below: f32,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let capture = Capture::read_and_tell(&options.file, terminal)?;
    let selection = options.selection.as_deref().map(|path| capture.selection(path)).transpose()?;
    if selection.as_ref().is_some_and(|s| s.count() == 0) {
        return Err(Failure::failed("the selection is empty; select the object that shall lie straight"));
    }
    let mut report = Report {
        file: options.file.display().to_string(),
        output: options.out.as_ref().map(|p| p.display().to_string()),
        matrix: moves::matrix(&Similarity::IDENTITY),
        angle_degrees: 0.0,
        principal: None,
        floor: None,
        ambiguities: Vec::new(),
    };
    let working = terminal.progress("looking for directions", None);
    let transform = if options.floor {
        level(options, &capture, selection.as_ref(), &mut report)?
    } else {
        straighten(options, &capture, selection.as_ref(), &mut report)?
    };
    drop(working);
    report.matrix = moves::matrix(&transform);
    report.angle_degrees = 2.0 * transform.rotation.w.abs().min(1.0).acos().to_degrees();
    for sentence in &report.ambiguities {
        terminal.note(sentence);
    }
    if let Some(out) = &options.out {
        let written = splat_io::write(out, &capture.cloud.transformed(&transform), &WriteOptions::default())?;
        for loss in &written.losses {
            terminal.note(loss);
        }
        terminal.done(format!("wrote {}: {}", gaussians(capture.cloud.len()), out.display()));
    }
    terminal.report(&report, || report.text())
}

fn level(
    options: &Options,
    capture: &Capture,
    selection: Option<&splat_core::Selection>,
    report: &mut Report,
) -> Result<Similarity, Failure> {
    let up = options.up.unwrap_or_else(|| up_of(&capture.cloud));
    let settings = FloorSettings { seed: options.seed, ..FloorSettings::default() };
    let floor = orient::floor_plane(&capture.cloud, selection, up, &settings).ok_or_else(|| {
        Failure::failed(
            "no plane has the capture on one side; select the floor and name it with --selection, or turn the capture with \
             `splat convert --transform`",
        )
    })?;
    if let Some((normal, share)) = floor.rival {
        report.ambiguities.push(format!(
            "a plane facing {} holds {:.0} % (the one taken {:.0} %); name the direction that is up with --up if that is the floor",
            point(normal.to_array()),
            100.0 * share,
            100.0 * floor.share
        ));
    }
    let center = robust_bounds(&capture.cloud).map_or(Vec3::ZERO, |b| b.center);
    report.floor = Some(FloorReport {
        normal: floor.normal.to_array(),
        offset: floor.offset,
        share: floor.share,
        below: floor.below,
    });
    Ok(orient::upright(&floor, up, center))
}

fn straighten(
    options: &Options,
    capture: &Capture,
    selection: Option<&splat_core::Selection>,
    report: &mut Report,
) -> Result<Similarity, Failure> {
    let axes = orient::principal_axes(&capture.cloud, selection).ok_or_else(|| {
        Failure::failed("no Gaussian can be drawn, so there are no directions; `splat check` tells why")
    })?;
    match (axes.first_two_ambiguous(), axes.last_two_ambiguous()) {
        (true, true) => report.ambiguities.push("it spreads alike in all directions: nothing was turned".to_owned()),
        (true, false) => report.ambiguities.push(
            "it is round about its shortest direction: only that one was laid straight, the others are as near as can be"
                .to_owned(),
        ),
        (false, true) => report.ambiguities.push(
            "it is round about its longest direction: only that one was laid straight, the others are as near as can be"
                .to_owned(),
        ),
        (false, false) if axes.flatness() > 0.5 => {
            report.ambiguities.push(format!(
                "it has no flat direction (the shortest variance is {:.0} % of the middle one): which side is up is a guess",
                100.0 * axes.flatness()
            ));
        }
        (false, false) => {}
    }
    report.principal = Some(Principal {
        center: axes.center.to_array(),
        axes: axes.axes.map(|a| a.to_array()),
        deviations: axes.variances.map(f32::sqrt),
        flatness: axes.flatness(),
        gaussians: axes.count,
    });
    Ok(orient::align(&axes, options.axes))
}

impl Report {
    fn text(&self) -> String {
        let mut lines = Vec::new();
        if let Some(p) = &self.principal {
            lines.push(format!("center      {}, {} counted", point(p.center), gaussians(p.gaussians)));
            for (name, (axis, deviation)) in
                ["longest", "middle", "shortest"].iter().zip(p.axes.iter().zip(p.deviations))
            {
                lines.push(format!("{name:<12}{} with deviation {}", point(*axis), short(deviation)));
            }
        }
        if let Some(f) = &self.floor {
            lines.push(format!(
                "floor       facing {}, {:.0} % of the surface on it, {:.1} % below",
                point(f.normal),
                100.0 * f.share,
                100.0 * f.below
            ));
        }
        lines.push(format!("turned by   {} degrees", short(self.angle_degrees)));
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::axes;

    #[test]
    fn axes_are_a_permutation() {
        assert_eq!(axes("xzy"), Ok([0, 2, 1]));
        assert_eq!(axes("z,x,y"), Ok([2, 0, 1]));
        for bad in ["", "xy", "xxy", "xyzx", "abc"] {
            assert!(axes(bad).is_err(), "{bad}");
        }
    }
}
