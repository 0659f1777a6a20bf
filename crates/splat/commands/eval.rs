//! `splat eval`: scores of a method on captures with labels.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use clap::builder::PossibleValuesParser;
use clap::{Args, FromArgMatches, ValueEnum};
use serde::Serialize;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::eval::{EvalMethod, EvalSettings, ObjectScore, PromptKind, PromptMode, evaluate};

use super::Command;
use crate::bench_scene;
use crate::failure::Failure;
use crate::terminal::Terminal;

pub(crate) const COMMAND: Command = Command {
    name: "eval",
    about: "Score a method on labelled captures: how well it finds each object from a click, a box or masks",
    examples: "  splat eval assets/room\n  \
               splat eval assets/room --prompt best3 --clicks 5\n  \
               splat eval target/scenes/plaza target/scenes/desk --prompt mask3 --json\n  \
               splat eval target/scenes/bench --method votes --prompt mask --leave-out \"label plate\"",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

/// IoU at which an object counts as found by clicks.
const FOUND: f64 = 0.9;

#[derive(Args, Debug)]
struct Options {
    /// Folders of the benchmark layout, or folders that have such folders in them
    #[arg(required = true, value_name = "BENCH_DIR")]
    folders: Vec<PathBuf>,
    /// Who answers: the capture's own structure (graph), means inside the masks (frustum), or a rule over the masks alone
    #[arg(long, default_value = "graph", value_parser = PossibleValuesParser::new(EvalMethod::names()))]
    method: String,
    /// What is given: a click (its first proposal, the best of three, or the best step of the granularity wheel), a
    /// box, the mask of one view, or the masks of three [default: click, or best3 with --clicks]
    #[arg(long, value_parser = PossibleValuesParser::new(PromptMode::ALL.map(PromptMode::name)))]
    prompt: Option<String>,
    /// Let a scripted user go on from the best of three proposals, up to this many clicks in all
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100))]
    clicks: Option<u32>,
    /// Prompts in views that have the whole object, or also those in views whose edge cuts it
    #[arg(long, value_enum, default_value = "main")]
    objects: Objects,
    /// Leave out the object of this name
    #[arg(long, value_name = "NAME")]
    leave_out: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Objects {
    /// Main prompts
    Main,
    /// Main and cut prompts
    All,
}

#[derive(Debug, Serialize)]
struct Report {
    scenes: Vec<SceneReport>,
    mean: Scores,
}

#[derive(Debug, Serialize)]
struct SceneReport {
    scene: String,
    objects: Vec<ObjectReport>,
}

