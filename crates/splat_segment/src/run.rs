//! [`Run`]: progress of long work, and the wish to stop it.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::SegmentError;

/// How far a stage of long work has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// What is being done, in a word or two (`track`, `votes`).
    pub stage: &'static str,
    /// Steps done.
    pub done: usize,
    /// Steps in all.
    pub total: usize,
}

/// Handed into long work: reports [`Progress`] and carries the wish to stop. Clones share both.
#[derive(Clone, Default)]
pub struct Run {
    cancelled: Arc<AtomicBool>,
    report: Option<Arc<dyn Fn(Progress) + Send + Sync>>,
}

impl fmt::Debug for Run {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Run").field("cancelled", &self.cancelled()).field("reports", &self.report.is_some()).finish()
    }
}

impl Run {
    /// Work that nobody watches.
    pub fn new() -> Self {
        Self::default()
    }

    /// Work whose progress goes to `report`, which may be called from any thread.
    pub fn with_progress(report: impl Fn(Progress) + Send + Sync + 'static) -> Self {
        Self { cancelled: Arc::default(), report: Some(Arc::new(report)) }
    }

    /// Asks the work to stop at its next step.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether [`Run::cancel`] was called.
    pub fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Called by the work between steps: reports, then says whether to go on.
    ///
    /// # Errors
    /// [`SegmentError::Cancelled`] if the caller asked to stop.
    pub fn step(&self, stage: &'static str, done: usize, total: usize) -> Result<(), SegmentError> {
        if self.cancelled() {
            return Err(SegmentError::Cancelled);
        }
        if let Some(report) = &self.report {
            report(Progress { stage, done, total });
        }
        Ok(())
    }
}
