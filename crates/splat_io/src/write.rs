//! [`write()`]: a [`Cloud`] into a file, its format decided by the name.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

use splat_core::Cloud;

use crate::format::{Format, WriteOptions, Written};
use crate::formats::FORMATS;
use crate::read::extension_length;
use crate::{SourceName, WriteError};

/// Writes a cloud in the format of the name's ending (`.compressed.ply` before `.ply`).
///
/// The file appears whole or not at all: it is written beside its place and renamed.
///
/// # Errors
/// [`WriteError`] naming the file; what was there before is unchanged then.
pub fn write(path: impl AsRef<Path>, cloud: &Cloud, options: &WriteOptions) -> Result<Written, WriteError> {
    let path = path.as_ref();
    let name = SourceName::from(path);
    let format = format_of_name(name.as_str())
        .ok_or_else(|| WriteError::UnknownExtension { known: writable_extensions(), path: name })?;
    write_file(path, |sink| write_as(format, cloud, options, sink))
}

/// Writes a cloud in a given format to any sink.
///
/// # Errors
/// [`WriteError`] when the sink fails, or the format cannot be written or cannot hold the cloud.
pub fn write_as(
    format: &dyn Format,
    cloud: &Cloud,
    options: &WriteOptions,
    sink: &mut dyn Write,
) -> Result<Written, WriteError> {
    if !format.writable() {
        return Err(WriteError::ReadOnly { format: format.name(), known: writable_extensions() });
    }
    format.write(cloud, options, sink)
}

/// The format with this short name (`spz`) or this extension.
pub fn format_named(name: &str) -> Option<&'static dyn Format> {
    let name = name.trim_start_matches('.').to_ascii_lowercase();
    let by_name = FORMATS.iter().find(|f| f.name() == name);
    by_name.or_else(|| FORMATS.iter().find(|f| f.extensions().contains(&name.as_str()))).copied()
}

/// The format whose longest extension `name` ends with.
pub fn format_of_name(name: &str) -> Option<&'static dyn Format> {
    FORMATS.iter().copied().filter(|f| extension_length(*f, name) > 0).max_by_key(|f| extension_length(*f, name))
}

fn writable_extensions() -> String {
    let endings = FORMATS.iter().filter(|f| f.writable()).filter_map(|f| f.extensions().first());
    endings.map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ")
}

/// Writes a file as a whole: `body` fills a file beside `path`, which then takes its place.
///
/// # Errors
/// What `body` returns, and [`WriteError::Io`]; `path` is unchanged then.
pub fn write_file<T>(path: &Path, body: impl FnOnce(&mut dyn Write) -> Result<T, WriteError>) -> Result<T, WriteError> {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let name = SourceName::from(path);
    let io = |source| WriteError::Io { source, path: name.clone() };
    let Some(file_name) = path.file_name() else {
        return Err(io(std::io::Error::new(std::io::ErrorKind::InvalidInput, "this is not the name of a file")));
    };
    let serial = NEXT.fetch_add(1, Ordering::Relaxed);
    let mut part = std::ffi::OsString::from(".");
    part.push(file_name);
    part.push(format!(".{}-{serial}.part", std::process::id()));
    let part = path.with_file_name(part);
    let fill = || {
        let mut sink = BufWriter::with_capacity(1 << 20, File::create_new(&part).map_err(io)?);
        let result = body(&mut sink).map_err(|error| match error {
            WriteError::Sink(source) => io(source),
            other => other,
        })?;
        sink.flush().map_err(io)?;
        drop(sink);
        std::fs::rename(&part, path).map_err(io)?;
        Ok(result)
    };
    let result = fill();
    if result.is_err() {
        // The error that matters is the first one.
        let _ = std::fs::remove_file(&part);
    }
    result
}
