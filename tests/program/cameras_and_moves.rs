//! `convert`, `cameras` and `orient`: other formats, parts, other places, and cameras that come along.

use std::fs;
use std::path::Path;

use serde_json::json;
use splat_core::glam::{Quat, Vec3};

use crate::common::{Dab, cloud, done, folder, json, picture, splat, three_heaps, write};

/// A camera file with two cameras that see the three heaps.
fn cameras() -> String {
    let camera = |id: u32, position: [f32; 3], rotation: [[f32; 3]; 3]| {
        json!({"id": id, "img_name": format!("view_{id}"), "width": 96, "height": 64, "position": position,
               "rotation": rotation, "fx": 80.0, "fy": 80.0})
    };
    let ahead = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // Right is -z, forward is +x.
    let from_the_side = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    json!([camera(0, [0.0, 0.0, -5.0], ahead), camera(1, [-6.0, 0.1, 0.2], from_the_side)]).to_string()
}

#[test]
fn an_untouched_ply_comes_back_bit_for_bit() {
    let dir = folder("bits");
    write(&dir, "a.ply", &three_heaps(3));
    done(&dir, "convert a.ply b.ply");
    assert!(fs::read(dir.join("a.ply")).unwrap() == fs::read(dir.join("b.ply")).unwrap());
}

#[test]
fn a_selection_and_a_lower_degree_are_converted() {
    let dir = folder("part");
    write(&dir, "a.ply", &three_heaps(3));
    let ids: Vec<u8> = (0..180).map(|i| u8::from(i % 3 == 0)).collect();
    splat_io::npy::write_u8(dir.join("s.npy"), &ids).unwrap();
    let report = json(&dir, "convert a.ply b.ply --select s.npy --sh-degree 1 --order order.npy");
    assert_eq!((report["gaussians_written"].as_u64(), report["sh_degree"].as_u64()), (Some(60), Some(1)));
    assert!(report["losses"][0].as_str().unwrap().contains("degree 1"));
    let (a, b) = (splat_io::read(dir.join("a.ply")).unwrap().0, splat_io::read(dir.join("b.ply")).unwrap().0);
    for k in 0..60 {
        assert_eq!(b.means()[k], a.means()[3 * k]);
        assert_eq!(b.sh_of(k), &a.sh_of(3 * k)[..12]);
    }
    let order = splat_io::npy::read(dir.join("order.npy")).unwrap().to_f64();
    assert!(order.iter().enumerate().all(|(k, &id)| id == 3.0 * k as f64));

    splat_io::npy::write_u8(dir.join("short.npy"), &ids[..100]).unwrap();
    let said = splat(&dir, "convert a.ply c.ply --select short.npy");
    assert!(said.code == 1 && said.err.contains("100 entries") && !dir.join("c.ply").exists(), "{said:?}");
}

#[test]
fn a_moved_capture_seen_by_moved_cameras_gives_the_same_picture() {
    let dir = folder("moved");
    write(&dir, "a.ply", &three_heaps(3));
    fs::write(dir.join("cameras.json"), cameras()).unwrap();
    let transform = "30,-70,110,2.5,4,-3,8";
    done(&dir, &format!("convert a.ply b.ply --transform {transform}"));
    done(&dir, &format!("cameras cameras.json moved.json --transform {transform}"));
    for n in 0..2 {
        done(&dir, &format!("render a.ply -o a{n}.png --camera cameras.json#{n}"));
        done(&dir, &format!("render b.ply -o b{n}.png --camera moved.json#view_{n}"));
        let (a, b) = (picture(&dir.join(format!("a{n}.png"))), picture(&dir.join(format!("b{n}.png"))));
        assert!(a.2.iter().flatten().any(|&v| v > 60), "the picture is not black");
        let differ = |(a, b): (&u8, &u8)| a.abs_diff(*b) > 3;
        let count = a.2.iter().flatten().zip(b.2.iter().flatten()).filter(|&p| differ(p)).count();
        assert!(count <= 6, "{count} values differ in view {n}");
    }
}

#[test]
fn a_matrix_moves_as_the_numbers_do_and_anything_else_is_refused() {
    let dir = folder("matrix");
    write(&dir, "a.ply", &three_heaps(0));
    let matrix = json!({"matrix": [[0, 0, 2, 1], [0, 2, 0, 2], [-2, 0, 0, 3], [0, 0, 0, 1]]});
    fs::write(dir.join("m.json"), matrix.to_string()).unwrap();
    done(&dir, "convert a.ply b.ply --transform m.json");
    done(&dir, "convert a.ply c.ply --transform 90,0,0,2,1,2,3");
    let [a, b, c] = ["a", "b", "c"].map(|n| splat_io::read(dir.join(format!("{n}.ply"))).unwrap().0);
    for i in 0..a.len() {
        let m = a.means()[i];
        let wanted = Vec3::new(2.0 * m.z + 1.0, 2.0 * m.y + 2.0, -2.0 * m.x + 3.0);
        assert!(b.means()[i].distance(wanted) < 1e-4 && c.means()[i].distance(wanted) < 1e-4);
    }
    for bad in ["[1,2,3]", "{}", "not json", "[[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]"] {
        fs::write(dir.join("bad.json"), bad).unwrap();
        let said = splat(&dir, "convert a.ply d.ply --transform bad.json");
        assert!(said.code == 1 && said.err.contains("bad.json") && !dir.join("d.ply").exists(), "{bad}: {said:?}");
    }
}

