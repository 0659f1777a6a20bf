//! Reads and writes splat files and camera files.
//!
//! [`read`] decides the format by content first, by extension only between candidates; [`write()`] by extension.
//! [`FORMATS`] is the one list of formats: `--help`, README and the file dialog are made from it.

pub mod cameras;
mod error;
mod format;
pub mod formats;
mod read;
mod write;

pub use error::{ReadError, SourceName, WriteError};
pub use format::{Format, ReadReport, Written, WriteOptions};
pub use formats::FORMATS;
pub use read::{read, read_bytes};
pub use write::{write, write_as};
