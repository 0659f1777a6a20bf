//! From numbers of any camera file to a checked [`View`].

use glam::{DMat3, DVec3};
use splat_core::{DEFAULT_NEAR, Intrinsics, Pose, Projection, View};

use crate::{ReadError, SourceName};

/// A pinhole camera as files state it: focal lengths and principal point in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pinhole {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) fx: f64,
    pub(super) fy: f64,
    pub(super) cx: f64,
    pub(super) cy: f64,
}

/// Makes a view. `world_from_view`: right, down and forward axes as columns.
///
/// # Errors
/// [`ReadError::Malformed`] naming the camera if a number is unusable.
pub(super) fn view(
    pinhole: &Pinhole,
    world_from_view: DMat3,
    position: DVec3,
    camera: &str,
    name: &SourceName,
) -> Result<View, ReadError> {
    let view = View {
        width: pinhole.width,
        height: pinhole.height,
        intrinsics: Intrinsics {
            fx: pinhole.fx as f32,
            fy: pinhole.fy as f32,
            cx: pinhole.cx as f32,
            cy: pinhole.cy as f32,
        },
        projection: Projection::Perspective,
        pose: Pose { world_from_view: world_from_view.as_mat3(), position: position.as_vec3() },
        near: DEFAULT_NEAR,
    };
    let sentence = |e: splat_core::ViewError| ReadError::malformed(camera, "a usable camera", e.to_string(), name);
    view.check().map_err(sentence)?;
    Ok(view)
}
