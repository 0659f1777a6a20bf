//! Deformations against formulas, and fast paths against slow ones.

use glam::{DMat3, DVec3, Mat3, Quat, UVec3, Vec3};

use super::nodes::polar;
use super::*;
use crate::{Cloud, CloudArrays, Similarity, sh};

/// Numbers that a seed means for ever.
struct Random(u64);

impl Random {
    fn next(&mut self, low: f32, high: f32) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (self.0 >> 40) as f32 / (1u64 << 24) as f32 * (high - low)
    }

    fn vector(&mut self, low: f32, high: f32) -> Vec3 {
        Vec3::new(self.next(low, high), self.next(low, high), self.next(low, high))
    }

    fn rotation(&mut self) -> Quat {
        let v = [self.next(-1.0, 1.0), self.next(-1.0, 1.0), self.next(-1.0, 1.0), self.next(-1.0, 1.0)];
        Quat::from_array(v).normalize()
    }
}

fn cage() -> Cage {
    Cage { origin: Vec3::new(-1.0, -0.5, -0.4), cell: 0.1, cells: UVec3::new(20, 10, 8) }
}

/// A beam along x bent to an arc of radius 2 in the x-y plane, and twisted a little.
fn bent(p: Vec3) -> Vec3 {
    let (angle, r) = (p.x / 2.0, 2.0 - p.y);
    let twist = Quat::from_axis_angle(Vec3::X, 0.4 * p.x);
    let p = twist * Vec3::new(0.0, p.y, p.z);
    let r = r - (p.y - (2.0 - r));
    Vec3::new(r * angle.sin(), 2.0 - r * angle.cos(), p.z)
}

fn points(seed: u64, count: usize, reach: f32) -> Vec<Vec3> {
    let mut r = Random(seed);
    (0..count).map(|_| r.vector(-1.0, 1.0) * Vec3::new(1.0, 0.5, 0.4) * reach).collect()
}

fn cloud(seed: u64, count: usize, degree: u8) -> Cloud {
    let mut r = Random(seed);
    Cloud::new(CloudArrays {
        means: points(seed + 1, count, 1.2),
        log_scales: (0..count).map(|_| r.vector(-6.0, -2.0)).collect(),
        rotations: (0..count).map(|_| r.rotation() * 1.5).collect(),
        opacity_logits: (0..count).map(|_| r.next(-2.0, 4.0)).collect(),
        sh_degree: degree,
        sh: (0..count * 3 * sh::coefficient_count(degree)).map(|_| r.next(-0.5, 0.5)).collect(),
        ..CloudArrays::default()
    })
    .unwrap()
}

#[test]
fn a_cage_at_rest_moves_nothing_to_the_bit() {
    let rest = Deformation::from_fn(cage(), |p| p).unwrap();
    for p in points(1, 500, 3.0) {
        let local = rest.at(p);
        assert_eq!(local.position, p);
        assert!(local.gradient.abs_diff_eq(Mat3::IDENTITY, 1e-6));
        assert!(local.rotation.abs_diff_eq(Quat::IDENTITY, 1e-6));
    }
    let cloud = cloud(2, 300, 3);
    assert_eq!(cloud.deformed(&rest), cloud);
    assert!(Cloud::default().deformed(&rest).is_empty());
}

#[test]
fn affine_maps_are_exact_everywhere_and_rigid_outside() {
    let mut r = Random(3);
    let turn = r.rotation();
    let stretch = Mat3::from_diagonal(Vec3::new(1.5, 0.7, 1.1));
    let linear = Mat3::from_quat(turn) * stretch;
    let shift = Vec3::new(3.0, -2.0, 0.5);
    let map = |p: Vec3| linear * p + shift;
    let d = Deformation::from_fn(cage(), map).unwrap();
    assert!((d.largest_stretch() - 1.5).abs() < 1e-4);
    for p in points(4, 500, 1.0) {
        let local = d.at(p);
        assert!(local.position.distance(map(p)) < 1e-5, "{p}");
        assert!(local.gradient.abs_diff_eq(linear, 1e-4));
        assert!(local.rotation.dot(turn).abs() > 1.0 - 1e-6);
    }
    // Beyond the face the map goes on without its stretch.
    let (face, beyond) = (Vec3::new(1.0, 0.1, 0.1), Vec3::new(1.7, 0.1, 0.1));
    let wanted = map(face) + turn * (beyond - face);
    assert!(d.at(beyond).position.distance(wanted) < 1e-5);
    let far = d.at(Vec3::splat(1e6));
    assert!(far.position.distance(d.at(Vec3::new(1.0, 0.5, 0.4)).position) < 1.8e6);
}

