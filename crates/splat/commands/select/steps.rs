//! From options in any order to steps in that order.

use std::path::PathBuf;

use clap::builder::ValueParser;
use clap::{Arg, ArgAction, ArgMatches, Command};
use splat_core::SelectMode;
use splat_segment::project::{DepthTolerance, Footprint, Lift};

use super::shapes::Shape;
use super::values::Filter;
use crate::camera::Standpoint;
use crate::failure::Failure;

/// One step.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// The options it was made from.
    pub(super) text: String,
    /// What it does.
    pub(super) act: Act,
    /// How its set is combined with the selection; `None` for the default.
    pub(super) mode: Option<SelectMode>,
}

/// What a step does.
#[derive(Clone, Debug)]
pub(super) enum Act {
    /// Look from here from now on.
    Stand(Standpoint),
    /// Lift a shape.
    Shape(Shape, Lift),
    /// Take Gaussians by a value.
    Value(Filter),
    /// Add the neighbours, so many times.
    Grow(u32),
    /// Take the border away, so many times.
    Shrink(u32),
    /// Keep the largest connected piece.
    Largest,
    /// Select what is not selected.
    Invert,
}

/// One option of the command line.
#[derive(Clone, Debug)]
enum Item {
    Act(Act),
    Project(Projected),
    Inside(Footprint),
    Mode(SelectMode),
}

#[derive(Clone, Copy, Debug)]
enum Projected {
    Frustum,
    Depth,
    Surface,
}

