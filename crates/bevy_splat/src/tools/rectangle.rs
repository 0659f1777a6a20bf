//! [`Rectangle`]: from corner to corner.

use bevy::prelude::*;

use super::{SplatTool, ToolSettings};
use crate::select::Shape2d;

/// The rectangle between the press and the pointer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rectangle;

impl SplatTool for Rectangle {
    fn name(&self) -> &'static str {
        "rectangle"
    }

    fn shape(&self, points: &[Vec2], _: &ToolSettings) -> Option<Shape2d> {
        let (first, last) = (*points.first()?, *points.last()?);
        (first != last).then_some(Shape2d::Rect(first, last))
    }
}
