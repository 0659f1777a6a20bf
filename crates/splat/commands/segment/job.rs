//! A task done from end to end: prepare, solve, take out, write, tell.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;
use splat_core::{Cloud, Mask2d, View};
use splat_io::WriteOptions;
use splat_raster::Scene;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::aggregations::MaskedView;
use splat_segment::boundary::{self, Boundary, BoundaryReport, StraddleSettings};
use splat_segment::views::evenly_spaced;

use super::pictures::{self, Subject};
use super::session::{self, CaptureRecord, Session};
use super::solve::{Answer, Offer, solve};
use super::task::{Edge, Shape, Task};
use crate::capture::write_selection;
use crate::failure::Failure;
use crate::prepare::{Keep, prepare};
use crate::terminal::{Terminal, gaussians};

/// Views at most in which the edge of an object is looked at.
const EDGE_VIEWS: usize = 12;

/// A capture to work on.
pub(crate) struct Job<'a> {
    pub(crate) cloud: Arc<Cloud>,
    /// File name as given; none for the built-in room.
    pub(crate) file: Option<String>,
    pub(crate) task: &'a Task,
    pub(crate) out: &'a Path,
    pub(crate) keep: Keep,
    /// When the program began with this.
    pub(crate) began: Instant,
}

/// What `--json` prints.
#[derive(Serialize)]
pub(crate) struct Report {
    pub(crate) file: Option<String>,
    pub(crate) gaussians: usize,
    pub(crate) selected: usize,
    /// Best first; empty for masks.
    pub(crate) proposals: Vec<Offer>,
    /// From part to group.
    pub(crate) wheel: Vec<Offer>,
    /// What was done at the edge; none where all stays whole.
    pub(crate) boundary: Option<EdgeReport>,
    /// Whether the preparation was kept from an earlier run.
    pub(crate) cached: bool,
    /// Per stage; `first_selection` counts from the start of the program.
    pub(crate) seconds: BTreeMap<&'static str, f64>,
    pub(crate) notes: Vec<String>,
    pub(crate) folder: String,
    pub(crate) files: Vec<String>,
}

/// As [`BoundaryReport`].
#[derive(Serialize)]
pub(crate) struct EdgeReport {
    straddling: usize,
    cut_selected: usize,
    cut_rest: usize,
    pieces_object: usize,
    pieces_rest: usize,
}

impl From<BoundaryReport> for EdgeReport {
    fn from(r: BoundaryReport) -> Self {
        Self {
            straddling: r.straddling,
            cut_selected: r.cut_selected,
            cut_rest: r.cut_rest,
            pieces_object: r.pieces_object,
            pieces_rest: r.pieces_rest,
        }
    }
}