#[test]
fn nodal_gradients_are_the_mean_over_the_cells_around() {
    let d = Deformation::from_fn(cage(), bent).unwrap();
    let c = *d.cage();
    for node in (0..c.node_count()).step_by(7) {
        let at = c.node_at(node);
        let (mut sum, mut cells) = (Mat3::ZERO, 0.0);
        for k in 0..8u32 {
            let side = UVec3::new(k & 1, k >> 1 & 1, k >> 2);
            let low = at.as_ivec3() - side.as_ivec3();
            if low.min_element() < 0 || low.as_uvec3().cmpge(c.cells).any() {
                continue;
            }
            let cell = CagePoint { node: low.as_uvec3(), local: side.as_vec3() };
            for (corner, g) in c.corners(cell.node).into_iter().zip(cell.gradients()) {
                let (y, g) = (d.positions()[corner], g / c.cell);
                sum += Mat3::from_cols(y * g.x, y * g.y, y * g.z);
            }
            cells += 1.0;
        }
        assert!(d.node_gradient(node).abs_diff_eq(sum * (1.0 / cells), 2e-5), "node {node}");
    }
}

#[test]
fn points_between_nodes_are_those_of_the_cage_and_the_bend() {
    let d = Deformation::from_fn(cage(), bent).unwrap();
    let c = *d.cage();
    for p in points(5, 1000, 1.0) {
        let place = c.locate(p);
        let slow: Vec3 =
            c.corners(place.node).into_iter().zip(place.weights()).map(|(i, w)| d.positions()[i] * w).sum();
        let local = d.at(p);
        assert!(local.position.distance(slow) < 2e-6);
        assert!(local.position.distance(bent(p)) < 2e-3);
        let e = 1e-3;
        let column = |axis: Vec3| (bent(p + axis * e) - bent(p - axis * e)) / (2.0 * e);
        let wanted = Mat3::from_cols(column(Vec3::X), column(Vec3::Y), column(Vec3::Z));
        assert!(local.gradient.abs_diff_eq(wanted, 0.03), "{p}: {} {wanted}", local.gradient);
        let r = Mat3::from_quat(local.rotation);
        let s = r.transpose() * local.gradient;
        assert!((s - s.transpose()).abs_diff_eq(Mat3::ZERO, 0.01), "rotations are those of the gradients");
    }
}

#[test]
fn polar_rotations_leave_a_symmetric_stretch() {
    let mut r = Random(8);
    for n in 0..500 {
        let scale = if n % 5 == 0 { 1e6 } else { 1.0 };
        let (a, b) = (Mat3::from_quat(r.rotation()), Mat3::from_quat(r.rotation()));
        let f = a * b * Mat3::from_diagonal(r.vector(0.3, 5.0)) * b.transpose() * scale;
        assert!(polar(f).abs_diff_eq(a, 1e-4), "{f} {} {a}", polar(f));
    }
    assert_eq!(polar(Mat3::IDENTITY), Mat3::IDENTITY);
}

#[test]
fn flat_and_turned_out_nodes_keep_the_last_rotation_and_stretches_stay_within_bounds() {
    let turn = Quat::from_rotation_z(1.0);
    let whole = Deformation::from_fn(cage(), |p| turn * p).unwrap();
    for (what, squash) in [("flat", 0.0), ("inside out", -1.0), ("thin", 0.06)] {
        let flat = whole.after(whole.positions().iter().map(|p| *p * Vec3::new(1.0, 1.0, squash)).collect()).unwrap();
        for node in [0, 77, 500] {
            let kept = flat.node_rotation(node);
            assert!(kept.dot(turn).abs() > 1.0 - 1e-5, "{what}: {kept}");
            let s = Mat3::from_quat(kept).transpose() * flat.node_gradient(node);
            let expected = Vec3::new(1.0, 1.0, LEAST_STRETCH);
            assert!(s.abs_diff_eq(Mat3::from_diagonal(expected), 1e-4), "{what}: {s}");
        }
    }
    // Where nothing was before, and nothing upright is beside it.
    let lost = Deformation::from_fn(cage(), |p| p * Vec3::new(1.0, 1.0, 0.0)).unwrap();
    assert_eq!(lost.node_rotation(9), Quat::IDENTITY);
    // One corner folded over, the rest turned: the corner turns with the rest.
    let mut places = whole.positions().to_vec();
    places[0] = places[2] + (places[2] - places[1]);
    let folded = Deformation::new(cage(), places).unwrap();
    assert!(folded.node_rotation(0).dot(turn).abs() > 0.95, "{}", folded.node_rotation(0));
    let wild = Deformation::from_fn(cage(), |p| p * Vec3::new(1e12, 1.0, 20.0)).unwrap();
    assert_eq!(wild.largest_stretch(), LARGEST_STRETCH);
    let f = wild.at(Vec3::ZERO).gradient;
    assert!(f.abs_diff_eq(Mat3::from_diagonal(Vec3::new(4.0, 1.0, 4.0)), 1e-3), "{f}");
}

