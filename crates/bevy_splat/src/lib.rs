//! Draw, pick, select and take apart 3D Gaussian splat captures in Bevy.
//!
//! # A first scene
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_splat::prelude::*;
//!
//! fn main() -> AppExit {
//!     App::new().add_plugins((DefaultPlugins, BevySplatPlugins)).add_systems(Startup, setup).run()
//! }
//!
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn(Splats(assets.load("room.ply")));
//!     let camera = Transform::from_xyz(0.0, 1.5, 4.0).looking_at(Vec3::ZERO, Vec3::Y);
//!     commands.spawn((Camera3d::default(), camera));
//! }
//! ```
//!
//! `room.ply` lies in the folder `assets`, and may be a file of any format that `splat_io` reads: its content decides.
//!
//! # What there is
//!
//! | where | what |
//! |---|---|
//! | [`Splats`] | the component that shows a capture; turned upright unless it has a `Transform` of its own |
//! | [`asset`] | [`SplatCloud`] from files and from code, saving, settings, hot reload, cameras |
//! | [`components`] | what a capture may have beside it: [`SplatSelection`], [`SplatFlags`] (hidden, locked), [`SplatParts`], [`SplatSubset`], [`SplatHighlight`] |
//! | [`parts`] | parts as entities: `commands.extract_part(capture, part)`, `commands.restore_part(entity)` |
//! | [`render`] | drawing, in front of and behind meshes, on the GPU or without one; [`SplatCamera`](render::SplatCamera) |
//! | [`picking`] | the Gaussian under a pointer, through `bevy_picking` |
//! | [`select`] | messages that change what is selected |
//! | [`tools`] | rectangle, lasso, brush: pointer input as such messages |
//! | [`orient`] | captures upright and in metres, by messages |
//! | [`segment`] | one click to a whole object, in the background |
//!
//! [`BevySplatPlugins`] adds all of it; each plugin can be left out (`BevySplatPlugins.build().disable::<..>()`) or added
//! alone. Everything a scene names is in the [`prelude`].
//!
//! All that is kept in components can be written into scene files and read again, with one exception that is Bevy's: a scene
//! is built with `deny_component::<VisibilityClass>()`, because Bevy's own type cannot be written (nor can a mesh's).
//!
//! # Versions
//!
//! | `bevy_splat` | Bevy | wgpu | Rust |
//! |---|---|---|---|
//! | 0.1 | 0.19 | 29 | 1.95 |
//!
//! The crate has no features of its own. It asks Bevy for what drawing and picking need (no window, no light, no audio, no UI):
//! an app adds the rest.
//!
//! # Limits
//!
//! - A capture can be moved, turned and scaled evenly, not sheared or mirrored.
//! - Ids of Gaussians are their positions in the file. A file that changes its number of Gaussians loses what was selected,
//!   hidden, locked or labelled; a warning says what.
//! - A file is read as a whole: it is not streamed.
//! - Splats cast no shadows and receive no light; their colours are as trained.

pub mod asset;
pub mod components;
pub mod orient;
pub mod parts;
#[cfg(feature = "physics")]
pub mod physics;
pub mod picking;
mod placed;
mod plugins;
pub mod prelude;
pub mod render;
pub mod segment;
pub mod select;
mod splats;
#[cfg(test)]
mod testing;
pub mod tools;

pub use asset::SplatCloud;
pub use components::{
    DefaultSplatHighlight, SplatDeformation, SplatFlags, SplatHighlight, SplatParts, SplatSelection, SplatSubset,
    SplatTint, SplatTintChange,
};
pub use parts::{PartOf, SplatPart, SplatPartCommands};
pub use plugins::BevySplatPlugins;
pub use splats::{Splats, UPRIGHT};
