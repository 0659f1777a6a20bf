//! `splat orient`: turn a capture so that an object or the floor lies along the axes.

use std::path::PathBuf;

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_core::bounds::robust_bounds;
use splat_core::glam::{Quat, Vec3};
use splat_core::orient::{self, AxisSign, AxisTarget, Floor, FloorSettings};
use splat_core::{Selection, Similarity};
use splat_io::WriteOptions;

use super::Command;
use super::info::{point, short};
use crate::camera::up_of;
use crate::capture::Capture;
use crate::failure::Failure;
use crate::moves;
use crate::parse;
use crate::places::{self, Places};
use crate::terminal::{Terminal, gaussians};

pub(crate) const COMMAND: Command = Command {
    name: "orient",
    about: "Turn a capture: an object along the axes, or a floor or three points level",
    examples: "  splat orient scene.ply --floor -o level.ply\n  \
               splat orient scene.ply --selection table.npy -o straight.ply\n  \
               splat orient scene.ply --selection table.npy --axes x-zy -o straight.ply\n  \
               splat orient scene.ply --selection table_top.npy --floor -o level.ply\n  \
               splat orient scene.ply --points \"0,1,2;1,1.1,2;0.5,1,3\" -o level.ply\n  \
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
    #[arg(long, value_name = "NPY", conflicts_with = "points")]
    selection: Option<PathBuf>,
    /// The axes that the longest, the middle and the shortest direction are laid along, such as xzy; with + or - before an
    /// axis, which end of it: x-zy [default: the nearest]
    #[arg(long, value_name = "AXES", value_parser = axes, conflicts_with_all = ["floor", "points"], allow_hyphen_values = true)]
    axes: Option<[AxisTarget; 3]>,
    /// Make the plane that everything stands on level, at height 0; with --selection the plane of that surface
    #[arg(long, conflicts_with = "points")]
    floor: bool,
    /// Three places: the first two lie along x, all three level, at height 0: X,Y,Z;X,Y,Z;X,Y,Z or Gaussians ID,ID,ID
    #[arg(long, value_name = "PLACES", value_parser = places::three, allow_hyphen_values = true)]
    points: Option<Places>,
    /// Direction that is up, before and after --floor and --points [default: as the file says, else 0,-1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    up: Option<Vec3>,
    /// With --floor and --points: what was up becomes +y, as most engines have it
    #[arg(long, conflicts_with = "axes")]
    y_up: bool,
    /// Seed of the search for the floor
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
}

