//! Growing, flooding and counting of voxels: [`Mask`].

use glam::UVec3;

/// One byte per voxel, 1 or 0, numbered as in [`VoxelGrid`](super::VoxelGrid).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Mask {
    pub(super) dims: UVec3,
    pub(super) voxels: Vec<u8>,
}

impl Mask {
    pub(super) fn count(&self) -> usize {
        self.voxels.iter().filter(|&&voxel| voxel != 0).count()
    }

    /// What is set within `steps` steps from voxel to voxel through faces.
    pub(super) fn grown(&self, steps: u32) -> Self {
        let (nx, ny) = (self.dims.x as usize, self.dims.y as usize);
        let layer = nx * ny;
        let mut now = self.voxels.clone();
        for _ in 0..steps {
            let mut next = now.clone();
            let mut or = |to: usize, from: usize, len: usize| {
                next[to..to + len].iter_mut().zip(&now[from..from + len]).for_each(|(to, from)| *to |= from);
            };
            for row in (0..now.len()).step_by(nx) {
                or(row, row + 1, nx - 1);
                or(row + 1, row, nx - 1);
            }
            for layer in (0..now.len()).step_by(layer) {
                or(layer, layer + nx, nx * (ny - 1));
                or(layer + nx, layer, nx * (ny - 1));
            }
            or(0, layer, now.len() - layer);
            or(layer, 0, now.len() - layer);
            now = next;
        }
        Self { dims: self.dims, voxels: now }
    }

    /// What is not set.
    pub(super) fn inverted(mut self) -> Self {
        self.voxels.iter_mut().for_each(|voxel| *voxel ^= 1);
        self
    }

    /// What can be reached from the grid's first voxel through faces of voxels that are not set.
    ///
    /// The grid's faces must not be set: so a step that leaves a row ends in another row's end, which is outside as well.
    pub(super) fn outside(&self) -> Self {
        let row = self.dims.x as usize;
        let steps = [1, row, row * self.dims.y as usize];
        let mut reached = vec![0u8; self.voxels.len()];
        let mut stack = vec![0usize];
        reached[0] = 1;
        while let Some(voxel) = stack.pop() {
            for near in steps.into_iter().flat_map(|step| [voxel.wrapping_sub(step), voxel + step]) {
                if self.voxels.get(near) == Some(&0) && std::mem::replace(&mut reached[near], 1) == 0 {
                    stack.push(near);
                }
            }
        }
        Self { dims: self.dims, voxels: reached }
    }

    /// What is set, with all that it encloses once holes of up to `2 * steps` voxels are closed.
    ///
    /// The grid's faces must be `steps + 1` voxels away from all that is set.
    pub(super) fn filled(&self, steps: u32) -> Self {
        self.grown(steps).outside().grown(steps).inverted()
    }
}

/// The up to six voxels that share a face with one, and the axis along which each does, in a fixed order.
pub(super) fn faces(voxel: usize, dims: UVec3) -> impl Iterator<Item = (usize, usize)> {
    let (nx, ny, nz) = (dims.x as usize, dims.y as usize, dims.z as usize);
    let at = [voxel % nx, voxel / nx % ny, voxel / (nx * ny)];
    let (strides, sizes) = ([1, nx, nx * ny], [nx, ny, nz]);
    (0..3).flat_map(move |k| {
        let before = (at[k] > 0).then(|| (voxel - strides[k], k));
        let after = (at[k] + 1 < sizes[k]).then(|| (voxel + strides[k], k));
        before.into_iter().chain(after)
    })
}

/// The up to 26 voxels that share a corner with one, in rising order.
fn corners(voxel: usize, dims: UVec3) -> impl Iterator<Item = usize> {
    let (nx, ny, nz) = (dims.x as i64, dims.y as i64, dims.z as i64);
    let v = voxel as i64;
    let (x, y, z) = (v % nx, v / nx % ny, v / (nx * ny));
    (0..27i64).filter(|k| *k != 13).filter_map(move |k| {
        let (x, y, z) = (x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1);
        let inside = (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z);
        inside.then_some((x + nx * (y + ny * z)) as usize)
    })
}

/// What hangs together through faces, or with `by_corners` also through edges and corners: for each voxel the number of its
/// piece, from 1, or 0 where nothing is set; and the size of each piece.
pub(super) fn pieces(mask: &Mask, by_corners: bool) -> (Vec<u32>, Vec<usize>) {
    let mut labels = vec![0u32; mask.voxels.len()];
    let mut sizes = Vec::new();
    let mut stack = Vec::new();
    for seed in 0..labels.len() {
        if mask.voxels[seed] == 0 || labels[seed] != 0 {
            continue;
        }
        let label = sizes.len() as u32 + 1;
        let mut size = 0;
        labels[seed] = label;
        stack.push(seed);
        while let Some(voxel) = stack.pop() {
            size += 1;
            let mut visit = |near: usize| {
                if mask.voxels[near] != 0 && labels[near] == 0 {
                    labels[near] = label;
                    stack.push(near);
                }
            };
            if by_corners {
                corners(voxel, mask.dims).for_each(&mut visit);
            } else {
                faces(voxel, mask.dims).for_each(|(near, _)| visit(near));
            }
        }
        sizes.push(size);
    }
    (labels, sizes)
}

/// The pieces that hold more than `1 / share` of the largest, or the largest alone; how many hold so much; and the share of what
/// is set that the largest has.
pub(super) fn large_pieces(mask: &Mask, share: usize, largest_only: bool) -> (Mask, usize, f64) {
    let (labels, sizes) = pieces(mask, true);
    let most = sizes.iter().copied().max().unwrap_or(0);
    let first = sizes.iter().position(|&size| size == most);
    let large = |piece: usize| sizes[piece] * share > most;
    let count = (0..sizes.len()).filter(|&piece| large(piece)).count();
    let stays = |piece: usize| if largest_only { Some(piece) == first } else { large(piece) };
    let keep = |&label: &u32| u8::from(label > 0 && stays(label as usize - 1));
    let kept = Mask { dims: mask.dims, voxels: labels.iter().map(keep).collect() };
    (kept, count, most as f64 / mask.count().max(1) as f64)
}
