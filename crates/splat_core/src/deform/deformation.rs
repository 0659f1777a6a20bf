//! [`Deformation`]: where the nodes of a cage are, and what that does to the points between them.

use std::sync::Arc;

use glam::{Mat3, Quat, UVec3, Vec3, Vec4};

use super::nodes::{Node, nodes};
use super::{Cage, DeformError};

/// A bent cage.
///
/// Between nodes, places, gradients and rotations are interpolated trilinearly, so that none of them jumps at the faces of
/// cells. A point outside the cage moves rigidly with the nearest point of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Deformation {
    cage: Cage,
    positions: Vec<Vec3>,
    /// Shared with whoever sends them to a GPU.
    nodes: Arc<[Node]>,
    largest_stretch: f32,
}

/// What a [`Deformation`] does at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalDeformation {
    /// Where the point is now.
    pub position: Vec3,
    /// Deformation gradient F: a short vector v of the rest shape is F v now. Stretches are within
    /// [`LEAST_STRETCH`](super::LEAST_STRETCH) and [`LARGEST_STRETCH`](super::LARGEST_STRETCH) at nodes.
    pub gradient: Mat3,
    /// Rotation of F, of unit length.
    pub rotation: Quat,
}

impl LocalDeformation {
    /// Nothing happens at `point`.
    pub fn rest(point: Vec3) -> Self {
        Self { position: point, gradient: Mat3::IDENTITY, rotation: Quat::IDENTITY }
    }
}

impl Deformation {
    /// The nodes of `cage` at `positions`, in the cloud's space, in the order of the cage.
    ///
    /// A node that is flat or inside out ([`FLATTEST`](super::FLATTEST)) takes the rotation of the whole cage;
    /// [`Deformation::after`] knows better where there was a deformation before.
    ///
    /// # Errors
    /// [`DeformError`] for a cage without cells, another number of nodes than it has, or one that is not finite.
    pub fn new(cage: Cage, positions: Vec<Vec3>) -> Result<Self, DeformError> {
        Self::build(cage, positions, None)
    }

    /// The next deformation of the same cage: a node that is flat or inside out keeps the rotation it has in this one.
    ///
    /// # Errors
    /// As [`Deformation::new`].
    pub fn after(&self, positions: Vec<Vec3>) -> Result<Self, DeformError> {
        Self::build(self.cage, positions, Some(&self.nodes))
    }

    /// The cage with every node at `place` of where it rests.
    ///
    /// # Errors
    /// As [`Deformation::new`].
    pub fn from_fn(cage: Cage, place: impl Fn(Vec3) -> Vec3) -> Result<Self, DeformError> {
        check(&cage)?;
        Self::new(cage, (0..cage.node_count()).map(|i| place(cage.node_position(i))).collect())
    }

    fn build(cage: Cage, positions: Vec<Vec3>, last: Option<&[Node]>) -> Result<Self, DeformError> {
        check(&cage)?;
        let (found, expected) = (positions.len(), cage.node_count());
        if found != expected {
            return Err(DeformError::Length { found, expected });
        }
        let (nodes, largest_stretch) = nodes(&cage, &positions, last)?;
        Ok(Self { cage, positions, nodes: nodes.into(), largest_stretch })
    }

    /// The cage, at rest.
    pub fn cage(&self) -> &Cage {
        &self.cage
    }

    /// Where the nodes are.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Deformation gradient at a node.
    pub fn node_gradient(&self, node: usize) -> Mat3 {
        self.nodes[node].gradient()
    }

    /// Rotation of the gradient at a node; the sign of the quaternion is that of its neighbours where they agree.
    pub fn node_rotation(&self, node: usize) -> Quat {
        self.nodes[node].rotation()
    }

    /// Sixteen floats a node, ready for a GPU: displacement, x of the quaternion; then the columns of the gradient, each
    /// followed by y, z and w of the quaternion.
    pub fn packed(&self) -> &[[f32; 16]] {
        bytemuck::cast_slice(&self.nodes)
    }

    /// An upper bound of the largest stretch at any node, at most [`LARGEST_STRETCH`](super::LARGEST_STRETCH).
    pub fn largest_stretch(&self) -> f32 {
        self.largest_stretch
    }

