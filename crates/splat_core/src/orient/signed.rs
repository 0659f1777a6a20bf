//! Principal axes onto chosen world axes, with or without a sign: [`align_to`]; axes and planes of what was moved.

use glam::{Mat3, Quat};

use super::{Floor, PrincipalAxes, about, positive, told_apart};
use crate::Similarity;

/// Turns whose angles differ by less are as near as each other, in radians (10 degrees).
const AS_NEAR: f32 = 0.174_532_9;

/// Where a principal axis is laid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AxisTarget {
    /// World axis: 0 x, 1 y, 2 z.
    pub axis: usize,
    /// `None`: whichever end is nearer.
    pub sign: Option<AxisSign>,
}

/// An end of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AxisSign {
    /// The principal axis points along the world axis.
    Positive,
    /// It points against it.
    Negative,
}

/// What [`align_to`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aligned {
    /// From where the set is to where it lies straight.
    pub transform: Similarity,
    /// Angle of that turn, in radians, 0..=pi.
    pub angle: f32,
    /// Angle of another turn that lays the axes as well and is within 10 degrees of being as near.
    pub rival: Option<f32>,
}

/// Why targets lay nothing straight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignError {
    /// An axis is named twice, or is none of the three.
    #[error("each of the axes x, y and z is needed once")]
    NotEachOnce,
    /// Three signs that only a mirror could give.
    #[error("these three signs mirror the object; turn one of them round, or leave one open")]
    Mirrors,
}

/// The rotation about [`PrincipalAxes::center`] that lays principal axis k along `targets[k]`.
///
/// A sign refers to the direction of [`PrincipalAxes::axes`], whose largest component is positive (the third follows from
/// right-handedness). Where signs are open, the nearest of all rotations that fit is taken. Directions that the set does
/// not tell apart stay as near to where they are as they can.
///
/// # Errors
/// [`AlignError`] if no rotation fits.
pub fn align_to(axes: &PrincipalAxes, targets: [AxisTarget; 3]) -> Result<Aligned, AlignError> {
    let mut named = targets.map(|t| t.axis);
    named.sort_unstable();
    if named != [0, 1, 2] {
        return Err(AlignError::NotEachOnce);
    }
    let free = (targets[0].sign.is_none() && axes.first_two_ambiguous())
        || (targets[2].sign.is_none() && axes.last_two_ambiguous());
    // Whoever names signs wants the axes as they were told, round or not.
    let own = if free { told_apart(axes, targets.map(|t| t.axis)) } else { axes.axes };
    let mut found: Vec<(f32, Mat3)> = Vec::new();
    for signs in 0..8u8 {
        let negative = |k: usize| signs >> k & 1 == 1;
        let fits = |k: usize| targets[k].sign.is_none_or(|s| (s == AxisSign::Negative) == negative(k));
        if !(0..3).all(fits) {
            continue;
        }
        let rotation: Mat3 = (0..3).fold(Mat3::ZERO, |sum, k| {
            let to = glam::Vec3::AXES[targets[k].axis] * if negative(k) { -1.0 } else { 1.0 };
            sum + Mat3::from_cols(to * own[k].x, to * own[k].y, to * own[k].z)
        });
        if rotation.determinant() > 0.0 {
            let trace = rotation.x_axis.x + rotation.y_axis.y + rotation.z_axis.z;
            found.push((((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos(), rotation));
        }
    }
    // Stable: of equals the one with fewer turned axes comes first.
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let &(angle, rotation) = found.first().ok_or(AlignError::Mirrors)?;
    let rival = found.get(1).map(|f| f.0).filter(|other| other - angle < AS_NEAR);
    let rotation = Quat::from_mat3(&rotation).normalize();
    Ok(Aligned { transform: about(axes.center, rotation), angle, rival })
}

impl PrincipalAxes {
    /// The axes of the same set after it was moved; signs are those of the new directions.
    pub fn moved(&self, by: &Similarity) -> Self {
        let turned = |k: usize| positive((by.rotation * self.axes[k]).as_dvec3()).as_vec3();
        let (first, second) = (turned(0), turned(1));
        Self {
            center: by.apply(self.center),
            axes: [first, second, first.cross(second)],
            variances: self.variances.map(|v| v * by.scale * by.scale),
            count: self.count,
        }
    }
}

impl Floor {
    /// The same plane after the scene was moved.
    pub fn moved(&self, by: &Similarity) -> Self {
        let normal = by.rotation * self.normal;
        let offset = by.scale * self.offset + normal.dot(by.translation);
        Self { normal, offset, rival: self.rival.map(|(n, share)| (by.rotation * n, share)), ..*self }
    }
}
