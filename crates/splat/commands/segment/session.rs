//! `session.json`: a task with all its inputs, so that it can be done again with the same result.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use splat_core::glam::{Mat3, Vec2, Vec3};
use splat_core::{Intrinsics, Pose, Projection, View};
use splat_io::{WriteError, picture};
use splat_segment::graph::clicks::ClickKind;
use xxhash_rust::xxh3::xxh3_128;

use super::task::{Prompt, Settings, Shape, Task};
use crate::failure::Failure;

/// Name of the file in the folder of results.
pub(crate) const FILE: &str = "session.json";
/// Raised when the meaning of a field changes.
const VERSION: u32 = 1;

/// A task as a file.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Session {
    /// Layout of this file.
    pub(crate) session: u32,
    /// Version of the program that wrote it.
    pub(crate) program: String,
    /// What was worked on.
    pub(crate) capture: CaptureRecord,
    /// How.
    pub(crate) settings: Settings,
    /// What was pointed at, in order.
    pub(crate) prompts: Vec<PromptRecord>,
    /// Views that prompts refer to.
    pub(crate) views: Vec<ViewRecord>,
    /// Views that the capture was taken apart by.
    pub(crate) survey: Vec<ViewRecord>,
    /// Whether these were training cameras.
    pub(crate) survey_given: bool,
    /// Gaussians selected.
    pub(crate) selected: usize,
    /// Files written, with the hash of their bytes (XXH3, 128 bits).
    pub(crate) files: BTreeMap<String, String>,
}

/// Which capture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CaptureRecord {
    /// As the user named it; none for the built-in room.
    pub(crate) file: Option<String>,
    /// Its number of Gaussians.
    pub(crate) gaussians: usize,
    /// Hash of their values.
    pub(crate) content: String,
}

/// One view; floats as doubles, which hold them exactly.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ViewRecord {
    size: [u32; 2],
    orthographic: bool,
    /// fx, fy, cx, cy.
    intrinsics: [f64; 4],
    position: [f64; 3],
    /// Right, down, forward in world space.
    axes: [f64; 9],
    near: f64,
}

/// One prompt.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", tag = "kind")]
pub(crate) enum PromptRecord {
    /// A pixel of the object, or with `negative` of something else.
    Click { view: usize, at: [f64; 2], negative: bool },
    /// Left, top, right, bottom.
    Box { view: usize, corners: [u32; 4] },
    /// A stroke.
    Scribble { view: usize, points: Vec<[f64; 2]> },
    /// A mask, kept beside the session.
    Mask { view: usize, file: String, content: String },
}

impl From<&View> for ViewRecord {
    fn from(v: &View) -> Self {
        let i = &v.intrinsics;
        Self {
            size: [v.width, v.height],
            orthographic: v.projection == Projection::Orthographic,
            intrinsics: [i.fx, i.fy, i.cx, i.cy].map(f64::from),
            position: v.pose.position.to_array().map(f64::from),
            axes: v.pose.world_from_view.to_cols_array().map(f64::from),
            near: f64::from(v.near),
        }
    }
}

impl ViewRecord {
    fn view(&self) -> Result<View, Failure> {
        let [fx, fy, cx, cy] = self.intrinsics.map(|v| v as f32);
        let view = View {
            width: self.size[0],
            height: self.size[1],
            intrinsics: Intrinsics { fx, fy, cx, cy },
            projection: if self.orthographic { Projection::Orthographic } else { Projection::Perspective },
            pose: Pose {
                world_from_view: Mat3::from_cols_array(&self.axes.map(|v| v as f32)),
                position: Vec3::from_array(self.position.map(|v| v as f32)),
            },
            near: self.near as f32,
        };
        view.check()?;
        Ok(view)
    }
}

/// Writes the masks of a task into a folder and makes its record; `files` and `selected` are the results.
///
/// # Errors
/// [`Failure::Failed`] if a mask cannot be written.
pub(crate) fn record(
    task: &Task,
    capture: &CaptureRecord,
    selected: usize,
    files: BTreeMap<String, String>,
    folder: &Path,
) -> Result<Session, Failure> {
    let mut prompts = Vec::with_capacity(task.prompts.len());
    for (k, prompt) in task.prompts.iter().enumerate() {
        let view = prompt.view;
        let pair = |p: Vec2| [f64::from(p.x), f64::from(p.y)];
        prompts.push(match &prompt.shape {
            Shape::Click(at, kind) => {
                PromptRecord::Click { view, at: pair(*at), negative: *kind == ClickKind::Negative }
            }
            Shape::Box(corners) => PromptRecord::Box { view, corners: *corners },
            Shape::Scribble(points) => {
                PromptRecord::Scribble { view, points: points.iter().map(|p| pair(*p)).collect() }
            }
            Shape::Mask(mask) => {
                let file = format!("prompt_mask_{}.png", k + 1);
                picture::write_mask(folder.join(&file), mask)?;
                PromptRecord::Mask { view, file, content: hash(mask.values()) }
            }
        });
    }
    Ok(Session {
        session: VERSION,
        program: env!("CARGO_PKG_VERSION").to_owned(),
        capture: capture.clone(),
        settings: task.settings.clone(),
        prompts,
        views: task.views.iter().map(ViewRecord::from).collect(),
        survey: task.survey.iter().map(ViewRecord::from).collect(),
        survey_given: task.survey_given,
        selected,
        files,
    })
}

