//! [`BakeError`].

use std::fmt;

/// Name of a section: four letters.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tag(pub [u8; 4]);

impl fmt::Display for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.escape_ascii())
    }
}

impl fmt::Debug for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Why bytes are not a baked part, or lack what was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// Something else.
    #[error("this is not a .splatphys file")]
    NotABake,
    /// Written by something newer or older.
    #[error("version {found} of .splatphys was found, {known} is known; bake the part again")]
    Version {
        /// In the file.
        found: u32,
        /// Of this library.
        known: u32,
    },
    /// More sections than any writer makes.
    #[error("the file names {found} sections, {most} are possible; it is damaged")]
    TooManySections {
        /// In the file.
        found: u32,
        /// Possible.
        most: usize,
    },
    /// Cut off, or a length that is none.
    #[error("the file ends at byte {have}, but its table or a section goes to byte {need}; it was cut off or damaged")]
    Truncated {
        /// Bytes needed.
        need: u64,
        /// Bytes there.
        have: usize,
    },
    /// The table is not what was written.
    #[error("the file's table does not have its checksum; it is damaged")]
    TableChecksum,
    /// A section is not what was written.
    #[error("section {section} does not have its checksum; the file is damaged")]
    Checksum {
        /// Which.
        section: Tag,
    },
    /// The same name for two sections.
    #[error("section {section} is there twice")]
    Twice {
        /// Which.
        section: Tag,
    },
    /// What was asked for is not there.
    #[error("the file has no section {section}")]
    Missing {
        /// Which.
        section: Tag,
    },
    /// A section ends before what is read from it.
    #[error("section {section} ends too early for what it should hold")]
    Short {
        /// Which.
        section: Tag,
    },
    /// A section goes on after what is read from it.
    #[error("section {section} has {bytes} bytes too many for what it should hold")]
    Long {
        /// Which.
        section: Tag,
        /// Left over.
        bytes: usize,
    },
    /// Numbers that cannot be.
    #[error("section {section} is not sound: {what}")]
    Unsound {
        /// Which.
        section: Tag,
        /// What is wrong with it.
        what: &'static str,
    },
}
