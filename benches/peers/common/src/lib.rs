//! What every contender of the comparison needs: the same job, the same clock, the same report.
//!
//! A contender is a program of its own, started by the driver once per round: [`Job`] are its options, [`Cameras`] the file
//! of standpoints, [`Meter`] measures its frames, [`Report`] is the one line that it writes to standard output.

mod cameras;
mod job;
mod meter;
mod report;

pub use cameras::{Cameras, Pose};
pub use job::{Job, parse_size};
pub use meter::{Meter, Sample, median, memory_mib};
pub use report::{Failure, Report, Stage, write_shot};