#[derive(Debug, Serialize)]
struct ObjectReport {
    label: u8,
    name: String,
    #[serde(flatten)]
    scores: Scores,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
struct Scores {
    iou_visible: f64,
    iou_weighted: f64,
    iou_2d: Option<f64>,
    boundary_iou_2d: Option<f64>,
    removal_residual: Option<f64>,
    clicks: Vec<Clicked>,
    seconds: BTreeMap<String, f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Clicked {
    n: u32,
    iou_visible: f64,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let settings = settings(options)?;
    let mut folders = Vec::new();
    for folder in &options.folders {
        folders.extend(bench_scene::find(folder)?);
    }
    let wanted = |kind: PromptKind, name: &str| {
        (kind == PromptKind::Main || options.objects == Objects::All) && !options.leave_out.iter().any(|n| n == name)
    };
    let mut scenes = Vec::with_capacity(folders.len());
    for folder in &folders {
        let start = Instant::now();
        let bench = bench_scene::read(folder, terminal, wanted)?;
        let load = start.elapsed().as_secs_f64();
        let mut raster = CpuRasterizer::new();
        let scores = evaluate(&bench, &settings, &mut raster, &terminal.run())?;
        let kinds = bench.prompts.iter().map(|p| p.kind);
        let objects = scores.into_iter().zip(kinds).map(|(score, kind)| ObjectReport::new(score, kind, load)).collect();
        scenes.push(SceneReport { scene: folder.name.clone(), objects });
        if !options.leave_out.is_empty() && bench.prompts.is_empty() {
            terminal.note(format!("all objects of {} are left out", folder.name));
        }
    }
    let all: Vec<&Scores> = scenes.iter().flat_map(|s| &s.objects).map(|o| &o.scores).collect();
    if all.is_empty() {
        return Err(Failure::failed("there is no object to score; leave fewer out, or ask for --objects all"));
    }
    let report = Report { mean: Scores::mean(&all), scenes };
    terminal.report(&report, || report.text(&settings))
}

fn settings(options: &Options) -> Result<EvalSettings, Failure> {
    let unknown = |what: &str, name: &str| Failure::usage(format!("there is no {what} `{name}`"));
    let method = EvalMethod::named(&options.method).ok_or_else(|| unknown("method", &options.method))?;
    let clicks = options.clicks.unwrap_or(0);
    let usual = if clicks > 0 { PromptMode::Best3 } else { PromptMode::Click };
    let prompt = match &options.prompt {
        Some(name) => PromptMode::ALL.into_iter().find(|p| p.name() == name).ok_or_else(|| unknown("prompt", name))?,
        None if method.answers(usual) => usual,
        None => PromptMode::Mask,
    };
    if !method.answers(prompt) || (clicks > 0 && !method.answers(PromptMode::Click)) {
        return Err(Failure::usage(format!(
            "the method `{}` answers masks and boxes only; use --prompt mask, mask3 or box without --clicks, or --method graph",
            method.name()
        )));
    }
    Ok(EvalSettings { method, prompt, clicks })
}

impl ObjectReport {
    fn new(score: ObjectScore, kind: PromptKind, load: f64) -> Self {
        let load = ("load".to_owned(), load);
        let seconds = score.seconds.into_iter().map(|(stage, s)| (stage.to_owned(), s)).chain([load]).collect();
        let clicks = score.clicks.iter().map(|c| Clicked { n: c.n, iou_visible: c.iou_visible }).collect();
        let name = match kind {
            PromptKind::Main => score.name,
            PromptKind::Cut => format!("{} (cut)", score.name),
        };
        let scores = Scores {
            iou_visible: score.iou_visible,
            iou_weighted: score.iou_weighted,
            iou_2d: score.iou_2d,
            boundary_iou_2d: score.boundary_iou_2d,
            removal_residual: score.removal_residual,
            clicks,
            seconds,
        };
        Self { label: score.label, name, scores }
    }
}

/// Mean of what is there; `None` of nothing.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

impl Scores {
    /// Means over objects, each score over those that have it.
    fn mean(all: &[&Self]) -> Self {
        let of = |get: fn(&Self) -> Option<f64>| mean(all.iter().filter_map(|s| get(s)));
        let points = all.iter().map(|s| s.clicks.len()).max().unwrap_or(0);
        let clicks = (0..points).filter_map(|k| {
            let n = all.iter().find_map(|s| s.clicks.get(k))?.n;
            Some(Clicked { n, iou_visible: mean(all.iter().filter_map(|s| Some(s.clicks.get(k)?.iou_visible)))? })
        });
        let stages: BTreeMap<&String, ()> = all.iter().flat_map(|s| s.seconds.keys()).map(|k| (k, ())).collect();
        let seconds = stages
            .into_keys()
            .filter_map(|stage| Some((stage.clone(), mean(all.iter().filter_map(|s| s.seconds.get(stage).copied()))?)));
        Self {
            iou_visible: of(|s| Some(s.iou_visible)).unwrap_or_default(),
            iou_weighted: of(|s| Some(s.iou_weighted)).unwrap_or_default(),
            iou_2d: of(|s| s.iou_2d),
            boundary_iou_2d: of(|s| s.boundary_iou_2d),
            removal_residual: of(|s| s.removal_residual),
            clicks: clicks.collect(),
            seconds: seconds.collect(),
        }
    }

    /// Clicks after which the object counts as found, if that is reached.
    fn clicks_to_found(&self) -> Option<u32> {
        self.clicks.iter().find(|c| c.iou_visible >= FOUND).map(|c| c.n)
    }

    /// Scores, then seconds of these stages, in columns.
    fn line(&self, name: &str, stages: &[&str]) -> String {
        let known = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
        let (a, b) = (Some(self.iou_visible), Some(self.iou_weighted));
        let scores = [a, b, self.iou_2d, self.boundary_iou_2d, self.removal_residual];
        let seconds = stages.iter().map(|&stage| self.seconds.get(stage).copied());
        let cells = scores.iter().map(|&v| format!(" {:>8}", known(v)));
        let cells: String = cells.chain(seconds.map(|v| format!(" {:>15}", known(v)))).collect();
        format!("  {name:<26}{cells}\n")
    }