impl Session {
    /// Reads a session.
    ///
    /// # Errors
    /// [`Failure::Failed`] in one sentence naming the file.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let wrong = |what: String| Failure::failed(format!("{what}: {}", path.display()));
        let bytes =
            std::fs::read(path).map_err(|e| wrong(format!("the session cannot be read ({e}); name a session.json")))?;
        let value: Value = serde_json::from_slice(&bytes)
            .map_err(|e| wrong(format!("this is no session ({e}); name a session.json")))?;
        if let Some(version) = value.get("session").and_then(Value::as_u64).filter(|&v| v != u64::from(VERSION)) {
            return Err(wrong(format!(
                "the session has layout {version}, this program reads {VERSION}; segment again"
            )));
        }
        serde_json::from_value(value).map_err(|e| wrong(format!("the session is damaged ({e}); segment again")))
    }

    /// The task in it; masks are read from beside `path`.
    ///
    /// # Errors
    /// [`Failure::Failed`] if a mask is missing or not the one it was, or a number makes no sense.
    pub(crate) fn task(&self, path: &Path) -> Result<Task, Failure> {
        let views = |records: &[ViewRecord]| records.iter().map(ViewRecord::view).collect::<Result<Vec<_>, _>>();
        let task = Task {
            views: views(&self.views)?,
            survey: views(&self.survey)?,
            survey_given: self.survey_given,
            prompts: self.prompts.iter().map(|p| prompt(p, path)).collect::<Result<_, _>>()?,
            settings: self.settings.clone(),
        };
        if task.views.is_empty() || task.prompts.iter().any(|p| p.view >= task.views.len()) {
            return Err(Failure::failed(format!(
                "the session names a view that it does not have; segment again: {}",
                path.display()
            )));
        }
        Ok(task)
    }

    /// Writes it: one line per field, and per element of lists.
    ///
    /// # Errors
    /// [`Failure::Failed`] if it cannot be written.
    pub(crate) fn write(&self, path: &Path) -> Result<(), Failure> {
        let Value::Object(fields) = serde_json::to_value(self)? else { return Ok(()) };
        let mut lines = Vec::with_capacity(fields.len());
        for (name, value) in &fields {
            let value = match value {
                Value::Array(items) if !items.is_empty() => {
                    let items: Vec<String> = items.iter().map(Value::to_string).collect();
                    format!("[\n  {}\n]", items.join(",\n  "))
                }
                other => other.to_string(),
            };
            lines.push(format!("{}: {value}", Value::from(name.as_str())));
        }
        let text = format!("{{\n{}\n}}\n", lines.join(",\n"));
        Ok(splat_io::write_file(path, |sink| sink.write_all(text.as_bytes()).map_err(WriteError::Sink))?)
    }
}

fn prompt(record: &PromptRecord, path: &Path) -> Result<Prompt, Failure> {
    let pair = |p: &[f64; 2]| Vec2::new(p[0] as f32, p[1] as f32);
    let (view, shape) = match record {
        PromptRecord::Click { view, at, negative } => {
            (*view, Shape::Click(pair(at), if *negative { ClickKind::Negative } else { ClickKind::Positive }))
        }
        PromptRecord::Box { view, corners } => (*view, Shape::Box(*corners)),
        PromptRecord::Scribble { view, points } => (*view, Shape::Scribble(points.iter().map(pair).collect())),
        PromptRecord::Mask { view, file, content } => {
            let own = Path::new(file).file_name().is_some_and(|name| name == file.as_str());
            if !own {
                return Err(Failure::failed(format!(
                    "the session names a mask outside its folder; segment again: {file}"
                )));
            }
            let file = path.with_file_name(file);
            let mask = picture::read_mask(&file)?;
            if hash(mask.values()) != *content {
                return Err(Failure::failed(format!(
                    "the mask is not the one that the session was made with; segment again: {}",
                    file.display()
                )));
            }
            (*view, Shape::Mask(mask))
        }
    };
    if matches!(&shape, Shape::Scribble(points) if points.is_empty()) {
        return Err(Failure::failed(format!(
            "the session has a stroke without points; segment again: {}",
            path.display()
        )));
    }
    Ok(Prompt { view, shape })
}

/// Hash of bytes, as sessions keep it.
pub(crate) fn hash(bytes: &[u8]) -> String {
    format!("{:032x}", xxh3_128(bytes))
}
