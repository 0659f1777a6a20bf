//! What a `Splats` entity may have beside its cloud: which Gaussians are shown, selected, hidden, locked, and whose they are.
//!
//! All are reflected and can be written into scene files. Ids are positions in the capture's file, also in an entity that
//! shows only some of a cloud's Gaussians. Bits of a length other than the cloud's are reset once it is loaded, see
//! [`SplatFitSystems`](crate::asset::SplatFitSystems).

mod deformation;
mod flags;
mod highlight;
mod part_table;
mod selection;
mod subset;
mod tint;

pub use deformation::SplatDeformation;
pub use flags::SplatFlags;
pub use highlight::{DefaultSplatHighlight, SplatHighlight};
pub use part_table::SplatParts;
pub use selection::SplatSelection;
pub use subset::SplatSubset;
pub use tint::{SplatHighlightPlugin, SplatTint, SplatTintChange, SplatTintSystems};
