//! How thick what is set is along its thinnest direction.

use glam::{DMat3, DVec3};

use super::VoxelGrid;
use super::morphology::Mask;

/// In voxels: that of a slab with the same spread along its thinnest principal axis.
pub(super) fn thickness(mask: &Mask, grid: &VoxelGrid) -> f64 {
    let places =
        || (0..mask.voxels.len()).filter(|&voxel| mask.voxels[voxel] != 0).map(|voxel| grid.at(voxel).as_dvec3());
    let count = mask.count().max(1) as f64;
    let mean = places().sum::<DVec3>() / count;
    let mut spread = DMat3::ZERO;
    for r in places().map(|place| place - mean) {
        spread += DMat3::from_cols(r.x * r, r.y * r, r.z * r);
    }
    (12.0 * least_eigenvalue(spread * (1.0 / count)).max(0.0)).sqrt()
}

/// Of a symmetric matrix, in closed form (O. K. Smith, "Eigenvalues of a symmetric 3 x 3 matrix", 1961).
fn least_eigenvalue(m: DMat3) -> f64 {
    let mean = (m.x_axis.x + m.y_axis.y + m.z_axis.z) / 3.0;
    let rest = m - DMat3::from_diagonal(DVec3::splat(mean));
    let scale = (rest.to_cols_array().iter().map(|x| x * x).sum::<f64>() / 6.0).sqrt();
    if scale <= 0.0 {
        return mean;
    }
    let half = (0.5 * (rest * (1.0 / scale)).determinant()).clamp(-1.0, 1.0);
    mean + 2.0 * scale * (half.acos() / 3.0 + std::f64::consts::TAU / 3.0).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_eigenvalues_are_those_of_a_turned_diagonal() {
        for (k, d) in [DVec3::new(3.0, 0.5, 2.0), DVec3::ONE, DVec3::new(0.0, 4.0, 4.0)].into_iter().enumerate() {
            let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.4 + k as f64);
            let least = least_eigenvalue(turn * DMat3::from_diagonal(d) * turn.transpose());
            assert!((least - d.min_element()).abs() < 1e-9, "{least} for {d}");
        }
    }
}
