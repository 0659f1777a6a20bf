//! [`SplatPickIndices`]: the hierarchy of bounds of every cloud that is shown.

use std::collections::HashMap;
use std::sync::{Arc, Weak};

use bevy::asset::AssetId;
use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use splat_core::Cloud;
use splat_raster::pick::PickIndex;

use crate::SplatCloud;
use crate::placed::PlacedSplats;

/// The [`PickIndex`] of every cloud that some entity shows: about 8 bytes a Gaussian, made in the background, dropped with the
/// last entity that shows the cloud, made anew when the asset changes.
#[derive(Resource, Default)]
pub struct SplatPickIndices {
    known: HashMap<AssetId<SplatCloud>, Entry>,
}

struct Entry {
    cloud: Weak<Cloud>,
    state: State,
}

enum State {
    Building(Task<PickIndex>),
    Ready(Arc<PickIndex>),
}

impl Entry {
    fn is_of(&self, cloud: &Arc<Cloud>) -> bool {
        std::ptr::eq(self.cloud.as_ptr(), Arc::as_ptr(cloud))
    }
}

impl SplatPickIndices {
    /// The index of this very cloud, if it is ready.
    pub fn get(&self, asset: AssetId<SplatCloud>, cloud: &Arc<Cloud>) -> Option<Arc<PickIndex>> {
        match self.known.get(&asset).filter(|entry| entry.is_of(cloud)) {
            Some(Entry { state: State::Ready(index), .. }) => Some(index.clone()),
            _ => None,
        }
    }

    /// Clouds whose index is ready.
    pub fn ready_count(&self) -> usize {
        self.known.values().filter(|entry| matches!(entry.state, State::Ready(_))).count()
    }

    /// Clouds that are known, ready or not.
    pub fn count(&self) -> usize {
        self.known.len()
    }
}

pub(super) fn keep_indices(mut indices: ResMut<SplatPickIndices>, splats: PlacedSplats) {
    let shown: HashMap<_, _> = splats.clouds().collect();
    let known = &mut indices.known;
    known.retain(|asset, entry| shown.get(asset).is_some_and(|cloud| entry.is_of(cloud)));
    for entry in known.values_mut() {
        if let State::Building(task) = &mut entry.state
            && let Some(index) = check_ready(task)
        {
            entry.state = State::Ready(Arc::new(index));
        }
    }
    for (asset, cloud) in shown {
        known.entry(asset).or_insert_with(|| {
            let of = Arc::clone(cloud);
            let task = AsyncComputeTaskPool::get().spawn(async move { PickIndex::new(&of) });
            Entry { cloud: Arc::downgrade(cloud), state: State::Building(task) }
        });
    }
}