/// Does a job and writes everything; gives what was found and the session as written.
///
/// # Errors
/// [`Failure`] in one sentence; a session is written last, so a folder with one is complete.
pub(crate) fn run(job: &Job<'_>, terminal: &Terminal) -> Result<(Report, Session), Failure> {
    let task = job.task;
    task.check()?;
    let format = writable_format(&task.settings.format)?;
    job.spare_the_capture(format)?;
    std::fs::create_dir_all(job.out).map_err(|e| {
        Failure::failed(format!(
            "the folder cannot be made ({e}); name one that you may write to: {}",
            job.out.display()
        ))
    })?;
    let mut watch = Watch::new(job.began);
    watch.lap("load");
    let content = job.cloud.content_hash();
    let scene = Scene::of(job.cloud.clone());
    let mut raster = CpuRasterizer::new();
    let running = terminal.run();
    let preparation = prepare(&scene, content, &task.survey, job.keep, &mut raster, &running)?;
    watch.lap("prepare");
    let prepared = &preparation.prepared;
    let answer = solve(task, &scene, prepared, &mut raster, &running)?;
    watch.seconds.insert("first_selection", answer.first.duration_since(job.began).as_secs_f64());
    watch.lap("select");
    let (object, rest, edge) = take_out(job, &scene, &answer, &mut raster, &running)?;
    watch.lap("extract");
    drop(running);

    let before = Session::read(&job.out.join(session::FILE)).ok();
    if before.is_some() {
        // Half of this run beside the session of another would be a lie.
        std::fs::remove_file(job.out.join(session::FILE))?;
    }
    let mut files = Vec::new();
    for (name, cloud) in [("object", &object), ("rest", &rest)] {
        let name = format!("{name}.{format}");
        splat_io::write(job.out.join(&name), cloud, &WriteOptions::default())?;
        files.push(name);
    }
    write_selection(&job.out.join("selection.npy"), &answer.selection)?;
    files.push("selection.npy".to_owned());
    watch.lap("write");
    if task.settings.pictures {
        let working = terminal.progress("drawing", None);
        let up = if task.survey_given { pictures::up_of_views(&task.survey) } else { None };
        let subject = Subject {
            task,
            answer: &answer,
            scene: &scene,
            prepared,
            object: &object,
            rest: &rest,
            up: up.unwrap_or_else(|| crate::camera::up_of(&job.cloud)),
        };
        files.extend(pictures::make(&subject, &mut raster, job.out)?);
        drop(working);
        watch.lap("pictures");
    }
    let hashes = hashes(job.out, &files)?;
    if let Some(before) = before {
        remove_stale(&before, &files, job.out);
    }
    let capture =
        CaptureRecord { file: job.file.clone(), gaussians: job.cloud.len(), content: format!("{content:032x}") };
    let session = session::record(task, &capture, answer.selection.count(), hashes, job.out)?;
    session.write(&job.out.join(session::FILE))?;
    files.push(session::FILE.to_owned());
    watch.seconds.insert("total", job.began.elapsed().as_secs_f64());
    for note in &answer.notes {
        terminal.note(note);
    }
    let report = Report {
        file: job.file.clone(),
        gaussians: job.cloud.len(),
        selected: answer.selection.count(),
        proposals: answer.offers.proposals,
        wheel: answer.offers.wheel,
        boundary: edge.map(EdgeReport::from),
        cached: preparation.cached,
        seconds: watch.seconds,
        notes: answer.notes,
        folder: job.out.display().to_string(),
        files,
    };
    Ok((report, session))
}

impl Job<'_> {
    /// Refuses to write results over the capture they come from.
    fn spare_the_capture(&self, format: &str) -> Result<(), Failure> {
        let Some(capture) = self.file.as_deref().and_then(|file| std::fs::canonicalize(file).ok()) else {
            return Ok(());
        };
        for name in ["object", "rest"] {
            let path = self.out.join(format!("{name}.{format}"));
            if std::fs::canonicalize(&path).is_ok_and(|p| p == capture) {
                return Err(Failure::failed(format!(
                    "the capture itself would be written over; name another folder: {}",
                    path.display()
                )));
            }
        }
        Ok(())
    }
}

