//! [`Failure`]: why a command did not do its job.

use std::process::ExitCode;

/// Why a command did not do its job; decides the exit code.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line asks for something that does not exist or does not fit together: exit code 2.
    Usage(String),
    /// The job could not be done: exit code 1.
    Failed(String),
    /// Whoever read the output has stopped reading (`splat list | head`): nothing to say, exit code 0.
    Closed,
}

impl Failure {
    /// A mistake in the command line, in one sentence with a way on.
    pub(crate) fn usage(sentence: impl Into<String>) -> Self {
        Self::Usage(sentence.into())
    }

    /// A job that could not be done, in one sentence with a way on.
    pub(crate) fn failed(sentence: impl Into<String>) -> Self {
        Self::Failed(sentence.into())
    }

    /// The code that the program ends with.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Closed => ExitCode::SUCCESS,
            Self::Failed(_) => ExitCode::FAILURE,
            Self::Usage(_) => ExitCode::from(2),
        }
    }
}

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(error.to_string())
    }
}
