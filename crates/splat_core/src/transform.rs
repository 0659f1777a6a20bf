//! [`Similarity`]: rotation, uniform scale and translation.

use glam::{Mat3, Mat4, Quat, Vec3};

/// Maps x to `scale * rotation * x + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Unit quaternion.
    pub rotation: Quat,
    /// Positive, uniform.
    pub scale: f32,
    /// In units of the target space.
    pub translation: Vec3,
}

/// Why a matrix is no [`Similarity`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SimilarityError {
    /// A number is NaN or infinite, or the last row is not 0 0 0 1.
    #[error("the matrix's last row is not 0 0 0 1, or a number is not finite; write it for column vectors")]
    Affine,
    /// The determinant is not positive.
    #[error("the matrix mirrors or flattens; Gaussians can be rotated, scaled uniformly and moved")]
    Mirrored,
    /// Axes are scaled differently or are not at right angles.
    #[error("the matrix shears or scales unevenly; Gaussians can be rotated, scaled uniformly and moved")]
    Sheared,
}

impl Default for Similarity {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Similarity {
    /// Changes nothing.
    pub const IDENTITY: Self = Self { rotation: Quat::IDENTITY, scale: 1.0, translation: Vec3::ZERO };

    /// Where a point goes.
    pub fn apply(&self, x: Vec3) -> Vec3 {
        self.scale * (self.rotation * x) + self.translation
    }

    /// The map that undoes this one.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        let scale = 1.0 / self.scale;
        Self { rotation, scale, translation: -(scale * (rotation * self.translation)) }
    }

    /// First `inner`, then this.
    pub fn compose(&self, inner: &Self) -> Self {
        Self {
            rotation: (self.rotation * inner.rotation).normalize(),
            scale: self.scale * inner.scale,
            translation: self.apply(inner.translation),
        }
    }

    /// The rotation as a matrix.
    pub fn rotation_matrix(&self) -> Mat3 {
        Mat3::from_quat(self.rotation)
    }

    /// The map as a matrix for column vectors.
    pub fn matrix(&self) -> Mat4 {
        Mat4::from_scale_rotation_translation(Vec3::splat(self.scale), self.rotation, self.translation)
    }

    /// The similarity that a matrix for column vectors is, up to a thousandth.
    ///
    /// # Errors
    /// [`SimilarityError`] if it is none.
    pub fn from_matrix(matrix: Mat4) -> Result<Self, SimilarityError> {
        let last = matrix.row(3);
        if !matrix.is_finite() || last.truncate().length() > 1e-6 || (last.w - 1.0).abs() > 1e-6 {
            return Err(SimilarityError::Affine);
        }
        let linear = Mat3::from_mat4(matrix);
        // In f64: the third power of a small scale is beyond f32.
        let scale = linear.as_dmat3().determinant().cbrt() as f32;
        if scale <= 1e-12 {
            return Err(SimilarityError::Mirrored);
        }
        let rotation = linear * (1.0 / scale);
        if !(rotation * rotation.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-3) {
            return Err(SimilarityError::Sheared);
        }
        Ok(Self { rotation: Quat::from_mat3(&rotation).normalize(), scale, translation: matrix.w_axis.truncate() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> [Similarity; 3] {
        let of = |angle: f32, scale: f32, translation: Vec3| Similarity {
            rotation: Quat::from_euler(glam::EulerRot::YXZ, angle, 2.0 * angle, -angle),
            scale,
            translation,
        };
        [of(0.4, 2.0, Vec3::X), of(-1.9, 0.01, Vec3::new(3.0, -2.0, 1.0)), of(3.0, 50.0, Vec3::NEG_Y)]
    }

    const P: Vec3 = Vec3::new(0.3, -0.8, 1.7);

    #[test]
    fn inverses_undo_and_composition_is_one_after_the_other() {
        for a in some() {
            assert!(a.inverse().apply(a.apply(P)).distance(P) < 1e-4);
            assert!(a.apply(a.inverse().apply(P)).distance(P) < 1e-3);
            for b in some() {
                let (both, wanted) = (a.compose(&b).apply(P), a.apply(b.apply(P)));
                assert!(both.distance(wanted) < 1e-5 * wanted.length().max(1.0));
            }
            let none = a.compose(&a.inverse());
            assert!(none.apply(P).distance(P) < 1e-3 && (none.scale - 1.0).abs() < 1e-6);
        }
        assert_eq!(Similarity::default().apply(P), P);
    }

    #[test]
    fn matrices_say_the_same() {
        for a in some() {
            assert!(a.matrix().transform_point3(P).distance(a.apply(P)) < 1e-4);
            let back = Similarity::from_matrix(a.matrix()).unwrap();
            assert!(back.apply(P).distance(a.apply(P)) < 1e-4 * a.scale.max(1.0));
            assert!((back.rotation_matrix() - a.rotation_matrix()).abs_diff_eq(Mat3::ZERO, 1e-5));
        }
    }

    #[test]
    fn what_is_no_similarity_is_refused() {
        use SimilarityError::{Affine, Mirrored, Sheared};
        let scale = |x: f32, y: f32, z: f32| Mat4::from_scale(Vec3::new(x, y, z));
        let mut sheared = Mat4::IDENTITY;
        sheared.x_axis.y = 0.2;
        for (matrix, error) in [
            (Mat4::NAN, Affine),
            (Mat4::perspective_rh(1.0, 1.0, 0.1, 9.0), Affine),
            (scale(-1.0, 1.0, 1.0), Mirrored),
            (scale(1.0, 0.0, 1.0), Mirrored),
            (
                Mat4::ZERO + Mat4::from_cols_array(&[0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 1.]),
                Mirrored,
            ),
            (scale(1.0, 2.0, 1.0), Sheared),
            (sheared, Sheared),
        ] {
            assert_eq!(Similarity::from_matrix(matrix), Err(error), "{matrix}");
        }
        assert!(Similarity::from_matrix(scale(1e-8, 1e-8, 1e-8)).is_ok());
    }
}
