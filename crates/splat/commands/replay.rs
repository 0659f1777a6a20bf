//! `splat replay`: does a segmentation again and compares it bit for bit.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, FromArgMatches};
use serde::Serialize;

use super::Command;
use super::main_job;
use super::segment::job::{self, Job};
use super::segment::session::Session;
use crate::capture::Capture;
use crate::failure::Failure;
use crate::prepare::Keep;
use crate::terminal::Terminal;

pub(crate) const COMMAND: Command = Command {
    name: "replay",
    about: "Do a segmentation again from its session.json, and compare the results bit for bit",
    examples: "  splat replay chair/session.json -o again\n  \
               splat replay chair/session.json --file moved/scene.ply -o again",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// A session that `splat segment` wrote
    session: PathBuf,
    /// The folder for results; it is made if it is not there
    #[arg(short, long = "out", value_name = "DIR")]
    out: PathBuf,
    /// The capture, if it is no longer where it was
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    /// Neither read nor keep what a capture is prepared to
    #[arg(long)]
    no_cache: bool,
}

#[derive(Serialize)]
struct Report {
    session: String,
    folder: String,
    selected: usize,
    /// Whether every file has the same bytes as then.
    identical: bool,
    /// Files that have the same bytes.
    same: Vec<String>,
    /// Files that differ.
    differ: Vec<String>,
    seconds: f64,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let began = Instant::now();
    let session = Session::read(&options.session)?;
    let task = session.task(&options.session)?;
    let cloud = match (&options.file, &session.capture.file) {
        (Some(file), _) => Capture::read_and_tell(file, terminal)?.cloud,
        (None, Some(file)) => Capture::read_and_tell(&found(file, &options.session), terminal)?.cloud,
        (None, None) => main_job::room()?.0.into(),
    };
    if format!("{:032x}", cloud.content_hash()) != session.capture.content {
        return Err(Failure::failed(format!(
            "the capture is not the one that the session was made with (its content hash differs); name that one by --file, or segment \
             again: {}",
            options.session.display()
        )));
    }
    let job = Job {
        cloud,
        file: session.capture.file.clone(),
        task: &task,
        out: &options.out,
        keep: if options.no_cache { Keep::Nothing } else { Keep::InCache },
        began,
    };
    let (done, again) = job::run(&job, terminal)?;
    let (same, differ): (Vec<_>, Vec<_>) =
        session.files.iter().map(|(name, hash)| (name.clone(), again.files.get(name) == Some(hash))).partition(|f| f.1);
    let names = |list: Vec<(String, bool)>| list.into_iter().map(|f| f.0).collect::<Vec<String>>();
    let report = Report {
        session: options.session.display().to_string(),
        folder: done.folder,
        selected: done.selected,
        identical: differ.is_empty(),
        same: names(same),
        differ: names(differ),
        seconds: began.elapsed().as_secs_f64(),
    };
    terminal.report(&report, || report.text())?;
    if report.identical {
        return Ok(());
    }
    let by = if session.program == env!("CARGO_PKG_VERSION") {
        String::new()
    } else {
        format!("; the session was made by version {}, this is {}", session.program, env!("CARGO_PKG_VERSION"))
    };
    Err(Failure::failed(format!("the results are not the same as then{by}: {}", report.differ.join(", "))))
}

/// Where the capture is now: where it was, seen from here or from the session's folder.
fn found(file: &str, session: &Path) -> PathBuf {
    let beside = session.parent().map(|folder| folder.join(file));
    match beside {
        Some(beside) if !Path::new(file).exists() && beside.exists() => beside,
        _ => PathBuf::from(file),
    }
}

impl Report {
    fn text(&self) -> String {
        if self.identical {
            format!("the same bits as then, in all {} files: {}", self.same.len(), self.folder)
        } else {
            format!("the same bits in {} files, others in {}: {}", self.same.len(), self.differ.join(", "), self.folder)
        }
    }
}
