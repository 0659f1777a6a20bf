//! The main job on the built-in room: what `splat` does without a command.
//!
//! The room is part of the program, so that a fresh build shows something at once and needs nothing else.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use splat_core::Cloud;
use splat_io::SourceName;
use splat_io::cameras::{self, NamedView};
use splat_io::picture;
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Rasterizer, Scene};

use crate::failure::Failure;
use crate::paint;
use crate::terminal::{Terminal, gaussians};

/// The generated room and its cameras; `cargo run --release --example generate_room` makes them.
const ROOM: &[u8] = include_bytes!("../../../assets/room/scene.spz");
const ROOM_CAMERAS: &[u8] = include_bytes!("../../../assets/room/cameras.json");
/// Where the results go, in the current folder.
const OUT: &str = "splat-room";

#[derive(Serialize)]
struct Report {
    gaussians: usize,
    pictures: Vec<String>,
}

/// Does the main job on the room.
///
/// # Errors
/// [`Failure::Failed`] if the results cannot be written.
pub(crate) fn run(terminal: &Terminal) -> Result<(), Failure> {
    let (cloud, views) = room()?;
    let out = Path::new(OUT);
    std::fs::create_dir_all(out).map_err(|e| {
        Failure::failed(format!("the folder `{OUT}` cannot be made here ({e}); go to a folder that you may write to"))
    })?;
    let mut raster = CpuRasterizer::new();
    let scene = Scene::of(Arc::new(cloud));
    let mut pictures = Vec::new();
    let working = terminal.progress("drawing the room", Some(views.len() as u64));
    for (k, named) in views.iter().enumerate().step_by(views.len().div_ceil(4).max(1)) {
        working.at(k as u64);
        let color = raster.render(&scene, &named.view)?;
        let path = out.join(format!("view_{k:02}.png"));
        picture::write_png_rgb8(&path, named.view.width, named.view.height, &paint::over(&color, [0.0; 3]))?;
        pictures.push(path.display().to_string());
    }
    drop(working);
    let report = Report { gaussians: scene.len(), pictures };
    terminal.report(&report, || {
        format!("the built-in room: {}\npictures: {}", gaussians(report.gaussians), report.pictures.join(", "))
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
