//! What one pixel sees of an instance: the projection of a frame, for as many Gaussians as one wants.

use rayon::prelude::*;
use splat_core::View;

use super::project::{Project, Setup};
use super::simd::InstructionSet;
use super::splat::{Cover, Splat};
use super::{BLOCK, LARGEST_ALPHA, SMALLEST_ALPHA};
use crate::Instance;

/// A Gaussian at a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Camera z of its mean.
    pub(crate) z: f32,
    /// Position in its instance.
    pub(crate) position: u32,
    pub(crate) alpha: f32,
}

/// The Gaussians of an instance that count at the point `pixel` of the picture, in no order that matters.
pub(crate) fn samples(instance: &Instance, view: &View, pixel: [f32; 2]) -> Vec<Sample> {
    let setup = Setup::new(instance, 0, view, false);
    let set = InstructionSet::best();
    let len = instance.len();
    let block = |k: usize| {
        let start = k * BLOCK;
        let count = BLOCK.min(len - start);
        let mut splats = vec![Splat::default(); count];
        let mut covers = vec![Cover::default(); count];
        let mut keys = vec![0; count];
        let project = Project { setup: &setup, start, splats: &mut splats, covers: &mut covers, keys: &mut keys };
        let kept = set.run(project).count as usize;
        let found: Vec<Sample> = keys[..kept]
            .iter()
            .filter_map(|&key| {
                let position = key as u32;
                let splat = &splats[position as usize - start];
                let (dx, dy) = (pixel[0] - splat.mean[0], pixel[1] - splat.mean[1]);
                let e = splat.along * (dx - splat.shear * dy);
                let f = splat.across * dy;
                let alpha = (splat.level - e * e - f * f).exp2().min(LARGEST_ALPHA);
                (alpha >= SMALLEST_ALPHA).then_some(Sample { z: splat.z, position, alpha })
            })
            .collect();
        found
    };
    let blocks = len.div_ceil(BLOCK);
    // A few blocks are done before another thread has woken up.
    if blocks <= 4 {
        (0..blocks).flat_map(block).collect()
    } else {
        (0..blocks).into_par_iter().flat_map_iter(block).collect()
    }
}