    fn curve(&self, name: &str, found: &str) -> String {
        let points: String = self.clicks.iter().map(|c| format!(" {:>6.3}", c.iou_visible)).collect();
        format!("  {name:<26}{points}   {found}\n")
    }
}

/// Stages of a scene, then those of an object, in the order in which they run.
const STAGES: ([&str; 2], [&str; 4]) = (["load", "prepare"], ["first_click", "further_click", "box", "masks"]);

impl Report {
    fn text(&self, settings: &EvalSettings) -> String {
        let stages: Vec<&str> = STAGES.1.into_iter().filter(|s| self.mean.seconds.contains_key(*s)).collect();
        let heads = ["visible", "weighted", "2d", "boundary", "residual"].map(|h| format!(" {h:>8}")).concat();
        let heads: String =
            std::iter::once(heads).chain(stages.iter().map(|s| format!(" {:>15}", format!("{s} s")))).collect();
        let (method, prompt) = (settings.method.name(), settings.prompt.name());
        let mut text = format!("method {method}, prompt {prompt}\n  {:<26}{heads}\n", "object");
        for scene in &self.scenes {
            text.push_str(&scene.scene);
            if let Some(object) = scene.objects.first() {
                let seconds = &object.scores.seconds;
                let told = STAGES.0.iter().filter_map(|&s| Some(format!("{s} {:.3} s", seconds.get(s)?)));
                text.push_str(&format!(": {}", told.collect::<Vec<_>>().join(", ")));
            }
            text.push('\n');
            for object in &scene.objects {
                text.push_str(&object.scores.line(&object.name, &stages));
            }
        }
        let objects = || self.scenes.iter().flat_map(|s| &s.objects);
        text.push_str(&self.mean.line(&format!("mean of {}", objects().count()), &stages));
        if settings.clicks > 0 {
            text.push_str(&format!(
                "visible IoU after 1 to {} clicks of a scripted user, and clicks to {FOUND:.2}\n",
                settings.clicks
            ));
            for object in objects() {
                let found = object.scores.clicks_to_found().map_or_else(|| "-".to_owned(), |n| n.to_string());
                text.push_str(&object.scores.curve(&object.name, &found));
            }
            let found: Vec<f64> = objects().filter_map(|o| o.scores.clicks_to_found()).map(f64::from).collect();
            let clicks = mean(found.iter().copied()).map_or_else(String::new, |clicks| format!("{clicks:.2}, "));
            let told = format!("{clicks}{} of {} reach it", found.len(), objects().count());
            text.push_str(&self.mean.curve("mean", &told));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(iou: f64, iou_2d: Option<f64>, clicks: &[f64]) -> Scores {
        let clicks = (1..).zip(clicks).map(|(n, &iou_visible)| Clicked { n, iou_visible }).collect();
        let seconds = BTreeMap::from([("load".to_owned(), iou)]);
        Scores { iou_visible: iou, iou_2d, clicks, seconds, ..Scores::default() }
    }

    #[test]
    fn means_are_over_the_objects_that_have_a_score() {
        let (a, b) = (scores(0.5, None, &[0.5, 1.0]), scores(1.0, Some(0.25), &[0.75]));
        let m = Scores::mean(&[&a, &b]);
        assert_eq!((m.iou_visible, m.iou_2d, m.boundary_iou_2d), (0.75, Some(0.25), None));
        assert_eq!(m.clicks, [Clicked { n: 1, iou_visible: 0.625 }, Clicked { n: 2, iou_visible: 1.0 }]);
        assert_eq!(m.seconds["load"], 0.75);
    }

    #[test]
    fn the_first_click_that_is_good_enough_counts() {
        assert_eq!(scores(0.5, None, &[0.5, 0.9, 0.8, 0.95]).clicks_to_found(), Some(2));
        assert_eq!(scores(0.5, None, &[0.5]).clicks_to_found(), None);
        assert_eq!(scores(0.95, None, &[]).clicks_to_found(), None);
    }
}
