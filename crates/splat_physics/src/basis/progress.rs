//! [`Progress`]: how long work tells how far it is, and learns that nobody wants it any more.

/// Handed into long work; called from the thread that does it, several times a second.
pub trait Progress: Sync {
    /// How much is done, 0..=1, never falling within one call of the work.
    fn report(&self, fraction: f32);
    /// Whether to stop; the work then answers with its error for this.
    fn cancelled(&self) -> bool;
}

/// For work that nobody watches.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProgress;

impl Progress for NoProgress {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        false
    }
}
