//! Reads and writes splat files and camera files.
//!
//! [`read`] decides the format by content first, by extension only between candidates; [`write()`] by extension.
//! [`FORMATS`] is the one list of formats: `--help`, README and the file dialog are made from it.
//! Cameras: [`cameras`]; masks, label maps and pictures: [`picture`]; numpy arrays: [`npy`].

pub mod cameras;
mod error;
mod format;
pub mod formats;
pub mod npy;
mod pages;
pub mod picture;
mod read;
mod write;

pub use error::{ReadError, SourceName, WriteError};
pub use format::{Folder, Format, InMemory, ReadReport, Siblings, WriteOptions, Written};
pub use formats::FORMATS;
pub use read::{read, read_bytes, read_with, sniff};
pub use write::{format_named, format_of_name, write, write_as, write_file};