fn axes(text: &str) -> Result<[AxisTarget; 3], String> {
    let wrong = || "each of x, y and z once was expected, a sign before it or none, for example xzy or x-zy".to_owned();
    let mut found = Vec::new();
    let mut sign = None;
    for c in text.chars().filter(|&c| c != ',') {
        match (c, sign) {
            ('+', None) => sign = Some(AxisSign::Positive),
            ('-', None) => sign = Some(AxisSign::Negative),
            _ => {
                let axis = "xyz".find(c).ok_or_else(wrong)?;
                found.push(AxisTarget { axis, sign: sign.take() });
            }
        }
    }
    let axes: [AxisTarget; 3] = found.try_into().map_err(|_| wrong())?;
    let mut sorted = axes.map(|t| t.axis);
    sorted.sort_unstable();
    if sorted == [0, 1, 2] && sign.is_none() { Ok(axes) } else { Err(wrong()) }
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
    /// The three points, as they were.
    points: Option<[[f32; 3]; 3]>,
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
        points: None,
        ambiguities: Vec::new(),
    };
    let working = terminal.progress("looking for directions", None);
    let transform = match (&options.points, options.floor, &selection) {
        (Some(places), ..) => pointed(options, &capture, places, &mut report)?,
        (None, true, Some(surface)) => level_surface(options, &capture, surface, &mut report)?,
        (None, true, None) => level(options, &capture, &mut report)?,
        (None, false, _) => straighten(options, &capture, selection.as_ref(), &mut report)?,
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

impl Options {
    /// What is up before, and after.
    fn ups(&self, capture: &Capture) -> (Vec3, Vec3) {
        let up = self.up.unwrap_or_else(|| up_of(&capture.cloud));
        (up, if self.y_up { Vec3::Y } else { up })
    }
}

fn pointed(options: &Options, capture: &Capture, places: &Places, report: &mut Report) -> Result<Similarity, Failure> {
    let (was_up, up) = options.ups(capture);
    let points = places.in_cloud(&capture.cloud)?;
    let [a, b, c] = points[..] else { return Err(Failure::usage("three places are needed")) };
    let found = orient::three_points([a, b, c], was_up, up)?;
    let normal = found.rotation.conjugate() * up;
    if normal.dot(was_up) < 0.2 {
        report.ambiguities.push(format!(
            "the plane of the points is nearly upright: which of its sides is up was decided by --up ({})",
            point(was_up.to_array())
        ));
    }
    report.points = Some([a, b, c].map(|p| p.to_array()));
    Ok(found)
}

fn level(options: &Options, capture: &Capture, report: &mut Report) -> Result<Similarity, Failure> {
    let (was_up, up) = options.ups(capture);
    let settings = FloorSettings { seed: options.seed, ..FloorSettings::default() };
    let floor = orient::floor_plane(&capture.cloud, None, was_up, &settings).ok_or_else(|| {
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
    report.floor = Some(FloorReport::of(&floor));
    Ok(made_level(capture, &floor, was_up, up))
}

fn level_surface(
    options: &Options,
    capture: &Capture,
    surface: &Selection,
    report: &mut Report,
) -> Result<Similarity, Failure> {
    let (was_up, up) = options.ups(capture);
    let settings = FloorSettings { seed: options.seed, ..FloorSettings::default() };
    let found = orient::surface_plane(&capture.cloud, surface, was_up, &settings).ok_or_else(|| {
        Failure::failed("the selected Gaussians lie on no plane; select more of the surface that shall be level")
    })?;
    if found.plane.share < 0.3 {
        report.ambiguities.push(format!(
            "only {:.0} % of what is selected lies on the plane; select less beside the surface",
            100.0 * found.plane.share
        ));
    }
    if let Some((normal, share)) = found.plane.rival {
        report.ambiguities.push(format!(
            "another plane of the selection, facing {}, holds {:.0} % (the one taken {:.0} %)",
            point(normal.to_array()),
            100.0 * share,
            100.0 * found.plane.share
        ));
    }
    if found.side_ambiguous {
        report.ambiguities.push("nothing tells which side of the surface is up; name it with --up".to_owned());
    } else if found.rest.1 > 2.0 * found.rest.0 {
        report.ambiguities.push(format!(
            "{:.0} % of the rest of the capture lies below the surface and {:.0} % above; turn --up round if that is wrong",
            100.0 * found.rest.1,
            100.0 * found.rest.0
        ));
    }
    report.floor = Some(FloorReport::of(&found.plane));
    Ok(made_level(capture, &found.plane, was_up, up))
}

/// The plane level; what was up goes along with `up` where that is another direction.
fn made_level(capture: &Capture, floor: &Floor, was_up: Vec3, up: Vec3) -> Similarity {
    let center = robust_bounds(&capture.cloud).map_or(Vec3::ZERO, |b| b.center);
    let leveled = orient::upright(floor, was_up, center);
    if was_up == up {
        return leveled;
    }
    let rotation = Quat::from_rotation_arc(was_up, up);
    Similarity { rotation, ..Similarity::IDENTITY }.compose(&leveled)
}

fn straighten(
    options: &Options,
    capture: &Capture,
    selection: Option<&Selection>,
    report: &mut Report,
) -> Result<Similarity, Failure> {
    let axes = orient::principal_axes(&capture.cloud, selection).ok_or_else(|| {
        Failure::failed("no Gaussian can be drawn, so there are no directions; `splat check` tells why")
    })?;
    // Open signs leave round directions where they are; named ones do not.
    let named = options.axes.is_some_and(|targets| targets.iter().all(|t| t.sign.is_some()));
    let left = if named { "which way they point is chance" } else { "the others are as near as can be" };
    match (axes.first_two_ambiguous(), axes.last_two_ambiguous()) {
        (true, true) if named => report.ambiguities.push(format!("it spreads alike in all directions: {left}")),
        (true, true) => report.ambiguities.push("it spreads alike in all directions: nothing was turned".to_owned()),
        (true, false) => report
            .ambiguities
            .push(format!("it is round about its shortest direction: only that one was laid straight, {left}")),
        (false, true) => report
            .ambiguities
            .push(format!("it is round about its longest direction: only that one was laid straight, {left}")),
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
    let Some(targets) = options.axes else { return Ok(orient::align(&axes, None)) };
    let found = orient::align_to(&axes, targets).map_err(|e| Failure::usage(format!("--axes: {e}")))?;
    if let Some(rival) = found.rival {
        report.ambiguities.push(format!(
            "a turn by {} degrees lays the axes as well and is about as near (the one taken {}); name ends with + and -",
            short(rival.to_degrees()),
            short(found.angle.to_degrees())
        ));
    }
    Ok(found.transform)
}

impl FloorReport {
    fn of(floor: &Floor) -> Self {
        Self { normal: floor.normal.to_array(), offset: floor.offset, share: floor.share, below: floor.below }
    }
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
        if let Some([a, b, c]) = self.points {
            lines.push(format!("points      {}, {} and {}", point(a), point(b), point(c)));
        }
        lines.push(format!("turned by   {} degrees", short(self.angle_degrees)));
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_a_permutation_with_signs_or_without() {
        let said = |text: &str| axes(text).map(|found| found.map(|t| (t.axis, t.sign)));
        let (plus, minus) = (Some(AxisSign::Positive), Some(AxisSign::Negative));
        assert_eq!(said("xzy"), Ok([(0, None), (2, None), (1, None)]));
        assert_eq!(said("z,-x,+y"), Ok([(2, None), (0, minus), (1, plus)]));
        assert_eq!(said("x-zy"), Ok([(0, None), (2, minus), (1, None)]));
        assert_eq!(said("-x-z-y"), Ok([(0, minus), (2, minus), (1, minus)]));
        for bad in ["", "xy", "xxy", "xyzx", "abc", "x--zy", "xzy-", "x+-zy", "-"] {
            assert!(axes(bad).is_err(), "{bad}");
        }
    }
}
