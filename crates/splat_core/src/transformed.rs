//! Clouds moved for good: [`Cloud::transformed`].

use glam::Vec3;
use rayon::prelude::*;

use crate::{Cloud, Similarity, sh};

/// Gaussians per task.
const BLOCK: usize = 1 << 12;

impl Cloud {
    /// The cloud moved by `by`, spherical harmonics included: from a moved camera it looks as it did.
    ///
    /// Extra properties are kept as they are; normals (`nx`, `ny`, `nz`) are no exception, because most files hold zeros.
    /// What the source says about metres per unit goes along with the scale. The identity gives an equal cloud, to the bit.
    pub fn transformed(&self, by: &Similarity) -> Cloud {
        let mut arrays = self.clone().into_arrays();
        if *by == Similarity::IDENTITY {
            return self.clone();
        }
        arrays.means.par_iter_mut().with_min_len(BLOCK).for_each(|mean| *mean = by.apply(*mean));
        // A stored rotation need not be of unit length; the product keeps its length.
        arrays.rotations.par_iter_mut().with_min_len(BLOCK).for_each(|r| *r = by.rotation * *r);
        let log = Vec3::splat(by.scale.ln());
        arrays.log_scales.par_iter_mut().with_min_len(BLOCK).for_each(|s| *s += log);
        let turn = sh::Rotation::new(arrays.sh_degree, by.rotation_matrix());
        let stride = 3 * sh::coefficient_count(arrays.sh_degree);
        arrays.sh.par_chunks_exact_mut(stride).with_min_len(BLOCK).for_each(|values| turn.apply(values));
        let metres = arrays.source.metres_per_unit();
        if by.scale != 1.0 && metres.is_some() {
            arrays.source.set_metres_per_unit(metres.map(|m| m / f64::from(by.scale)));
        }
        // Lengths fit because they were not changed.
        Cloud::new(arrays).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::CloudArrays;

    fn directions() -> impl Iterator<Item = Vec3> {
        (0..40).map(|i| {
            let i = i as f32;
            Vec3::new((1.3 * i).sin(), (2.1 * i + 0.4).cos(), (0.7 * i + 1.0).sin()).normalize()
        })
    }

    fn one(degree: u8) -> Cloud {
        let sh = (0..3 * sh::coefficient_count(degree)).map(|k| 0.3 * (1.7 * k as f32).sin()).collect();
        Cloud::new(CloudArrays {
            means: vec![Vec3::new(1.0, 2.0, 3.0)],
            log_scales: vec![Vec3::new(-1.0, -2.0, -3.0)],
            rotations: vec![Quat::from_rotation_x(0.4) * 2.0],
            opacity_logits: vec![0.5],
            sh_degree: degree,
            sh,
            ..CloudArrays::default()
        })
        .unwrap()
    }

    #[test]
    fn colours_turn_with_the_cloud_in_every_band() {
        let rotation = Quat::from_euler(glam::EulerRot::YXZ, 0.8, -1.9, 2.7);
        let by = Similarity { rotation, scale: 2.0, translation: Vec3::X };
        for degree in 0..=4 {
            let (before, after) = (one(degree), one(degree).transformed(&by));
            for d in directions() {
                let (a, b) = (sh::color(degree, before.sh_of(0), d), sh::color(degree, after.sh_of(0), rotation * d));
                assert!(a.distance(b) < 2e-5, "degree {degree}: {a} {b}");
            }
        }
    }

    #[test]
    fn covariances_and_means_move_as_points_do() {
        let by =
            Similarity { rotation: Quat::from_rotation_z(0.9), scale: 0.5, translation: Vec3::new(3.0, -1.0, 2.0) };
        let (before, after) = (one(1), one(1).transformed(&by));
        assert!(after.means()[0].distance(by.apply(before.means()[0])) < 1e-6);
        let linear = by.rotation_matrix() * by.scale;
        let wanted = linear * before.covariance(0) * linear.transpose();
        assert!(after.covariance(0).abs_diff_eq(wanted, 1e-6));
        assert!((after.rotations()[0].length() - 2.0).abs() < 1e-5, "the stored length is kept");
        assert_eq!(before.transformed(&Similarity::IDENTITY), before);
        assert!(Cloud::default().transformed(&by).is_empty());
    }
}
