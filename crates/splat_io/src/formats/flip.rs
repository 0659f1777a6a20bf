//! Axes with other signs: what mirroring coordinates does to means, rotations and spherical harmonics.

use glam::{Quat, Vec3};
use rayon::prelude::*;
use splat_core::{CloudArrays, sh};

/// Right, up, back (SPZ) to right, down, forward (PLY of the INRIA trainer), and the other way round.
pub(crate) const RUB_RDF: Vec3 = Vec3::new(1.0, -1.0, -1.0);

/// Signs of every stored value under a change of the signs of the axes. Applying it twice changes nothing, to the bit.
#[derive(Clone, Debug)]
pub(crate) struct Flip {
    /// Of the mean.
    pub(crate) mean: Vec3,
    /// Of the rotation's vector part; right for mirrors too, as a covariance does not see them.
    pub(crate) rotation: Vec3,
    /// Of SH coefficient `k`: the parity of its polynomial.
    pub(crate) sh: [f32; 25],
}

impl Flip {
    /// `signs`: +1 or -1 per axis.
    pub(crate) fn new(signs: Vec3) -> Self {
        let Vec3 { x, y, z } = signs;
        let (xy, yz, xz, xyz) = (x * y, y * z, x * z, x * y * z);
        let one = 1.0;
        // Bands 0 to 4, each from m = -l to l. The last entry is even in both axes, whatever other programs use there.
        let sh = [one, y, z, x, xy, yz, one, xz, one, y, xyz, y, z, x, z, x, xy, yz, xy, yz, one, xz, one, xz, one];
        Self { mean: signs, rotation: Vec3::new(yz, xz, xy), sh }
    }

    /// The rotation of a flipped Gaussian.
    pub(crate) fn rotation(&self, q: Quat) -> Quat {
        let s = self.rotation;
        Quat::from_xyzw(q.x * s.x, q.y * s.y, q.z * s.z, q.w)
    }

    /// Signs of the values of one Gaussian in [`CloudArrays::sh`], times `factor`.
    pub(crate) fn sh_values(&self, degree: u8, factor: f32) -> Vec<f32> {
        self.sh[..sh::coefficient_count(degree)].iter().flat_map(|s| [s * factor; 3]).collect()
    }

    /// Flips all Gaussians.
    pub(crate) fn apply(&self, arrays: &mut CloudArrays) {
        const BLOCK: usize = 1 << 12;
        let signs = self.sh_values(arrays.sh_degree, 1.0);
        arrays.means.par_iter_mut().with_min_len(BLOCK).for_each(|mean| *mean *= self.mean);
        arrays.rotations.par_iter_mut().with_min_len(BLOCK).for_each(|q| *q = self.rotation(*q));
        arrays.sh.par_chunks_exact_mut(signs.len()).with_min_len(BLOCK).for_each(|values| {
            for (value, sign) in values.iter_mut().zip(&signs) {
                *value *= sign;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_signs_of_harmonics_are_those_of_their_values_at_the_flipped_direction() {
        let direction = Vec3::new(0.36, 0.48, 0.8);
        for bits in 0..8u8 {
            let sign = |bit: u8| if bits >> bit & 1 == 1 { -1.0 } else { 1.0 };
            let signs = Vec3::new(sign(0), sign(1), sign(2));
            let (mut here, mut there) = ([0.0; 25], [0.0; 25]);
            sh::basis(4, direction, &mut here);
            sh::basis(4, direction * signs, &mut there);
            for (k, sign) in Flip::new(signs).sh.iter().enumerate() {
                assert!((here[k] * sign - there[k]).abs() < 1e-6, "coefficient {k} of flip {signs}");
            }
        }
    }

    #[test]
    fn a_flipped_rotation_gives_the_mirrored_covariance() {
        use glam::Mat3;
        let q = Quat::from_xyzw(0.1, -0.5, 0.3, 0.7).normalize();
        let covariance = |q: Quat| {
            let m = Mat3::from_quat(q) * Mat3::from_diagonal(Vec3::new(1.0, 0.3, 0.1));
            m * m.transpose()
        };
        for signs in [RUB_RDF, Vec3::new(-1.0, 1.0, 1.0), Vec3::new(-1.0, -1.0, 1.0)] {
            let mirror = Mat3::from_diagonal(signs);
            let expected = mirror * covariance(q) * mirror;
            assert!(covariance(Flip::new(signs).rotation(q)).abs_diff_eq(expected, 1e-6));
        }
    }
}