    /// What happens at a point of the rest shape. A point that is not finite stays so.
    #[inline]
    pub fn at(&self, point: Vec3) -> LocalDeformation {
        let [moved, x, y, z, excess] = self.sample(point);
        let rotation = unit(Vec4::new(moved.w, x.w, y.w, z.w));
        let excess = excess.truncate();
        let mut position = point + moved.truncate();
        if excess != Vec3::ZERO {
            position += rotation * excess - excess;
        }
        LocalDeformation { position, gradient: Mat3::from_cols(x.truncate(), y.truncate(), z.truncate()), rotation }
    }

    /// The interpolated node, and how far the point is outside the cage.
    #[inline(always)]
    pub(super) fn sample(&self, point: Vec3) -> [Vec4; 5] {
        let cage = &self.cage;
        let at = (point - cage.origin) / cage.cell;
        let inside = at.clamp(Vec3::ZERO, cage.cells.as_vec3());
        let last = cage.cells - UVec3::ONE;
        // Casts round down, and NaN becomes 0.
        let cell =
            UVec3::new((inside.x as u32).min(last.x), (inside.y as u32).min(last.y), (inside.z as u32).min(last.z));
        let b = inside - cell.as_vec3();
        let a = Vec3::ONE - b;
        let n = cage.cells + UVec3::ONE;
        let (y, z) = (n.x as usize, n.x as usize * n.y as usize);
        let first = cell.x as usize + y * cell.y as usize + z * cell.z as usize;
        let (ay, by, cy, dy) = (a.y * a.z, b.y * a.z, a.y * b.z, b.y * b.z);
        let mut sum = [Vec4::ZERO; 4];
        for (row, weight) in [(first, ay), (first + y, by), (first + z, cy), (first + y + z, dy)] {
            let [near, far] = [&self.nodes[row].0, &self.nodes[row + 1].0];
            let (wa, wb) = (weight * a.x, weight * b.x);
            for k in 0..4 {
                sum[k] += near[k] * wa + far[k] * wb;
            }
        }
        let [s0, s1, s2, s3] = sum;
        [s0, s1, s2, s3, ((at - inside) * cage.cell).extend(0.0)]
    }

    /// A box around Gaussians whose means are within `rest` (least and largest corner) and whose largest standard
    /// deviation is `sigma`: that of [`Deformation::bounds_of`], grown by three deviations at the largest stretch.
    pub fn bounds(&self, rest: (Vec3, Vec3), sigma: f32) -> (Vec3, Vec3) {
        let (low, high) = self.bounds_of(rest);
        let grown = Vec3::splat(3.0 * sigma.max(0.0) * self.largest_stretch.max(1.0));
        (low - grown, high + grown)
    }

    /// A box around where the points of the box `rest` (least and largest corner) are now: the nodes of the cells that it
    /// meets, grown by how far it reaches beyond the cage.
    pub fn bounds_of(&self, rest: (Vec3, Vec3)) -> (Vec3, Vec3) {
        let cage = &self.cage;
        // A little more than exact: which cell a point on a face is in is a matter of rounding.
        let margin = Vec3::splat(1e-3 * cage.cell);
        let first = cage.locate(rest.0 - margin).node;
        let last = cage.locate(rest.1 + margin).node + UVec3::ONE;
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                let row = cage.node_index(UVec3::new(first.x, y, z));
                for p in &self.positions[row..=row + (last.x - first.x) as usize] {
                    low = low.min(*p);
                    high = high.max(*p);
                }
            }
        }
        let end = cage.origin + cage.cells.as_vec3() * cage.cell;
        let beyond = (cage.origin - rest.0).max(rest.1 - end).max(Vec3::ZERO).length();
        // Places are sums of what they were and of how far they moved: a little for the rounding of that.
        let grown = Vec3::splat(beyond + 1e-5 * (low.abs().max(high.abs()).max_element() + beyond));
        (low - grown, high + grown)
    }
}

/// A quaternion of unit length, also where the average of neighbours is nothing.
#[inline(always)]
pub(super) fn unit(q: Vec4) -> Quat {
    let square = q.length_squared();
    if square > 1e-12 { Quat::from_vec4(q * (1.0 / square.sqrt())) } else { Quat::IDENTITY }
}

fn check(cage: &Cage) -> Result<(), DeformError> {
    let fits = cage.cells.min_element() > 0
        && cage.cells.max_element() < 1 << 20
        && cage.origin.is_finite()
        && cage.cell.is_finite()
        && cage.cell > 0.0;
    if fits { Ok(()) } else { Err(DeformError::Cage) }
}
