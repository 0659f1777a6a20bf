//! What the Gaussians say about how a capture lies, apart from the world: everything in the cloud's own space, so that it holds
//! wherever the capture stands when it is found.

use std::sync::Arc;

use bevy::math::Vec3;
use splat_core::bounds::robust_bounds;
use splat_core::orient::{self, AxisTarget, Floor, FloorSettings, PrincipalAxes};
use splat_core::{Cloud, Selection, Similarity};

use super::OrientError;

/// What is looked for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Wanted {
    Axes(Option<[AxisTarget; 3]>),
    Plane,
}

/// A question that takes time.
pub(super) struct Job {
    pub(super) cloud: Arc<Cloud>,
    /// What counts; `None`: everything.
    pub(super) of: Option<Selection>,
    /// Whether somebody selected it, or it is all that the entity shows.
    pub(super) chosen: bool,
    pub(super) up: Vec3,
    pub(super) wanted: Wanted,
}

/// An answer.
pub(super) enum Found {
    Axes { axes: PrincipalAxes, targets: Option<[AxisTarget; 3]> },
    Plane { floor: Floor, center: Vec3, ambiguities: Vec<String> },
}

impl Job {
    pub(super) fn run(self) -> Result<Found, OrientError> {
        let of = self.of.as_ref();
        match self.wanted {
            Wanted::Axes(targets) => {
                let axes = orient::principal_axes(&self.cloud, of).ok_or(OrientError::NothingDrawn)?;
                Ok(Found::Axes { axes, targets })
            }
            Wanted::Plane => {
                let settings = FloorSettings::default();
                let center = robust_bounds(&self.cloud).map_or(Vec3::ZERO, |b| b.center);
                let mut ambiguities = Vec::new();
                let floor = match of.filter(|_| self.chosen) {
                    Some(surface) => {
                        let found = orient::surface_plane(&self.cloud, surface, self.up, &settings)
                            .ok_or(OrientError::NoPlane)?;
                        if found.side_ambiguous {
                            ambiguities.push("nothing tells which side of the surface is up".to_owned());
                        }
                        found.plane
                    }
                    None => orient::floor_plane(&self.cloud, of, self.up, &settings).ok_or(OrientError::NoFloor)?,
                };
                if let Some((_, share)) = floor.rival {
                    ambiguities.push(format!(
                        "another plane holds {:.0} % of the surface (the one taken {:.0} %); select the floor if it is wrong",
                        100.0 * share,
                        100.0 * floor.share
                    ));
                }
                Ok(Found::Plane { floor, center, ambiguities })
            }
        }
    }
}

impl Found {
    /// How the world moves for it. `placed`: from the cloud's space to the world's.
    pub(super) fn motion(self, placed: &Similarity) -> Result<(Similarity, Vec<String>), OrientError> {
        match self {
            Self::Axes { axes, targets } => {
                let axes = axes.moved(placed);
                let mut ambiguities = Vec::new();
                match (axes.first_two_ambiguous(), axes.last_two_ambiguous()) {
                    (true, true) => ambiguities.push("it spreads alike in all directions".to_owned()),
                    (true, false) => ambiguities
                        .push("it is round about its shortest direction: only that one is laid straight".to_owned()),
                    (false, true) => ambiguities
                        .push("it is round about its longest direction: only that one is laid straight".to_owned()),
                    (false, false) if axes.flatness() > 0.5 => {
                        ambiguities.push("it has no flat direction: which side is up is a guess".to_owned());
                    }
                    (false, false) => {}
                }
                let Some(targets) = targets else { return Ok((orient::align(&axes, None), ambiguities)) };
                let found = orient::align_to(&axes, targets)?;
                if found.rival.is_some() {
                    ambiguities.push("the opposite turn lays the axes as well and is about as near".to_owned());
                }
                Ok((found.transform, ambiguities))
            }
            Self::Plane { floor, center, ambiguities } => {
                Ok((orient::upright(&floor.moved(placed), Vec3::Y, placed.apply(center)), ambiguities))
            }
        }
    }
}
