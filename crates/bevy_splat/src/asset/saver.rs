//! [`SplatCloudSaver`]: captures as files of every writable format.

use bevy::asset::saver::{AssetSaver, SavedAsset};
use bevy::asset::{AssetPath, AsyncWriteExt, io::Writer};
use bevy::log::warn;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};
use splat_io::{FORMATS, SourceName, WriteError, WriteOptions, format_named, format_of_name, write_as};

use super::{SplatCloud, SplatCloudLoader, SplatCloudSettings};

/// Saves a [`SplatCloud`] in the format of the path's ending, or in the one that the settings name.
///
/// ```no_run
/// # use bevy::asset::saver::{SavedAsset, save_using_saver};
/// # use bevy::prelude::*;
/// # use bevy_splat::asset::{SplatCloudSaver, SplatSaveSettings};
/// # use bevy_splat::prelude::*;
/// # async fn save(asset_server: AssetServer, capture: SplatCloud) -> Result<(), BevyError> {
/// let path = "chair.compressed.ply".into();
/// let (asset, settings) = (SavedAsset::from_asset(&capture), SplatSaveSettings::default());
/// save_using_saver(asset_server, &SplatCloudSaver, &path, asset, &settings).await?;
/// # Ok(())
/// # }
/// ```
///
/// What a format cannot hold is dropped with a warning; `splat_io::write` reports the same as a value.
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct SplatCloudSaver;

/// How a [`SplatCloud`] is saved.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SplatSaveSettings {
    /// Name of the format (`ply`, `spz`, ...); `None`, the default: the path's ending decides.
    pub format: Option<String>,
    /// Version of the format where it has several (SPZ: 2, 3, 4); `None`, the default: the one most programs read.
    pub version: Option<u32>,
}

/// Why a [`SplatCloud`] could not be saved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SplatSaveError {
    /// The format cannot hold the cloud, or cannot be written.
    #[error("{source}: {path}")]
    Write {
        /// Why not.
        source: WriteError,
        /// Which file.
        path: SourceName,
    },
    /// Neither the settings nor the ending name a format.
    #[error("neither the settings nor the ending name one of the formats {known}: {path}")]
    UnknownFormat {
        /// Names of all writable formats.
        known: String,
        /// Which file.
        path: SourceName,
    },
    /// The bytes could not be stored.
    #[error("the file cannot be written ({source}); check the folder and the free space: {path}")]
    Io {
        /// The storage's answer.
        source: std::io::Error,
        /// Which file.
        path: SourceName,
    },
}

impl AssetSaver for SplatCloudSaver {
    type Asset = SplatCloud;
    type Settings = SplatSaveSettings;
    type OutputLoader = SplatCloudLoader;
    type Error = SplatSaveError;

    async fn save(
        &self,
        writer: &mut Writer,
        asset: SavedAsset<'_, '_, SplatCloud>,
        settings: &SplatSaveSettings,
        asset_path: AssetPath<'_>,
    ) -> Result<SplatCloudSettings, SplatSaveError> {
        let path = SourceName::from(asset_path.to_string().as_str());
        let format = match &settings.format {
            Some(name) => format_named(name),
            None => format_of_name(path.as_str()),
        };
        let unknown = || SplatSaveError::UnknownFormat {
            known: FORMATS.iter().filter(|f| f.writable()).map(|f| f.name()).collect::<Vec<_>>().join(", "),
            path: path.clone(),
        };
        let format = format.ok_or_else(unknown)?;
        let mut options = WriteOptions::default();
        options.version = settings.version;
        let mut bytes = Vec::new();
        let written = write_as(format, &asset.cloud, &options, &mut bytes);
        let written = written.map_err(|source| SplatSaveError::Write { source, path: path.clone() })?;
        for loss in &written.losses {
            warn!("{loss}: {path}");
        }
        writer.write_all(&bytes).await.map_err(|source| SplatSaveError::Io { source, path: path.clone() })?;
        Ok(SplatCloudSettings { format: Some(format.name().to_owned()), ..default() })
    }
}
