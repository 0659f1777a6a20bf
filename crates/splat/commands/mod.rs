//! One file per subcommand, and the table of them.
//!
//! To add one: a file here with a `pub(crate) static COMMAND`, its `mod` line, and its line in [`COMMANDS`].

mod bench;
mod cameras;
mod check;
mod completions;
mod convert;
mod eval;
mod info;
mod list;
pub(crate) mod main_job;
mod orient;
mod render;
mod replay;
mod scale;
pub(crate) mod segment;
mod select;
mod simulate;

use clap::ArgMatches;

use crate::failure::Failure;
use crate::terminal::Terminal;

/// A subcommand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Command {
    /// Its name.
    pub(crate) name: &'static str,
    /// What it does, in one line.
    pub(crate) about: &'static str,
    /// Commands to try, one a line, indented by two.
    pub(crate) examples: &'static str,
    /// Adds its options.
    pub(crate) options: fn(clap::Command) -> clap::Command,
    /// Does its job.
    pub(crate) run: fn(&ArgMatches, &Terminal) -> Result<(), Failure>,
}

/// Every subcommand, in the order of `--help`.
pub(crate) static COMMANDS: &[Command] = &[
    info::COMMAND,
    convert::COMMAND,
    cameras::COMMAND,
    render::COMMAND,
    check::COMMAND,
    segment::COMMAND,
    replay::COMMAND,
    select::COMMAND,
    orient::COMMAND,
    scale::COMMAND,
    simulate::COMMAND,
    eval::COMMAND,
    bench::COMMAND,
    list::COMMAND,
    completions::COMMAND,
];

impl Command {
    /// The command line of this subcommand.
    pub(crate) fn arguments(&self) -> clap::Command {
        // The description comes last: that of shared options would take its place.
        (self.options)(clap::Command::new(self.name))
            .about(self.about)
            .long_about(self.about)
            .after_help(format!("Examples:\n{}", self.examples))
    }
}
