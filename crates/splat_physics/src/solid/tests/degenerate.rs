//! Parts that are no bodies, and values that are no numbers.

use glam::{DVec3, Quat, Vec3, dvec3};
use splat_core::{Cloud, CloudArrays};

use super::*;
use crate::Material;
use crate::solid::{Leaks, Pieces, Solid, SolidError, SolidSettings};

/// Numbers and a sentence in every message.
fn told(result: Result<Solid, SolidError>) -> SolidError {
    let error = result.map(|solid| solid.report).expect_err("no body");
    let sentence = error.to_string();
    assert!(sentence.contains(|c: char| c.is_ascii_digit()) && !sentence.contains('\n'), "{sentence}");
    error
}

fn ids(shell: &Shell) -> Vec<u32> {
    (0..shell.len() as u32).collect()
}

#[test]
fn few_faint_or_no_gaussians_are_no_body() {
    let mut one = Shell::default();
    assert!(matches!(told(one.solid(&settings())), SolidError::TooFewSplats { have: 0, of: 0, need: 50 }));
    one.push(DVec3::ZERO, DVec3::Z, &mut Random(1));
    assert!(matches!(told(one.solid(&settings())), SolidError::TooFewSplats { have: 1, of: 1, need: 50 }));
    let mut faint = Shell::sphere(1000, |_| true);
    faint.arrays.opacity_logits.fill(-5.0);
    assert!(matches!(told(faint.solid(&settings())), SolidError::TooFewSplats { have: 0, of: 1000, .. }));
    // Enough, but each alone.
    let sparse = Shell::default().floaters(60, 50.0);
    assert!(matches!(
        told(sparse.solid(&settings())),
        SolidError::TooFewSplats { .. } | SolidError::EmptyOccupancy { .. }
    ));
}

#[test]
fn what_is_not_opaque_has_no_surface() {
    let mut haze = Shell::sphere(400, |_| true);
    haze.arrays.opacity_logits.fill(-2.0);
    assert_eq!(told(haze.solid(&SolidSettings { cut: 0.9, ..settings() })), SolidError::EmptyOccupancy { cut: 0.9 });
}

#[test]
fn all_in_one_place_or_in_a_plane_are_too_thin() {
    let mut heap = Shell::sphere(100, |_| true);
    heap.arrays.means.fill(Vec3::ONE);
    // One round blob is a body of its own size, or told to be none.
    if let Ok(solid) = heap.solid(&settings()) {
        assert!(solid.volume() > 0.0 && solid.volume() < 0.01, "{}", solid.volume());
    }
    let mut random = Random(5);
    for normal in [DVec3::Z, DVec3::Y, dvec3(0.3, 0.5, 0.8).normalize()] {
        let (a, b) = normal.any_orthonormal_pair();
        let mut plane = Shell::default();
        for _ in 0..5000 {
            let at = random.between(-0.5, 0.5) * a + random.between(-0.5, 0.5) * b;
            plane.push(at, normal, &mut random);
        }
        let error = told(plane.solid(&settings()));
        assert!(matches!(error, SolidError::TooThin { voxels: 1 | 2, .. }), "{error}");
    }
}

#[test]
fn islands_are_kept_dropped_or_refused_as_asked() {
    let small = Shell::sphere(8000, |_| true).moved(0.5, glam::DQuat::IDENTITY, dvec3(2.5, 0.0, 0.0));
    let both = Shell::sphere(8000, |_| true).joined(small);
    let both_kept = both.solid(&settings()).unwrap();
    let ball = std::f64::consts::PI / 6.0;
    assert_eq!(both_kept.report.pieces, 2);
    assert!((both_kept.volume() / (ball * 1.125) - 1.0).abs() < 0.1, "{}", both_kept.volume());
    assert_eq!(both_kept.report.notes().count(), 1);
    let larger = both.solid(&SolidSettings { pieces: Pieces::Largest, ..settings() }).unwrap();
    assert!(larger.volume() < 0.92 * both_kept.volume() && larger.report.left_out > 0.05);
    assert!(larger.mass_properties(&[Material::preset("steel").unwrap()]).center.length() < 0.02);
    let error = told(both.solid(&SolidSettings { pieces: Pieces::One, ..settings() }));
    let SolidError::Disconnected { pieces: 2, largest } = error else { panic!("{error}") };
    assert!(largest > 0.8 && largest < 0.95, "{largest}");
}

