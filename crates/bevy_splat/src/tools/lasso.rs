//! [`Lasso`]: a free line around something.

use bevy::prelude::*;

use super::{SplatTool, ToolSettings};
use crate::select::Shape2d;

/// What the pointer's way encloses, closed by a straight line.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lasso;

impl SplatTool for Lasso {
    fn name(&self) -> &'static str {
        "lasso"
    }

    fn shape(&self, points: &[Vec2], _: &ToolSettings) -> Option<Shape2d> {
        (points.len() >= 3).then(|| Shape2d::Polygon(points.to_vec()))
    }
}
