//! What is left of a capture, as something that elastic parts touch: by its field of distance, with and without an engine.

use std::fmt;
use std::sync::Arc;

use bevy::math::{DQuat, DVec3};
use bevy::prelude::*;
use splat_physics::DistanceField;

use super::super::ground::CaptureGround;
use super::super::part::Sources;
use super::obstacle::{
    ContactSurface, ElasticLayers, ElasticObstacle, ElasticObstacles, ObstacleMotion, ObstacleShape,
};

/// The field of a capture that stands somewhere.
struct FieldShape {
    field: Arc<DistanceField>,
    rotation: DQuat,
    translation: DVec3,
}

impl fmt::Debug for FieldShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FieldShape").field("translation", &self.translation).finish_non_exhaustive()
    }
}

impl ObstacleShape for FieldShape {
    fn nearest(&self, point: DVec3, _inside: DVec3, reach: f64) -> Option<(f64, DVec3)> {
        let (gap, normal) = self.field.nearest(self.rotation.conjugate() * (point - self.translation))?;
        (gap < reach).then(|| (gap, self.rotation * normal))
    }
}

/// Adds the grounds of all captures to what parts may touch.
pub(super) fn find(
    grounds: Query<(Entity, &CaptureGround)>,
    sources: Sources,
    mut obstacles: ResMut<ElasticObstacles>,
) {
    let mut found: Vec<(Entity, &CaptureGround)> = grounds.iter().collect();
    found.sort_unstable_by_key(|(entity, _)| *entity);
    for (entity, ground) in found {
        let Ok(place) = sources.place(entity) else { continue };
        let shape =
            FieldShape { field: ground.field.clone(), rotation: place.rotation, translation: place.translation };
        obstacles.push(ElasticObstacle {
            entity: Some(entity),
            shape: Arc::new(shape),
            bounds: None,
            surface: ContactSurface {
                friction: ground.friction,
                restitution: ground.restitution,
                ..ContactSurface::default()
            },
            layers: ElasticLayers::default(),
            motion: ObstacleMotion::Still,
        });
    }
}
