//! Files beside the one being loaded, for formats that are several files.

use std::collections::BTreeMap;
use std::io;
use std::sync::{Mutex, PoisonError};

use bevy::asset::{AssetPath, LoadContext};
use splat_io::{InMemory, ReadError, Siblings, SourceName};

/// The files fetched so far. Readers ask for one at a time and cannot wait; so a reader is run again after each file that it
/// asked for in vain. Readers of many files ask before they decode anything, which keeps that cheap.
#[derive(Default)]
struct Beside {
    fetched: InMemory,
    /// Names that were looked for, with the answer.
    absent: BTreeMap<String, String>,
    /// The first name asked for that is in neither.
    wanted: Mutex<Option<String>>,
}

impl Siblings for Beside {
    fn get(&self, name: &str) -> Result<Vec<u8>, ReadError> {
        let result = self.fetched.get(name);
        // Names that leave the folder fail in another way, and are never looked for.
        if !matches!(result, Err(ReadError::Io { .. })) {
            return result;
        }
        if let Some(answer) = self.absent.get(name) {
            let source = io::Error::new(io::ErrorKind::NotFound, answer.clone());
            return Err(ReadError::Io { source, path: SourceName::from(name) });
        }
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| name.to_owned());
        result
    }
}

/// Runs `read` until it has all the files it asks for. Each becomes a dependency: when it changes, the asset is loaded again.
pub(super) async fn read_with_beside<T: Send>(
    context: &mut LoadContext<'_>,
    read: impl Fn(&dyn Siblings) -> Result<T, ReadError> + Send,
) -> Result<T, ReadError> {
    let mut beside = Beside::default();
    loop {
        let result = read(&beside);
        let Some(name) = beside.wanted.get_mut().unwrap_or_else(PoisonError::into_inner).take() else {
            return result;
        };
        drop(result);
        // Not `resolve`: a name with `#` or `://` is a name here.
        let own = context.path();
        let path = own.path().parent().map(|folder| folder.join(&name)).unwrap_or_else(|| name.clone().into());
        let path = AssetPath::from_path_buf(path).with_source(own.source().clone_owned());
        match context.read_asset_bytes(path).await {
            Ok(bytes) => {
                beside.fetched.files.insert(name, bytes);
            }
            Err(error) => {
                beside.absent.insert(name, error.to_string());
            }
        }
    }
}
