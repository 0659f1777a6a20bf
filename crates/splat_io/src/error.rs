//! Why a file could not be read or written, as fields: `Display` says where, what was expected, what was found, what to do.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use splat_core::CloudError;

/// What a user calls the bytes being read: usually a path.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SourceName(Arc<str>);

impl SourceName {
    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The name of a file beside this one (`meta.json` -> `means_l.webp` in the same folder).
    pub fn sibling(&self, name: &str) -> Self {
        match self.0.rfind(['/', '\\']) {
            Some(at) => Self(format!("{}{name}", &self.0[..=at]).into()),
            None => Self(name.into()),
        }
    }
}

impl fmt::Display for SourceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<&Path> for SourceName {
    fn from(path: &Path) -> Self {
        Self(path.to_string_lossy().into())
    }
}

impl From<&str> for SourceName {
    fn from(name: &str) -> Self {
        Self(name.into())
    }
}

/// Why bytes could not become a cloud, cameras, a mask or an array.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system refused.
    #[error("the file cannot be read ({source}); check its name and its permissions: {path}")]
    Io {
        /// The operating system's answer.
        source: std::io::Error,
        /// Which file.
        path: SourceName,
    },
    /// No format recognises the bytes.
    #[error("the file is none of the known formats ({known}); it starts with {head}: {path}")]
    UnknownFormat {
        /// Names of the formats tried.
        known: String,
        /// First bytes, printable.
        head: String,
        /// Which file.
        path: SourceName,
    },
    /// The file is shorter than its own header says.
    #[error("the file holds {found} of {expected} {what}; it was cut off, copy it again: {path}")]
    Truncated {
        /// What is counted (`bytes of the vertices`).
        what: String,
        /// How many the header promises.
        expected: u64,
        /// How many there are.
        found: u64,
        /// Which file.
        path: SourceName,
    },
    /// Something has a value that the format does not allow.
    #[error(
        "{what} is {found}, {expected} was expected; the file is damaged, or its writer differs from the format: {path}"
    )]
    Malformed {
        /// Where in the file.
        what: String,
        /// What the format asks for.
        expected: String,
        /// What is there.
        found: String,
        /// Which file.
        path: SourceName,
    },
    /// A file of a known format, with something that is not supported.
    #[error("{what} is not supported; {advice}: {path}")]
    Unsupported {
        /// What.
        what: String,
        /// A way on.
        advice: String,
        /// Which file.
        path: SourceName,
    },
    /// A well-formed file that holds something else.
    #[error("the file holds {found}, not {expected}; {advice}: {path}")]
    Other {
        /// What it holds.
        found: String,
        /// What was wanted.
        expected: String,
        /// A way on.
        advice: String,
        /// Which file.
        path: SourceName,
    },
    /// A count that the size of the file does not justify.
    #[error("{what} is {found}, at most {limit} fits a file of this size; the file is damaged: {path}")]
    Limit {
        /// What is counted.
        what: String,
        /// How many the file asks for.
        found: u64,
        /// How many are allowed.
        limit: u64,
        /// Which file.
        path: SourceName,
    },
    /// A file names another one outside its own folder.
    #[error("the file refers to `{name}`, outside its own folder; such names are not followed: {path}")]
    Outside {
        /// The name given.
        name: String,
        /// Which file refers to it.
        path: SourceName,
    },
    /// The arrays do not fit together.
    #[error("the arrays of the file do not fit together ({source}): {path}")]
    Cloud {
        /// What does not fit.
        source: CloudError,
        /// Which file.
        path: SourceName,
    },
}

impl ReadError {
    /// Shorthand of [`ReadError::Malformed`].
    pub fn malformed(
        what: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
        path: &SourceName,
    ) -> Self {
        Self::Malformed { what: what.into(), expected: expected.into(), found: found.into(), path: path.clone() }
    }

    /// Shorthand of [`ReadError::Truncated`].
    pub fn truncated(what: impl Into<String>, expected: u64, found: u64, path: &SourceName) -> Self {
        Self::Truncated { what: what.into(), expected, found, path: path.clone() }
    }

    /// Shorthand of [`ReadError::Unsupported`].
    pub fn unsupported(what: impl Into<String>, advice: impl Into<String>, path: &SourceName) -> Self {
        Self::Unsupported { what: what.into(), advice: advice.into(), path: path.clone() }
    }

    /// Shorthand of [`ReadError::Cloud`], for `map_err`.
    pub fn cloud(path: &SourceName) -> impl FnOnce(CloudError) -> Self + '_ {
        |source| Self::Cloud { source, path: path.clone() }
    }

    /// Shorthand of [`ReadError::Io`], for `map_err`.
    pub fn io(path: &SourceName) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |source| Self::Io { source, path: path.clone() }
    }
}

/// Why a cloud, cameras or a picture could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The sink refused.
    #[error("writing failed ({0}); check the free space")]
    Sink(#[from] std::io::Error),
    /// The operating system refused a file; what was there before is unchanged.
    #[error("the file cannot be written ({source}); check the folder, its permissions and the free space: {path}")]
    Io {
        /// The operating system's answer.
        source: std::io::Error,
        /// Which file.
        path: SourceName,
    },
    /// The name does not say which format to write.
    #[error("the ending of the name is none of {known}; choose one of these: {path}")]
    UnknownExtension {
        /// Endings of the writable formats.
        known: String,
        /// Which file.
        path: SourceName,
    },
    /// The format can only be read.
    #[error("{format} files can be read but not written; choose another of {known}")]
    ReadOnly {
        /// Name of the format.
        format: &'static str,
        /// Endings of the writable formats.
        known: String,
    },
    /// The format cannot hold this.
    #[error("{format} cannot hold {what}; {advice}")]
    CannotHold {
        /// Name of the format.
        format: &'static str,
        /// What does not fit.
        what: String,
        /// A way on.
        advice: String,
    },
}
