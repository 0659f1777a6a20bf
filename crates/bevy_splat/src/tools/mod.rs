//! Tools that turn pointer input into selections: rectangle, lasso, brush.
//!
//! A tool says which shape a gesture means and nothing else; the shape goes out as a [`SelectRequest`]
//! like that of any script. Pointers are `bevy_picking`'s, so a mouse, a finger and a test do the same: they write
//! `PointerInput` messages.
//!
//! - [`ActiveTool`]: which tool pointers drive; none at first.
//! - [`ToolMode`]: new, add, subtract or intersect; modifier keys set it: Shift adds, Ctrl subtracts, both intersect.
//! - [`ToolSettings`]: button, brush radius, projection, which entities are meant.
//! - [`Gesture`]: what is being drawn now, for a line on the screen. Escape, or [`CancelGesture`], ends it without a selection.
//!
//! To add a tool is a type and a line:
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_splat::prelude::*;
//! use bevy_splat::select::Shape2d;
//!
//! /// A circle, from its middle outwards.
//! #[derive(Default)]
//! struct Circle;
//!
//! impl SplatTool for Circle {
//!     fn name(&self) -> &'static str {
//!         "circle"
//!     }
//!     fn shape(&self, points: &[Vec2], _: &ToolSettings) -> Option<Shape2d> {
//!         let (first, last) = (*points.first()?, *points.last()?);
//!         Some(Shape2d::Stroke { points: vec![first], radius: first.distance(last) })
//!     }
//! }
//!
//! let mut app = App::new();
//! app.add_plugins(SplatToolsPlugin).add_tool::<Circle>();
//! app.insert_resource(ActiveTool::named("circle"));
//! assert_eq!(app.world().resource::<SplatToolTable>().names(), ["rectangle", "lasso", "brush", "circle"]);
//! ```
//!
//! A tool hears every press over a camera's viewport. Where a window has panels, or another tool of the app has the pointer, keep
//! gestures from starting: `app.configure_sets(PreUpdate, SplatToolSystems.run_if(no_panel_wants_the_pointer))`.

mod brush;
mod gesture;
mod lasso;
mod modifiers;
mod rectangle;
mod settings;
mod table;

pub use brush::Brush;
pub use gesture::{CancelGesture, Gesture, GestureInProgress};
pub use lasso::Lasso;
pub use rectangle::Rectangle;
pub use settings::{ActiveTool, ToolMode, ToolProjection, ToolSettings, ToolTargets};
pub use table::{AddSplatTool, SplatTool, SplatToolTable};

use bevy::app::{App, Plugin, PreUpdate};
use bevy::picking::PickingSystems;
use bevy::picking::pointer::PointerInput;
use bevy::prelude::*;

use crate::select::SelectRequest;

/// The tools' systems, in `PreUpdate` after pointers moved: first the modifier keys, then gestures.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SplatToolSystems;

/// Adds the tools of this crate, and what drives them. What they select is done by
/// [`SplatSelectPlugin`](crate::select::SplatSelectPlugin).
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatToolsPlugin;

impl Plugin for SplatToolsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<ActiveTool>()
            .init_resource::<ToolMode>()
            .init_resource::<ToolSettings>()
            .init_resource::<Gesture>()
            .add_message::<PointerInput>()
            .add_message::<CancelGesture>()
            .add_message::<SelectRequest>()
            .register_type::<(ActiveTool, ToolMode)>()
            .add_tool::<Rectangle>()
            .add_tool::<Lasso>()
            .add_tool::<Brush>()
            .configure_sets(PreUpdate, SplatToolSystems.after(PickingSystems::ProcessInput))
            .add_systems(
                PreUpdate,
                (modifiers::set_mode, modifiers::cancel, gesture::follow).chain().in_set(SplatToolSystems),
            );
    }
}
