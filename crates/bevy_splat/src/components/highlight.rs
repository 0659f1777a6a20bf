//! [`SplatHighlight`]: how selected Gaussians and parts are shown.

use bevy::prelude::*;

/// How the selection and the parts of a [`Splats`](crate::Splats) entity are shown. Without it, as
/// [`DefaultSplatHighlight`] says.
///
/// The outline around the selection is the camera's: [`SplatCamera::outline`](crate::render::SplatCamera::outline).
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct SplatHighlight {
    /// Colour that is mixed over selected Gaussians.
    pub selection_color: Srgba,
    /// How much of it, 0 to 1; 0 leaves their own colour.
    pub selection_strength: f32,
    /// How much of a part's own colour is mixed over its Gaussians, 0 to 1; 0, the default, leaves theirs.
    pub part_strength: f32,
}

impl Default for SplatHighlight {
    fn default() -> Self {
        Self { selection_color: Srgba::rgb(1.0, 0.72, 0.1), selection_strength: 0.55, part_strength: 0.0 }
    }
}

impl SplatHighlight {
    /// Shows neither selection nor parts.
    pub const OFF: Self = Self { selection_color: Srgba::BLACK, selection_strength: 0.0, part_strength: 0.0 };
}

/// How the selection and the parts are shown of entities that have no [`SplatHighlight`] of their own.
#[derive(Resource, Clone, Copy, Debug, Default, Deref, DerefMut, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct DefaultSplatHighlight(pub SplatHighlight);
