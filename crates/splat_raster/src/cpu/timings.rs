//! [`Timings`]: what the stages of a frame took.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// One stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stage {
    /// From its begin to its end.
    pub wall: Duration,
    /// CPU time of the threads that worked on it, added up (on systems without a clock per thread: their wall time).
    pub cpu: Duration,
}

/// Measures one stage while its threads work.
pub(super) struct Watch {
    begin: Instant,
    nanoseconds: AtomicU64,
}

impl Watch {
    pub(super) fn start() -> Self {
        Self { begin: Instant::now(), nanoseconds: AtomicU64::new(0) }
    }

    /// Does a part of the stage on this thread.
    pub(super) fn work<T>(&self, work: impl FnOnce() -> T) -> T {
        let begin = thread_clock();
        let out = work();
        self.nanoseconds.fetch_add(thread_clock().saturating_sub(begin), Ordering::Relaxed);
        out
    }

    /// Both times so far.
    pub(super) fn read(&self) -> Stage {
        Stage { wall: self.begin.elapsed(), cpu: Duration::from_nanos(self.nanoseconds.load(Ordering::Relaxed)) }
    }
}

/// CPU time of this thread so far, in nanoseconds.
#[cfg(unix)]
fn thread_clock() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: a valid place for the answer.
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Time since the first call, in nanoseconds: the nearest thing where there is no clock per thread.
#[cfg(not(unix))]
fn thread_clock() -> u64 {
    static FIRST: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    FIRST.get_or_init(Instant::now).elapsed().as_nanos() as u64
}

/// What the stages of one draw took; zero where a stage was skipped, because the lists of the draw before served.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// Gaussians to splats: culling, projection, colour.
    pub project: Stage,
    /// One order by depth.
    pub sort: Stage,
    /// Lists per tile.
    pub bin: Stage,
    /// Blending, and clearing and writing the outputs.
    pub raster: Stage,
}

impl Timings {
    /// The stages with their names, in order.
    pub fn stages(&self) -> [(&'static str, Stage); 4] {
        [("project", self.project), ("sort", self.sort), ("bin", self.bin), ("raster", self.raster)]
    }
}
