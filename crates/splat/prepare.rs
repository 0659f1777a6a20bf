//! A capture taken apart, ready for clicks; kept on the disk between runs.
//!
//! Kept files lie in the user's cache folder, beside nothing that the user owns. They are named by a hash of everything they
//! follow from: the Gaussians, the views, and the program itself. A file that does not fit is made anew, and a cache that
//! cannot be read or written is no error.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use splat_core::View;
use splat_io::WriteError;
use splat_raster::{Rasterizer, Scene};
use splat_segment::graph::prepared::Prepared;
use splat_segment::votes::view_hash;
use splat_segment::{Run, SegmentError};
use xxhash_rust::xxh3::Xxh3;

/// Names another folder for what is kept.
const VARIABLE: &str = "SPLAT_CACHE";
/// What is kept may fill this many bytes; the longest unused goes first.
const LIMIT: u64 = 1 << 30;

/// A capture taken apart, and whether that had been done before.
#[derive(Debug)]
pub(crate) struct Preparation {
    /// The patches and trees.
    pub(crate) prepared: Prepared,
    /// It was kept from an earlier run.
    pub(crate) cached: bool,
}

/// Whether things are kept between runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// In the user's cache folder.
    InCache,
    /// Not at all.
    Nothing,
}

/// Takes a capture apart, or finds that this was done.
///
/// `content`: [`splat_core::Cloud::content_hash`] of the capture.
///
/// # Errors
/// As [`Prepared::new`].
pub(crate) fn prepare(
    scene: &Scene,
    content: u128,
    views: &[View],
    keep: Keep,
    raster: &mut dyn Rasterizer,
    run: &Run,
) -> Result<Preparation, SegmentError> {
    let kept = match keep {
        Keep::InCache => folder().map(|folder| folder.join(name(content, views))),
        Keep::Nothing => None,
    };
    if let Some(prepared) = kept.as_deref().and_then(|path| load(path, scene.len())) {
        return Ok(Preparation { prepared, cached: true });
    }
    let prepared = Prepared::new(scene, views, raster, run)?;
    if let Some(path) = kept {
        save(&path, &prepared);
    }
    Ok(Preparation { prepared, cached: false })
}

/// The user's cache folder for this program; `None` where the system names none.
fn folder() -> Option<PathBuf> {
    folder_from(|name| std::env::var_os(name).filter(|v| !v.is_empty()))
}

fn folder_from(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    if let Some(own) = variable(VARIABLE) {
        return Some(own.into());
    }
    let users = if cfg!(windows) {
        PathBuf::from(variable("LOCALAPPDATA")?)
    } else if cfg!(target_os = "macos") {
        Path::new(&variable("HOME")?).join("Library/Caches")
    } else {
        match variable("XDG_CACHE_HOME").map(PathBuf::from).filter(|p| p.is_absolute()) {
            Some(folder) => folder,
            None => Path::new(&variable("HOME")?).join(".cache"),
        }
    };
    Some(users.join("splat"))
}

/// Name of the file for a capture and its views. Another build of the program may prepare differently, so it counts too.
fn name(content: u128, views: &[View]) -> String {
    let mut h = Xxh3::new();
    h.update(env!("CARGO_PKG_VERSION").as_bytes());
    if let Ok(program) = std::env::current_exe().and_then(std::fs::read) {
        h.update(&program);
    }
    h.update(&content.to_le_bytes());
    views.iter().for_each(|v| h.update(&view_hash(v).to_le_bytes()));
    format!("{:032x}.prepared", h.digest128())
}

fn load(path: &Path, gaussians: usize) -> Option<Prepared> {
    let bytes = std::fs::read(path).ok()?;
    let prepared = Prepared::from_bytes(&bytes).filter(|p| p.graph.of.len() == gaussians)?;
    // Used now, so thrown away last.
    if let Ok(file) = std::fs::File::options().append(true).open(path) {
        let _ = file.set_modified(SystemTime::now());
    }
    Some(prepared)
}

fn save(path: &Path, prepared: &Prepared) {
    let Some(folder) = path.parent() else { return };
    if std::fs::create_dir_all(folder).is_err() {
        return;
    }
    let bytes = prepared.to_bytes();
    let written = splat_io::write_file(path, |sink| sink.write_all(&bytes).map_err(WriteError::Sink));
    if written.is_ok() {
        prune(folder, LIMIT);
    }
}

/// Removes the longest unused of our files until the others fit into `limit` bytes.
fn prune(folder: &Path, limit: u64) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut files: Vec<(SystemTime, PathBuf, u64)> = entries
        .filter_map(|entry| {
            let entry = entry.ok()?;
            let name = entry.file_name();
            let ours = name.to_str().is_some_and(|n| n.ends_with(".prepared") || n.ends_with(".part"));
            let about = entry.metadata().ok().filter(|m| ours && m.is_file())?;
            Some((about.modified().ok()?, entry.path(), about.len()))
        })
        .collect();
    files.sort();
    let mut total: u64 = files.iter().map(|f| f.2).sum();
    for (_, path, len) in files {
        if total <= limit {
            break;
        }
        if std::fs::remove_file(path).is_ok() {
            total -= len;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_users_cache_folder_follows_the_systems_variables() {
        let with = |set: &[(&str, &str)]| {
            folder_from(|name| set.iter().find(|(n, _)| *n == name).map(|(_, v)| OsString::from(v)))
        };
        assert_eq!(with(&[("SPLAT_CACHE", "here"), ("HOME", "/h")]), Some("here".into()));
        assert_eq!(with(&[]), None);
        if cfg!(all(unix, not(target_os = "macos"))) {
            assert_eq!(with(&[("HOME", "/h"), ("XDG_CACHE_HOME", "/c")]), Some("/c/splat".into()));
            // A relative one is to be ignored, says the specification.
            assert_eq!(with(&[("HOME", "/h"), ("XDG_CACHE_HOME", "c")]), Some("/h/.cache/splat".into()));
        }
    }

    #[test]
    fn the_longest_unused_goes_first_and_strangers_stay() {
        let folder = std::env::temp_dir().join(format!("splat-prune-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for (k, name) in ["old.prepared", "stranger.txt", "mid.prepared", "new.prepared"].into_iter().enumerate() {
            let path = folder.join(name);
            std::fs::write(&path, [0; 100]).unwrap();
            let file = std::fs::File::options().append(true).open(&path).unwrap();
            file.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(1000 * (1 + k as u64))).unwrap();
        }
        prune(&folder, 250);
        let left = |name: &str| folder.join(name).exists();
        assert!(!left("old.prepared") && left("mid.prepared") && left("new.prepared") && left("stranger.txt"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
