//! `splat check`: what is wrong with a capture, and the same capture with that put right.
//!
//! [`findings`] holds the tests; the order of [`findings::CHECKS`] is the order of repairs: what changes values first, what
//! drops Gaussians last.

mod conventions;
mod findings;
mod gaussians;

use std::path::PathBuf;

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_core::{Cloud, Selection};
use splat_io::WriteOptions;

use self::findings::{CHECKS, Finding, Look, Repair};
use super::Command;
use crate::capture::Capture;
use crate::failure::Failure;
use crate::terminal::{self, Terminal, grouped};

pub(crate) const COMMAND: Command = Command {
    name: "check",
    about: "Tell what is wrong with a capture, and repair it",
    examples: "  splat check scene.ply\n  \
               splat check scene.ply --json\n  \
               splat check scene.ply --repair clean.ply\n  \
               splat check scene.ply --repair clean.ply --keep floaters --keep giants\n  \
               splat check scene.ply --strict --quiet",
    options: |command| Options::augment_args(command).after_long_help(checks_help()),
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// The capture
    file: PathBuf,
    /// Write the capture here with everything found put right
    #[arg(long, value_name = "OUT")]
    repair: Option<PathBuf>,
    /// Leave what this check finds as it is; may be given several times
    #[arg(long, value_name = "CHECK", value_parser = check_name, requires = "repair")]
    keep: Vec<String>,
    /// Fail (exit code 1) if anything is found
    #[arg(long)]
    strict: bool,
}

fn check_name(name: &str) -> Result<String, String> {
    let known = || CHECKS.iter().map(|c| c.name).collect::<Vec<_>>().join(", ");
    if CHECKS.iter().any(|c| c.name == name) {
        Ok(name.to_owned())
    } else {
        Err(format!("no such check; there are {}", known()))
    }
}

fn checks_help() -> String {
    let lines: Vec<String> = CHECKS.iter().map(|c| format!("  {:<14} {}", c.name, c.about)).collect();
    format!("Checks:\n{}\n\nExamples:\n{}", lines.join("\n"), COMMAND.examples)
}

#[derive(Serialize)]
struct Report {
    file: String,
    gaussians: usize,
    findings: Vec<Told>,
    /// What the reader put right by itself.
    notes: Vec<String>,
    repaired: Option<Repaired>,
}

#[derive(Serialize)]
struct Told {
    check: &'static str,
    /// Gaussians, unless `what` says otherwise.
    count: usize,
    what: String,
    advice: &'static str,
}

#[derive(Serialize)]
struct Repaired {
    output: String,
    gaussians: usize,
    dropped: usize,
    /// What was done, one sentence per finding.
    done: Vec<String>,
    losses: Vec<String>,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let capture = Capture::read(&options.file, terminal)?;
    let working = terminal.progress("checking", Some(CHECKS.len() as u64));
    let look = Look::new(&capture.cloud);
    let mut findings = Vec::new();
    for (k, check) in CHECKS.iter().enumerate() {
        working.at(k as u64);
        if let Some(finding) = (check.find)(&look) {
            findings.push((check, finding));
        }
    }
    drop(working);
    let told = |(check, finding): &(&findings::Check, Finding)| Told {
        check: check.name,
        count: finding.count,
        what: finding.what.clone(),
        advice: check.advice,
    };
    let mut report = Report {
        file: options.file.display().to_string(),
        gaussians: capture.cloud.len(),
        findings: findings.iter().map(told).collect(),
        notes: capture.report.notes.clone(),
        repaired: None,
    };
    if let Some(out) = &options.repair {
        let (cloud, done) = repair(&capture.cloud, &options.keep)?;
        let working = terminal.progress(&format!("writing {}", out.display()), None);
        let written = splat_io::write(out, &cloud, &WriteOptions::default())?;
        drop(working);
        report.repaired = Some(Repaired {
            output: out.display().to_string(),
            gaussians: cloud.len(),
            dropped: capture.cloud.len() - cloud.len(),
            done,
            losses: written.losses,
        });
    }
    terminal.report(&report, || report.text())?;
    if options.strict && !report.findings.is_empty() {
        return Err(Failure::failed(format!(
            "{} checks found something; `splat check FILE --repair OUT` puts it right: {}",
            report.findings.len(),
            report.file
        )));
    }
    Ok(())
}

/// Puts right what the checks find, one check after the other, each on what the one before left.
fn repair(cloud: &Cloud, keep: &[String]) -> Result<(Cloud, Vec<String>), Failure> {
    let mut cloud = cloud.clone();
    let mut done = Vec::new();
    for check in CHECKS.iter().filter(|c| !keep.iter().any(|k| k == c.name)) {
        let Some(finding) = (check.find)(&Look::new(&cloud)) else { continue };
        match finding.repair {
            Repair::Drop(ids) => {
                let mut kept = Selection::from_ids(cloud.len(), ids);
                kept.invert();
                done.push(format!("{}: dropped {}", check.name, terminal::gaussians(cloud.len() - kept.count())));
                cloud = cloud.pick(&kept.ids());
            }
            Repair::Change(change) => {
                let mut arrays = cloud.into_arrays();
                done.push(format!("{}: {}", check.name, change(&mut arrays)));
                cloud = Cloud::new(arrays)?;
            }
            Repair::Nothing => {}
        }
    }
    Ok((cloud, done))
}

impl Report {
    fn text(&self) -> String {
        let mut lines = vec![format!("{}: {}", self.file, terminal::gaussians(self.gaussians))];
        for told in &self.findings {
            lines.push(format!("  {:<14} {:>9}  {}", told.check, grouped(told.count), told.what));
            lines.push(format!("  {:<14} {:>9}  -> {}", "", "", told.advice));
        }
        lines.extend(self.notes.iter().map(|n| format!("  note: {n}")));
        if self.findings.is_empty() {
            lines.push("  nothing to complain about".to_owned());
        }
        if let Some(repaired) = &self.repaired {
            lines.extend(repaired.done.iter().map(|d| format!("  repaired {d}")));
            lines.extend(repaired.losses.iter().map(|l| format!("  note: {l}")));
            lines.push(format!("wrote {}: {}", terminal::gaussians(repaired.gaussians), repaired.output));
        }
        lines.join("\n")
    }
}
