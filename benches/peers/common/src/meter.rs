//! [`Meter`]: wall and processor time of frames.

use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

/// What one frame cost, in milliseconds.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Sample {
    /// From the call until the picture is finished.
    pub wall_ms: f64,
    /// User and system time of the whole process, all threads together: on a software device also the pixels.
    pub cpu_ms: f64,
}

/// Measures frames, and skips those that warm up.
#[derive(Debug)]
pub struct Meter {
    begun: Instant,
    /// From the start of the program to the end of the first frame.
    pub first_frame_ms: f64,
    skip: usize,
    /// One per frame that counts.
    pub samples: Vec<Sample>,
}

impl Meter {
    /// Begins with the program: `skip` frames do not count.
    pub fn new(skip: usize) -> Self {
        Self { begun: Instant::now(), first_frame_ms: 0.0, skip, samples: Vec::new() }
    }

    /// Draws a frame. `draw` returns when the picture is finished, not when it is submitted.
    ///
    /// # Errors
    /// Those of `draw`.
    pub fn frame<T, E>(&mut self, draw: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
        let (cpu, wall) = (process_time(), Instant::now());
        let drawn = draw()?;
        let sample = Sample { wall_ms: ms(wall.elapsed()), cpu_ms: ms(process_time().saturating_sub(cpu)) };
        if self.first_frame_ms == 0.0 {
            self.first_frame_ms = ms(self.begun.elapsed());
        }
        if self.skip > 0 {
            self.skip -= 1;
        } else {
            self.samples.push(sample);
        }
        Ok(drawn)
    }
}

fn ms(d: Duration) -> f64 {
    d.as_secs_f64() * 1e3
}

/// User and system time of this process so far.
fn process_time() -> Duration {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(t.tv_sec.try_into().unwrap_or(0), t.tv_nsec.try_into().unwrap_or(0))
}

/// Most memory that this process ever held, in MiB, where the system tells.
pub fn memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches("kB").trim().parse::<f64>().ok().map(|kib| kib / 1024.0)
}

/// The middle value, the mean of the two in the middle of an even number; NaN of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let (Some(low), Some(high)) = (values.get(values.len().saturating_sub(1) / 2), values.get(values.len() / 2)) else {
        return f64::NAN;
    };
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_warm_up_do_not_count() {
        let mut meter = Meter::new(2);
        for _ in 0..5 {
            meter.frame(|| Ok::<_, ()>(())).unwrap();
        }
        assert_eq!(meter.samples.len(), 3);
        assert_eq!(meter.frame(|| Err::<(), _>(7)), Err(7));
        assert_eq!(meter.samples.len(), 3);
    }

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0]), 2.5);
        assert!(median(Vec::new()).is_nan());
    }
}
