//! [`deform_splats`]: many Gaussians at once.

use glam::{Mat3, Quat, Vec3, Vec4};
use rayon::prelude::*;

use super::Deformation;
use super::deformation::unit;

/// Gaussians per task.
const BLOCK: usize = 1 << 12;

/// Gaussians after a deformation, an array per value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeformedSplats {
    /// Means, in the cloud's space.
    pub means: Vec<Vec3>,
    /// Covariances `F S F^T`: xx, xy, xz, yy, yz, zz.
    pub covariances: Vec<[f32; 6]>,
    /// Rotations of F, of unit length: a Gaussian is seen from directions turned by the inverse.
    pub rotations: Vec<Quat>,
}

impl DeformedSplats {
    fn resize(&mut self, count: usize) {
        self.means.resize(count, Vec3::ZERO);
        self.covariances.resize(count, [0.0; 6]);
        self.rotations.resize(count, Quat::IDENTITY);
    }
}

/// Deforms Gaussians with the `means` and `covariances` (xx, xy, xz, yy, yz, zz) that they have at rest, on this thread.
///
/// As many are deformed as the shorter of both has. The arrays of `to` are reused. The same as [`Deformation::at`] for
/// each of them, up to rounding.
pub fn deform_splats(deformation: &Deformation, means: &[Vec3], covariances: &[[f32; 6]], to: &mut DeformedSplats) {
    to.resize(means.len().min(covariances.len()));
    deform(deformation, means, covariances, &mut to.means, &mut to.covariances, &mut to.rotations);
}

/// As [`deform_splats`], on all threads of the current rayon pool, with the same bits.
pub fn deform_splats_parallel(
    deformation: &Deformation,
    means: &[Vec3],
    covariances: &[[f32; 6]],
    to: &mut DeformedSplats,
) {
    to.resize(means.len().min(covariances.len()));
    (means.par_chunks(BLOCK), covariances.par_chunks(BLOCK))
        .into_par_iter()
        .zip((to.means.par_chunks_mut(BLOCK), to.covariances.par_chunks_mut(BLOCK), to.rotations.par_chunks_mut(BLOCK)))
        .for_each(|((m, c), (to_m, to_c, to_r))| deform(deformation, m, c, to_m, to_c, to_r));
}

fn deform(
    deformation: &Deformation,
    means: &[Vec3],
    covariances: &[[f32; 6]],
    to_means: &mut [Vec3],
    to_covariances: &mut [[f32; 6]],
    to_rotations: &mut [Quat],
) {
    let to = to_means.iter_mut().zip(to_covariances).zip(to_rotations);
    for ((mean, s), ((to_mean, to_covariance), to_rotation)) in means.iter().zip(covariances).zip(to) {
        let [moved, x, y, z, excess] = deformation.sample(*mean);
        let rotation = unit(Vec4::new(moved.w, x.w, y.w, z.w));
        *to_rotation = rotation;
        let excess = excess.truncate();
        *to_mean = *mean + moved.truncate();
        if excess != Vec3::ZERO {
            *to_mean += rotation * excess - excess;
        }
        // F S, then times F^T, by columns of four floats: the fourth is not looked at.
        let [xx, xy, xz, yy, yz, zz] = *s;
        let bx = x * xx + y * xy + z * xz;
        let by = x * xy + y * yy + z * yz;
        let bz = x * xz + y * yz + z * zz;
        let cx = bx * x.x + by * y.x + bz * z.x;
        let cy = bx * x.y + by * y.y + bz * z.y;
        let czz = bx.z * x.z + by.z * y.z + bz.z * z.z;
        *to_covariance = [cx.x, cx.y, cx.z, cy.y, cy.z, czz];
    }
}

/// A covariance as [`deform_splats`] takes it.
pub fn packed_covariance(m: &Mat3) -> [f32; 6] {
    [m.x_axis.x, m.x_axis.y, m.x_axis.z, m.y_axis.y, m.y_axis.z, m.z_axis.z]
}
