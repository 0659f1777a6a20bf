//! `check`: every defect is found and put right, and a healthy capture stays as it is.

use serde_json::Value;
use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays};

use crate::common::{Dab, cloud, done, folder, json, splat, three_heaps, write};

/// Count of a check's finding, 0 if there is none.
fn count(report: &Value, check: &str) -> u64 {
    let found = report["findings"].as_array().unwrap().iter().find(|f| f["check"] == check);
    found.map_or(0, |f| f["count"].as_u64().unwrap())
}

fn changed(cloud: Cloud, change: impl FnOnce(&mut CloudArrays)) -> Cloud {
    let mut arrays = cloud.into_arrays();
    change(&mut arrays);
    Cloud::new(arrays).unwrap()
}

/// Makes one defect in the three heaps; the check must find `wanted` of it, and nothing more after the repair.
fn one_defect(check: &str, wanted: u64, change: impl FnOnce(&mut CloudArrays)) -> Cloud {
    let dir = folder(&format!("check-{check}"));
    write(&dir, "a.ply", &changed(three_heaps(1), change));
    let report = json(&dir, "check a.ply --repair b.ply");
    assert_eq!(count(&report, check), wanted, "{report}");
    assert!(!report["repaired"]["done"].as_array().unwrap().is_empty(), "{report}");
    let after = json(&dir, "check b.ply");
    assert!(after["findings"].as_array().unwrap().is_empty(), "{after}");
    splat_io::read(dir.join("b.ply")).unwrap().0
}

#[test]
fn a_healthy_capture_is_left_as_it_is() {
    let dir = folder("healthy");
    write(&dir, "a.ply", &three_heaps(2));
    let report = json(&dir, "check a.ply --repair b.ply --strict");
    assert!(report["findings"].as_array().unwrap().is_empty(), "{report}");
    assert!(std::fs::read(dir.join("a.ply")).unwrap() == std::fs::read(dir.join("b.ply")).unwrap());
    assert!(done(&dir, "check a.ply").out.contains("nothing to complain about"));
}

#[test]
fn nan_and_infinity_are_dropped() {
    let left = one_defect("not-finite", 3, |a| {
        a.means[0].x = f32::NAN;
        a.log_scales[5].z = f32::INFINITY;
        a.opacity_logits[7] = f32::NAN;
    });
    assert_eq!(left.len(), 177);
}

#[test]
fn broken_colours_and_rotations_are_set_right() {
    let left = one_defect("colors", 1, |a| a.sh[14] = f32::NAN);
    assert_eq!((left.len(), left.sh()[14]), (180, 0.0));
    let left = one_defect("rotations", 2, |a| a.rotations[..2].fill(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)));
    assert_eq!(left.rotations()[0], Quat::IDENTITY);
}

#[test]
fn unused_degrees_are_left_out() {
    let left = one_defect("unused-sh", 180, |a| a.sh.chunks_exact_mut(12).for_each(|c| c[3..].fill(0.0)));
    assert_eq!((left.len(), left.sh_degree()), (180, 0));
}

#[test]
fn the_transparent_the_doubled_the_far_and_the_giant_are_dropped() {
    assert_eq!(one_defect("transparent", 2, |a| a.opacity_logits[..2].fill(-8.0)).len(), 178);
    let left = one_defect("duplicates", 3, |a| {
        for (to, from) in [(10, 3), (11, 3), (20, 4)] {
            a.means[to] = a.means[from];
            a.log_scales[to] = a.log_scales[from];
            a.rotations[to] = a.rotations[from];
            a.opacity_logits[to] = a.opacity_logits[from];
            a.sh.copy_within(from * 12..(from + 1) * 12, to * 12);
        }
    });
    assert_eq!(left.len(), 177);
    assert_eq!(one_defect("far", 1, |a| a.means[0] = Vec3::splat(1e5)).len(), 179);
    assert_eq!(one_defect("giants", 1, |a| a.log_scales[0] = Vec3::splat(4.0)).len(), 179);
}

