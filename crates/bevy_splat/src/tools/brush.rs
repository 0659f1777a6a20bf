//! [`Brush`]: a round brush over something.

use bevy::prelude::*;

use super::{SplatTool, ToolSettings};
use crate::select::Shape2d;

/// What a disc of [`ToolSettings::brush_radius`] covers along the pointer's way; a press alone is a dab.
#[derive(Clone, Copy, Debug, Default)]
pub struct Brush;

impl SplatTool for Brush {
    fn name(&self) -> &'static str {
        "brush"
    }

    fn shape(&self, points: &[Vec2], settings: &ToolSettings) -> Option<Shape2d> {
        (!points.is_empty()).then(|| Shape2d::Stroke { points: points.to_vec(), radius: settings.brush_radius })
    }
}