/// An option whose place among the others counts: name, name of its value (none for a flag), help, parser.
type Ordered = (&'static str, &'static str, &'static str, fn(&str) -> Result<Item, String>);

/// Every such option.
static ORDERED: &[Ordered] = &[
    ("camera", "CAMERAS#N", "The shapes that follow lie over camera N of a camera file", |t| {
        Ok(Item::Act(Act::Stand(Standpoint::Camera(t.parse()?))))
    }),
    ("orbit", "YAW,PITCH[,DIST]", "The shapes that follow lie over this view of the middle [default: 30,20]", |t| {
        Ok(Item::Act(Act::Stand(Standpoint::Orbit(t.parse()?))))
    }),
    ("rect", "X0,Y0,X1,Y1", "A rectangle of pixels, both corners included", |t| Shape::rect(t).map(shape)),
    ("polygon", "X,Y;X,Y;...", "The inside of a polygon, in pixels", |t| Shape::polygon(t).map(shape)),
    ("brush", "X,Y;...:R", "A stroke with a round brush of radius R pixels", |t| Shape::brush(t).map(shape)),
    ("mask", "PNG", "The white pixels of a picture of the view's size", |t| Ok(shape(Shape::Mask(PathBuf::from(t))))),
    (
        "value",
        "TEST",
        "Gaussians by a value, for example \"opacity<0.1\", with < <= > >= = or !=: opacity, scale, volume, x, y, z, \
         red, green, blue, radius (from the middle) or an extra property",
        |t| Ok(Item::Act(Act::Value(t.parse()?))),
    ),
    (
        "project",
        "HOW",
        "How the shape before becomes Gaussians: frustum (all behind it), depth (those at the depth that is seen), \
      surface (those hit first) [default: frustum]",
        |t| match t {
            "frustum" => Ok(Item::Project(Projected::Frustum)),
            "depth" => Ok(Item::Project(Projected::Depth)),
            "surface" => Ok(Item::Project(Projected::Surface)),
            _ => Err("frustum, depth or surface was expected".to_owned()),
        },
    ),
    (
        "inside",
        "WHAT",
        "What must lie inside the shape before: center, any (of the ellipse), most (of what is seen) \
      [default: center]",
        |t| match t {
            "center" => Ok(Item::Inside(Footprint::Center)),
            "any" => Ok(Item::Inside(Footprint::Ellipse)),
            "most" => Ok(Item::Inside(Footprint::Weight(0.5))),
            _ => Err("center, any or most was expected".to_owned()),
        },
    ),
    (
        "mode",
        "MODE",
        "What the shape or value before does to the selection: new, add, subtract, intersect [default: new for the \
      first, add for the others]",
        |t| match t {
            "new" => Ok(Item::Mode(SelectMode::New)),
            "add" => Ok(Item::Mode(SelectMode::Add)),
            "subtract" => Ok(Item::Mode(SelectMode::Subtract)),
            "intersect" => Ok(Item::Mode(SelectMode::Intersect)),
            _ => Err("new, add, subtract or intersect was expected".to_owned()),
        },
    ),
    ("grow", "N", "Add the nearest neighbours, N times", |t| Ok(Item::Act(Act::Grow(times(t)?)))),
    ("shrink", "N", "Take away what touches the unselected, N times", |t| Ok(Item::Act(Act::Shrink(times(t)?)))),
    ("largest", "", "Keep only the largest connected piece", |_| Ok(Item::Act(Act::Largest))),
    ("invert", "", "Select what is not selected", |_| Ok(Item::Act(Act::Invert))),
];

fn shape(shape: Shape) -> Item {
    Item::Act(Act::Shape(shape, Lift::Frustum(Footprint::Center)))
}

fn times(text: &str) -> Result<u32, String> {
    let times = text.parse().ok().filter(|n| (1..=1000).contains(n));
    times.ok_or_else(|| "a whole number from 1 to 1000 was expected".to_owned())
}

/// Adds the options whose order counts.
pub(super) fn arguments(command: Command) -> Command {
    ORDERED.iter().fold(command, |command, &(name, value, help, parse)| {
        let parser: ValueParser = ValueParser::new(move |t: &str| parse(t).map(|item| (t.to_owned(), item)));
        let arg = Arg::new(name)
            .long(name)
            .help(help)
            .help_heading("Steps, done in the order in which they are given")
            .action(ArgAction::Append)
            .value_parser(parser);
        command.arg(if value.is_empty() {
            arg.num_args(0).default_missing_value("")
        } else {
            // Coordinates may be negative.
            arg.value_name(value).allow_hyphen_values(true)
        })
    })
}

/// The steps, in order.
///
/// # Errors
/// [`Failure::Usage`] if an option belongs to a shape and there is none before it.
pub(super) fn in_order(matches: &ArgMatches) -> Result<Vec<Step>, Failure> {
    let mut items: Vec<(usize, &'static str, &(String, Item))> = Vec::new();
    for &(name, ..) in ORDERED {
        let values = matches.get_many::<(String, Item)>(name).into_iter().flatten();
        items.extend(matches.indices_of(name).into_iter().flatten().zip(values).map(|(at, v)| (at, name, v)));
    }
    items.sort_by_key(|item| item.0);
    let mut steps: Vec<Step> = Vec::new();
    for (_, name, (text, item)) in items {
        let text = format!("--{name} {text}").trim_end().to_owned();
        if let Item::Act(act) = item {
            steps.push(Step { text, act: act.clone(), mode: None });
            continue;
        }
        let wrong = |wanted: &str| Failure::usage(format!("{text} belongs behind {wanted}; put it there"));
        let Some(step) = steps.last_mut() else { return Err(wrong("a shape")) };
        match (item, &mut step.act) {
            (Item::Mode(mode), Act::Shape(..) | Act::Value(_)) => step.mode = Some(*mode),
            (Item::Mode(_), _) => return Err(wrong("a shape or a value")),
            (Item::Project(projected), Act::Shape(_, lift)) => *lift = with_projection(*lift, *projected),
            (Item::Inside(footprint), Act::Shape(_, lift)) => *lift = with_footprint(*lift, *footprint),
            _ => return Err(wrong("a shape")),
        }
        step.text = format!("{} {text}", step.text);
    }
    Ok(steps)
}

fn with_projection(lift: Lift, projected: Projected) -> Lift {
    let footprint = match lift {
        Lift::Frustum(f) | Lift::Depth(f, _) => f,
        Lift::Surface(_) => Footprint::Center,
    };
    match projected {
        Projected::Frustum => Lift::Frustum(footprint),
        Projected::Depth => Lift::Depth(footprint, DepthTolerance::default()),
        // Half of the light has been taken away where a surface begins.
        Projected::Surface => Lift::Surface(0.5),
    }
}

fn with_footprint(lift: Lift, footprint: Footprint) -> Lift {
    match lift {
        Lift::Frustum(_) => Lift::Frustum(footprint),
        Lift::Depth(_, tolerance) => Lift::Depth(footprint, tolerance),
        // What is hit first is hit inside: there is no choice.
        Lift::Surface(tau) => Lift::Surface(tau),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(line: &str) -> Result<Vec<Step>, Failure> {
        let command = arguments(Command::new("select"));
        in_order(&command.try_get_matches_from(std::iter::once("select").chain(line.split(' '))).unwrap())
    }

    #[test]
    fn steps_come_in_the_order_of_the_command_line() {
        let line = "--invert --rect 0,0,9,9 --project depth --mode subtract --grow 2 --rect 1,1,2,2 --largest --invert";
        let texts: Vec<String> = steps(line).unwrap().into_iter().map(|s| s.text).collect();
        let wanted = [
            "--invert",
            "--rect 0,0,9,9 --project depth --mode subtract",
            "--grow 2",
            "--rect 1,1,2,2",
            "--largest",
            "--invert",
        ];
        assert_eq!(texts, wanted);
    }

    #[test]
    fn what_follows_a_shape_changes_that_shape_alone() {
        let steps = steps("--rect 0,0,9,9 --inside any --project depth --rect 0,0,1,1 --mode intersect").unwrap();
        assert!(matches!(steps[0].act, Act::Shape(_, Lift::Depth(Footprint::Ellipse, _))));
        assert!(matches!(steps[1].act, Act::Shape(_, Lift::Frustum(Footprint::Center))));
        assert_eq!((steps[0].mode, steps[1].mode), (None, Some(SelectMode::Intersect)));
    }

    #[test]
    fn options_without_their_shape_are_refused() {
        for line in
            ["--mode add", "--grow 1 --mode add", "--value opacity<1 --project depth", "--orbit 0,0 --project depth"]
        {
            assert!(matches!(steps(line), Err(Failure::Usage(_))), "{line}");
        }
    }
}
