//! Parts as entities: [`extract_part`](SplatPartCommands::extract_part) takes the Gaussians of a part out of a capture,
//! [`restore_part`](SplatPartCommands::restore_part) puts them back.
//!
//! The part's entity shows the same cloud through a [`SplatSubset`](crate::SplatSubset), and the capture keeps one of the rest:
//! nothing is stored twice, and each draws only its own. A Gaussian belongs to exactly one entity; with it goes whether
//! it is selected, hidden or locked. The table of parts stays with the capture, labels and all.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_splat::prelude::*;
//! fn take_the_chair_out(mut commands: Commands, captures: Query<(Entity, &SplatParts)>) {
//!     for (capture, parts) in &captures {
//!         for (id, _) in parts.iter().filter(|(_, part)| part.name == "chair") {
//!             let chair = commands.extract_part(capture, id);
//!             commands.entity(chair).insert(Transform::from_xyz(0.0, 1.0, 0.0));
//!         }
//!     }
//! }
//! # bevy::ecs::system::assert_is_system(take_the_chair_out);
//! ```

mod bits;
mod commands;
mod despawned;
mod extract;
mod lookup;
mod messages;
mod part_of;
mod restore;

use bevy::prelude::*;

pub use commands::SplatPartCommands;
pub use despawned::DespawnedParts;
pub use extract::{PartError, extract_part};
pub use lookup::PartsLookup;
pub use messages::{PartExtracted, PartRestored};
pub use part_of::{PartOf, SplatPart};
pub use restore::restore_part;

/// Parts as entities: the messages [`PartExtracted`] and [`PartRestored`], and the memory of parts whose entities were
/// despawned, so that these can be restored too.
pub struct SplatPartsPlugin;

impl Plugin for SplatPartsPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<PartExtracted>()
            .add_message::<PartRestored>()
            .register_type::<(PartOf, SplatPart, extract::WasWhole)>()
            .add_observer(despawned::remember);
    }
}

#[cfg(test)]
mod tests;
