//! Frames of Bevy, with and without splats.

use bevy::prelude::*;
use bevy_splat::prelude::*;
use peer_bevy_frame::BevyFrame;
use peer_common::{Failure, Job};

use crate::Backend;

/// The capture through the plugin.
pub(crate) fn run(job: &Job, backend: Backend) -> Result<(), Failure> {
    let mut frame = BevyFrame::new(job, |app| {
        app.add_plugins(BevySplatPlugins);
        app.insert_resource(match backend {
            Backend::Auto => SplatBackend::Auto,
            Backend::Cpu => SplatBackend::Cpu,
            Backend::Gpu => SplatBackend::Gpu,
        });
    })?;
    let world = frame.app.world_mut();
    let cloud: Handle<SplatCloud> = world.resource::<AssetServer>().load(BevyFrame::asset(job));
    // Cameras stand in the space of the file, so the capture is not turned upright.
    world.spawn((Splats(cloud.clone()), Transform::IDENTITY));
    frame.run(job, |world| BevyFrame::loaded(world, &cloud))
}

/// The camera alone.
pub(crate) fn empty(job: &Job) -> Result<(), Failure> {
    BevyFrame::new(job, |_| {})?.run(job, |_| Ok(true))
}
