//! [`Terminal`]: what the program says, and where.
//!
//! Reports (what a command was asked for) go to standard output, as text or as JSON. Everything else goes to standard error: notes,
//! what was written, progress. Progress is drawn only on a terminal and only for work that takes longer than a second.

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::Mutex;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use splat_segment::Run;

use crate::failure::Failure;

/// Work shorter than this shows no progress.
const PATIENCE: Duration = Duration::from_secs(1);

/// What the user wants to hear.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Terminal {
    /// Only reports and errors.
    pub(crate) quiet: bool,
    /// Reports as JSON.
    pub(crate) json: bool,
}

impl Terminal {
    /// Gives what the command was asked for: `report` as JSON if that is wanted, else `text`.
    ///
    /// # Errors
    /// [`Failure::Closed`] if nobody reads any more, [`Failure::Failed`] if standard output cannot be written.
    pub(crate) fn report(&self, report: &impl Serialize, text: impl FnOnce() -> String) -> Result<(), Failure> {
        let mut out = if self.json { serde_json::to_string_pretty(report)? } else { text() };
        if !out.is_empty() && !out.ends_with('\n') {
            out.push('\n');
        }
        write_out(out.as_bytes())
    }

    /// Something the user should know, on standard error.
    pub(crate) fn note(&self, sentence: impl Display) {
        if !self.quiet {
            say("note", sentence);
        }
    }

    /// What was done, on standard error.
    pub(crate) fn done(&self, sentence: impl Display) {
        if !self.quiet {
            // Nobody can be told that standard error is closed.
            let _ = writeln!(io::stderr(), "{sentence}");
        }
    }

    /// Progress of work with `total` steps, or of unknown length; it disappears when the value is dropped.
    pub(crate) fn progress(&self, label: &str, total: Option<u64>) -> Working {
        if self.quiet || !io::stderr().is_terminal() {
            return Working { bar: ProgressBar::hidden(), stop: None };
        }
        let (bar, template) = match total {
            Some(total) => (ProgressBar::new(total), "{msg} [{bar:30}] {pos}/{len}, {eta} left"),
            None => (ProgressBar::no_length(), "{spinner} {msg}, {elapsed}"),
        };
        bar.set_draw_target(ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(label.to_owned());
        let (stop, stopped) = mpsc::channel::<()>();
        let shown = bar.clone();
        std::thread::spawn(move || {
            if stopped.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                shown.set_draw_target(ProgressDrawTarget::stderr());
                shown.enable_steady_tick(Duration::from_millis(120));
            }
        });
        Working { bar, stop: Some(stop) }
    }

    /// A watcher of long work in the libraries: one bar per stage.
    pub(crate) fn run(&self) -> Run {
        let terminal = *self;
        let current: Mutex<Option<(&'static str, Working)>> = Mutex::new(None);
        Run::with_progress(move |progress| {
            let Ok(mut current) = current.lock() else { return };
            if current.as_ref().is_none_or(|(stage, _)| *stage != progress.stage) {
                // The old bar goes before the new one comes.
                current.take();
                *current = Some((progress.stage, terminal.progress(progress.stage, Some(progress.total as u64))));
            }
            if let Some((_, working)) = current.as_ref() {
                working.bar.set_length(progress.total as u64);
                working.at(progress.done as u64);
            }
        })
    }
}

/// Work in progress; see [`Terminal::progress`].
#[derive(Debug)]
pub(crate) struct Working {
    bar: ProgressBar,
    /// Dropped with this value, which ends the thread that waits to show the bar.
    stop: Option<mpsc::Sender<()>>,
}

impl Working {
    /// `done` steps are done.
    pub(crate) fn at(&self, done: u64) {
        self.bar.set_position(done);
    }
}

impl Drop for Working {
    fn drop(&mut self) {
        self.stop.take();
        self.bar.finish_and_clear();
    }
}

/// `kind: sentence` on standard error.
pub(crate) fn say(kind: &str, sentence: impl Display) {
    // Nobody can be told that standard error is closed.
    let _ = writeln!(io::stderr(), "{kind}: {sentence}");
}

/// Bytes to standard output.
///
/// # Errors
/// As [`Terminal::report`].
pub(crate) fn write_out(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Ok(()) => Ok(()),
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Err(Failure::Closed),
        Err(e) => Err(Failure::failed(format!("standard output cannot be written ({e}); redirect it elsewhere"))),
    }
}

/// A count with commas between thousands.
pub(crate) fn grouped(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A number of Gaussians in words.
pub(crate) fn gaussians(n: usize) -> String {
    if n == 1 { "1 Gaussian".to_owned() } else { format!("{} Gaussians", grouped(n)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_grouped_from_the_right() {
        let text: Vec<String> = [0, 7, 999, 1000, 660_140, 12_345_678].into_iter().map(grouped).collect();
        assert_eq!(text, ["0", "7", "999", "1,000", "660,140", "12,345,678"]);
    }
}
