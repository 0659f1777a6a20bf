//! Bounds that a handful of monster splats cannot decide.

use glam::Vec3;

use crate::Cloud;

/// Where the bulk of a cloud is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobustBounds {
    /// Median of the means, per axis.
    pub center: Vec3,
    /// Lower corner: the 2nd percentile of the means, per axis.
    pub min: Vec3,
    /// Upper corner: the 98th percentile of the means, per axis.
    pub max: Vec3,
    /// Distance from [`RobustBounds::center`] within which 90 % of the means lie, in scene units.
    pub radius: f32,
}

/// Bounds of the drawable Gaussians of `cloud` with an opacity above 0.05; `None` if there are none.
///
/// Percentiles of at most about 65,536 evenly spaced Gaussians: the cost does not grow with the cloud.
pub fn robust_bounds(cloud: &Cloud) -> Option<RobustBounds> {
    let step = (cloud.len() / 65_536).max(1);
    let points: Vec<Vec3> = (0..cloud.len())
        .step_by(step)
        .filter(|&i| cloud.drawable(i) && cloud.opacity(i) > 0.05)
        .map(|i| cloud.means()[i])
        .collect();
    if points.is_empty() {
        return None;
    }
    let at = |values: &mut Vec<f32>, share: f32| {
        let k = ((values.len() - 1) as f32 * share).round() as usize;
        *values.select_nth_unstable_by(k, f32::total_cmp).1
    };
    let axis = |k: usize| {
        let mut v: Vec<f32> = points.iter().map(|p| p[k]).collect();
        (at(&mut v, 0.02), at(&mut v, 0.5), at(&mut v, 0.98))
    };
    let (x, y, z) = (axis(0), axis(1), axis(2));
    let center = Vec3::new(x.1, y.1, z.1);
    let mut distances: Vec<f32> = points.iter().map(|p| p.distance(center)).collect();
    let radius = at(&mut distances, 0.9).max(1e-6);
    Some(RobustBounds { center, min: Vec3::new(x.0, y.0, z.0), max: Vec3::new(x.2, y.2, z.2), radius })
}
