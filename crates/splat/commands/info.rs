//! `splat info`: what is in a capture.

use std::fmt::Write;
use std::path::PathBuf;

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_core::bounds::robust_bounds;
use splat_core::glam::Vec3;
use splat_core::{Cloud, ExtraValues};

use super::Command;
use crate::capture::Capture;
use crate::failure::Failure;
use crate::terminal::{Terminal, gaussians, grouped};

pub(crate) const COMMAND: Command = Command {
    name: "info",
    about: "Tell what is in a capture: format, counts, bounds, statistics, oddities",
    examples: "  splat info scene.ply\n  splat info scene.sog --json",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// The capture, of any format that `splat list` shows
    file: PathBuf,
}

#[derive(Serialize)]
struct Info {
    file: String,
    format: &'static str,
    bytes: u64,
    gaussians: usize,
    sh_degree: u8,
    antialiased: bool,
    /// Where +X, +Y and +Z point, if the file says so.
    axes: Option<String>,
    metres_per_unit: Option<f64>,
    content_hash: String,
    bounds: Option<Bounds>,
    robust: Option<Robust>,
    opacity: Option<Statistics>,
    scale: Option<Statistics>,
    transparent: usize,
    extras: Vec<Extra>,
    comments: Vec<String>,
    not_finite: usize,
    bad_rotations: usize,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct Bounds {
    min: [f32; 3],
    max: [f32; 3],
}

#[derive(Serialize)]
struct Robust {
    center: [f32; 3],
    min: [f32; 3],
    max: [f32; 3],
    radius: f32,
}

/// Of activated values over all drawable Gaussians.
#[derive(Serialize)]
struct Statistics {
    min: f32,
    p05: f32,
    median: f32,
    p95: f32,
    max: f32,
}

#[derive(Serialize)]
struct Extra {
    name: String,
    r#type: &'static str,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let capture = Capture::read(&options.file, terminal)?;
    let info = Info::of(&capture);
    terminal.report(&info, || info.text())
}

impl Info {
    fn of(capture: &Capture) -> Self {
        let cloud = &*capture.cloud;
        let drawable: Vec<usize> = (0..cloud.len()).filter(|&i| cloud.drawable(i)).collect();
        let opacities: Vec<f32> = drawable.iter().map(|&i| cloud.opacity(i)).collect();
        let largest: Vec<f32> = drawable.iter().map(|&i| cloud.scale(i).max_element()).collect();
        let source = cloud.source();
        Self {
            file: capture.path.display().to_string(),
            format: capture.report.format,
            bytes: capture.report.bytes,
            gaussians: cloud.len(),
            sh_degree: cloud.sh_degree(),
            antialiased: source.antialiased,
            axes: (!source.axes.is_empty()).then(|| source.axes.clone()),
            metres_per_unit: source.metres_per_unit(),
            content_hash: format!("{:032x}", cloud.content_hash()),
            bounds: bounds(cloud, &drawable),
            robust: robust_bounds(cloud).map(|b| Robust {
                center: b.center.to_array(),
                min: b.min.to_array(),
                max: b.max.to_array(),
                radius: b.radius,
            }),
            transparent: opacities.iter().filter(|&&a| a < 1.0 / 255.0).count(),
            opacity: Statistics::of(opacities),
            scale: Statistics::of(largest),
            extras: cloud
                .extras()
                .iter()
                .map(|e| Extra { name: e.name.clone(), r#type: type_name(&e.values) })
                .collect(),
            comments: source.comments.clone(),
            not_finite: capture.report.not_finite,
            bad_rotations: capture.report.bad_rotations,
            notes: capture.oddities(),
        }
    }

    fn text(&self) -> String {
        let mut t = String::new();
        // Writing into a string cannot fail.
        let mut line = |name: &str, value: String| {
            let _ = writeln!(t, "{name:<14}{value}");
        };
        line("file", self.file.clone());
        line("format", format!("{}, {} bytes", self.format, grouped(self.bytes as usize)));
        line("Gaussians", grouped(self.gaussians));
        let kind = if self.antialiased { ", trained antialiased" } else { "" };
        line("SH degree", format!("{}{kind}", self.sh_degree));
        line("axes", self.axes.clone().unwrap_or_else(|| "not told (x right, y down, z forward is usual)".to_owned()));
        let metres = self.metres_per_unit.map(|m| format!("{} metres per unit", short(m as f32)));
        line("scale", metres.unwrap_or_else(|| "not known (`splat scale` measures it)".to_owned()));
        if let Some(b) = &self.bounds {
            line("bounds", format!("{} to {}", point(b.min), point(b.max)));
        }
        if let Some(b) = &self.robust {
            line("bulk", format!("{} to {} (2nd to 98th percentile)", point(b.min), point(b.max)));
            line("", format!("90 % within {} of {}", short(b.radius), point(b.center)));
        }
        if let Some(s) = &self.opacity {
            let unseen = if self.transparent > 0 {
                format!("; {} below 1/255 are never seen", grouped(self.transparent))
            } else {
                String::new()
            };
            line("opacity", format!("{s}{unseen}"));
        }
        if let Some(s) = &self.scale {
            line("largest axis", format!("{s}"));
        }
        if !self.extras.is_empty() {
            let extras: Vec<String> = self.extras.iter().map(|e| format!("{} ({})", e.name, e.r#type)).collect();
            line("extras", extras.join(", "));
        }
        for comment in &self.comments {
            line("comment", comment.clone());
        }
        line("hash", self.content_hash.clone());
        for note in &self.notes {
            line("note", note.clone());
        }
        if self.gaussians == 0 {
            line("note", format!("{}: an empty capture", gaussians(0)));
        }
        t
    }
}

impl Statistics {
    fn of(mut values: Vec<f32>) -> Option<Self> {
        values.sort_unstable_by(f32::total_cmp);
        let at = |share: f32| values[((values.len() - 1) as f32 * share).round() as usize];
        (!values.is_empty()).then(|| Self { min: at(0.0), p05: at(0.05), median: at(0.5), p95: at(0.95), max: at(1.0) })
    }
}

impl std::fmt::Display for Statistics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [min, p05, median, p95, max] = [self.min, self.p05, self.median, self.p95, self.max].map(short);
        write!(f, "median {median}, 90 % in {p05} to {p95}, all in {min} to {max}")
    }
}

fn bounds(cloud: &Cloud, drawable: &[usize]) -> Option<Bounds> {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (min, max) = drawable.iter().fold(start, |(min, max), &i| {
        let mean = cloud.means()[i];
        (min.min(mean), max.max(mean))
    });
    (!drawable.is_empty()).then(|| Bounds { min: min.to_array(), max: max.to_array() })
}

fn type_name(values: &ExtraValues) -> &'static str {
    match values {
        ExtraValues::I8(_) => "i8",
        ExtraValues::U8(_) => "u8",
        ExtraValues::I16(_) => "i16",
        ExtraValues::U16(_) => "u16",
        ExtraValues::I32(_) => "i32",
        ExtraValues::U32(_) => "u32",
        ExtraValues::F32(_) => "f32",
        ExtraValues::F64(_) => "f64",
        _ => "number",
    }
}

/// Four digits that matter.
pub(super) fn short(v: f32) -> String {
    if v == 0.0 || !v.is_finite() {
        return v.to_string();
    }
    let digits = (3 - v.abs().log10().floor() as i32).max(0) as usize;
    if digits > 9 { format!("{v:.3e}") } else { trimmed(&format!("{v:.digits$}")).to_owned() }
}

fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

pub(super) fn point(p: [f32; 3]) -> String {
    format!("({}, {}, {})", short(p[0]), short(p[1]), short(p[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_but_keep_four_digits() {
        let text: Vec<String> = [0.0, 1.0, -0.5, 1234.56, 0.00123456, 123_456.0, 1e-12].map(short).to_vec();
        assert_eq!(text, ["0", "1", "-0.5", "1235", "0.001235", "123456", "1.000e-12"]);
    }

    #[test]
    fn statistics_of_one_value_are_that_value() {
        let s = Statistics::of(vec![3.0]).unwrap();
        assert_eq!((s.min, s.p05, s.median, s.p95, s.max), (3.0, 3.0, 3.0, 3.0, 3.0));
        assert!(Statistics::of(Vec::new()).is_none());
    }
}
