//! [`StaticCaptureCache`]: surfaces of captures that were made before.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use bevy::prelude::*;
use splat_physics::Ground;

/// Grounds by their keys.
type Kept = Vec<(u64, Arc<Ground>)>;

/// Surfaces of captures by content: of Gaussians, scale, settings and parts that are out. What was made once is there again at
/// once, when a part is put back, or when a scene is entered again.
#[derive(Resource, Clone, Debug, Default)]
pub struct StaticCaptureCache {
    /// Where surfaces are kept beyond the end of the program, one file each; `None`, the default: nowhere. Files that do not
    /// fit are made anew, and a folder that cannot be written changes nothing.
    pub folder: Option<PathBuf>,
    kept: Arc<Mutex<Kept>>,
}

/// As many surfaces are kept in memory.
const KEPT: usize = 8;

impl StaticCaptureCache {
    /// The surface with this key, from memory or from the folder, else the one that `make` gives, which is kept.
    pub(super) fn get<E>(&self, key: u64, make: impl FnOnce() -> Result<Ground, E>) -> Result<Arc<Ground>, E> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = kept.iter().position(|(known, _)| *known == key) {
            // The one used last is forgotten last.
            let found = kept.remove(at);
            let ground = found.1.clone();
            kept.push(found);
            return Ok(ground);
        }
        drop(kept);
        let path = self.folder.as_ref().map(|folder| folder.join(format!("{key:016x}.splatground")));
        let read = path.as_ref().and_then(|path| std::fs::read(path).ok());
        let ground = match read.and_then(|bytes| Ground::from_bytes(&bytes).ok()) {
            Some(ground) => ground,
            None => {
                let ground = make()?;
                if let Some(path) = path {
                    write(&path, &ground.to_bytes());
                }
                ground
            }
        };
        let ground = Arc::new(ground);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() >= KEPT {
            kept.remove(0);
        }
        kept.push((key, ground.clone()));
        Ok(ground)
    }
}

/// Writes a file as a whole or not at all; what cannot be written is made again next time.
fn write(path: &std::path::Path, bytes: &[u8]) {
    let part = path.with_extension(format!("{}.part", std::process::id()));
    let written = path
        .parent()
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| std::fs::write(&part, bytes))
        .and_then(|()| std::fs::rename(&part, path));
    if let Err(error) = written {
        std::fs::remove_file(&part).ok();
        warn_once!("surfaces of captures cannot be kept in {}: {error}", path.display());
    }
}
