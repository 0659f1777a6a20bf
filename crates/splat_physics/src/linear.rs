//! Decompositions of 3 x 3 matrices.

use glam::{DMat3, DVec3};

/// `F = U diag(s) V^T` with rotations `U` and `V`; the last of `s` has the sign of `det F`.
pub(crate) fn svd(f: &DMat3) -> (DMat3, DVec3, DMat3) {
    let (values, mut v) = symmetric_eigen(f.transpose() * *f);
    // Falling order, so that the direction which may vanish comes last.
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    v = DMat3::from_cols(v.col(order[0]), v.col(order[1]), v.col(order[2]));
    if v.determinant() < 0.0 {
        v.z_axis = -v.z_axis;
    }
    let fv = *f * v;
    let first = fv.x_axis.length();
    let x = if first > 0.0 { fv.x_axis / first } else { DVec3::X };
    let rest = fv.y_axis - x * x.dot(fv.y_axis);
    let second = rest.length();
    let y = if second > 1e-12 * first && second > 0.0 { rest / second } else { x.any_orthonormal_vector() };
    let z = x.cross(y);
    (DMat3::from_cols(x, y, z), DVec3::new(first, y.dot(fv.y_axis), z.dot(fv.z_axis)), v)
}

/// Eigenvalues and orthonormal eigenvectors (as columns) of a symmetric matrix, by Jacobi's rotations.
pub(crate) fn symmetric_eigen(mut a: DMat3) -> (DVec3, DMat3) {
    let mut v = DMat3::IDENTITY;
    for _ in 0..16 {
        let off = a.y_axis.x.abs() + a.z_axis.x.abs() + a.z_axis.y.abs();
        let scale = a.x_axis.x.abs() + a.y_axis.y.abs() + a.z_axis.z.abs();
        if !(off > 1e-15 * scale) {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = a.col(q)[p];
            if apq == 0.0 {
                continue;
            }
            let theta = (a.col(q)[q] - a.col(p)[p]) / (2.0 * apq);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let t = if theta == 0.0 { 1.0 } else { t };
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = c;
            turn.col_mut(q)[q] = c;
            turn.col_mut(q)[p] = s;
            turn.col_mut(p)[q] = -s;
            a = turn.transpose() * a * turn;
            v *= turn;
        }
    }
    (DVec3::new(a.x_axis.x, a.y_axis.y, a.z_axis.z), v)
}

/// The rotation nearest to `f`; `None` where `f` is flat or inverted.
pub(crate) fn polar(f: &DMat3) -> Option<DMat3> {
    let (u, s, v) = svd(f);
    (s.is_finite() && s.z > 1e-6 * s.x).then(|| u * v.transpose())
}
