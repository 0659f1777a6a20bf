//! The main job on the built-in room: what `splat` does without a command.
//!
//! The room is part of the program, so that a fresh build shows something at once and needs nothing else.

use std::path::Path;
use std::time::Instant;

use splat_core::glam::Vec2;
use splat_core::{Cloud, View};
use splat_io::SourceName;
use splat_io::cameras::{self, NamedView};
use splat_segment::graph::clicks::ClickKind;

use super::segment::job::{self, Job};
use super::segment::task::{Edge, Granularity, Method, Prompt, Settings, Shape, Task};
use crate::failure::Failure;
use crate::prepare::Keep;
use crate::terminal::Terminal;

/// The generated room and its cameras; `cargo run --release --example generate_room` makes them.
const ROOM: &[u8] = include_bytes!("../../../assets/room/scene.spz");
const ROOM_CAMERAS: &[u8] = include_bytes!("../../../assets/room/cameras.json");
/// Where the results go, in the current folder, where nothing else is named.
pub(crate) const OUT: &str = "splat-room";

/// The camera that looks at the teddy bear on the rug, and a pixel of the bear.
const CAMERA: usize = 27;
const BEAR: Vec2 = Vec2::new(434.5, 408.5);

/// Does the main job on the room: one click on the bear, which wears a hat.
///
/// # Errors
/// [`Failure::Failed`] if the results cannot be written.
pub(crate) fn run(out: &Path, terminal: &Terminal) -> Result<(), Failure> {
    let began = Instant::now();
    let (cloud, named) = room()?;
    let survey: Vec<View> = named.into_iter().map(|v| v.view).collect();
    let view =
        *survey.get(CAMERA).ok_or_else(|| Failure::failed("the built-in room has too few cameras; build again"))?;
    let task = Task {
        views: vec![view],
        survey,
        survey_given: true,
        prompts: vec![Prompt { view: 0, shape: Shape::Click(BEAR, ClickKind::Positive) }],
        settings: Settings {
            granularity: Granularity::Object,
            step: None,
            method: Method::Graph,
            dense_views: 0,
            theta: 0.5,
            presegment: true,
            boundary: Edge::Keep,
            format: "ply".to_owned(),
            pictures: true,
        },
    };
    let job = Job { cloud: cloud.into(), file: None, task: &task, out, keep: Keep::InCache, began };
    let (report, _) = job::run(&job, terminal)?;
    terminal.report(&report, || {
        let at = |name: &str| out.join(name).display().to_string();
        [
            "The main job on the built-in room: one click on the teddy bear.".to_owned(),
            report.text(),
            String::new(),
            format!("  {:<32} where was clicked", at("view.png")),
            format!("  {:<32} what that selected", at("selection.png")),
            format!("  {:<32} what else the click could have meant", at("proposals.png")),
            format!("  {:<32} the bear by itself, from four sides", at("object.png")),
            format!("  {:<32} the room without it", at("rest.png")),
            String::new(),
            "Next: splat segment YOUR.ply --camera cameras.json#0 --click X,Y -o DIR".to_owned(),
        ]
        .join("\n")
    })
}

/// The room and the cameras it is looked at from.
///
/// # Errors
/// [`Failure::Failed`] if this build holds no readable room.
pub(crate) fn room() -> Result<(Cloud, Vec<NamedView>), Failure> {
    let (cloud, _) = splat_io::read_bytes(ROOM, "room/scene.spz")?;
    let name = SourceName::from("room/cameras.json");
    let cameras = cameras::read_with(ROOM_CAMERAS, &name, &splat_io::InMemory::default())?;
    Ok((cloud, cameras.views))
}
