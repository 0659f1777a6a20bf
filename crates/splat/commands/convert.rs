//! `splat convert`: a capture into another format, whole or in part, moved or with fewer coefficients.

use std::path::PathBuf;

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_core::{Cloud, sh};
use splat_io::{Format, WriteOptions, Written};

use super::Command;
use crate::capture::Capture;
use crate::failure::Failure;
use crate::moves;
use crate::terminal::{Terminal, gaussians, grouped};

pub(crate) const COMMAND: Command = Command {
    name: "convert",
    about: "Write a capture in another format; select, move and reduce on the way",
    examples: "  splat convert scene.ply scene.spz\n  \
               splat convert scene.ply chair.ply --select selection.npy\n  \
               splat convert scene.sog upright.ply --transform 0,180,0\n  \
               splat convert scene.ply small.spz --sh-degree 0 --format-version 2",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// The capture, of any format that `splat list formats` shows
    input: PathBuf,
    /// The file to write; its ending names the format
    output: PathBuf,
    /// Write this format whatever the ending
    #[arg(long, value_name = "NAME", value_parser = format_named)]
    format: Option<FormatChoice>,
    /// Version of the format where it has several (SPZ: 2, 3, 4)
    #[arg(long, value_name = "N")]
    format_version: Option<u32>,
    /// Keep only the Gaussians selected in this .npy file (one 0 or 1 per Gaussian)
    #[arg(long, value_name = "NPY")]
    select: Option<PathBuf>,
    #[arg(long, value_name = "MOVE", allow_hyphen_values = true, help = help_line(), long_help = moves::HELP)]
    transform: Option<String>,
    /// Keep at most this degree of spherical harmonics
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=4))]
    sh_degree: Option<u8>,
    /// Write here, as .npy, which input Gaussian each written one is
    #[arg(long, value_name = "NPY")]
    order: Option<PathBuf>,
}

/// A format by its name.
#[derive(Clone, Copy)]
struct FormatChoice(&'static dyn Format);

impl std::fmt::Debug for FormatChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name())
    }
}

fn format_named(name: &str) -> Result<FormatChoice, String> {
    let known = || splat_io::FORMATS.iter().map(|f| f.name()).collect::<Vec<_>>().join(", ");
    splat_io::format_named(name).map(FormatChoice).ok_or_else(|| format!("no such format; there are {}", known()))
}

fn help_line() -> &'static str {
    moves::HELP.split("\n\n").next().unwrap_or_default()
}

#[derive(Serialize)]
struct Report {
    input: String,
    output: String,
    format: &'static str,
    gaussians_read: usize,
    gaussians_written: usize,
    bytes_read: u64,
    bytes_written: u64,
    sh_degree: u8,
    /// Whether Gaussians stand in another order than in the input.
    reordered: bool,
    losses: Vec<String>,
    notes: Vec<String>,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let format = match options.format {
        Some(FormatChoice(format)) => format,
        // Before the work, not after it.
        None => splat_io::format_of_name(&options.output.to_string_lossy()).ok_or_else(|| {
            let endings: Vec<String> =
                splat_io::FORMATS.iter().filter(|f| f.writable()).map(|f| format!(".{}", f.extensions()[0])).collect();
            Failure::usage(format!(
                "the ending of the output names no format; take one of {}, or --format: {}",
                endings.join(", "),
                options.output.display()
            ))
        })?,
    };
    let transform = options.transform.as_deref().map(moves::similarity).transpose()?;
    let capture = Capture::read_and_tell(&options.input, terminal)?;
    let ids = match &options.select {
        Some(path) => Some(capture.selection(path)?.ids()),
        None => None,
    };
    // The reader's notes (axes) matter to whoever reads the new file.
    capture.report.notes.iter().for_each(|note| terminal.note(note));
    let notes = capture.oddities();
    let (bytes_read, gaussians_read) = (capture.report.bytes, capture.cloud.len());
    let mut losses = Vec::new();
    let mut cloud = capture.cloud;
    if let Some(ids) = &ids {
        cloud = cloud.pick(ids).into();
    }
    if let Some(transform) = &transform {
        cloud = cloud.transformed(transform).into();
    }
    if let Some(degree) = options.sh_degree.filter(|&d| d < cloud.sh_degree()) {
        losses.push(format!("spherical harmonics above degree {degree} were left out, as asked"));
        cloud = with_degree(&cloud, degree)?.into();
    }
    let mut settings = WriteOptions::default();
    settings.version = options.format_version;
    let working = terminal.progress(&format!("writing {}", options.output.display()), None);
    let written = splat_io::write_file(&options.output, |sink| splat_io::write_as(format, &cloud, &settings, sink))?;
    drop(working);
    if let Some(path) = &options.order {
        splat_io::npy::write_u32(path, &input_ids(ids.as_deref(), &written, cloud.len()))?;
    }
    losses.extend(written.losses.iter().cloned());
    let report = Report {
        input: options.input.display().to_string(),
        output: options.output.display().to_string(),
        format: format.name(),
        gaussians_read,
        gaussians_written: cloud.len(),
        bytes_read,
        bytes_written: written.bytes,
        sh_degree: cloud.sh_degree(),
        reordered: written.order.is_some(),
        losses,
        notes,
    };
    if terminal.json {
        return terminal.report(&report, String::new);
    }
    for loss in &report.losses {
        terminal.note(loss);
    }
    if report.reordered && options.order.is_none() {
        terminal.note(
            "the Gaussians were put into another order: selections made for the input do not fit (--order tells it)",
        );
    }
    terminal.done(format!(
        "wrote {} as {}, {} bytes: {}",
        gaussians(report.gaussians_written),
        report.format,
        grouped(report.bytes_written as usize),
        report.output
    ));
    Ok(())
}

/// For each written Gaussian its id in the input.
fn input_ids(selected: Option<&[u32]>, written: &Written, count: usize) -> Vec<u32> {
    (0..count as u32)
        .map(|k| written.order.as_ref().map_or(k, |order| order[k as usize]))
        .map(|k| selected.map_or(k, |ids| ids[k as usize]))
        .collect()
}

/// The cloud with the coefficients above `degree` left out.
pub(super) fn with_degree(cloud: &Cloud, degree: u8) -> Result<Cloud, Failure> {
    let kept = 3 * sh::coefficient_count(degree);
    let mut arrays = cloud.clone().into_arrays();
    arrays.sh = arrays.sh.chunks_exact(cloud.sh_stride()).flat_map(|c| &c[..kept]).copied().collect();
    arrays.sh_degree = degree;
    // The layout of the file it came from counts coefficients.
    arrays.source.layout = None;
    Ok(Cloud::new(arrays)?)
}