#[test]
fn many_turns_along_a_cage_do_not_cancel_between_nodes() {
    let long = Cage { origin: Vec3::new(-1.0, -0.1, -0.1), cells: UVec3::new(80, 2, 2), ..cage() };
    let twisted = |p: Vec3| Quat::from_rotation_x(4.0 * p.x) * p;
    let d = Deformation::from_fn(long, twisted).unwrap();
    for k in 0..400 {
        let x = -0.99 + k as f32 * 0.0198;
        let turn = d.at(Vec3::new(x, 0.0, 0.03)).rotation;
        assert!(turn.dot(Quat::from_rotation_x(4.0 * x)).abs() > 0.98, "{x}: {turn}");
    }
}

#[test]
fn what_is_no_deformation_is_refused() {
    let c = cage();
    let rest: Vec<Vec3> = (0..c.node_count()).map(|i| c.node_position(i)).collect();
    let (found, expected) = (rest.len() - 1, rest.len());
    assert_eq!(Deformation::new(c, rest[1..].to_vec()), Err(DeformError::Length { found, expected }));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut nodes = rest.clone();
        nodes[11].y = bad;
        assert_eq!(Deformation::new(c, nodes), Err(DeformError::NotFinite { node: 10 }));
    }
    let mut nodes = rest.clone();
    nodes[40] = Vec3::splat(3e38);
    assert!(matches!(Deformation::new(c, nodes), Err(DeformError::NotFinite { .. })));
    for broken in [
        Cage { cells: UVec3::new(0, 1, 1), ..c },
        Cage { cell: 0.0, ..c },
        Cage { cell: f32::NAN, ..c },
        Cage { origin: Vec3::NAN, ..c },
        Cage { cells: UVec3::MAX, ..c },
    ] {
        assert_eq!(Deformation::new(broken, Vec::new()), Err(DeformError::Cage));
        assert_eq!(Deformation::from_fn(broken, |p| p), Err(DeformError::Cage));
    }
    let local = Deformation::new(c, rest).unwrap().at(Vec3::NAN);
    assert!(local.position.is_nan() && local.gradient.is_finite());
}

#[test]
fn many_splats_at_once_are_those_one_by_one_in_double_precision() {
    let d = Deformation::from_fn(cage(), bent).unwrap();
    let cloud = cloud(6, 10_000, 0);
    let covariances: Vec<[f32; 6]> = (0..cloud.len()).map(|i| packed_covariance(&cloud.covariance(i))).collect();
    let (mut fast, mut parallel) = (DeformedSplats::default(), DeformedSplats::default());
    for _ in 0..2 {
        deform_splats(&d, cloud.means(), &covariances, &mut fast);
        deform_splats_parallel(&d, cloud.means(), &covariances, &mut parallel);
        assert_eq!(fast, parallel);
    }
    for i in 0..cloud.len() {
        let local = d.at(cloud.means()[i]);
        assert_eq!((fast.means[i], fast.rotations[i]), (local.position, local.rotation));
        let f = local.gradient.as_dmat3();
        let slow = f * cloud.covariance(i).as_dmat3() * f.transpose();
        let [xx, xy, xz, yy, yz, zz] = fast.covariances[i].map(f64::from);
        let found = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
        let size = slow.x_axis.x + slow.y_axis.y + slow.z_axis.z;
        assert!(found.abs_diff_eq(slow, 1e-6 * size), "{i}: {found} {slow}");
    }
    deform_splats(&d, &cloud.means()[..5], &[], &mut fast);
    assert_eq!(fast, DeformedSplats::default());
}

