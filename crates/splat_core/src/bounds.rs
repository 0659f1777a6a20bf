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

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::CloudArrays;

    /// A grid of 10 by 10 by 10 Gaussians from 0 to 9, and others at `more`.
    fn cloud(more: &[Vec3]) -> Cloud {
        let grid = (0..1000).map(|i| Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32));
        let means: Vec<Vec3> = grid.chain(more.iter().copied()).collect();
        let n = means.len();
        Cloud::new(CloudArrays {
            means,
            log_scales: vec![Vec3::ZERO; n],
            rotations: vec![Quat::IDENTITY; n],
            opacity_logits: vec![1.0; n],
            sh: vec![0.0; 3 * n],
            ..CloudArrays::default()
        })
        .unwrap()
    }

    #[test]
    fn bounds_are_percentiles_of_the_means() {
        let b = robust_bounds(&cloud(&[])).unwrap();
        assert!((b.min, b.max) == (Vec3::ZERO, Vec3::splat(9.0)), "{b:?}");
        assert!(b.center.cmpge(Vec3::splat(4.0)).all() && b.center.cmple(Vec3::splat(5.0)).all());
        let mut far: Vec<f32> = cloud(&[]).means().iter().map(|p| p.distance(b.center)).collect();
        far.sort_by(f32::total_cmp);
        assert_eq!(b.radius, far[899]);
    }

    #[test]
    fn monsters_and_what_is_no_number_do_not_move_the_bounds() {
        let plain = robust_bounds(&cloud(&[])).unwrap();
        let monsters = [Vec3::splat(1e30), Vec3::new(-1e9, 1e9, 0.0), Vec3::NAN, Vec3::new(0.0, f32::INFINITY, 0.0)];
        let b = robust_bounds(&cloud(&monsters)).unwrap();
        assert_eq!((b.min, b.max), (plain.min, plain.max));
        assert!(b.center.distance(plain.center) <= 1.8 && b.radius < plain.radius + 1.0, "{b:?}");
    }

    #[test]
    fn what_cannot_be_seen_does_not_count() {
        let mut arrays = cloud(&[Vec3::splat(50.0); 600]).into_arrays();
        arrays.opacity_logits[1000..].fill(-9.0);
        let b = robust_bounds(&Cloud::new(arrays.clone()).unwrap()).unwrap();
        assert_eq!(b.max, Vec3::splat(9.0));
        arrays.opacity_logits.fill(f32::NAN);
        assert_eq!(robust_bounds(&Cloud::new(arrays).unwrap()), None);
        assert_eq!(robust_bounds(&Cloud::default()), None);
    }

    #[test]
    fn one_gaussian_has_bounds_too() {
        let one = cloud(&[]).pick(&[77]);
        let b = robust_bounds(&one).unwrap();
        assert_eq!((b.center, b.min, b.max), (one.means()[0], one.means()[0], one.means()[0]));
        assert!(b.radius > 0.0);
    }
}
