//! [`SplatCloudLoader`]: every format of `splat_io` as an asset.

use std::sync::{Arc, LazyLock};

use bevy::asset::{AssetLoader, LoadContext, io::Reader};
use bevy::log::warn;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};
use splat_core::{Cloud, sh};
use splat_io::{FORMATS, ReadError, ReadReport, SourceName, format_named, read_as, read_with};

use super::SplatCloud;
use super::beside::read_with_beside;

/// Loads a [`SplatCloud`] from any file that `splat_io` can read. The content decides on the format; the ending does not matter:
/// this is the only loader of [`SplatCloud`].
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_splat::prelude::*;
/// # use bevy_splat::asset::SplatCloudSettings;
/// # fn system(asset_server: Res<AssetServer>) {
/// let small: Handle<SplatCloud> = asset_server
///     .load_builder()
///     .with_settings(|s: &mut SplatCloudSettings| s.max_sh_degree = 1)
///     .load("room.ply");
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct SplatCloudLoader;

/// How a file becomes a [`SplatCloud`]. May be kept in the file's `.meta`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SplatCloudSettings {
    /// Name of the format (`ply`, `spz`, ...); `None`, the default: the content decides.
    pub format: Option<String>,
    /// Whether the capture was trained with the antialiased low-pass form; `None`, the default: as the file says.
    pub antialiased: Option<bool>,
    /// Spherical harmonics above this degree (0 to 4) are dropped, to save memory. 4 by default: all are kept.
    pub max_sh_degree: u8,
    /// Gaussians of a lower opacity (0 to 1) are dropped; ids then count those that are left. 0 by default: all are kept, those
    /// that cannot be drawn included.
    pub min_opacity: f32,
}

impl Default for SplatCloudSettings {
    fn default() -> Self {
        Self { format: None, antialiased: None, max_sh_degree: sh::MAX_DEGREE, min_opacity: 0.0 }
    }
}

/// Why a file did not become a [`SplatCloud`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SplatLoadError {
    /// The file is damaged, of an unknown format, or cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The settings name a format that does not exist.
    #[error("`{name}` in the settings is no format; known are {known}: {path}")]
    UnknownFormat {
        /// The name given.
        name: String,
        /// Names of all formats.
        known: String,
        /// Which file.
        path: SourceName,
    },
    /// The settings hold a number that has no meaning.
    #[error("`{setting}` in the settings is {found}, {expected} was expected: {path}")]
    Setting {
        /// Which setting.
        setting: &'static str,
        /// Its value.
        found: String,
        /// What it may be.
        expected: &'static str,
        /// Which file.
        path: SourceName,
    },
}

/// The endings of all formats, but for those of formats that Bevy has loaders for: these files are opened as captures by
/// type, `load::<SplatCloud>("capture.glb")`, and remain Bevy's where the type does not decide.
static EXTENSIONS: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let all = FORMATS.iter().flat_map(|format| format.extensions().iter().copied());
    all.filter(|extension| !["glb", "gltf"].contains(extension)).collect()
});

impl AssetLoader for SplatCloudLoader {
    type Asset = SplatCloud;
    type Settings = SplatCloudSettings;
    type Error = SplatLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &SplatCloudSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<SplatCloud, SplatLoadError> {
        let name = SourceName::from(context.path().to_string().as_str());
        let format = checked(settings, &name)?;
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(ReadError::io(&name))?;
        let (cloud, report) = read_with_beside(context, |files| match format {
            Some(format) => read_as(format, &bytes, &name, files),
            None => read_with(&bytes, &name, files),
        })
        .await?;
        drop(bytes);
        for oddity in oddities(&report) {
            warn!("{oddity}: {name}");
        }
        Ok(SplatCloud { cloud: Arc::new(settled(cloud, settings)), report: Arc::new(report) })
    }

    fn extensions(&self) -> &[&str] {
        &EXTENSIONS
    }
}

/// The format that the settings name, if they do.
fn checked(
    settings: &SplatCloudSettings,
    path: &SourceName,
) -> Result<Option<&'static dyn splat_io::Format>, SplatLoadError> {
    let wrong = |setting, found, expected| SplatLoadError::Setting { setting, found, expected, path: path.clone() };
    if settings.max_sh_degree > sh::MAX_DEGREE {
        return Err(wrong("max_sh_degree", settings.max_sh_degree.to_string(), "a number from 0 to 4"));
    }
    if !(0.0..=1.0).contains(&settings.min_opacity) {
        return Err(wrong("min_opacity", settings.min_opacity.to_string(), "a number from 0 to 1"));
    }
    let Some(name) = &settings.format else { return Ok(None) };
    let unknown = || SplatLoadError::UnknownFormat {
        name: name.clone(),
        known: FORMATS.iter().map(|f| f.name()).collect::<Vec<_>>().join(", "),
        path: path.clone(),
    };
    format_named(name).ok_or_else(unknown).map(Some)
}

/// The cloud as the settings want it.
fn settled(mut cloud: Cloud, settings: &SplatCloudSettings) -> Cloud {
    if settings.min_opacity > 0.0 {
        let kept: Vec<u32> =
            (0..cloud.len()).filter(|&i| cloud.opacity(i) >= settings.min_opacity).map(|i| i as u32).collect();
        if kept.len() < cloud.len() {
            cloud = cloud.pick(&kept);
        }
    }
    if settings.max_sh_degree < cloud.sh_degree() {
        // The degree was checked; lower ones are always right.
        cloud = cloud.with_sh_degree(settings.max_sh_degree).unwrap_or(cloud);
    }
    if let Some(antialiased) = settings.antialiased
        && antialiased != cloud.source().antialiased
    {
        let mut arrays = cloud.into_arrays();
        arrays.source.antialiased = antialiased;
        // What a writer kept of the file no longer describes the cloud.
        arrays.source.layout = None;
        // No length has changed.
        cloud = Cloud::new(arrays).unwrap_or_default();
    }
    cloud
}

/// Sentences about Gaussians that will not look as they should.
fn oddities(report: &ReadReport) -> Vec<String> {
    let mut sentences = Vec::new();
    if report.not_finite > 0 {
        sentences.push(format!("{} Gaussians with NaN or infinite values are not drawn", report.not_finite));
    }
    if report.bad_rotations > 0 {
        sentences.push(format!("{} Gaussians without a rotation are drawn unrotated", report.bad_rotations));
    }
    if report.trailing_bytes > 0 {
        sentences.push(format!("{} bytes after the last Gaussian are ignored", report.trailing_bytes));
    }
    sentences
}
