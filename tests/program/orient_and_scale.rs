//! `orient` to ends of axes, by a selected surface and by three points; `scale`, and where its answer is kept.

use std::fs;
use std::path::Path;

use splat_core::glam::{Quat, Vec3};

use crate::common::{Dab, cloud, done, folder, json, splat, three_heaps, write};

fn vector(v: &serde_json::Value) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|k| v[k].as_f64().unwrap() as f32))
}

/// A tilted board of 4 x 2 units with a ball of Gaussians above it; up is the board's -y.
fn board(tilt: Quat) -> (Vec<Dab>, usize) {
    let fraction = |i: usize, step: f32| (i as f32 * step).fract() - 0.5;
    let flat = |i: usize| Dab {
        sigma: Vec3::new(0.1, 0.005, 0.1),
        ..Dab::ball(Vec3::new(4.0 * fraction(i, 0.618_034), 0.0, 2.0 * fraction(i, 0.414_214)), 0.1, Vec3::ONE)
    };
    let ball = (0..200).map(|i| {
        let around = 0.2 * Vec3::new(fraction(i, 0.618_034), fraction(i, 0.414_214), fraction(i, 0.732_051));
        Dab::ball(Vec3::new(0.5, -1.0, 0.2) + around, 0.05, Vec3::X)
    });
    let all = (0..1500).map(flat).chain(ball);
    (all.map(|d| Dab { mean: tilt * d.mean, rotation: tilt * d.rotation, ..d }).collect(), 1500)
}

#[test]
fn signs_say_which_end_of_an_axis_is_meant() {
    let dir = folder("signs");
    let turn = Quat::from_rotation_z(0.5);
    let fraction = |i: usize, step: f32| (i as f32 * step).fract() - 0.5;
    let at = |i: usize| {
        turn * (Vec3::new(4.0, 1.0, 0.2)
            * Vec3::new(fraction(i, 0.618_034), fraction(i, 0.414_214), fraction(i, 0.732_051)))
    };
    let plank: Vec<Dab> = (0..3000).map(|i| Dab::ball(at(i), 0.02, Vec3::ONE)).collect();
    write(&dir, "a.ply", &cloud(&plank, 0));
    for (axes, long) in [("x-zy", Vec3::X), ("-x-zy", Vec3::NEG_X), ("+z,x,y", Vec3::Z), ("-y+x,z", Vec3::NEG_Y)] {
        let report = json(&dir, &format!("orient a.ply --axes {axes}"));
        let first = vector(&report["principal"]["axes"][0]);
        let row = |k: usize| vector(&report["matrix"][k]);
        let turned = Vec3::new(row(0).dot(first), row(1).dot(first), row(2).dot(first));
        // A bare letter leaves the end open.
        let along = turned.dot(long);
        assert!(if axes == "x-zy" { along.abs() > 0.999 } else { along > 0.999 }, "{axes} {turned}");
    }
    let mirror = splat(&dir, "orient a.ply --axes +x+y-z");
    assert!(mirror.code == 2 && mirror.err.contains("mirror"), "{mirror:?}");
}

#[test]
fn a_selected_surface_and_three_points_become_level() {
    let dir = folder("surface");
    let tilt = Quat::from_euler(splat_core::glam::EulerRot::XYZ, 0.4, 0.2, -0.3);
    let (dabs, board) = board(tilt);
    write(&dir, "a.ply", &cloud(&dabs, 0));
    let selected: Vec<u8> = (0..dabs.len()).map(|i| u8::from(i < board + 40)).collect();
    splat_io::npy::write_u8(dir.join("s.npy"), &selected).unwrap();
    let report = json(&dir, "orient a.ply --floor --selection s.npy --y-up -o b.ply");
    assert!(vector(&report["floor"]["normal"]).dot(tilt * Vec3::NEG_Y) > 0.9999, "{report}");
    assert_eq!(report["ambiguities"].as_array().unwrap().len(), 0, "{report}");
    let level = splat_io::read(dir.join("b.ply")).unwrap().0;
    assert!(level.means()[..board].iter().all(|m| m.y.abs() < 0.03));
    assert!(level.means()[board..].iter().all(|m| m.y > 0.8));

    // The first two along x, by coordinates and by the Gaussians that are there.
    let ids = [3usize, 11, 700];
    let words: Vec<String> =
        ids.iter().map(|&i| format!("{},{},{}", dabs[i].mean.x, dabs[i].mean.y, dabs[i].mean.z)).collect();
    done(&dir, &format!("orient a.ply --points {} -o c.ply", words.join(";")));
    let report = json(&dir, "orient a.ply --points 3,11,700 -o d.ply");
    assert_eq!(vector(&report["points"][1]), dabs[11].mean);
    assert!(fs::read(dir.join("c.ply")).unwrap() == fs::read(dir.join("d.ply")).unwrap());
    let means = splat_io::read(dir.join("c.ply")).unwrap().0.means().to_vec();
    assert!(ids.iter().all(|&i| means[i].y.abs() < 1e-3));
    let along = means[11] - means[3];
    assert!(along.x > 0.0 && along.z.abs() < 1e-3, "{along}");
    assert!(means[board..].iter().all(|m| m.y < -0.8));

    let line = splat(&dir, "orient a.ply --points 0,0,0;1,1,1;2,2,2");
    assert!(line.code == 1 && line.err.contains("one line"), "{line:?}");
    let absent = splat(&dir, "orient a.ply --points 1,2,9999");
    assert!(absent.code == 2 && absent.err.contains("9999"), "{absent:?}");
}

