//! The table.

use std::fmt;

use peer_common::{Failure, Report, median};

use crate::contenders::{ALONE, BASE, Contender};

/// What is known of one contender.
pub(crate) struct Row {
    pub(crate) contender: &'static Contender,
    pub(crate) reports: Vec<Report>,
    /// A round that told of the stages.
    pub(crate) staged: Option<Report>,
    pub(crate) failures: Vec<Failure>,
    pub(crate) psnr: Result<f64, Failure>,
}

impl Row {
    pub(crate) fn new(contender: &'static Contender) -> Self {
        let psnr = Err(Failure("no picture was asked for".to_owned()));
        Self { contender, reports: Vec::new(), staged: None, failures: Vec::new(), psnr }
    }

    pub(crate) fn add(&mut self, outcome: Result<Report, Failure>) {
        match outcome {
            Ok(report) => self.reports.push(report),
            Err(failure) => self.failures.push(failure),
        }
    }

    /// Median over all frames of all rounds, and the least.
    pub(crate) fn wall(&self) -> Option<(f64, f64)> {
        self.over(|s| s.wall_ms)
    }

    pub(crate) fn cpu(&self) -> Option<(f64, f64)> {
        self.over(|s| s.cpu_ms)
    }

    fn over(&self, of: impl Fn(&peer_common::Sample) -> f64) -> Option<(f64, f64)> {
        let values: Vec<f64> = self.reports.iter().flat_map(|r| &r.samples).map(of).collect();
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        (!values.is_empty()).then(|| (median(values), least))
    }

    /// What the contender says of its stages: name, milliseconds, least bytes moved.
    pub(crate) fn stages(&self) -> impl Iterator<Item = (&str, f64, Option<f64>)> {
        let stages = self.staged.iter().flat_map(|report| &report.stages);
        stages.map(|stage| (&*stage.name, stage.ms, stage.bytes))
    }
}

/// All rows.
pub(crate) struct Table<'a>(pub(crate) &'a [Row]);

impl Table<'_> {
    fn of(&self, name: &str) -> Option<&Row> {
        self.0.iter().find(|row| row.contender.name == name)
    }
}

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| contender | wall ms (least) | CPU ms (least) | frames/s | CPU : {BASE} | CPU : {ALONE} | PSNR dB | first frame s | MiB |"
        )?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|")?;
        let base = self.of(BASE).and_then(Row::cpu);
        let alone = self.of(ALONE).and_then(Row::cpu);
        let dash = || "-".to_owned();
        for row in self.0 {
            let pair = |v: Option<(f64, f64)>| v.map_or_else(dash, |(mid, least)| format!("{mid:.1} ({least:.1})"));
            let ratio = |to: Option<(f64, f64)>| {
                row.cpu().zip(to).map_or_else(dash, |(own, to)| format!("{:.2}", own.0 / to.0))
            };
            let first = median(row.reports.iter().map(|r| r.first_frame_ms * 1e-3).collect());
            let memory = row.reports.iter().filter_map(|r| r.memory_mib).fold(f64::NAN, f64::max);
            let number = |v: f64, digits: usize| if v.is_finite() { format!("{v:.digits$}") } else { dash() };
            writeln!(
                f,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                row.contender.name,
                pair(row.wall()),
                pair(row.cpu()),
                row.wall().map_or_else(dash, |(mid, _)| format!("{:.1}", 1e3 / mid)),
                ratio(base),
                ratio(alone),
                row.psnr.as_ref().map_or_else(|_| dash(), |&v| number(v, 1)),
                number(first, 1),
                number(memory, 0),
            )?;
        }
        writeln!(f)?;
        for row in self.0 {
            let told: Vec<String> = row
                .stages()
                .filter(|(_, ms, _)| *ms >= 0.05)
                .map(|(name, ms, _)| format!("{name} {ms:.2} ms"))
                .collect();
            if !told.is_empty() {
                writeln!(f, "- stages of {}: {}", row.contender.name, told.join(", "))?;
            }
        }
        for row in self.0 {
            if let Some(report) = row.reports.first() {
                writeln!(f, "- {} drew on {}", row.contender.name, report.device)?;
            }
            let picture = row.psnr.as_ref().err().filter(|_| row.contender.draws);
            for failure in row.failures.first().into_iter().chain(picture) {
                writeln!(f, "- {}: {failure}", row.contender.name)?;
            }
        }
        Ok(())
    }
}
