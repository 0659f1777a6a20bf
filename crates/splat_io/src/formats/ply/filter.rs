//! Mip-Splatting's 3D filter (Yu et al. 2024), stored beside the Gaussians by its trainer.

use glam::Vec3;
use rayon::prelude::*;

/// Fuses filters of strength `filters` (standard deviation, scene units) into scales and opacities:
/// `s'^2 = s^2 + f^2`, `alpha' = alpha sqrt(prod s^2 / prod s'^2)`.
pub(super) fn fuse(log_scales: &mut [Vec3], opacity_logits: &mut [f32], filters: &[f32]) {
    let all = log_scales.par_iter_mut().zip(opacity_logits.par_iter_mut()).zip(filters.par_iter());
    all.with_min_len(4096).for_each(|((scale, logit), &filter)| (*scale, *logit) = fuse_one(*scale, *logit, filter));
}

/// The same for one Gaussian. A filter of zero changes no bit.
pub(super) fn fuse_one(log_scale: Vec3, logit: f32, filter: f32) -> (Vec3, f32) {
    if filter == 0.0 {
        return (log_scale, logit);
    }
    let added = f64::from(filter).powi(2);
    let mut out = log_scale;
    let mut log_ratio = 0.0;
    for axis in 0..3 {
        let log = f64::from(log_scale[axis]);
        let wider = 0.5 * ((2.0 * log).exp() + added).ln();
        log_ratio += log - wider;
        out[axis] = wider as f32;
    }
    // With log a = -softplus(-logit), so that strong opacities keep their digits.
    let logit = f64::from(logit);
    let log_alpha = -(-logit).exp().ln_1p() + log_ratio;
    let fused = log_alpha - (-log_alpha.exp_m1()).ln();
    (out, fused as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fused_values_follow_the_formula() {
        let (scale, logit) = fuse_one(Vec3::new(-3.0, -4.0, -5.0), 1.5, 0.02);
        let s = [(-3.0f64).exp(), (-4.0f64).exp(), (-5.0f64).exp()];
        let wide = s.map(|s| (s * s + 0.02f64 * 0.02).sqrt());
        for (axis, wide) in wide.iter().enumerate() {
            assert!((f64::from(scale[axis]).exp() - wide).abs() < 1e-8);
        }
        let alpha = 1.0 / (1.0 + (-1.5f64).exp()) * (s[0] * s[1] * s[2]) / (wide[0] * wide[1] * wide[2]);
        assert!((1.0 / (1.0 + (-f64::from(logit)).exp()) - alpha).abs() < 1e-7);
        assert_eq!(fuse_one(Vec3::ONE, f32::INFINITY, 0.0), (Vec3::ONE, f32::INFINITY));
    }
}
