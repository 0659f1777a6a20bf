//! [`Task`]: everything that decides which Gaussians come out, whoever asked for it.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use splat_core::glam::Vec2;
use splat_core::{Mask2d, View};
use splat_segment::graph::clicks::ClickKind;

use crate::failure::Failure;

/// Inputs and settings of one segmentation. The same task over the same capture gives the same bits.
#[derive(Clone, Debug)]
pub(crate) struct Task {
    /// Views that prompts refer to by position; the first is the user's own.
    pub(crate) views: Vec<View>,
    /// Views that the capture is taken apart by, and from which dense views are chosen.
    pub(crate) survey: Vec<View>,
    /// Whether the survey was given (training cameras) or made up about the capture.
    pub(crate) survey_given: bool,
    /// In the order given.
    pub(crate) prompts: Vec<Prompt>,
    /// How they are answered.
    pub(crate) settings: Settings,
}

/// What the user points at, in one of the task's views.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Prompt {
    /// Position in [`Task::views`].
    pub(crate) view: usize,
    /// What is pointed at.
    pub(crate) shape: Shape,
}

/// A click, a box, a stroke or a mask.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    /// Centre of the clicked pixel.
    Click(Vec2, ClickKind),
    /// Left, top, right, bottom, inclusive.
    Box([u32; 4]),
    /// Points of a stroke over the object.
    Scribble(Vec<Vec2>),
    /// Pixels of the object.
    Mask(Mask2d),
}

/// How prompts are answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Settings {
    /// How much around the click is meant.
    pub(crate) granularity: Granularity,
    /// A step of the granularity wheel instead, counted from 1.
    pub(crate) step: Option<usize>,
    /// What decides in the end.
    pub(crate) method: Method,
    /// Dense views that a mask is carried through; 0 for none.
    pub(crate) dense_views: usize,
    /// Share of inside votes from which on a Gaussian is selected, for [`Method::Votes`].
    pub(crate) theta: f32,
    /// Whether masks rule out what lies outside them in sight.
    pub(crate) presegment: bool,
    /// What happens to Gaussians on the edge.
    pub(crate) boundary: Edge,
    /// Extension of the captures written, as `splat convert` knows it.
    pub(crate) format: String,
    /// Whether pictures are made.
    pub(crate) pictures: bool,
}

/// How much around a click is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Granularity {
    /// A clearly smaller piece
    Part,
    /// The most likely thing
    #[default]
    Object,
    /// A clearly larger thing that it belongs to
    Group,
}

/// What decides in the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Method {
    /// The capture's own structure: also what no view shows is decided
    #[default]
    Graph,
    /// The share of inside votes of masks, against --theta
    Votes,
}

/// What happens to Gaussians that reach over the object's edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Edge {
    /// They stay whole, on the side the selection says
    #[default]
    Keep,
    /// They are cut into pieces that go to either side
    Split,
    /// They are shortened to their own side
    Trim,
}

impl Task {
    /// Whether any prompt is a mask.
    pub(crate) fn has_mask(&self) -> bool {
        self.prompts.iter().any(|p| matches!(p.shape, Shape::Mask(_)))
    }

    /// Checks that the prompts lie in their pictures and fit together.
    ///
    /// # Errors
    /// [`Failure`] in one sentence.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        for prompt in &self.prompts {
            let view = &self.views[prompt.view];
            let size = format!("{}x{}", view.width, view.height);
            let inside = |at: Vec2, what: &str| {
                if view.contains(at) {
                    return Ok(());
                }
                Err(Failure::failed(format!(
                    "the {what} at {},{} lies outside the picture of {size} pixels; pixels count from 0,0 at the top left",
                    at.x.floor(),
                    at.y.floor()
                )))
            };
            match &prompt.shape {
                Shape::Click(at, _) => inside(*at, "click")?,
                Shape::Scribble(points) => points.iter().try_for_each(|at| inside(*at, "stroke"))?,
                Shape::Box([x0, y0, x1, y1]) => {
                    if x0 > x1 || y0 > y1 || *x1 >= view.width || *y1 >= view.height {
                        return Err(Failure::failed(format!(
                            "the box {x0},{y0},{x1},{y1} does not lie in the picture of {size} pixels; it is left, top, right, \
                             bottom, counted from 0"
                        )));
                    }
                }
                Shape::Mask(mask) => {
                    if (mask.width(), mask.height()) != (view.width, view.height) {
                        return Err(Failure::failed(format!(
                            "the mask has {}x{} pixels but its view {size}; scale the mask, or name the view it was made for: \
                             --mask PNG@CAMERAS#N",
                            mask.width(),
                            mask.height()
                        )));
                    }
                    if mask.count() == 0 {
                        return Err(Failure::failed(
                            "the mask is empty: no pixel is at least half white; paint the object white on black",
                        ));
                    }
                }
            }
        }
        self.check_together()
    }

    fn check_together(&self) -> Result<(), Failure> {
        let count = |wanted: fn(&Shape) -> bool| self.prompts.iter().filter(|p| wanted(&p.shape)).count();
        let boxes = count(|s| matches!(s, Shape::Box(_)));
        let starts =
            boxes + count(|s| matches!(s, Shape::Click(_, ClickKind::Positive) | Shape::Scribble(_) | Shape::Mask(_)));
        if starts == 0 {
            return Err(Failure::usage(
                "nothing says what is wanted; point at it by --click X,Y, --box X0,Y0,X1,Y1 or --mask PNG",
            ));
        }
        if boxes > 1 {
            return Err(Failure::usage("one box says where the object is; correct it by clicks, not by another box"));
        }
        if self.has_mask() {
            if boxes > 0 {
                return Err(Failure::usage("a mask says already what a box would; leave one of them out"));
            }
            if self.settings.granularity != Granularity::Object || self.settings.step.is_some() {
                return Err(Failure::usage(
                    "--granularity and --step are for a click or a box; a mask says itself how much is meant",
                ));
            }
        }
        Ok(())
    }
}
