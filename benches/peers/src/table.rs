//! The table.

use std::fmt;

use peer_common::{Failure, Report, median};

use crate::contenders::{ALONE, BASE, Contender};

/// What is known of one contender.
pub(crate) struct Row {
    pub(crate) contender: &'static Contender,
    pub(crate) reports: Vec<Report>,
    pub(crate) failures: Vec<Failure>,
    pub(crate) psnr: Result<f64, Failure>,
}

impl Row {
    pub(crate) fn new(contender: &'static Contender) -> Self {
        let psnr = Err(Failure("no picture was asked for".to_owned()));
        Self { contender, reports: Vec::new(), failures: Vec::new(), psnr }
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

    /// Medians over the rounds of what the contender said of its stages, in the order of the first round.
    pub(crate) fn stages(&self) -> Vec<(String, f64, Option<f64>)> {
        let Some(first) = self.reports.first() else { return Vec::new() };
        let of = |name: &str| {
            let same = |r: &Report| r.stages.iter().find(|s| s.name == name).map(|s| s.ms);
            median(self.reports.iter().filter_map(same).collect())
        };
        first.stages.iter().map(|s| (s.name.clone(), of(&s.name), s.bytes)).collect()
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
            for (name, ms, _) in row.stages().into_iter().filter(|(_, ms, _)| *ms >= 0.05).take(12) {
                writeln!(f, "- {}: {name} {ms:.2} ms", row.contender.name)?;
            }
        }
        for row in self.0 {
            let device = row.reports.first().map(|r| &*r.device).unwrap_or("nothing");
            writeln!(f, "- {} drew on {device}", row.contender.name)?;
            let picture = row.psnr.as_ref().err().filter(|_| row.contender.draws);
            for failure in row.failures.first().into_iter().chain(picture) {
                writeln!(f, "- {}: {failure}", row.contender.name)?;
            }
        }
        Ok(())
    }
}
