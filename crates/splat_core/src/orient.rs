//! Which way is up, and which way an object lies: principal axes, the floor, and the rotations that follow from them.
//!
//! [`principal_axes`] gives the three directions in which Gaussians spread, [`align`] the rotation that lays them along the
//! world's axes, [`align_to`] the one to chosen ends of them. [`floor_plane`] finds the plane everything stands on,
//! [`surface_plane`] that of a selected surface, [`upright`] the transform that makes it level; [`three_points`] does by pointing
//! what they find. [`extent_along`] tells how large something is.
//! Sums run in `f64` in input order and random draws are seeded: the same cloud gives the same bits.

mod extent;
mod floor;
mod points;
mod signed;
mod surface;

use glam::{DMat3, DVec3, Mat3, Quat, Vec3};
use rayon::prelude::*;

pub use self::extent::extent_along;
pub use self::floor::{Floor, FloorSettings, floor_plane, upright};
pub use self::points::{PointsError, three_points};
pub use self::signed::{AlignError, Aligned, AxisSign, AxisTarget, align_to};
pub use self::surface::{Surface, surface_plane};
use crate::{Cloud, Selection, Similarity};

/// Neighbouring variances closer than this ratio do not tell their directions apart.
const AMBIGUOUS: f32 = 1.1;
/// Sets smaller than this count the extent of each Gaussian too: means alone may lie on a line or in a plane.
const SMALL: usize = 1000;

/// The directions in which a set of Gaussians spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipalAxes {
    /// Weighted mean, in scene units.
    pub center: Vec3,
    /// Unit vectors, right-handed, largest variance first.
    pub axes: [Vec3; 3],
    /// Variances along them, in scene units squared, falling.
    pub variances: [f32; 3],
    /// Gaussians that counted: drawable, and no outlier.
    pub count: usize,
}

impl PrincipalAxes {
    /// Whether the first two directions could as well be any others in their plane (the set is round seen along the third).
    pub fn first_two_ambiguous(&self) -> bool {
        self.variances[0] <= AMBIGUOUS * self.variances[1]
    }

    /// Whether the last two directions could as well be any others in their plane (the set is round seen along the first).
    pub fn last_two_ambiguous(&self) -> bool {
        self.variances[1] <= AMBIGUOUS * self.variances[2]
    }

    /// Least variance over middle one, 0..=1: near 0 for a sheet, above 0.5 there is no flat direction.
    pub fn flatness(&self) -> f32 {
        if self.variances[1] > 0.0 { self.variances[2] / self.variances[1] } else { 1.0 }
    }
}

/// Area-like weights of all Gaussians: `opacity * (s1 s2 s3)^(2/3)`, none above the 95th percentile; 0 for what is not
/// selected or cannot be drawn.
fn weights(cloud: &Cloud, selection: Option<&Selection>) -> Vec<f64> {
    let mut weights: Vec<f64> = (0..cloud.len())
        .into_par_iter()
        .map(|i| {
            let meant = selection.is_none_or(|s| s.contains(i)) && cloud.drawable(i);
            let volume_log = f64::from(cloud.log_scales()[i].element_sum());
            let weight = f64::from(cloud.opacity(i)) * (volume_log * 2.0 / 3.0).exp();
            if meant && weight.is_finite() { weight } else { 0.0 }
        })
        .collect();
    let mut sorted: Vec<f64> = weights.iter().copied().filter(|&w| w > 0.0).collect();
    if !sorted.is_empty() {
        let k = (sorted.len() - 1) * 95 / 100;
        let most = *sorted.select_nth_unstable_by(k, f64::total_cmp).1;
        weights.iter_mut().for_each(|w| *w = w.min(most));
    }
    weights
}

/// Mean and covariance of the weighted means `ids`, with the Gaussians' own covariances if `own`.
fn moments(cloud: &Cloud, weights: &[f64], ids: &[u32], own: bool) -> (DVec3, DMat3) {
    let (mut sum, mut mean) = (0.0, DVec3::ZERO);
    for &i in ids {
        let w = weights[i as usize];
        sum += w;
        mean += w * cloud.means()[i as usize].as_dvec3();
    }
    mean /= sum;
    let mut cov = DMat3::ZERO;
    for &i in ids {
        let d = cloud.means()[i as usize].as_dvec3() - mean;
        let outer = DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        let own = if own { cloud.covariance(i as usize).as_dmat3() } else { DMat3::ZERO };
        cov += (outer + own) * (weights[i as usize] / sum);
    }
    (mean, cov)
}

