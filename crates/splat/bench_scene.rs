//! Folders of the benchmark layout: a capture with labels, cameras, held-back views and prompts.
//!
//! A scene is a folder with `prompts.json`, a splat file `scene.*` of any format, `labels.npy`, `weight.npy`, `cameras.json`,
//! `gt/cameras.json` with `gt/labels_NN.png`, and optionally `stats.json`, which says how near a camera sees (`near`).

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use splat_core::View;
use splat_io::{cameras, npy, picture};
use splat_segment::eval::{BenchScene, Correction, LabelMap, Prompt, PromptKind};

use crate::capture::Capture;
use crate::failure::Failure;
use crate::terminal::Terminal;

/// The file that makes a folder a scene.
const PROMPTS: &str = "prompts.json";
/// Folders within folders that are searched for scenes.
const DEPTH: usize = 4;

/// A folder of the benchmark layout and the name its scene has in reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SceneFolder {
    pub(crate) name: String,
    pub(crate) path: PathBuf,
}

/// The scenes in a folder: itself, or those within it, by name. Names are as seen from the folder.
///
/// # Errors
/// [`Failure::Failed`] if there is none.
pub(crate) fn find(folder: &Path) -> Result<Vec<SceneFolder>, Failure> {
    let mut found = Vec::new();
    if folder.join(PROMPTS).is_file() {
        let last = folder.canonicalize().ok().and_then(|p| Some(p.file_name()?.to_string_lossy().into_owned()));
        let name = last.unwrap_or_else(|| folder.display().to_string());
        found.push(SceneFolder { name, path: folder.to_path_buf() });
    } else {
        search(folder, "", DEPTH, &mut found)?;
    }
    if found.is_empty() {
        return Err(Failure::failed(format!(
            "there is no scene with labels here; name a folder with {PROMPTS}, or one that has such folders in it: {}",
            folder.display()
        )));
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(found)
}

fn search(folder: &Path, prefix: &str, depth: usize, found: &mut Vec<SceneFolder>) -> Result<(), Failure> {
    let unreadable =
        |e: std::io::Error| Failure::failed(format!("the folder cannot be read ({e}): {}", folder.display()));
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let Some(last) = path.file_name().filter(|_| path.is_dir()) else { continue };
        let name = format!("{prefix}{}", last.to_string_lossy());
        if path.join(PROMPTS).is_file() {
            found.push(SceneFolder { name, path });
        } else if depth > 1 {
            search(&path, &format!("{name}/"), depth - 1, found)?;
        }
    }
    Ok(())
}

#[derive(Deserialize)]
struct PromptFile {
    label: u8,
    name: String,
    kind: KindName,
    camera: usize,
    click: [u32; 2],
    #[serde(rename = "box")]
    rectangle: [u32; 4],
    mask: PathBuf,
    #[serde(default)]
    corrections: Vec<CorrectionFile>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum KindName {
    Main,
    Cut,
}

#[derive(Deserialize)]
struct CorrectionFile {
    camera: usize,
    click: [u32; 2],
    mask: PathBuf,
}

#[derive(Deserialize)]
struct Stats {
    near: Option<f32>,
}

/// Reads a scene with those prompts for which `wanted` (by kind and name of the object).
///
/// # Errors
/// [`Failure::Failed`] naming the file.
pub(crate) fn read(
    folder: &SceneFolder,
    terminal: &Terminal,
    wanted: impl Fn(PromptKind, &str) -> bool,
) -> Result<BenchScene, Failure> {
    let at = |name: &str| folder.path.join(name);
    let cloud = Capture::read_and_tell(&splat_file(&folder.path)?, terminal)?.cloud;
    let near = if at("stats.json").is_file() { json::<Stats>(&at("stats.json"))?.near } else { None };
    let views = |path: &Path| -> Result<Vec<View>, Failure> {
        let near = |view: View| near.map_or(view, |near| View { near, ..view });
        Ok(cameras::read(path)?.views.into_iter().map(|v| near(v.view)).collect())
    };
    let held_back = views(&at("gt/cameras.json"))?
        .into_iter()
        .enumerate()
        .map(|(k, view)| Ok(LabelMap { view, labels: label_map(&at(&format!("gt/labels_{k:02}.png")), &view)? }))
        .collect::<Result<Vec<_>, Failure>>()?;
    let mask = |path: &Path| picture::read_mask(folder.path.join(path));
    let mut prompts = Vec::new();
    for p in json::<Vec<PromptFile>>(&at(PROMPTS))? {
        let kind = match p.kind {
            KindName::Main => PromptKind::Main,
            KindName::Cut => PromptKind::Cut,
        };
        if !wanted(kind, &p.name) {
            continue;
        }
        let mut corrections = Vec::with_capacity(p.corrections.len());
        for c in p.corrections {
            corrections.push(Correction { camera: c.camera, click: c.click, mask: mask(&c.mask)? });
        }
        let (camera, click, rectangle, mask) = (p.camera, p.click, p.rectangle, mask(&p.mask)?);
        prompts.push(Prompt { label: p.label, name: p.name, kind, camera, click, rectangle, mask, corrections });
    }
    let scene = BenchScene {
        name: folder.name.clone(),
        cloud,
        labels: npy::read_u8(at("labels.npy"))?,
        weight: npy::read_f32(at("weight.npy"))?,
        cameras: views(&at("cameras.json"))?,
        held_back,
        prompts,
    };
    scene
        .check()
        .map_err(|e| Failure::failed(format!("the scene does not fit together ({e}): {}", folder.path.display())))?;
    Ok(scene)
}

/// The file `scene.*` of a format that can be read; a PLY before any other, then by name.
fn splat_file(folder: &Path) -> Result<PathBuf, Failure> {
    let unreadable =
        |e: std::io::Error| Failure::failed(format!("the folder cannot be read ({e}): {}", folder.display()));
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let name = entry.map_err(unreadable)?.file_name().to_string_lossy().into_owned();
        let known = splat_io::FORMATS.iter().flat_map(|f| f.extensions());
        if known.into_iter().any(|e| name.to_lowercase() == format!("scene.{e}")) {
            names.push(name);
        }
    }
    names.sort_by_key(|name| (!name.to_lowercase().ends_with(".ply"), name.clone()));
    let first = names.first().ok_or_else(|| {
        Failure::failed(format!("the scene has no splat file; put one named scene.ply there: {}", folder.display()))
    })?;
    Ok(folder.join(first))
}

fn label_map(path: &Path, view: &View) -> Result<Vec<u8>, Failure> {
    let map = picture::read_labels(path)?;
    if (map.width, map.height) != (view.width, view.height) {
        return Err(Failure::failed(format!(
            "the label map has {}x{} pixels but its camera {}x{}; draw it at the camera's size: {}",
            map.width,
            map.height,
            view.width,
            view.height,
            path.display()
        )));
    }
    Ok(map.labels)
}

fn json<T: DeserializeOwned>(path: &Path) -> Result<T, Failure> {
    let bytes = std::fs::read(path)
        .map_err(|e| Failure::failed(format!("the file cannot be read ({e}): {}", path.display())))?;
    serde_json::from_slice(&bytes)
        .map_err(|e| Failure::failed(format!("this is not the benchmark's layout ({e}): {}", path.display())))
}
