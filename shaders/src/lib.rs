//! WGSL of the splat rasteriser: one file a stage, one table of constants, checked without a device.
//!
//! A stage's text is [`constants::wgsl`] + `common.wgsl` + the stage's own file. Variants are made by switches, never by
//! copying a file: lines between `//#if NAME` (or `//#if !NAME`) and `//#end`, with an optional `//#else`, stay only where
//! the switch is set. They nest. `@binding(next)` becomes the first number from 0 that no earlier such line has.

pub mod constants;
pub mod layouts;

use std::fmt::Write as _;

/// A stage of the frame.
#[derive(Clone, Copy, Debug)]
pub struct Stage {
    /// Name of its file, without the ending.
    pub name: &'static str,
    /// Its own text, switches not yet applied.
    pub text: &'static str,
    /// Sets of switches it is used with: tests validate each of them.
    pub variants: &'static [&'static [&'static str]],
}

/// Where a binding's number depends on the switches: they are counted from 0.
const NEXT: &str = "@binding(next)";

/// Functions that all stages may use.
const COMMON: &str = include_str!("../common.wgsl");

/// Declares the stages: a constant for each, and the table of all.
macro_rules! stages {
    ($($(#[$doc:meta])* $name:ident = $file:literal, $variants:expr;)*) => {
        $($(#[$doc])* pub const $name: Stage =
            Stage { name: $file, text: include_str!(concat!("../", $file, ".wgsl")), variants: $variants };)*

        /// All stages.
        pub const STAGES: &[Stage] = &[$($name),*];
    };
}

stages! {
    /// Gaussians to splats.
    PROJECT = "project", &[&[], &["PACKED"], &["DEFORM"], &["PACKED", "DEFORM"]];
    /// Keys of the splats that may be seen.
    COMPACT = "compact", &[&["COUNT"], &[]];
    /// Prefix sums.
    SCAN = "scan", &[&[]];
    /// One pass of the radix sort: a variant per kernel.
    SORT = "sort", &[
        &["PREPARE"],
        &["HISTOGRAM"],
        &["SCANS", "ROWS"],
        &["SCANS", "SCATTER"],
        &["SCANS", "SCATTER", "SUBGROUPS"],
    ];
    /// Pairs of tile and splat: a variant per kernel.
    BIN = "bin", &[&["PREPARE"], &["SHAPES", "SPLATS"], &["SHAPES", "PAIRS"], &["RANGES"]];
    /// Splats to pixels: any set of pictures, four channels of features, or votes of some masks.
    BLEND = "blend", &[
        &["COLOR"],
        &["COLOR", "WIDE"],
        &["COLOR", "MEDIAN", "EXPECTED", "HITS", "STRONGEST", "VISIBLE", "LIMIT", "DEPTH", "SUMS"],
        &["HITS"],
        &["FEATURES", "LIMIT", "DEPTH"],
        &["FEATURES"],
        &["VOTES", "SUMS"],
        &["VOTES", "LIMIT", "DEPTH", "SUMS"],
    ];
}

/// The WGSL of a stage without switches.
pub fn source(stage: &Stage) -> String {
    variant(stage, &[])
}

/// The WGSL of a stage with some switches set.
///
/// # Panics
/// If the text's switches do not match: a test tries every stage.
pub fn variant(stage: &Stage, switches: &[&str]) -> String {
    let mut text = constants::wgsl();
    text.push_str(COMMON);
    // Whether the lines of each open switch stay.
    let mut open: Vec<bool> = Vec::new();
    let mut bindings = 0;
    for line in stage.text.lines() {
        let mark = line.trim();
        if let Some(name) = mark.strip_prefix("//#if ") {
            let (name, wanted) = name.strip_prefix('!').map_or((name, true), |name| (name, false));
            open.push(switches.contains(&name) == wanted);
        } else if mark == "//#else" {
            let last = open.last_mut().expect("`//#else` follows `//#if`");
            *last = !*last;
        } else if mark == "//#end" {
            open.pop().expect("`//#end` follows `//#if`");
        } else if open.iter().all(|&stays| stays) {
            if line.contains(NEXT) {
                let line = line.replace(NEXT, &format!("@binding({bindings})"));
                writeln!(text, "{line}").expect("writing to a string");
                bindings += 1;
            } else {
                writeln!(text, "{line}").expect("writing to a string");
            }
        }
    }
    assert!(open.is_empty(), "`//#if` without `//#end` in {}", stage.name);
    text
}
