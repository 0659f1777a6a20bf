//! [`Format`]: what one file format must offer to be listed in [`FORMATS`](crate::FORMATS).

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use splat_core::Cloud;

use crate::{ReadError, SourceName, WriteError};

/// Oddities a reader survived; nothing here was silently changed.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ReadReport {
    /// Name of the format found.
    pub format: &'static str,
    /// Bytes of the file (all files together for a folder).
    pub bytes: u64,
    /// Gaussians with a NaN or infinity where none belongs; kept, never drawn.
    pub not_finite: usize,
    /// Gaussians whose quaternion has no direction; drawn with the identity.
    pub bad_rotations: usize,
    /// Bytes after the last Gaussian that nobody asked for.
    pub trailing_bytes: u64,
    /// Sentences about anything else that the user should know (axes, skipped extensions, odd SH counts).
    pub notes: Vec<String>,
}

/// Settings of a writer. Formats ignore what they have no use for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// Version of the format where it has several (SPZ: 2, 3, 4); `None` for the one most programs read.
    pub version: Option<u32>,
}

/// What a writer lost, by its nature.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Written {
    /// Bytes written.
    pub bytes: u64,
    /// Sentences about everything that the format could not hold (`spherical harmonics were dropped`).
    pub losses: Vec<String>,
    /// New position of every Gaussian of the file: `order[k]` is the input id written at place k; `None` if unchanged.
    pub order: Option<Vec<u32>>,
}

/// A splat file format. To add one: a file in `formats/` and a line in [`FORMATS`](crate::FORMATS).
pub trait Format: Sync {
    /// Short name in lower case: `ply`, `spz`.
    fn name(&self) -> &'static str;

    /// One line for lists.
    fn description(&self) -> &'static str;

    /// File name extensions without the dot; the first is the usual one. May have several dots (`compressed.ply`).
    fn extensions(&self) -> &'static [&'static str];

    /// Whether bytes look like this format. `head`: the first bytes (at least 4,096 where the file has them);
    /// `file_len`: length of the whole file.
    fn sniff(&self, head: &[u8], file_len: u64) -> bool;

    /// Reads a whole file from memory (usually a memory map: touch it in order). `files` gives the other files of a
    /// folder format by their relative names; a reader must not open anything itself.
    ///
    /// # Errors
    /// [`ReadError`]; never a panic, and never an allocation that the length of `bytes` does not justify.
    fn read(&self, bytes: &[u8], name: &SourceName, files: &dyn Siblings) -> Result<(Cloud, ReadReport), ReadError>;

    /// Whether [`Format::write`] works.
    fn writable(&self) -> bool;

    /// Whether values may change when a cloud is written and read again.
    fn lossy(&self) -> bool;

    /// Writes a cloud.
    ///
    /// # Errors
    /// [`WriteError`] when the sink fails or the format cannot hold the cloud at all.
    fn write(&self, cloud: &Cloud, options: &WriteOptions, sink: &mut dyn Write) -> Result<Written, WriteError>;
}

/// Files that lie beside the one being read.
pub trait Siblings {
    /// Bytes of the file `name` beside the one being read. Names that leave the folder (`..`, absolute) are refused.
    ///
    /// # Errors
    /// [`ReadError`] naming the file.
    fn get(&self, name: &str) -> Result<Vec<u8>, ReadError>;
}

/// For bytes that have no folder.
#[derive(Clone, Debug, Default)]
pub struct InMemory {
    /// Name to bytes.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// Files of a folder on disk.
#[derive(Clone, Copy, Debug)]
pub struct Folder<'a>(pub &'a Path);
