//! bevy_gaussian_splatting 8.0.2 as a contender, as its own headless example sets it up.

use std::process::ExitCode;

use bevy::prelude::*;
use bevy_gaussian_splatting::gaussian::settings::GaussianColorSpace;
use bevy_gaussian_splatting::sort::SortMode;
use bevy_gaussian_splatting::{
    CloudSettings, GaussianCamera, GaussianSplattingPlugin, PlanarGaussian3d, PlanarGaussian3dHandle,
};
use clap::{Parser, ValueEnum};
use peer_bevy_frame::BevyFrame;
use peer_common::{Failure, Job};

/// Draws a capture with bevy_gaussian_splatting and reports what the frames cost
#[derive(Parser)]
struct Options {
    #[command(flatten)]
    job: Job,
    /// What sorts
    #[arg(long, value_enum, default_value_t = Sort::Radix)]
    sort: Sort,
    /// Write colours as if they were linear: the picture is then encoded once too often, but blended as captures are
    /// trained, which the plugin cannot do otherwise
    #[arg(long)]
    blend_encoded: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Sort {
    /// On the device, every frame (the plugin's default)
    Radix,
    /// On all cores, at most once a second
    Rayon,
    /// On one core, at most once a second
    Std,
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Result<(), Failure> {
    let job = &options.job;
    let mut frame = BevyFrame::new(job, |app| {
        app.add_plugins(GaussianSplattingPlugin);
    })?;
    let world = frame.app.world_mut();
    let cloud: Handle<PlanarGaussian3d> = world.resource::<AssetServer>().load(BevyFrame::asset(job));
    let settings = CloudSettings {
        sort_mode: match options.sort {
            Sort::Radix => SortMode::Radix,
            Sort::Rayon => SortMode::Rayon,
            Sort::Std => SortMode::Std,
        },
        color_space: if options.blend_encoded {
            GaussianColorSpace::LinRec709Display
        } else {
            GaussianColorSpace::default()
        },
        ..default()
    };
    world.spawn((PlanarGaussian3dHandle(cloud.clone()), settings, Name::new("cloud")));
    world.entity_mut(frame.camera).insert(GaussianCamera::default());
    frame.run(job, |world| BevyFrame::loaded(world, &cloud))
}