#[test]
fn a_known_length_scales_by_coordinates_ids_and_pixels() {
    let dir = folder("scale");
    write(&dir, "a.ply", &three_heaps(0));
    let a = splat_io::read(dir.join("a.ply")).unwrap().0;
    let units = a.means()[0].distance(a.means()[130]);
    let report = json(&dir, "scale a.ply --length 0.5 --points 0,130 -o b.ply");
    let scale = report["metres_per_unit"].as_f64().unwrap();
    assert!((scale - 0.5 / f64::from(units)).abs() < 1e-6, "{report}");
    let b = splat_io::read(dir.join("b.ply")).unwrap().0;
    assert!((b.means()[0].distance(b.means()[130]) - 0.5).abs() < 1e-5);
    // What is in metres says so, and what is moved keeps its size.
    assert_eq!(json(&dir, "info b.ply")["metres_per_unit"], 1.0);
    done(&dir, "convert b.ply c.ply --transform 0,0,0,4");
    assert_eq!(json(&dir, "info c.ply")["metres_per_unit"], 0.25);
    assert!(done(&dir, "info c.ply").out.contains("0.25 metres per unit"));

    let words = [0, 130].map(|i| format!("{},{},{}", a.means()[i].x, a.means()[i].y, a.means()[i].z));
    let again = json(&dir, &format!("scale a.ply --length 0.5 --points {}", words.join(";")));
    assert!((again["metres_per_unit"].as_f64().unwrap() / scale - 1.0).abs() < 1e-5);

    // The heaps are 4 apart, seen from the front.
    let view = "--orbit 0,0,6 --size 320x200";
    let seen = json(&dir, &format!("scale a.ply --length 8 --pixels 88,100;232,100 {view}"));
    let (p, q) = (vector(&seen["points"][0]), vector(&seen["points"][1]));
    assert!((p.distance(q) - 4.0).abs() < 0.7, "{seen}");
    assert!((seen["metres_per_unit"].as_f64().unwrap() - f64::from(8.0 / p.distance(q))).abs() < 1e-4);
    for (line, code, word) in [
        (format!("scale a.ply --length 8 --pixels 1,1;232,100 {view}"), 1, "nothing solid"),
        (format!("scale a.ply --length 8 --pixels 999,1;232,100 {view}"), 2, "outside"),
        ("scale a.ply --length 8 --pixels 1,1;2,2".to_owned(), 2, "--camera"),
        ("scale a.ply --length 8 --points 4,4".to_owned(), 1, "same"),
        ("scale a.ply --length 1e30 --points 4,5".to_owned(), 1, "no capture"),
        ("scale a.ply --length 8".to_owned(), 2, "--points"),
        ("scale a.ply".to_owned(), 2, "--length"),
        ("scale a.ply --length -1 --points 4,5".to_owned(), 2, "above 0"),
    ] {
        let said = splat(&dir, &line);
        assert!(said.code == code && said.err.contains(word) && said.out.is_empty(), "{line}: {said:?}");
    }
}

#[test]
fn a_known_height_is_kept_beside_any_file_and_counts_for_the_same_gaussians_only() {
    let dir = folder("height");
    let (dabs, board) = board(Quat::IDENTITY);
    write(&dir, "a.spz", &cloud(&dabs, 0));
    let ball: Vec<u8> = (0..dabs.len()).map(|i| u8::from(i >= board)).collect();
    splat_io::npy::write_u8(dir.join("ball.npy"), &ball).unwrap();
    let before = fs::read(dir.join("a.spz")).unwrap();
    let report = json(&dir, "scale a.spz --height 0.6 --part ball.npy --store");
    // The ball is 0.2 units high, and a deviation of 0.05 beyond at either end.
    let scale = report["metres_per_unit"].as_f64().unwrap();
    assert!((scale - 2.0).abs() < 0.1, "{report}");
    assert!(fs::read(dir.join("a.spz")).unwrap() == before);
    assert_eq!(json(&dir, "info a.spz")["metres_per_unit"].as_f64(), Some(scale));

    // A format without comments gets its scale beside it; another capture of the same name has none.
    done(&dir, "scale a.spz --metres-per-unit 2 -o b.spz");
    assert_eq!(json(&dir, "info b.spz")["metres_per_unit"], 1.0);
    write(&dir, "a.spz", &three_heaps(0));
    let info = json(&dir, "info a.spz");
    assert!(info["metres_per_unit"].is_null());
    assert!(info["notes"].to_string().contains("a.spz.scale.json"), "{info}");
    fs::write(dir.join("a.spz.scale.json"), "nonsense").unwrap();
    assert!(json(&dir, "info a.spz")["notes"].to_string().contains("a.spz.scale.json"));

    splat_io::npy::write_u8(dir.join("none.npy"), &[0; 180]).unwrap();
    let said = splat(&dir, "scale a.spz --height 1 --part none.npy");
    assert!(said.code == 1 && said.err.contains("empty"), "{said:?}");
    assert!(!Path::new(&dir.join("c.ply")).exists());
}
