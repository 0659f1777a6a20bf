//! Which Gaussian is under a pointer, through `bevy_picking`.
//!
//! [`SplatPickingPlugin`] is a picking back end: for every pointer over a `Camera3d` it sends the first solid hit, which is the
//! Gaussian at which half of the light is taken (transmittance at most 0.5, as
//! [`first_hits`](splat_raster::Rasterizer::first_hits) of a drawn frame), not the one whose centre is nearest. All captures
//! on the camera's layers are one scene with one order, so that captures that stand in each other hide each other as they are
//! drawn. The answer comes in the pointer's own frame.
//!
//! Hits are for
//! - the `Splats` entity itself: a capture, or a part that [`extract_part`](crate::parts) made an entity of its own;
//! - the entity with a [`SplatPartHandle`], where a capture has such a child for the part that was hit. Pointer events go on
//!   to the capture, its parent.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_splat::prelude::*;
//!
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn(Splats(assets.load("room.ply"))).observe(|click: On<Pointer<Click>>| {
//!         if let Some(hit) = click.hit.extra_as::<SplatHit>() {
//!             info!("Gaussian {} at {:?}, part {:?}", hit.gaussian, click.hit.position, hit.part);
//!         }
//!     });
//! }
//! # bevy::ecs::system::assert_is_system(setup);
//! ```
//!
//! `HitData::depth` is the distance from the camera's near plane along the ray, in world units, as the mesh back end gives it:
//! splats and meshes hide each other for pointers as they do on the screen. `Pickable` is respected: what is not hoverable is
//! looked through, and behind what does not block the next hit is sent too.

mod backend;
mod hit;
mod index;

pub use hit::{SplatHit, SplatPartHandle};
pub use index::SplatPickIndices;

use bevy::app::{App, Plugin, PreUpdate};
use bevy::picking::PickingSystems;
use bevy::picking::backend::{PointerHits, ray::RayMap};
use bevy::prelude::*;

/// Sends `PointerHits` for splats; needs Bevy's `PickingPlugin` (in `DefaultPlugins`) for pointers and for `Pointer` events.
///
/// Keeps a [`SplatPickIndices`], built in the background. Until a cloud's index is there every Gaussian of it is looked at:
/// slower, and the same answer.
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatPickingPlugin;

impl Plugin for SplatPickingPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<crate::SplatCloud>()
            .init_resource::<RayMap>()
            .init_resource::<SplatPickIndices>()
            .add_message::<PointerHits>()
            .register_type::<SplatPartHandle>()
            .add_systems(
                PreUpdate,
                (index::keep_indices, backend::update_hits).chain().in_set(PickingSystems::Backend),
            );
    }
}
