//! Sets of voxels that take memory where there are some.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use glam::IVec3;

/// Hashes lattice places; nobody chooses them to collide.
#[derive(Clone, Copy, Default)]
pub(super) struct PlaceHasher(u64);

impl Hasher for PlaceHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u32(b.into()));
    }

    fn write_i32(&mut self, value: i32) {
        self.write_u32(value as u32);
    }

    fn write_u32(&mut self, value: u32) {
        self.0 = (self.0.rotate_left(21) ^ u64::from(value)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }

    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 29
    }
}

/// A map from lattice places.
pub(super) type PlaceMap<T> = HashMap<IVec3, T, BuildHasherDefault<PlaceHasher>>;

/// What Gaussians say about a voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Extinction.
    pub(super) weight: f32,
    /// Where in it they are on average: from its middle, in voxels.
    pub(super) offset: glam::Vec3,
}

/// A set of voxels, a bit each, in bricks of 8 x 8 x 8.
#[derive(Clone, Debug, Default)]
pub(super) struct Lattice {
    bricks: PlaceMap<[u64; 8]>,
}

impl Lattice {
    fn split(at: IVec3) -> (IVec3, usize, u32) {
        let local = at & 7;
        (at >> 3i32, local.z as usize, (local.x + 8 * local.y) as u32)
    }

    pub(super) fn insert(&mut self, at: IVec3) {
        let (brick, word, bit) = Self::split(at);
        self.bricks.entry(brick).or_default()[word] |= 1 << bit;
    }

    pub(super) fn has(&self, at: IVec3) -> bool {
        let (brick, word, bit) = Self::split(at);
        self.bricks.get(&brick).is_some_and(|bits| bits[word] >> bit & 1 == 1)
    }

    /// All of them, in rising order of (z, y, x) of bricks and then of voxels.
    pub(super) fn all(&self) -> Vec<IVec3> {
        let mut bricks: Vec<_> = self.bricks.iter().collect();
        bricks.sort_unstable_by_key(|(at, _)| (at.z, at.y, at.x));
        let mut out = Vec::new();
        for (brick, bits) in bricks {
            for (z, word) in bits.iter().enumerate() {
                let set = (0..64).filter(|bit| word >> bit & 1 == 1);
                out.extend(set.map(|bit| *brick * 8 + IVec3::new(bit & 7, bit >> 3, z as i32)));
            }
        }
        out
    }
}
