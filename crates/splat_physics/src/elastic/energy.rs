//! Strain energies per rest volume, their stresses and their Hessians.
//!
//! `F` is a `DMat3` whose `col(b)[a]` is `dx_a / dX_b`. Hessians are 9 x 9 with `F_ab` at `3 a + b`.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::linear::{svd, symmetric_eigen};

/// What stretching costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Energy {
    /// Stable neo-Hookean (Smith, de Goes, Kim, "Stable Neo-Hookean Flesh Simulation", 2018), with `lambda + mu` in the place
    /// of `lambda`, so that small strains have exactly the Young's modulus and Poisson's ratio asked for. Any strain, inverted
    /// samples included.
    #[default]
    StableNeoHookean,
    /// Linear in the strain that is left when the part's rotation is taken out: cheaper, right for strains of a few percent.
    Linear,
}

/// Lame's constants of a sample, in Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moduli {
    pub(super) lambda: f64,
    pub(super) mu: f64,
}

pub(super) type Hessian = [[f64; 9]; 9];

/// `dJ/dF`: its columns are cross products of the columns of `F`, so that no inverse is needed.
fn cofactor(f: &DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

fn norm_squared(f: &DMat3) -> f64 {
    f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared()
}

impl Energy {
    /// J per cubic metre at rest; 0 for rotations.
    ///
    /// `rotation`: of the part, which only `Linear` needs.
    pub(super) fn density(self, f: &DMat3, rotation: &DMat3, m: Moduli) -> f64 {
        match self {
            Self::StableNeoHookean => {
                let j = f.determinant() - 1.0;
                0.5 * m.mu * (norm_squared(f) - 3.0) + 0.5 * (m.lambda + m.mu) * j * j - m.mu * j
            }
            Self::Linear => {
                let strain = small_strain(f, rotation);
                let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
                m.mu * norm_squared(&strain) + 0.5 * m.lambda * trace * trace
            }
        }
    }

    /// First Piola-Kirchhoff stress `dW/dF`, in Pa.
    pub(super) fn stress(self, f: &DMat3, rotation: &DMat3, m: Moduli) -> DMat3 {
        match self {
            Self::StableNeoHookean => {
                let cofactor = cofactor(f);
                let j = f.x_axis.dot(cofactor.x_axis) - 1.0;
                *f * m.mu + cofactor * ((m.lambda + m.mu) * j - m.mu)
            }
            Self::Linear => {
                let strain = small_strain(f, rotation);
                let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
                *rotation * (strain * (2.0 * m.mu) + DMat3::from_diagonal(DVec3::splat(m.lambda * trace)))
            }
        }
    }

    /// `d2W/dF2` with its negative eigenvalues set to zero, so that a step along it goes down.
    pub(super) fn hessian(self, f: &DMat3, rotation: &DMat3, m: Moduli) -> Hessian {
        match self {
            Self::StableNeoHookean => neo_hookean_hessian(f, m),
            Self::Linear => linear_hessian(rotation, m),
        }
    }
}

fn small_strain(f: &DMat3, rotation: &DMat3) -> DMat3 {
    let local = rotation.transpose() * *f;
    (local + local.transpose()) * 0.5 - DMat3::IDENTITY
}

/// `mu (I + K) + lambda vec(I) vec(I)^T` with `K` the transposition, turned by the rotation.
fn linear_hessian(rotation: &DMat3, m: Moduli) -> Hessian {
    let mut h = [[0.0; 9]; 9];
    for a in 0..3 {
        for b in 0..3 {
            for c in 0..3 {
                for d in 0..3 {
                    // d(R strain)/dF: rows of R meet where the free index of the strain is the other's column.
                    let same = f64::from(u8::from(a == c && b == d));
                    let swapped = rotation.col(d)[a] * rotation.col(b)[c];
                    h[3 * a + b][3 * c + d] =
                        m.mu * (same + swapped) + m.lambda * rotation.col(b)[a] * rotation.col(d)[c];
                }
            }
        }
    }
    h
}

/// Closed-form eigenvalues (Smith, de Goes, Kim 2018, section 4): three twists, three flips, and a 3 x 3 block of stretches.
fn neo_hookean_hessian(f: &DMat3, m: Moduli) -> Hessian {
    let (u, s, v) = svd(f);
    let lambda = m.lambda + m.mu;
    let j = s.x * s.y * s.z;
    let pressure = lambda * (j - 1.0) - m.mu;
    let mut h = [[0.0; 9]; 9];
    let mut add = |value: f64, q: &DMat3| {
        if value > 0.0 {
            let flat: [f64; 9] = std::array::from_fn(|k| q.col(k % 3)[k / 3]);
            for r in 0..9 {
                for c in 0..9 {
                    h[r][c] += value * flat[r] * flat[c];
                }
            }
        }
    };
    let outer =
        |a: usize, b: usize| DMat3::from_cols(u.col(a) * v.col(b).x, u.col(a) * v.col(b).y, u.col(a) * v.col(b).z);
    for k in 0..3 {
        let (a, b) = ((k + 1) % 3, (k + 2) % 3);
        let (ab, ba) = (outer(a, b), outer(b, a));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        // det F bends along u_a v_b^T and u_b v_a^T with sigma_k, once with each sign.
        add(m.mu + s[k] * pressure, &((ab - ba) * half));
        add(m.mu - s[k] * pressure, &((ab + ba) * half));
    }
    let mut block = DMat3::ZERO;
    for a in 0..3 {
        for b in 0..3 {
            block.col_mut(b)[a] = if a == b {
                let other = s[(a + 1) % 3] * s[(a + 2) % 3];
                m.mu + lambda * other * other
            } else {
                let k = 3 - a - b;
                let (da, db) = (s[(a + 1) % 3] * s[(a + 2) % 3], s[(b + 1) % 3] * s[(b + 2) % 3]);
                lambda * da * db + pressure * s[k]
            };
        }
    }
    let (values, vectors) = symmetric_eigen(block);
    for k in 0..3 {
        let d = vectors.col(k);
        add(values[k], &(outer(0, 0) * d.x + outer(1, 1) * d.y + outer(2, 2) * d.z));
    }
    h
}

/// Von Mises' equivalent of a first Piola-Kirchhoff stress, in Pa.
pub(super) fn von_mises(f: &DMat3, p: &DMat3) -> f64 {
    let j = f.determinant().abs().max(1e-3);
    let cauchy = (*p * f.transpose()) * (1.0 / j);
    let (x, y, z) = (cauchy.x_axis.x, cauchy.y_axis.y, cauchy.z_axis.z);
    let shear = cauchy.y_axis.x.powi(2) + cauchy.z_axis.x.powi(2) + cauchy.z_axis.y.powi(2);
    (0.5 * ((x - y).powi(2) + (y - z).powi(2) + (z - x).powi(2)) + 3.0 * shear).sqrt()
}