#[test]
fn cameras_are_listed_and_keep_their_pictures_in_every_format() {
    let dir = folder("cameras");
    write(&dir, "a.ply", &three_heaps(1));
    fs::write(dir.join("cameras.json"), cameras()).unwrap();
    let list = json(&dir, "cameras cameras.json");
    assert_eq!(list["cameras"].as_array().unwrap().len(), 2);
    assert_eq!((list["cameras"][1]["name"].as_str(), list["format"].as_str()), (Some("view_1"), Some("inria")));
    done(&dir, "render a.ply -o wanted.png --camera cameras.json#1");
    let wanted = picture(&dir.join("wanted.png"));
    for output in ["transforms.json", "colmap", "other.json"] {
        done(&dir, &format!("cameras cameras.json {output}"));
        done(&dir, &format!("render a.ply -o got.png --camera {output}#1"));
        let got = picture(&dir.join("got.png"));
        let worst = got.2.iter().flatten().zip(wanted.2.iter().flatten()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst <= 2, "{output}: {worst}");
    }
    let said = splat(&dir, "render a.ply -o got.png --camera cameras.json#2");
    assert!(said.code == 2 && said.err.contains("0 to 1"), "{said:?}");
}

/// A tilted floor of flat dabs with a post on it; `tilt` takes the level scene (up is -y) to the tilted one.
fn tilted_room(tilt: Quat) -> Vec<Dab> {
    let flat = Dab { sigma: Vec3::new(0.2, 0.01, 0.2), ..Dab::ball(Vec3::ZERO, 0.2, Vec3::splat(0.5)) };
    let fraction = |i: usize, step: f32| (i as f32 * step).fract() - 0.5;
    let floor = (0..1500)
        .map(|i| Dab { mean: Vec3::new(8.0 * fraction(i, 0.618_034), 1.0, 8.0 * fraction(i, 0.414_214)), ..flat });
    let post = (0..300).map(|i| Dab::ball(Vec3::new(0.5, 1.0 - i as f32 * 0.01, 0.0), 0.1, Vec3::X));
    floor.chain(post).map(|d| Dab { mean: tilt * d.mean, rotation: tilt * d.rotation, ..d }).collect()
}

#[test]
fn the_floor_is_made_level_and_the_transform_told() {
    let dir = folder("floor");
    let tilt = Quat::from_euler(splat_core::glam::EulerRot::XYZ, 0.4, 0.2, -0.3);
    write(&dir, "a.ply", &cloud(&tilted_room(tilt), 0));
    let report = json(&dir, "orient a.ply --floor -o b.ply");
    let level = splat_io::read(dir.join("b.ply")).unwrap().0;
    assert!(level.means()[..1500].iter().all(|m| m.y.abs() < 0.05));
    assert!(level.means()[1500..].iter().all(|m| m.y < 0.05));
    assert!((report["floor"]["normal"][1].as_f64().unwrap() - f64::from((tilt * Vec3::NEG_Y).y)).abs() < 0.01);
    // What was told moves the capture to the same place.
    fs::write(dir.join("turn.json"), report.to_string()).unwrap();
    done(&dir, "convert a.ply c.ply --transform turn.json");
    let again = splat_io::read(dir.join("c.ply")).unwrap().0;
    let same = |(a, b): (&Vec3, &Vec3)| a.distance(*b) < 1e-4;
    assert!(level.means().iter().zip(again.means()).all(same));
}

#[test]
fn the_floor_of_the_generated_room_is_found() {
    let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/room");
    let report = json(&room, "orient scene.spz --floor");
    let stats: serde_json::Value = serde_json::from_slice(&fs::read(room.join("stats.json")).unwrap()).unwrap();
    let vector = |v: &serde_json::Value| Vec3::from_array(std::array::from_fn(|k| v[k].as_f64().unwrap() as f32));
    let angle = vector(&report["floor"]["normal"]).angle_between(vector(&stats["up"]));
    assert!(angle < 0.5f32.to_radians(), "{} degrees off", angle.to_degrees());
}

#[test]
fn an_object_is_laid_along_the_axes_and_what_is_open_is_told() {
    let dir = folder("axes");
    let turn = Quat::from_rotation_z(0.5);
    let fraction = |i: usize, step: f32| (i as f32 * step).fract() - 0.5;
    let plank = |size: Vec3| {
        let at = move |i: usize| {
            turn * (size * Vec3::new(fraction(i, 0.618_034), fraction(i, 0.414_214), fraction(i, 0.732_051)))
        };
        (0..3000).map(move |i| Dab::ball(at(i), 0.02, Vec3::ONE)).collect::<Vec<_>>()
    };
    write(&dir, "plank.ply", &cloud(&plank(Vec3::new(4.0, 1.0, 0.2)), 0));
    let report = json(&dir, "orient plank.ply --axes +z+yx -o b.ply");
    assert!(report["ambiguities"].as_array().unwrap().is_empty(), "{report}");
    let b = splat_io::read(dir.join("b.ply")).unwrap().0;
    let extent = |k: usize| b.means().iter().map(|m| m[k]).fold(0.0f32, |a, v| a.max(v.abs()));
    assert!((extent(2) - 2.0).abs() < 0.1 && (extent(1) - 0.5).abs() < 0.1 && extent(0) < 0.2);

    write(&dir, "rod.ply", &cloud(&plank(Vec3::new(4.0, 0.3, 0.3)), 0));
    let report = json(&dir, "orient rod.ply");
    assert!(report["ambiguities"][0].as_str().unwrap().contains("longest"), "{report}");
    splat_io::npy::write_u8(dir.join("none.npy"), &[0; 3000]).unwrap();
    let said = splat(&dir, "orient rod.ply --selection none.npy");
    assert!(said.code == 1 && said.err.contains("empty"), "{said:?}");
}
