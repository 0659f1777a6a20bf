//! Clouds bent for good: [`Cloud::deformed`].

use glam::{DMat3, DVec3, Mat3, Quat, Vec3};
use rayon::prelude::*;

use super::{Deformation, LocalDeformation};
use crate::{Cloud, sh};

/// Gaussians per task.
const BLOCK: usize = 1 << 9;
/// Gradients and rotations nearer to the identity than this leave scales, rotations and colours as they are stored.
const STILL: f32 = 1e-6;
/// The largest logarithm of a scale that counts, as for a frame: 40 powers of two.
const LARGEST_LOG_SCALE: f32 = 40.0 * std::f32::consts::LN_2;

impl Cloud {
    /// The cloud in the pose of a deformation: means, shapes and spherical harmonics are those that a frame of the deformed
    /// cloud shows. Opacities, extra properties and the source are kept.
    ///
    /// The scales of a Gaussian stay in their order by size. Gaussians that are never drawn stay as they are.
    pub fn deformed(&self, by: &Deformation) -> Cloud {
        let mut arrays = self.clone().into_arrays();
        let degree = arrays.sh_degree;
        let stride = 3 * sh::coefficient_count(degree);
        (
            arrays.means.par_iter_mut().with_min_len(BLOCK),
            arrays.log_scales.par_iter_mut().with_min_len(BLOCK),
            arrays.rotations.par_iter_mut().with_min_len(BLOCK),
            arrays.sh.par_chunks_exact_mut(stride).with_min_len(BLOCK),
        )
            .into_par_iter()
            .enumerate()
            .filter(|(i, _)| self.drawable(*i))
            .for_each(|(i, (mean, log_scale, rotation, sh))| {
                let local = by.at(*mean);
                *mean = local.position;
                if !local.gradient.abs_diff_eq(Mat3::IDENTITY, STILL) {
                    // A stored rotation need not be of unit length; it keeps its length.
                    let length = rotation.length();
                    let (scales, turned) = shape(&local, *log_scale, self.rotation(i));
                    *log_scale = scales;
                    *rotation = turned * if length > 0.0 && length.is_finite() { length } else { 1.0 };
                }
                let turn = Mat3::from_quat(local.rotation);
                if degree > 0 && !turn.abs_diff_eq(Mat3::IDENTITY, STILL) {
                    sh::Rotation::new(degree, turn).apply(sh);
                }
            });
        // Lengths fit because they were not changed.
        Cloud::new(arrays).unwrap_or_default()
    }
}

/// Logarithms of the scales and the rotation of `F S F^T`.
fn shape(local: &LocalDeformation, log_scale: Vec3, rotation: Quat) -> (Vec3, Quat) {
    let logs = log_scale.min(Vec3::splat(LARGEST_LOG_SCALE)).as_dvec3();
    let f = local.gradient.as_dmat3();
    let own = f * Mat3::from_quat(rotation).as_dmat3();
    // Relative to the largest scale, so that nothing under- or overflows.
    let largest = logs.max_element();
    let m = own * DMat3::from_diagonal((logs - largest).map(f64::exp));
    let (variances, vectors) = crate::orient::eigen(m * m.transpose());
    // The smallest is what the determinant leaves: its square may be below the rounding of the largest.
    let long = [0, 1].map(|k| 0.5 * variances[k].max(1e-30).ln() + largest);
    let volume = f.determinant().abs().max(1e-9).ln() + logs.element_sum();
    let short = (volume - long[0] - long[1]).min(long[1]);
    let lengths = [long[0], long[1], short];

    // The longest takes the place of the longest before, and so on; directions are as near as they can be to what they were.
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| logs[b].total_cmp(&logs[a]).then(a.cmp(&b)));
    let (mut scales, mut axes, mut near) = (DVec3::ZERO, DMat3::IDENTITY, [0.0; 3]);
    for (k, place) in order.into_iter().enumerate() {
        let along = vectors[k].dot(own.col(place));
        scales[place] = lengths[k];
        *axes.col_mut(place) = if along < 0.0 { -vectors[k] } else { vectors[k] };
        near[place] = along.abs() / own.col(place).length().max(1e-30);
    }
    if axes.determinant() < 0.0 {
        let least = if near[0] <= near[1] && near[0] <= near[2] { 0 } else { 1 + usize::from(near[2] < near[1]) };
        *axes.col_mut(least) = -axes.col(least);
    }
    let turned = Quat::from_mat3(&axes.as_mat3()).normalize();
    if scales.is_finite() && turned.is_finite() {
        (scales.as_vec3(), turned)
    } else {
        (log_scale, (local.rotation * rotation).normalize())
    }
}
