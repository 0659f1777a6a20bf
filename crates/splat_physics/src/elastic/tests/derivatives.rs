use glam::{DMat3, DQuat, DVec3};

use crate::elastic::Energy;
use crate::elastic::energy::Moduli;
use crate::linear::{polar, svd, symmetric_eigen};

const MODULI: Moduli = Moduli { lambda: 1.7, mu: 0.9 };

fn some_gradients() -> Vec<DMat3> {
    let noise = |k: u32| {
        DMat3::from_cols_array(&std::array::from_fn(|e| ((f64::from(k) * 9.0 + e as f64) * 12.9898).sin() * 0.3))
    };
    (0..20).map(|k| DMat3::from_quat(DQuat::from_rotation_y(f64::from(k))) + noise(k)).collect()
}

fn entry(f: &DMat3, k: usize) -> f64 {
    f.col(k % 3)[k / 3]
}

fn bumped(f: &DMat3, k: usize, by: f64) -> DMat3 {
    let mut f = *f;
    f.col_mut(k % 3)[k / 3] += by;
    f
}

#[test]
fn stress_is_the_slope_of_the_energy() {
    let rotation = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.4));
    for energy in [Energy::StableNeoHookean, Energy::Linear] {
        for f in some_gradients() {
            let stress = energy.stress(&f, &rotation, MODULI);
            for k in 0..9 {
                let e = 1e-5;
                let slope = (energy.density(&bumped(&f, k, e), &rotation, MODULI)
                    - energy.density(&bumped(&f, k, -e), &rotation, MODULI))
                    / (2.0 * e);
                assert!(
                    (slope - entry(&stress, k)).abs() < 1e-6 * 10.0,
                    "{energy:?} {k}: {slope} {}",
                    entry(&stress, k)
                );
            }
        }
    }
}

#[test]
fn the_hessian_is_the_slope_of_the_stress_where_it_has_no_negative_eigenvalue() {
    let rotation = DMat3::from_quat(DQuat::from_rotation_z(0.3));
    for energy in [Energy::StableNeoHookean, Energy::Linear] {
        // Near a rotation the Hessian of the neo-Hookean is positive, and nothing is cut away.
        for k in 0..8 {
            let turn = DMat3::from_quat(DQuat::from_rotation_x(f64::from(k)));
            let stretch = DMat3::from_diagonal(DVec3::new(1.05, 0.97, 1.02));
            let f = turn * stretch * DMat3::from_quat(DQuat::from_rotation_y(0.5 * f64::from(k)));
            let hessian = energy.hessian(&f, &rotation, MODULI);
            for c in (0..9).rev() {
                let e = 1e-5;
                let (up, down) = (
                    energy.stress(&bumped(&f, c, e), &rotation, MODULI),
                    energy.stress(&bumped(&f, c, -e), &rotation, MODULI),
                );
                for (r, row) in hessian.iter().enumerate() {
                    let slope = (entry(&up, r) - entry(&down, r)) / (2.0 * e);
                    assert!((slope - row[c]).abs() < 1e-6 * 10.0, "{energy:?} {r} {c}: {slope} {}", row[c]);
                }
            }
        }
    }
}

#[test]
fn the_hessian_has_no_negative_eigenvalue_anywhere() {
    for f in some_gradients().into_iter().chain([DMat3::ZERO, DMat3::from_diagonal(DVec3::new(1.0, 0.2, -0.5))]) {
        let hessian = Energy::StableNeoHookean.hessian(&f, &DMat3::IDENTITY, MODULI);
        for k in 0..60u32 {
            let d: [f64; 9] = std::array::from_fn(|e| ((f64::from(k) * 9.0 + e as f64) * 78.233).sin());
            let curve: f64 = (0..81).map(|e| d[e / 9] * hessian[e / 9][e % 9] * d[e % 9]).sum();
            assert!(curve > -1e-9, "{curve}");
        }
    }
}

#[test]
fn decompositions_give_the_matrix_back() {
    for f in some_gradients().into_iter().chain([DMat3::IDENTITY, DMat3::from_diagonal(DVec3::new(2.0, 2.0, -1.0))]) {
        let (u, s, v) = svd(&f);
        assert!((u * DMat3::from_diagonal(s) * v.transpose()).abs_diff_eq(f, 1e-9));
        assert!((u.determinant() - 1.0).abs() < 1e-9 && (v.determinant() - 1.0).abs() < 1e-9);
        let symmetric = f.transpose() + f;
        let (values, vectors) = symmetric_eigen(symmetric);
        assert!((vectors * DMat3::from_diagonal(values) * vectors.transpose()).abs_diff_eq(symmetric, 1e-9));
    }
    let turn = DMat3::from_quat(DQuat::from_rotation_z(2.0));
    assert!(polar(&(turn * DMat3::from_diagonal(DVec3::new(3.0, 0.5, 1.0)))).unwrap().abs_diff_eq(turn, 1e-9));
    assert!(polar(&DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0))).is_none());
    assert!(polar(&DMat3::NAN).is_none());
}