#[test]
fn nan_infinity_and_monsters_change_nothing() {
    let good = Shell::sphere(10_000, |_| true);
    let expected = good.solid(&settings()).unwrap();
    let mut random = Random(9);
    let mut bad = good.clone();
    for k in 0..60 {
        bad.push(dvec3(0.1, 0.0, 0.0), DVec3::Z, &mut random);
        let last = bad.len() - 1;
        match k % 6 {
            0 => bad.arrays.means[last] = Vec3::NAN,
            1 => bad.arrays.means[last] = Vec3::new(f32::INFINITY, 0.0, 0.0),
            2 => bad.arrays.log_scales[last] = Vec3::splat(f32::NAN),
            3 => bad.arrays.log_scales[last] = Vec3::splat(300.0),
            4 => bad.arrays.log_scales[last] = Vec3::splat(3.0),
            _ => bad.arrays.means[last] = Vec3::splat(1e30),
        }
    }
    let solid = bad.solid(&settings()).unwrap();
    assert_eq!(solid.report.unused.broken, 40);
    assert_eq!(solid.report.unused.huge + solid.report.unused.far, 20);
    assert!((solid.volume() / expected.volume() - 1.0).abs() < 0.01);
    let broken = CloudArrays {
        means: vec![Vec3::NAN; 70],
        log_scales: vec![Vec3::ZERO; 70],
        rotations: vec![Quat::IDENTITY; 70],
        opacity_logits: vec![3.0; 70],
        sh: vec![0.0; 210],
        ..CloudArrays::default()
    };
    let broken = Shell { arrays: broken };
    assert_eq!(told(broken.solid(&settings())), SolidError::NotFinite { count: 70 });
}

#[test]
fn arguments_without_a_meaning_are_named() {
    let shell = Shell::sphere(1000, |_| true);
    let (cloud, all): (Cloud, Vec<u32>) = (shell.cloud(), ids(&shell));
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9, 1e9] {
        let error = Solid::build(&cloud, &all, scale, None, &settings()).unwrap_err();
        assert!(matches!(error, SolidError::ScaleOutOfRange { .. }), "{error}");
    }
    let error = told(Solid::build(&cloud, &[0, 5000], 1.0, None, &settings()));
    assert_eq!(error, SolidError::UnknownGaussian { id: 5000, len: 1000 });
    let error = told(Solid::build(&cloud, &all, 1.0, Some(&[1, 2]), &settings()));
    assert_eq!(error, SolidError::RegionsMismatch { regions: 2, ids: 1000 });
    let wrong = [
        SolidSettings { voxels: 0, ..settings() },
        SolidSettings { voxels: 100_000, ..settings() },
        SolidSettings { cut: f32::NAN, ..settings() },
        SolidSettings { cut: 1.0, ..settings() },
        SolidSettings { max_closing: 0, ..settings() },
        SolidSettings { up: DVec3::ZERO, ..settings() },
        SolidSettings { up: DVec3::NAN, ..settings() },
        SolidSettings { hollow: Some(-0.1), ..settings() },
        SolidSettings { hollow: Some(f64::NAN), ..settings() },
    ];
    for settings in wrong {
        let error = shell.solid(&settings).unwrap_err();
        assert!(matches!(error, SolidError::Setting { .. }), "{error}");
    }
}

#[test]
fn what_weighs_nothing_is_told() {
    let solid = Solid::cuboid(DVec3::ONE, 2.0 * DVec3::ONE, 0.1);
    let steel = Material::preset("steel").unwrap();
    for density in [0.0, -1.0, f32::NAN] {
        let error = solid.checked_mass_properties(&[Material { density, ..steel }]).unwrap_err();
        assert!(matches!(error, SolidError::ZeroDensity { region: 0, .. }), "{error}");
    }
    let error = solid.checked_mass_properties(&[]).unwrap_err();
    assert_eq!(error, SolidError::MaterialMissing { region: 0, materials: 0 });
    let none = solid.mass_properties(&[Material { density: 0.0, ..steel }]);
    assert_eq!((none.mass, none.center), (0.0, DVec3::splat(1.5)));
    assert_eq!(solid.mass_properties(&[]).mass, 0.0);
}

#[test]
fn a_bowl_is_its_hull_or_its_shell() {
    let bowl = Shell::sphere(20_000, |p| p.z < 0.0);
    let hull = bowl.solid(&settings()).unwrap();
    assert!(
        hull.report.leaked && (hull.volume() / (std::f64::consts::PI / 12.0) - 1.0).abs() < 0.1,
        "{}",
        hull.volume()
    );
    let shell = bowl.solid(&SolidSettings { leaks: Leaks::Shell, ..settings() }).unwrap();
    assert!(shell.report.leaked && shell.volume() < 0.4 * hull.volume());
}
