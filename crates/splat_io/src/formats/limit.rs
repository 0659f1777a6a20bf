//! How much memory the size of a compressed file justifies.

use crate::{ReadError, SourceName};

/// Unpacked bytes that any file may have, however small.
const FLOOR: u64 = 16 << 20;
/// Unpacked bytes per byte of the file above that. Captures reach about 2; deflate could reach 1,032, zstd and WebP more.
const RATIO: u64 = 100;

/// Refuses to unpack more than a real capture could need.
///
/// # Errors
/// [`ReadError::Limit`].
pub(crate) fn check(what: &str, unpacked: u64, file_len: usize, name: &SourceName) -> Result<(), ReadError> {
    let limit = unpacked_limit(file_len);
    if unpacked <= limit {
        return Ok(());
    }
    Err(ReadError::Limit { what: what.to_owned(), found: unpacked, limit, path: name.clone() })
}

/// The most that [`check`] allows.
pub(crate) fn unpacked_limit(file_len: usize) -> u64 {
    FLOOR + RATIO * file_len as u64
}
