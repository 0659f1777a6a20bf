//! What happens at the nodes of a cage: gradients, their rotations, and the clamps that keep wild steps drawable.

use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Quat, Vec3, Vec4};
use rayon::prelude::*;

use super::{Cage, DeformError};

/// A node whose gradient has a determinant of at most this is flat or inside out: it keeps the rotation it had.
pub const FLATTEST: f32 = 0.05;
/// No Gaussian is pressed to less than this share of its size along an axis where the cage is flat, nor anywhere else.
pub const LEAST_STRETCH: f32 = 0.2;
/// No Gaussian is stretched to more than so many times its size, so that a wild step does not fill the screen.
pub const LARGEST_STRETCH: f32 = 4.0;

/// Nodes per task.
const BLOCK: usize = 1 << 10;

/// One node in one line of cache: displacement and the columns of the gradient; the fourth numbers are the quaternion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Node(pub(super) [Vec4; 4]);

impl Node {
    fn new(displacement: Vec3, gradient: Mat3, rotation: Quat) -> Self {
        Self([
            displacement.extend(rotation.x),
            gradient.x_axis.extend(rotation.y),
            gradient.y_axis.extend(rotation.z),
            gradient.z_axis.extend(rotation.w),
        ])
    }

    pub(super) fn gradient(&self) -> Mat3 {
        Mat3::from_cols(self.0[1].truncate(), self.0[2].truncate(), self.0[3].truncate())
    }

    pub(super) fn rotation(&self) -> Quat {
        Quat::from_xyzw(self.0[0].w, self.0[1].w, self.0[2].w, self.0[3].w)
    }

    fn set_rotation(&mut self, rotation: Quat) {
        (self.0[0].w, self.0[1].w, self.0[2].w, self.0[3].w) = rotation.into();
    }
}

/// Nodes of a cage at `positions`, and the largest stretch there; rotations of flat ones are those of `last`, if any.
pub(super) fn nodes(cage: &Cage, positions: &[Vec3], last: Option<&[Node]>) -> Result<(Vec<Node>, f32), DeformError> {
    // By displacements, so that a cage at rest gives the identity to the bit.
    let moved: Vec<Vec3> = positions.iter().enumerate().map(|(i, p)| *p - cage.node_position(i)).collect();
    let gradients: Vec<Mat3> =
        (0..moved.len()).into_par_iter().with_min_len(BLOCK).map(|i| gradient(cage, &moved, i)).collect();
    let finite = |i: &usize| moved[*i].is_finite() && gradients[*i].is_finite();
    if let Some(node) = (0..moved.len()).find(|i| !finite(i)) {
        return Err(DeformError::NotFinite { node });
    }
    // Where there is nothing to keep: the rotation of the whole.
    let upright = |f: &&Mat3| f.determinant() > FLATTEST;
    let flat = gradients.iter().any(|f| !upright(&f));
    let whole = if flat && last.is_none() {
        let (sum, count) = gradients.iter().filter(upright).fold((Mat3::ZERO, 0), |(s, n), f| (s + *f, n + 1));
        Some(sum * (1.0 / count.max(1) as f32)).filter(|f| f.is_finite() && f.determinant() > FLATTEST)
    } else {
        None
    };
    let whole = whole.map_or(Mat3::IDENTITY, polar);
    let mut nodes: Vec<(Node, f32)> = (0..moved.len())
        .into_par_iter()
        .with_min_len(BLOCK)
        .map(|i| {
            let f = gradients[i];
            let rotation = if upright(&&f) {
                polar(f)
            } else {
                last.map_or(whole, |last| Mat3::from_quat(last[i].rotation().normalize()))
            };
            let (f, stretch) = clamped(f, rotation);
            let turn = if rotation == Mat3::IDENTITY { Quat::IDENTITY } else { Quat::from_mat3(&rotation).normalize() };
            (Node::new(moved[i], f, turn), stretch)
        })
        .collect();
    let largest = nodes.iter().map(|(_, stretch)| *stretch).fold(LEAST_STRETCH, f32::max);
    // A quaternion and its negative are one rotation, but not when they are averaged: each takes the side of the node before it.
    let n = cage.nodes();
    let (y, z) = (n.x as usize, (n.x * n.y) as usize);
    for i in 1..nodes.len() {
        let at = cage.node_at(i);
        let before = i - if at.x > 0 {
            1
        } else if at.y > 0 {
            y
        } else {
            z
        };
        let rotation = nodes[i].0.rotation();
        if nodes[before].0.rotation().dot(rotation) < 0.0 {
            nodes[i].0.set_rotation(-rotation);
        }
    }
    Ok((nodes.into_iter().map(|(node, _)| node).collect(), largest))
}

