//! How large a capture is: [`ScaleRequest`].

use bevy::prelude::*;
use splat_core::orient::extent_along;

use super::place::Placed;
use super::queue::counted;
use super::{OrientError, OrientFailed};
use crate::physics::{CaptureScale, ScaleSource};
use crate::{SplatCloud, SplatSelection, SplatSubset, Splats};

/// Asks to give a capture its scale in metres, as a [`CaptureScale`].
#[derive(Message, Clone, Copy, Debug, PartialEq)]
pub struct ScaleRequest {
    /// The [`Splats`] entity.
    pub capture: Entity,
    /// By what.
    pub by: ScaleBy,
}

/// What is known of a capture's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScaleBy {
    /// The distance of two places.
    Length {
        /// In world space, such as that of a pointer's hit.
        a: Vec3,
        /// In world space.
        b: Vec3,
        /// What it is.
        metres: f32,
    },
    /// The height of a thing; half a percent of it at either end does not count.
    Height {
        /// A part's entity; `None`: what is selected of the capture, or everything.
        part: Option<Entity>,
        /// What it is.
        metres: f32,
    },
}

/// A capture has a [`CaptureScale`]; its `Transform` and those of its parts follow in the same or the next frame.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct Scaled {
    /// The entity of the request.
    pub capture: Entity,
    /// Metres per unit of the cloud.
    pub metres_per_unit: f32,
    /// The component as it was.
    pub scale_before: Option<CaptureScale>,
    /// The `Transform`s of the capture and of its parts as they were: with `scale_before`, what undoes the request.
    pub before: Vec<(Entity, Transform)>,
}

type Captures<'w, 's> = Query<
    'w,
    's,
    (&'static Splats, Option<&'static SplatSelection>, Option<&'static SplatSubset>, Option<&'static CaptureScale>),
>;

/// Answers requests at once: there is nothing to look for.
pub(super) fn answer(
    mut requests: MessageReader<ScaleRequest>,
    mut commands: Commands,
    (mut scaled, mut failed): (MessageWriter<Scaled>, MessageWriter<OrientFailed>),
    clouds: Res<Assets<SplatCloud>>,
    captures: Captures,
    placed: Placed,
) {
    for &ScaleRequest { capture, by } in requests.read() {
        let measured = match by {
            ScaleBy::Length { a, b, metres } => placed.of(capture).map(|at| (a.distance(b) / at.scale, metres)),
            ScaleBy::Height { part, metres } => {
                height(part.unwrap_or(capture), &captures, &clouds, &placed).map(|units| (units, metres))
            }
        };
        let result = measured.and_then(|(units, metres)| {
            let scale = metres / units;
            let (_, _, _, scale_before) = captures.get(capture).map_err(|_| OrientError::NoCapture)?;
            if units > 0.0 && metres > 0.0 && (1e-6..=1e6).contains(&scale) {
                Ok((scale, scale_before.copied()))
            } else {
                Err(OrientError::Length { units, metres })
            }
        });
        match result {
            Ok((metres_per_unit, scale_before)) => {
                let before = placed.together(capture);
                let scale = CaptureScale { metres_per_unit: Some(metres_per_unit), source: ScaleSource::Measured };
                commands.entity(capture).insert(scale);
                scaled.write(Scaled { capture, metres_per_unit, scale_before, before });
            }
            Err(error) => {
                failed.write(OrientFailed { capture, error });
            }
        }
    }
}

/// How high a thing is as it stands, in units of the cloud.
fn height(
    entity: Entity,
    captures: &Captures,
    clouds: &Assets<SplatCloud>,
    placed: &Placed,
) -> Result<f32, OrientError> {
    let (Splats(handle), selection, subset, _) = captures.get(entity).map_err(|_| OrientError::NoCapture)?;
    let cloud = &clouds.get(handle).ok_or(OrientError::Loading)?.cloud;
    let (of, _) = counted(cloud.len(), selection, subset);
    let up = placed.of(entity)?.rotation.conjugate() * Vec3::Y;
    let (low, high) = extent_along(cloud, of.as_ref(), up).ok_or(OrientError::NothingDrawn)?;
    Ok(high - low)
}
