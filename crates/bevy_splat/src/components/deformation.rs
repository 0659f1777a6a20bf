//! [`SplatDeformation`]: the pose of a bent capture.

use std::sync::Arc;

use bevy::prelude::*;
use splat_core::deform::Deformation;

/// How the entity's Gaussians are bent, in the cloud's own space, before its `Transform` places them. Without it, they are
/// as in the file.
///
/// What is drawn, picked and selected in views, and the entity's `Aabb`, follow. Elastic parts set it every frame; to bend
/// something by hand, insert it:
///
/// ```
/// use std::sync::Arc;
/// # use bevy::prelude::*;
/// # use bevy_splat::prelude::*;
/// use splat_core::deform::{Cage, Deformation};
///
/// # fn bend(mut commands: Commands, part: Entity) -> Result<(), BevyError> {
/// let cage = Cage { origin: Vec3::splat(-1.0), cell: 0.25, cells: UVec3::splat(8) };
/// let bent = Deformation::from_fn(cage, |p| Quat::from_rotation_y(0.5 * p.y) * p)?;
/// commands.entity(part).insert(SplatDeformation(Arc::new(bent)));
/// # Ok(())
/// # }
/// ```
///
/// It is a state of the moment: scene files leave it out.
#[derive(Component, Clone, Debug, Deref, PartialEq)]
pub struct SplatDeformation(pub Arc<Deformation>);
