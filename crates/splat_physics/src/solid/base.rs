//! Closing the underside of what stood on something.

use glam::{DVec3, UVec3};

use super::morphology::Mask;

/// Fills the footprint of the lowest `depth` voxels along `up`, each piece of it by itself (the feet of a chair stay apart); how
/// many voxels that put in.
///
/// The rim is drawn down to the lowest height, and what it encloses becomes a floor there. Columns run along the axis nearest to
/// `up`, so a floor of one voxel in each has no hole that could be passed through faces.
pub(super) fn close_base(shell: &mut Mask, up: DVec3, depth: u32) -> usize {
    let dims = shell.dims;
    let k = up.abs().max_position();
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let (ni, nj, nk) = (dims[i] as usize, dims[j] as usize, dims[k] as usize);
    let strides = [1, dims.x as usize, dims.x as usize * dims.y as usize];
    let voxel = |a: usize, b: usize, c: usize| a * strides[i] + b * strides[j] + c * strides[k];
    let height = |a: usize, b: usize, c: usize| up[i] * a as f64 + up[j] * b as f64 + up[k] * c as f64;

    let columns = || (0..nj).flat_map(move |b| (0..ni).map(move |a| (a, b)));
    let mut lowest = f64::INFINITY;
    for (a, b) in columns() {
        for c in (0..nk).filter(|&c| shell.voxels[voxel(a, b, c)] != 0) {
            lowest = lowest.min(height(a, b, c));
        }
    }
    if lowest.is_infinite() {
        return 0;
    }
    // The rim: by column, whether anything of it is low enough.
    let low = |a, b, c| shell.voxels[voxel(a, b, c)] != 0 && height(a, b, c) <= lowest + f64::from(depth) + 0.5;
    // One voxel more on all sides in which to go around it, and as much as holes in the rim may be wide.
    let around = depth as usize + 2;
    let flat = UVec3::new((ni + 2 * around) as u32, (nj + 2 * around) as u32, 1);
    let at = |a: usize, b: usize| a + around + flat.x as usize * (b + around);
    let mut rim = Mask { dims: flat, voxels: vec![0; (flat.x * flat.y) as usize] };
    for (a, b) in columns() {
        rim.voxels[at(a, b)] = u8::from((0..nk).any(|c| low(a, b, c)));
    }
    let footprint = rim.filled(depth / 2);

    let mut floor = Vec::new();
    for (a, b) in columns().filter(|&(a, b)| footprint.voxels[at(a, b)] != 0) {
        let bottom = ((lowest - height(a, b, 0)) / up[k]).round().clamp(0.0, (nk - 1) as f64) as usize;
        floor.push(voxel(a, b, bottom));
        if rim.voxels[at(a, b)] != 0 {
            let mut above = (0..nk).filter(|&c| low(a, b, c));
            // Nearest to the floor: with `up` against the axis that is the last.
            let nearest = if up[k] > 0.0 { above.next() } else { above.next_back() };
            if let Some(c) = nearest {
                floor.extend((bottom.min(c)..bottom.max(c)).map(|c| voxel(a, b, c)));
            }
        }
    }
    let before = shell.count();
    floor.into_iter().for_each(|voxel| shell.voxels[voxel] = 1);
    shell.count() - before
}