/// Removes what an earlier run wrote into the folder and this one did not, unless somebody changed it since.
fn remove_stale(before: &Session, files: &[String], folder: &Path) {
    for (name, hash) in &before.files {
        let own = Path::new(name).file_name().is_some_and(|n| n == name.as_str());
        let path = folder.join(name);
        let unchanged = || std::fs::read(&path).is_ok_and(|bytes| session::hash(&bytes) == *hash);
        if own && !files.contains(name) && unchanged() {
            // What stays is only untidy.
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// The extension to write captures with.
///
/// # Errors
/// [`Failure::Usage`] if no format has that name or it can only be read.
pub(crate) fn writable_format(name: &str) -> Result<&'static str, Failure> {
    let format = splat_io::format_named(name).filter(|f| f.writable());
    format.and_then(|f| f.extensions().first().copied()).ok_or_else(|| {
        let known: Vec<&str> = splat_io::FORMATS.iter().filter(|f| f.writable()).map(|f| f.name()).collect();
        Failure::usage(format!("captures cannot be written as `{name}`; take one of {}", known.join(", ")))
    })
}

type TakenOut = (Arc<Cloud>, Arc<Cloud>, Option<BoundaryReport>);

fn take_out(
    job: &Job<'_>,
    scene: &Scene,
    answer: &Answer,
    raster: &mut CpuRasterizer,
    run: &splat_segment::Run,
) -> Result<TakenOut, Failure> {
    let how = match job.task.settings.boundary {
        Edge::Keep => {
            let all = boundary::extract_with(&job.cloud, &answer.selection, &[], Boundary::Keep)?;
            return Ok((Arc::new(all.object), Arc::new(all.rest), None));
        }
        Edge::Split => Boundary::SPLIT,
        Edge::Trim => Boundary::Trim,
    };
    // The user's masks know the edge best; elsewhere the picture of the selection tells where it ends.
    let painted: Vec<(View, Mask2d)> = (job.task.prompts.iter())
        .filter_map(|p| match &p.shape {
            Shape::Mask(mask) => Some((job.task.views[p.view], mask.clone())),
            _ => None,
        })
        .collect();
    let chosen = evenly_spaced(job.task.survey.len(), EDGE_VIEWS);
    let mut views: Vec<View> = chosen.into_iter().map(|k| job.task.survey[k]).collect();
    views.extend(job.task.views.iter().filter(|v| painted.iter().all(|(p, _)| p != *v)));
    let drawn = boundary::silhouettes(raster, scene, &answer.selection, &views, run)?;
    let masked: Vec<MaskedView<'_>> = (painted.iter().map(|(v, m)| MaskedView::new(v, m)))
        .chain(views.iter().zip(&drawn).map(|(v, m)| MaskedView::new(v, m)))
        .collect();
    let settings = StraddleSettings::default();
    let all = boundary::extract(raster, &job.cloud, &answer.selection, &masked, how, &settings, run)?;
    Ok((Arc::new(all.object), Arc::new(all.rest), Some(all.report)))
}

fn hashes(folder: &Path, files: &[String]) -> Result<BTreeMap<String, String>, Failure> {
    let mut out = BTreeMap::new();
    for name in files {
        let path = folder.join(name);
        let bytes = std::fs::read(&path)
            .map_err(|e| Failure::failed(format!("what was written cannot be read ({e}): {}", path.display())))?;
        out.insert(name.clone(), session::hash(&bytes));
    }
    Ok(out)
}

struct Watch {
    last: Instant,
    seconds: BTreeMap<&'static str, f64>,
}

impl Watch {
    fn new(began: Instant) -> Self {
        Self { last: began, seconds: BTreeMap::new() }
    }

    fn lap(&mut self, stage: &'static str) {
        let now = Instant::now();
        self.seconds.insert(stage, (now - self.last).as_secs_f64());
        self.last = now;
    }
}

impl Report {
    /// What the terminal shows.
    pub(crate) fn text(&self) -> String {
        let seconds = |stage: &str| self.seconds.get(stage).copied().unwrap_or_default();
        let share = 100.0 * self.selected as f64 / self.gaussians.max(1) as f64;
        let mut lines = vec![format!(
            "the object has {} of {} ({share:.1} %)",
            gaussians(self.selected),
            gaussians(self.gaussians)
        )];
        let sizes = |offers: &[Offer]| {
            let words: Vec<String> =
                offers.iter().map(|o| format!("{}{}", o.gaussians, if o.taken { "*" } else { "" })).collect();
            words.join(", ")
        };
        if !self.proposals.is_empty() {
            lines.push(format!("proposals, best first: {} (* taken; before corrections)", sizes(&self.proposals)));
            lines.push(format!("granularity wheel, --step 1 to {}: {}", self.wheel.len(), sizes(&self.wheel)));
        }
        if let Some(edge) = &self.boundary {
            lines.push(format!(
                "on the edge: {}, {} of them cut",
                gaussians(edge.straddling),
                edge.cut_selected + edge.cut_rest
            ));
        }
        lines.push(format!(
            "first selection after {:.2} s (loading {:.2}, preparing {:.2}{}), all done after {:.2} s",
            seconds("first_selection"),
            seconds("load"),
            seconds("prepare"),
            if self.cached { " from the cache" } else { "" },
            seconds("total"),
        ));
        lines.push(format!("in {}: {}", self.folder, self.files.join(", ")));
        lines.join("\n")
    }
}