/// Mean of the gradients that the cells around a node have there: differences of its neighbours, one-sided at faces.
fn gradient(cage: &Cage, moved: &[Vec3], node: usize) -> Mat3 {
    let (at, n) = (cage.node_at(node), cage.nodes());
    let steps = [1, n.x as usize, (n.x * n.y) as usize];
    let column = |axis: usize| {
        let low = if at[axis] > 0 { node - steps[axis] } else { node };
        let high = if at[axis] + 1 < n[axis] { node + steps[axis] } else { node };
        let cells = if low < node && node < high { 2.0 } else { 1.0 };
        (moved[high] - moved[low]) / (cells * cage.cell)
    };
    Mat3::IDENTITY + Mat3::from_cols(column(0), column(1), column(2))
}

/// The rotation of a gradient of positive determinant, by Newton's iteration `R <- (g R + R^-T / g) / 2` with Higham's
/// scaling g (Higham 1986); the identity, to the bit, for the identity.
pub(super) fn polar(f: Mat3) -> Mat3 {
    // The scale does not matter, and products of huge numbers do.
    let scale = f.x_axis.abs().max(f.y_axis.abs()).max(f.z_axis.abs()).max_element();
    let mut r = if scale > 16.0 { f * (1.0 / scale) } else { f };
    let frobenius = |m: &Mat3| m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared();
    for step in 0..20 {
        let cofactors = Mat3::from_cols(r.y_axis.cross(r.z_axis), r.z_axis.cross(r.x_axis), r.x_axis.cross(r.y_axis));
        let det = r.x_axis.dot(cofactors.x_axis);
        if det.abs() < 1e-30 {
            return Mat3::IDENTITY;
        }
        let inverse = cofactors * (1.0 / det);
        let size = frobenius(&r);
        // Once close, the plain step is the one that converges quadratically.
        let g = if step < 3 && (size - 3.0).abs() > 0.3 { (frobenius(&inverse) / size).sqrt().sqrt() } else { 1.0 };
        let next = (r * g + inverse * (1.0 / g)) * 0.5;
        let change = frobenius(&(next - r));
        r = next;
        // The change squares from step to step: the next would be below rounding.
        if change < 1e-7 {
            break;
        }
    }
    r
}

/// A gradient with its stretches kept within bounds, and (an upper bound of) the largest of them.
fn clamped(f: Mat3, rotation: Mat3) -> (Mat3, f32) {
    let s = rotation.transpose() * f;
    let s = (s + s.transpose()) * 0.5;
    // No eigenvalue is beyond the largest sum along a row, or below what the smallest leaves.
    let sums = s.x_axis.abs().dot(Vec3::ONE).max(s.y_axis.abs().dot(Vec3::ONE)).max(s.z_axis.abs().dot(Vec3::ONE));
    let row = |d: f32, c: Vec3| 2.0 * d - c.abs().dot(Vec3::ONE);
    let least = row(s.x_axis.x, s.x_axis).min(row(s.y_axis.y, s.y_axis)).min(row(s.z_axis.z, s.z_axis));
    if sums <= LARGEST_STRETCH && least >= LEAST_STRETCH {
        return (f, sums);
    }
    let (values, vectors) = crate::orient::eigen(s.as_dmat3());
    let kept = values.map(|v| v.clamp(f64::from(LEAST_STRETCH), f64::from(LARGEST_STRETCH)));
    let largest = kept[0] as f32;
    if kept == values && f.determinant() > FLATTEST {
        return (f, largest);
    }
    let mut s = glam::DMat3::ZERO;
    for (value, v) in kept.into_iter().zip(vectors) {
        s += glam::DMat3::from_cols(v * v.x, v * v.y, v * v.z) * value;
    }
    (rotation * s.as_mat3(), largest)
}
