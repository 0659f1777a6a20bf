//! [`SplatCameras`]: the cameras that a capture's pictures were taken with.

use bevy::asset::{Asset, AssetLoader, LoadContext, io::Reader};
use bevy::prelude::*;
use splat_io::cameras::{self, NamedView};
use splat_io::{ReadError, SourceName};

use super::beside::read_with_beside;

/// The cameras of a capture, from a file of INRIA's (`cameras.json`), of nerfstudio's (`transforms.json`) or of COLMAP
/// (`images.bin`, `images.txt`): `asset_server.load::<SplatCameras>("room/cameras.json")`.
///
/// Their poses are in the capture's own space, as its Gaussians are.
#[derive(Asset, TypePath, Clone, Debug, Default)]
pub struct SplatCameras {
    /// In the order of the file.
    pub views: Vec<NamedView>,
    /// Sentences about anything that was not taken over (lens distortion).
    pub notes: Vec<String>,
}

/// Loads [`SplatCameras`]. It has no endings of its own: the asset's type decides.
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct SplatCamerasLoader;

impl AssetLoader for SplatCamerasLoader {
    type Asset = SplatCameras;
    type Settings = ();
    type Error = ReadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<SplatCameras, ReadError> {
        let name = SourceName::from(context.path().to_string().as_str());
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(ReadError::io(&name))?;
        let read = read_with_beside(context, |files| cameras::read_with(&bytes, &name, files)).await?;
        Ok(SplatCameras { views: read.views, notes: read.notes })
    }
}
