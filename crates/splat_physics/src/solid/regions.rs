//! Which material each voxel of a filled solid is made of.

use std::collections::VecDeque;

use super::morphology::{Mask, faces};

/// Regions of all of `filled`: those of `known` voxels stay, the others take that of the nearest, counted from face to face.
pub(super) fn spread(regions: &mut [u8], known: &Mask, filled: &Mask) {
    let mut done = known.voxels.clone();
    let mut queue: VecDeque<usize> =
        (0..done.len()).filter(|&voxel| done[voxel] != 0 && filled.voxels[voxel] != 0).collect();
    while let Some(voxel) = queue.pop_front() {
        for (near, _) in faces(voxel, filled.dims) {
            if filled.voxels[near] != 0 && done[near] == 0 {
                done[near] = 1;
                regions[near] = regions[voxel];
                queue.push_back(near);
            }
        }
    }
    regions.iter_mut().zip(&filled.voxels).filter(|(_, filled)| **filled == 0).for_each(|(region, _)| *region = 0);
}