#[test]
fn a_baked_turn_is_the_turned_cloud() {
    let turn = Quat::from_euler(glam::EulerRot::YXZ, 0.8, -1.9, 2.7);
    let by = Similarity { rotation: turn, scale: 1.0, translation: Vec3::new(0.3, 0.1, -2.0) };
    let before = cloud(7, 400, 3);
    let (baked, wanted) =
        (before.deformed(&Deformation::from_fn(cage(), |p| by.apply(p)).unwrap()), before.transformed(&by));
    for i in 0..before.len() {
        assert!(baked.means()[i].distance(wanted.means()[i]) < 1e-5);
        let (a, b) = (baked.covariance(i), wanted.covariance(i));
        assert!(a.abs_diff_eq(b, 2e-5 * baked.scale(i).max_element().powi(2)), "{i}");
        assert!(
            (baked.log_scales()[i] - before.log_scales()[i]).abs().max_element() < 1e-4,
            "{i}: scales keep their order"
        );
        for (a, b) in baked.sh_of(i).iter().zip(wanted.sh_of(i)) {
            assert!((a - b).abs() < 1e-4);
        }
    }
}

#[test]
fn a_baked_bend_has_the_covariances_of_the_gradients() {
    let d = Deformation::from_fn(cage(), bent).unwrap();
    let before = cloud(9, 500, 1);
    let baked = before.deformed(&d);
    for i in 0..before.len() {
        let local = d.at(before.means()[i]);
        let f = local.gradient;
        let wanted = f * before.covariance(i) * f.transpose();
        assert!(baked.covariance(i).abs_diff_eq(wanted, 2e-5 * before.scale(i).max_element().powi(2)), "{i}");
        assert!((baked.rotations()[i].length() - 1.5).abs() < 1e-4, "the stored length is kept");
        for k in 0..20 {
            let k = k as f32;
            let seen = Vec3::new((1.3 * k).sin(), (2.1 * k + 0.4).cos(), (0.7 * k + 1.0).sin()).normalize();
            let (a, b) =
                (sh::color(1, baked.sh_of(i), seen), sh::color(1, before.sh_of(i), local.rotation.inverse() * seen));
            assert!(a.distance(b) < 1e-4);
        }
    }
    assert_eq!(baked.opacity_logits(), before.opacity_logits());
}

#[test]
fn baking_leaves_alone_what_is_not_drawn_and_keeps_what_is_huge_or_flat_finite() {
    let d = Deformation::from_fn(cage(), bent).unwrap();
    let mut arrays = cloud(10, 10, 0).into_arrays();
    arrays.means[0] = Vec3::NAN;
    arrays.log_scales[1] = Vec3::splat(1e30);
    arrays.log_scales[2] = Vec3::new(-30.0, -2.0, -2.0);
    arrays.log_scales[3] = Vec3::new(-30.0, -30.0, 3.0);
    arrays.rotations[4] = Quat::from_array([0.0; 4]);
    let before = Cloud::new(arrays).unwrap();
    let baked = before.deformed(&d);
    assert!(baked.means()[0].is_nan());
    for i in 1..10 {
        assert!(baked.drawable(i), "{i}");
    }
    // A disc of no thickness stays one.
    assert!((baked.log_scales()[2].x + 30.0).abs() < 1.0 && (baked.log_scales()[2].y + 2.0).abs() < 1.0);
}

#[test]
fn bounds_hold_every_deformed_gaussian() {
    let d = Deformation::from_fn(cage(), bent).unwrap();
    let cloud = cloud(11, 2000, 0);
    let fold = |low: Vec3, high: Vec3, p: &Vec3| (low.min(*p), high.max(*p));
    let rest = cloud.means().iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| fold(l, h, p));
    let sigma = (0..cloud.len()).map(|i| cloud.scale(i).max_element()).fold(0.0, f32::max);
    let (low, high) = d.bounds(rest, sigma);
    let baked = cloud.deformed(&d);
    for i in 0..baked.len() {
        let c = baked.covariance(i);
        let reach = 2.9 * Vec3::new(c.x_axis.x.sqrt(), c.y_axis.y.sqrt(), c.z_axis.z.sqrt());
        let p = baked.means()[i];
        assert!((p - reach).cmpge(low).all() && (p + reach).cmple(high).all(), "{i}: {p} {low} {high}");
    }
    assert!((high - low).max_element() < 6.0, "{low} {high}");
}