/// Principal axes of the selected Gaussians (all without a selection); `None` if none has a weight.
///
/// Weights are area-like and clipped, so that neither a dense speck nor one huge Gaussian decides; three rounds leave out
/// what lies beyond a Mahalanobis distance of 3. Axes have the sign that makes their largest component positive, the
/// third follows from right-handedness.
///
/// # Panics
/// If the selection belongs to a cloud of another length.
pub fn principal_axes(cloud: &Cloud, selection: Option<&Selection>) -> Option<PrincipalAxes> {
    assert!(selection.is_none_or(|s| s.len() == cloud.len()), "a selection of another cloud");
    let weights = weights(cloud, selection);
    let all: Vec<u32> = (0..cloud.len() as u32).filter(|&i| weights[i as usize] > 0.0).collect();
    if all.is_empty() {
        return None;
    }
    let mut ids = all.clone();
    let (mut mean, mut cov) = moments(cloud, &weights, &ids, ids.len() < SMALL);
    for _ in 0..3 {
        // A flat set has no inverse: a share of its extent in every direction keeps the distance finite.
        let floor = 1e-9 * (cov.x_axis.x + cov.y_axis.y + cov.z_axis.z).max(1e-30);
        let inverse = (cov + DMat3::from_diagonal(DVec3::splat(floor))).inverse();
        let inside = |&&i: &&u32| {
            let d = cloud.means()[i as usize].as_dvec3() - mean;
            d.dot(inverse * d) <= 9.0
        };
        let kept: Vec<u32> = all.iter().filter(inside).copied().collect();
        if kept.is_empty() {
            break;
        }
        ids = kept;
        (mean, cov) = moments(cloud, &weights, &ids, ids.len() < SMALL);
    }
    let (variances, vectors) = eigen(cov);
    let (first, second) = (positive(vectors[0]), positive(vectors[1]));
    Some(PrincipalAxes {
        center: mean.as_vec3(),
        axes: [first.as_vec3(), second.as_vec3(), first.cross(second).as_vec3()],
        variances: variances.map(|v| v.max(0.0) as f32),
        count: ids.len(),
    })
}

/// The direction or its opposite, so that its largest component is positive.
fn positive(v: DVec3) -> DVec3 {
    let largest = v.abs().max_position();
    if v[largest] < 0.0 { -v } else { v }
}

/// Eigenvalues, falling, and unit eigenvectors of a symmetric matrix, by Jacobi rotations.
pub(crate) fn eigen(mut m: DMat3) -> ([f64; 3], [DVec3; 3]) {
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..24 {
        let off = m.y_axis.x.abs() + m.z_axis.x.abs() + m.z_axis.y.abs();
        if off <= 1e-18 * (m.x_axis.x.abs() + m.y_axis.y.abs() + m.z_axis.z.abs()) {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = m.col(q)[p];
            if apq == 0.0 {
                continue;
            }
            let theta = (m.col(q)[q] - m.col(p)[p]) / (2.0 * apq);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut rotation = DMat3::IDENTITY;
            rotation.col_mut(p)[p] = c;
            rotation.col_mut(q)[q] = c;
            rotation.col_mut(q)[p] = s;
            rotation.col_mut(p)[q] = -s;
            m = rotation.transpose() * m * rotation;
            vectors *= rotation;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| m.col(b)[b].total_cmp(&m.col(a)[a]).then(a.cmp(&b)));
    (order.map(|k| m.col(k)[k]), order.map(|k| vectors.col(k).normalize()))
}

/// The rotation about [`PrincipalAxes::center`] that lays the axes along the world's.
///
/// `targets[k]`: the world axis (0 x, 1 y, 2 z) for principal axis k, each once; `None` chooses them. Of all rotations that do
/// so the one nearest to none is taken: an object that lies straight already is not turned over. Directions that the
/// set does not tell apart ([`PrincipalAxes::first_two_ambiguous`] and so on) stay as near to where they are as they can.
pub fn align(axes: &PrincipalAxes, targets: Option<[usize; 3]>) -> Similarity {
    const PERMUTATIONS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut best: Option<(f32, Mat3)> = None;
    let wanted = targets.map_or(PERMUTATIONS.to_vec(), |t| vec![t]);
    for targets in wanted {
        let own = told_apart(axes, targets);
        for signs in 0..8u8 {
            let sign = |k: usize| if signs >> k & 1 == 0 { 1.0 } else { -1.0 };
            // Rotation = sum over k of (world axis) (own axis)^T.
            let mut rotation = Mat3::ZERO;
            for k in 0..3 {
                let (to, from) = (Vec3::AXES[targets[k]], sign(k) * own[k]);
                rotation += Mat3::from_cols(to * from.x, to * from.y, to * from.z);
            }
            let trace = rotation.x_axis.x + rotation.y_axis.y + rotation.z_axis.z;
            if rotation.determinant() > 0.0 && best.is_none_or(|(most, _)| trace > most) {
                best = Some((trace, rotation));
            }
        }
    }
    let rotation = best.map_or(Quat::IDENTITY, |(_, m)| Quat::from_mat3(&m).normalize());
    about(axes.center, rotation)
}

/// The axes, those that are not told apart replaced by the nearest to their targets.
fn told_apart(axes: &PrincipalAxes, targets: [usize; 3]) -> [Vec3; 3] {
    let own = axes.axes;
    let world = targets.map(|t| Vec3::AXES[t]);
    let within = |known: Vec3, a: Vec3, b: Vec3| {
        let first = a.reject_from_normalized(known);
        // One of two different world axes is never parallel to the known one.
        let first = if first.length() > 0.1 { first } else { b.reject_from_normalized(known).cross(known) };
        let first = first.normalize();
        (first, known.cross(first))
    };
    match (axes.first_two_ambiguous(), axes.last_two_ambiguous()) {
        (true, true) => world,
        (true, false) => {
            let (a, b) = within(own[2], world[0], world[1]);
            [a, b, own[2]]
        }
        (false, true) => {
            let (b, c) = within(own[0], world[1], world[2]);
            [own[0], b, c]
        }
        (false, false) => own,
    }
}

fn about(center: Vec3, rotation: Quat) -> Similarity {
    Similarity { rotation, scale: 1.0, translation: center - rotation * center }
}

#[cfg(test)]
mod tests;
