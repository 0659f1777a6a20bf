//! [`Cage`]: a regular grid of nodes around a part; moving the nodes moves what lies between them.

use glam::{UVec3, Vec3};

/// A box of equal cubic cells; values at its nodes are interpolated trilinearly.
///
/// Nodes are numbered with x fastest: `x + (nx + 1) * (y + (ny + 1) * z)` for `cells = (nx, ny, nz)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cage {
    /// Node (0, 0, 0), in the cloud's space.
    pub origin: Vec3,
    /// Side of a cell, in the cloud's units; positive and finite.
    pub cell: f32,
    /// Cells along each axis, at least one.
    pub cells: UVec3,
}

/// Where a point lies in a [`Cage`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CagePoint {
    /// The corner of the cell with the least coordinates.
    pub node: UVec3,
    /// Place in the cell; 0..=1 along each axis for points inside the cage, beyond that for points outside.
    pub local: Vec3,
}

impl Cage {
    /// Nodes along each axis.
    pub fn nodes(&self) -> UVec3 {
        self.cells + 1
    }

    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        let n = self.nodes();
        n.x as usize * n.y as usize * n.z as usize
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.cells.x as usize * self.cells.y as usize * self.cells.z as usize
    }

    /// Number of a node.
    pub fn node_index(&self, node: UVec3) -> usize {
        let n = self.nodes();
        node.x as usize + n.x as usize * (node.y as usize + n.y as usize * node.z as usize)
    }

    /// The node of a number.
    pub fn node_at(&self, index: usize) -> UVec3 {
        let n = self.nodes();
        let (nx, ny) = (n.x as usize, n.y as usize);
        UVec3::new((index % nx) as u32, (index / nx % ny) as u32, (index / (nx * ny)) as u32)
    }

    /// Place of a node at rest, in the cloud's space.
    pub fn node_position(&self, index: usize) -> Vec3 {
        self.origin + self.node_at(index).as_vec3() * self.cell
    }

    /// Numbers of the eight corners of the cell at `node`: bit 0 of the position is x, bit 1 y, bit 2 z.
    pub fn corners(&self, node: UVec3) -> [usize; 8] {
        let n = self.nodes();
        let first = self.node_index(node);
        let (y, z) = (n.x as usize, n.x as usize * n.y as usize);
        [0, 1, y, y + 1, z, z + 1, z + y, z + y + 1].map(|step| first + step)
    }

    /// The cell of a point, or the nearest one for a point outside; NaN counts as the origin.
    pub fn locate(&self, point: Vec3) -> CagePoint {
        let at = (point - self.origin) / self.cell;
        let at = Vec3::select(at.cmpeq(at), at, Vec3::ZERO);
        let node = at.floor().clamp(Vec3::ZERO, (self.cells - 1).as_vec3());
        CagePoint { node: node.as_uvec3(), local: at - node }
    }
}

impl CagePoint {
    /// Weights of the eight corners, in the order of [`Cage::corners`]; their sum is 1.
    pub fn weights(&self) -> [f32; 8] {
        let (b, a) = (self.local, Vec3::ONE - self.local);
        [
            a.x * a.y * a.z,
            b.x * a.y * a.z,
            a.x * b.y * a.z,
            b.x * b.y * a.z,
            a.x * a.y * b.z,
            b.x * a.y * b.z,
            a.x * b.y * b.z,
            b.x * b.y * b.z,
        ]
    }

    /// Gradients of the weights by the local coordinates; divide by the cell's side for gradients in space.
    pub fn gradients(&self) -> [Vec3; 8] {
        let (b, a) = (self.local, Vec3::ONE - self.local);
        let corner = |x: bool, y: bool, z: bool| {
            let (wx, wy, wz) = (if x { b.x } else { a.x }, if y { b.y } else { a.y }, if z { b.z } else { a.z });
            let sign = |up: bool| if up { 1.0 } else { -1.0 };
            Vec3::new(sign(x) * wy * wz, sign(y) * wx * wz, sign(z) * wx * wy)
        };
        [0, 1, 2, 3, 4, 5, 6, 7].map(|k| corner(k & 1 != 0, k & 2 != 0, k & 4 != 0))
    }
}
