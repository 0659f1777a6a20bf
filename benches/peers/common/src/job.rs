//! [`Job`]: what a contender is asked to do.

use std::path::PathBuf;

use clap::Args;

use crate::{Cameras, Failure};

/// Options of every contender.
#[derive(Args, Clone, Debug)]
pub struct Job {
    /// The capture: a PLY file with spherical harmonics of degree 3
    #[arg(long)]
    pub scene: PathBuf,
    /// Where the camera stands, frame by frame
    #[arg(long)]
    pub cameras: PathBuf,
    /// Pixels across and down
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: (u32, u32),
    /// Frames drawn before the first that counts
    #[arg(long, default_value_t = 3)]
    pub warmup: usize,
    /// Frames that count
    #[arg(long, default_value_t = 10)]
    pub frames: usize,
    /// Measure the parts of a frame, too: the frames are then slower than without
    #[arg(long)]
    pub stages: bool,
    /// Draw the still view instead, and write its picture here
    #[arg(long, value_name = "PNG")]
    pub shot: Option<PathBuf>,
}

impl Job {
    /// The standpoints of the job.
    ///
    /// # Errors
    /// A sentence if the file cannot be read.
    pub fn cameras(&self) -> Result<Cameras, Failure> {
        Cameras::read(&self.cameras)
    }

    /// Standpoint of every frame, those of the warm-up first; the still view throughout where a picture is wanted.
    ///
    /// # Errors
    /// As [`Job::cameras`].
    pub fn walk(&self) -> Result<Vec<crate::Pose>, Failure> {
        let cameras = self.cameras()?;
        let frames = self.warmup + self.frames;
        Ok(match self.shot {
            Some(_) => vec![cameras.still; frames],
            None => (0..frames).map(|k| cameras.path[k % cameras.path.len()]).collect(),
        })
    }
}

/// Two numbers with an x between them.
///
/// # Errors
/// What was expected.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    sides.filter(|&(w, h)| w > 0 && h > 0).ok_or_else(|| "a size such as 1280x720 was expected".to_owned())
}
