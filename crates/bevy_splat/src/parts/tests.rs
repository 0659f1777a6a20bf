use bevy::prelude::*;
use splat_core::{PartId, Parts, SelectMode, Selection};

use super::*;
use crate::components::{SplatFlags, SplatParts, SplatSelection, SplatSubset};
use crate::{Splats, testing};

mod picture;
mod random;
mod road;

const LEN: usize = 300;
const CHAIR: PartId = PartId(1);
const SEAT: PartId = PartId(2);
const LAMP: PartId = PartId(3);

/// A capture of 300 Gaussians with a chair (20 to 120), its seat (60 to 90), and a lamp (every second of 200 to 260).
fn scene() -> (App, Entity) {
    let mut app = testing::app();
    app.add_plugins(SplatPartsPlugin);
    let capture = testing::spawn(&mut app, LEN);
    let mut parts = Parts::new(LEN);
    let of = |inside: &dyn Fn(usize) -> bool| Selection::from_fn(LEN, inside);
    for (id, name, up) in [(CHAIR, "chair", None), (SEAT, "seat", Some(CHAIR)), (LAMP, "lamp", None)] {
        assert_eq!(parts.add(name, [id.0 as u8; 3], up), Ok(id));
    }
    parts.assign(CHAIR, &of(&|i| (20..120).contains(&i)), SelectMode::New).unwrap();
    parts.assign(SEAT, &of(&|i| (60..90).contains(&i)), SelectMode::New).unwrap();
    parts.assign(LAMP, &of(&|i| (200..260).contains(&i) && i % 2 == 0), SelectMode::New).unwrap();
    app.world_mut().entity_mut(capture).insert(SplatParts(parts));
    app.update();
    (app, capture)
}

/// Everything a capture must get back.
fn state(
    world: &World,
    entity: Entity,
) -> (Option<SplatSubset>, SplatFlags, Option<SplatSelection>, Option<SplatParts>) {
    let entity = world.entity(entity);
    (entity.get().cloned(), entity.get().cloned().unwrap(), entity.get().cloned(), entity.get().cloned())
}

/// The Gaussians that an entity shows, hidden ones included.
fn members(world: &World, entity: Entity) -> Vec<u32> {
    world.get::<SplatSubset>(entity).map_or_else(|| (0..LEN as u32).collect(), |subset| subset.0.to_vec())
}
