//! [`Similarity`]: rotation, uniform scale and translation.

use glam::{Mat3, Quat, Vec3};

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
}
