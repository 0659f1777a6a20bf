//! Three points that say how a capture lies: [`three_points`].

use glam::{Mat3, Quat, Vec3};

use crate::Similarity;

/// Three points span no plane if the third is nearer to the line of the others than this share of their distance.
const LEAST_OFFSET: f32 = 1e-3;

/// Why three points say nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PointsError {
    /// A coordinate is NaN or infinite.
    #[error("a point has no finite coordinates; name others")]
    NotFinite,
    /// Two points in one place.
    #[error("two of the three points are the same; name three that lie apart")]
    Same,
    /// All on one line.
    #[error("the three points lie on one line, which leaves the turn about it open; name a third point beside it")]
    Collinear,
}

/// The rotation and shift after which `b` lies from `a` along +x, and all three on the plane at height 0 along `up`.
///
/// `was_up`: a direction (unit vector, before the turn) roughly up: of the plane's two sides it says which one becomes up. `up`: unit
/// vector, after the turn; where it is x itself, y takes the place of x. The turn is about `a`, so that nothing moves along the
/// plane.
///
/// # Errors
/// [`PointsError`] if the points span no plane.
pub fn three_points([a, b, c]: [Vec3; 3], was_up: Vec3, up: Vec3) -> Result<Similarity, PointsError> {
    if ![a, b, c].iter().all(|p| p.is_finite()) {
        return Err(PointsError::NotFinite);
    }
    let sides = [b - a, c - a, c - b];
    let longest = sides.iter().map(|s| s.length()).fold(0.0, f32::max);
    if sides.iter().any(|s| !(s.length() > 1e-6 * longest)) {
        return Err(PointsError::Same);
    }
    let x = sides[0].normalize();
    let beside = sides[1].reject_from_normalized(x);
    if !(beside.length() > LEAST_OFFSET * longest) {
        return Err(PointsError::Collinear);
    }
    let normal = x.cross(beside.normalize()).normalize();
    let normal = if normal.dot(was_up) < 0.0 { -normal } else { normal };
    let ahead = [Vec3::X, Vec3::Y].into_iter().find(|axis| axis.dot(up).abs() < 0.9).unwrap_or(Vec3::X);
    let ahead = ahead.reject_from_normalized(up).normalize();
    let frame = |x: Vec3, up: Vec3| Mat3::from_cols(x, up, x.cross(up));
    let rotation = Quat::from_mat3(&(frame(ahead, up) * frame(x, normal).transpose())).normalize();
    Ok(Similarity { rotation, scale: 1.0, translation: a - up * up.dot(a) - rotation * a })
}
