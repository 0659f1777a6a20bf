//! Parts as entities: `extract_part` takes the Gaussians of a part out of a capture, `restore_part` puts them back.

mod part_of;

pub use part_of::{PartOf, SplatPart};
