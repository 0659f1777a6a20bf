//! [`SplatHit`]: what a hit on a capture is.

use bevy::prelude::*;
use splat_core::PartId;

/// What a pointer's hit on splats says beside position, normal and depth: `hit.extra_as::<SplatHit>()`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatHit {
    /// The `Splats` entity whose Gaussian it is; the hit's own entity, unless that is a [`SplatPartHandle`].
    pub splats: Entity,
    /// Id of the Gaussian in the cloud.
    pub gaussian: u32,
    /// Its part, by the label in the capture's [`SplatParts`](crate::SplatParts); for an extracted part's entity too.
    pub part: Option<PartId>,
    /// Its share of the pixel, 0 to 1: alpha times transmittance.
    pub weight: f32,
    /// Distance of its mean from the camera along the view, in world units.
    pub view_depth: f32,
    /// Whether it is locked: seen and hit, but no tool selects it.
    pub locked: bool,
}

/// Stands for a part that was not taken out of its capture: pointers that hit the part hit this entity.
///
/// Spawn it as a child of the capture. Without a handle for a part the handle of the part it belongs to is hit, and without
/// that the capture.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_splat::prelude::*;
/// fn listen_to_the_chair(mut commands: Commands, capture: Single<Entity, With<SplatParts>>) {
///     commands.spawn((SplatPartHandle(PartId(1)), ChildOf(*capture))).observe(|_: On<Pointer<Click>>| info!("chair"));
/// }
/// # bevy::ecs::system::assert_is_system(listen_to_the_chair);
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct SplatPartHandle(pub PartId);
