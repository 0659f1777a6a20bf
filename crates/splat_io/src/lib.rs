//! Reads and writes splat files and camera files.
//!
//! [`read`] decides the format by content first, by extension only between candidates; [`write()`] by extension.
//! [`FORMATS`] is the one list of formats: `--help`, README and the file dialog are made from it.
//! Cameras: [`cameras`]; masks, label maps and pictures: [`picture`]; numpy arrays: [`npy`]; metres per unit: [`scale`].
//!
//! ```
//! use splat_io::{WriteOptions, read, write};
//!
//! # let folder = std::env::temp_dir().join(format!("splat_io_doc_{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! # let (input, output) = (folder.join("room.ply"), folder.join("half.compressed.ply"));
//! # write(&input, &splat_core::Cloud::default(), &WriteOptions::default())?;
//! let (cloud, report) = read(&input)?;
//! assert_eq!((report.format, report.not_finite), ("ply", 0));
//!
//! let every_second: Vec<u32> = (0..cloud.len() as u32).step_by(2).collect();
//! let written = write(&output, &cloud.pick(&every_second), &WriteOptions::default())?;
//! for loss in &written.losses {
//!     println!("{loss}");
//! }
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod cameras;
mod error;
mod format;
pub mod formats;
pub mod npy;
mod pages;
pub mod picture;
mod read;
pub mod scale;
mod write;

pub use error::{ReadError, SourceName, WriteError};
pub use format::{Folder, Format, InMemory, ReadReport, Siblings, WriteOptions, Written};
pub use formats::FORMATS;
pub use read::{read, read_as, read_bytes, read_with, sniff};
pub use write::{format_named, format_of_name, write, write_as, write_file};