#[test]
fn floaters_are_dropped_unless_kept() {
    let change = |a: &mut CloudArrays| a.means[0] = Vec3::new(0.0, 8.0, 0.0);
    assert_eq!(one_defect("floaters", 1, change).len(), 179);
    let dir = folder("check-keep");
    write(&dir, "a.ply", &changed(three_heaps(1), change));
    let report = json(&dir, "check a.ply --repair b.ply --keep floaters");
    assert_eq!((count(&report, "floaters"), report["repaired"]["dropped"].as_u64()), (1, Some(0)), "{report}");
    let said = splat(&dir, "check a.ply --strict");
    assert!(said.code == 1 && said.out.contains("floaters") && said.err.contains("--repair"), "{said:?}");
}

#[test]
fn values_stored_by_other_conventions_are_read_as_what_they_are() {
    let healthy = three_heaps(1);
    let close = |a: f32, b: f32| (a - b).abs() < 1e-3 * (1.0 + b.abs());
    let left = one_defect("linear-scales", 180, |a| a.log_scales.iter_mut().for_each(|s| *s = s.map(f32::exp)));
    assert!((0..180).all(|i| close(left.log_scales()[i].x, healthy.log_scales()[i].x)));

    let varied =
        |a: &mut CloudArrays| a.opacity_logits.iter_mut().zip(0..).for_each(|(v, i)| *v = 0.5 + 0.002 * i as f32);
    let left = one_defect("linear-opacity", 180, varied);
    assert!((0..180).all(|i| close(left.opacity(i), 0.5 + 0.002 * i as f32)));

    for full in [1.0, 255.0] {
        let left = one_defect("plain-colors", 180, |a| {
            for c in a.sh.chunks_exact_mut(12) {
                c[..3].iter_mut().for_each(|v| *v = (*v * splat_core::sh::C0 + 0.5) * full);
            }
        });
        assert!((0..180).all(|i| left.base_color(i).distance(healthy.base_color(i)) < 1e-2));
    }
}

#[test]
fn what_the_reader_put_right_is_told() {
    let dir = folder("check-notes");
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 filter_3D";
    let properties: String = names.split(' ').map(|n| format!("property float {n}\n")).collect();
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n0 0 0 0 0 0 1 -3 -3 -3 1 0 0 0 0.05\n"
    );
    std::fs::write(dir.join("a.ply"), ply).unwrap();
    let report = json(&dir, "check a.ply");
    assert!(report["notes"][0].as_str().unwrap().contains("filter_3D"), "{report}");
}

#[test]
fn a_floor_on_its_side_is_told() {
    let dir = folder("check-tilted");
    let flat = Dab { sigma: Vec3::new(0.1, 0.01, 0.1), ..Dab::ball(Vec3::ZERO, 0.1, Vec3::ONE) };
    let fraction = |i: u32, step: f32| 6.0 * ((i as f32 * step).fract() - 0.5);
    let floor = (0..1500).map(|i| Dab { mean: Vec3::new(fraction(i, 0.618_034), 1.0, fraction(i, 0.414_214)), ..flat });
    let post = (0..100).map(|i| Dab::ball(Vec3::new(0.0, 1.0 - i as f32 * 0.02, 0.0), 0.05, Vec3::X));
    let dabs: Vec<Dab> = floor.chain(post).collect();
    write(&dir, "level.ply", &cloud(&dabs, 0));
    assert_eq!(count(&json(&dir, "check level.ply"), "tilted"), 0);
    done(&dir, "convert level.ply side.ply --transform 0,90,0");
    let report = json(&dir, "check side.ply");
    assert_eq!(count(&report, "tilted"), 1600, "{report}");
    done(&dir, "orient side.ply --floor -o again.ply");
    assert_eq!(count(&json(&dir, "check again.ply"), "tilted"), 0);
}

#[test]
fn a_capture_of_nothing_is_told() {
    let dir = folder("check-empty");
    write(&dir, "a.ply", &cloud(&[], 0));
    let report = json(&dir, "check a.ply");
    assert_eq!(report["findings"][0]["check"], "empty");
    write(&dir, "one.ply", &cloud(&[Dab::ball(Vec3::ZERO, 0.1, Vec3::X)], 0));
    assert!(json(&dir, "check one.ply")["findings"].as_array().unwrap().is_empty());
}
