//! Messages that change what is selected.
//!
//! All that selects, whether a tool, a script, a test or a segmentation, writes a [`SelectRequest`]; nothing else in this
//! crate writes a [`SplatSelection`](crate::SplatSelection). What came of it is a [`SelectionChanged`] with the difference, which
//! is its own inverse and so all that an undo history needs, or a [`SelectFailed`].
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_splat::prelude::*;
//!
//! /// Adds everything that is nearly transparent.
//! fn select_haze(captures: Query<Entity, With<Splats>>, mut requests: MessageWriter<SelectRequest>) {
//!     for entity in &captures {
//!         let by = SelectBy::Criterion(Criterion::Opacity(0.0..=0.1));
//!         requests.write(SelectRequest { entity, mode: SelectMode::Add, by });
//!     }
//! }
//! # bevy::ecs::system::assert_is_system(select_haze);
//! ```
//!
//! Hidden and locked Gaussians, and those of the cloud that are not the entity's own, are never added: the set of a request is
//! without them before it is combined.
//!
//! [`MakePart`] turns what is selected into a named part.

mod apply;
mod by;
mod make_part;
mod request;
mod shape;

pub use make_part::{MakePart, MakePartError, PartMade, SplatMakePartCommands, make_part};
pub use request::{SelectBy, SelectError, SelectFailed, SelectRequest, SelectionChanged};
pub use shape::Shape2d;
pub use splat_core::{Criterion, Likeness};
pub use splat_segment::project::{DepthTolerance, Footprint};

use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::CameraUpdateSystems;
use bevy::prelude::*;

use crate::asset::SplatFitSystems;
use crate::components::SplatTintSystems;

/// When [`SelectRequest`]s and [`MakePart`]s are done: in `PostUpdate`, so that what is asked for in `Update` shows in the same
/// frame.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SplatSelectSystems;

/// Adds the messages [`SelectRequest`], [`SelectionChanged`], [`SelectFailed`], [`MakePart`] and [`PartMade`], and what does them.
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatSelectPlugin;

impl Plugin for SplatSelectPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<crate::SplatCloud>()
            .add_message::<SelectRequest>()
            .add_message::<SelectionChanged>()
            .add_message::<SelectFailed>()
            .add_message::<MakePart>()
            .add_message::<PartMade>()
            .configure_sets(
                PostUpdate,
                SplatSelectSystems
                    .after(TransformSystems::Propagate)
                    .after(CameraUpdateSystems)
                    .after(SplatFitSystems)
                    .before(SplatTintSystems),
            )
            .add_systems(
                PostUpdate,
                (apply::apply, make_part::answer.run_if(on_message::<MakePart>)).chain().in_set(SplatSelectSystems),
            );
    }
}
