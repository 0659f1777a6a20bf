//! What a user sets about tools.

use std::borrow::Cow;

use bevy::picking::pointer::PointerButton;
use bevy::prelude::*;
use splat_core::SelectMode;
use splat_segment::project::{DepthTolerance, Footprint};

use super::SplatTool;

/// The tool that pointers drive. None, the default: gestures do nothing.
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct ActiveTool(pub Option<Cow<'static, str>>);

impl ActiveTool {
    /// A tool by its name.
    pub fn named(name: impl Into<Cow<'static, str>>) -> Self {
        Self(Some(name.into()))
    }

    /// A tool by its type.
    pub fn of<T: SplatTool + Default>() -> Self {
        Self::named(T::default().name())
    }
}

/// How the next gesture's set combines with what is selected. Set by modifier keys where the app has a keyboard.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct ToolMode(pub SelectMode);

/// How a tool's shape becomes a set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolProjection {
    /// Everything the shape sweeps through, front to back.
    Frustum(Footprint),
    /// What lies at the depth that is seen.
    Depth(Footprint, DepthTolerance),
    /// Exactly the Gaussians that are hit.
    Surface,
}

impl Default for ToolProjection {
    fn default() -> Self {
        Self::Frustum(Footprint::default())
    }
}

/// Which captures a gesture is for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ToolTargets {
    /// All that the camera sees.
    #[default]
    InView,
    /// These.
    These(Vec<Entity>),
}

/// What all tools share.
#[derive(Resource, Clone, Debug, PartialEq)]
pub struct ToolSettings {
    /// The button that draws; a finger is the primary one.
    pub button: PointerButton,
    /// Radius of the brush, in physical pixels.
    pub brush_radius: f32,
    /// How a shape becomes a set.
    pub projection: ToolProjection,
    /// Which captures are meant.
    pub targets: ToolTargets,
}

impl Default for ToolSettings {
    fn default() -> Self {
        Self {
            button: PointerButton::Primary,
            brush_radius: 24.0,
            projection: ToolProjection::default(),
            targets: ToolTargets::default(),
        }
    }
}
