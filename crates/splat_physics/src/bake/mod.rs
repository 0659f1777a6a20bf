//! `.splatphys` files: what was worked out about a part, so that it need not be worked out again.
//!
//! A file is a table of sections, each with its length and an xxh3 checksum; all numbers are little endian. What a section holds is
//! said by the type that it is read as, by [`Baked`]. Reading gives the bits that were written, or an error; no length in a file is
//! believed before as many bytes are there.
//!
//! ```text
//! 0   "SPLATPHY"
//! 8   u32 version, u32 number of sections
//! 16  u64 xxh3 of the table
//! 24  table: for each section [u8; 4] tag, u32 0, u64 first byte in the file, u64 bytes, u64 xxh3 of them
//!     sections, each at a multiple of 8
//! ```

mod error;
mod parts;
mod reader;
#[cfg(test)]
mod tests;
mod value;
mod writer;

pub use error::{BakeError, Tag};
pub use parts::BakedPart;
pub use reader::{BakeReader, Source};
pub use value::Baked;
pub use writer::{BakeWriter, Sink};

/// The sections of an elastic or rigid part. A file may lack some and have others.
pub mod tags {
    use super::Tag;

    /// [`super::BakedPart`]: which part it is.
    pub const PART: Tag = Tag(*b"PART");
    /// [`crate::PartCage`].
    pub const CAGE: Tag = Tag(*b"CAGE");
    /// `Vec<`[`crate::Material`]`>`, one for each region.
    pub const MATERIALS: Tag = Tag(*b"MATS");
    /// [`crate::BasisKind`].
    pub const BASIS: Tag = Tag(*b"BASE");
    /// [`crate::BasisWeights`].
    pub const WEIGHTS: Tag = Tag(*b"WGHT");
    /// [`crate::SimplicitsState`].
    pub const TRAINING: Tag = Tag(*b"TRAI");
    /// Cubature: places, volumes and regions of the samples.
    pub const SAMPLES: Tag = Tag(*b"SMPL");
    /// [`crate::MassProperties`].
    pub const MASS: Tag = Tag(*b"MASS");
    /// `Vec<Vec<DVec3>>`: corners of convex hulls, in metres in the body's frame.
    pub const HULLS: Tag = Tag(*b"HULL");
    /// `Vec<DVec3>`: contact points at rest, in metres in the body's frame.
    pub const CONTACTS: Tag = Tag(*b"CNTC");
    /// Settings of the solver.
    pub const SETTINGS: Tag = Tag(*b"SETT");
}

const MAGIC: [u8; 8] = *b"SPLATPHY";
const VERSION: u32 = 1;
const HEADER: usize = 24;
const ENTRY: usize = 32;
/// Sections of a file, at most.
const MOST_SECTIONS: usize = 1024;
