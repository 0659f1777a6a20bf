//! Our own contenders: the Bevy plugin, the rasteriser alone, and a Bevy frame without splats.

mod bandwidth;
mod device;
mod gpu;
mod plugin;
mod rasterizer;

use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use peer_common::{Failure, Job};

/// Draws a capture and reports what the frames cost
#[derive(Parser)]
enum Contender {
    /// Bevy with bevy_splat
    Plugin {
        #[command(flatten)]
        job: Job,
        /// What draws
        #[arg(long, value_enum, default_value_t = Backend::Auto)]
        backend: Backend,
    },
    /// Bevy with a camera and nothing to see
    Empty {
        #[command(flatten)]
        job: Job,
    },
    /// How fast the graphics device copies memory
    Bandwidth,
    /// The rasteriser without an engine
    Rasterizer {
        #[command(flatten)]
        job: Job,
        /// What draws
        #[arg(long, value_enum, default_value_t = Backend::Cpu)]
        backend: Backend,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Backend {
    /// As the plugin decides: the graphics device unless that is a processor
    Auto,
    /// The processor
    Cpu,
    /// The graphics device
    Gpu,
}

fn main() -> ExitCode {
    let done = match Contender::parse() {
        Contender::Plugin { job, backend } => plugin::run(&job, backend),
        Contender::Empty { job } => plugin::empty(&job),
        Contender::Bandwidth => bandwidth::run(),
        Contender::Rasterizer { job, backend: Backend::Gpu } => gpu::run(&job),
        Contender::Rasterizer { job, .. } => rasterizer::cpu(&job),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

/// What goes wrong with a file or a device, as it says itself.
fn failed(why: impl std::fmt::Display) -> Failure {
    Failure(why.to_string())
}
