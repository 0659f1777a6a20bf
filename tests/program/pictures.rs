//! `render`: every kind of picture, looked at by its pixels.

use splat_core::glam::Vec3;

use crate::common::{Dab, cloud, done, folder, json, picture, three_heaps, write};

/// A camera that looks along +z from (0, 0, -5), straight at the heaps.
const AHEAD: &str = "--orbit 0,0,5 --size 120x60 --fov 60";

#[test]
fn colours_are_where_the_gaussians_are_and_the_background_elsewhere() {
    let dir = folder("color");
    write(&dir, "a.ply", &three_heaps(0));
    done(&dir, &format!("render a.ply -o a.png {AHEAD} --background 0,0,1"));
    let (width, height, pixels) = picture(&dir.join("a.png"));
    assert_eq!((width, height), (120, 60));
    let at = |x: usize, y: usize| pixels[y * 120 + x];
    // Two scene units are about 21 pixels: 30 / tan(30 degrees) * 2 / 5.
    let (red, green, corner) = (at(39, 30), at(60, 30), at(2, 2));
    assert!(red[0] > 180 && red[1] < 100, "{red:?}");
    assert!(green[1] > 180 && green[0] < 100, "{green:?}");
    assert_eq!(corner, [0, 0, 255]);
}

#[test]
fn a_transparent_picture_has_no_background() {
    let dir = folder("transparent");
    write(&dir, "a.ply", &three_heaps(0));
    done(&dir, &format!("render a.ply -o a.png {AHEAD} --background none"));
    let png = splat_io::picture::read_png(dir.join("a.png")).unwrap();
    assert_eq!(png.channels, 4);
    assert_eq!(png.values[3], 0);
    assert!(png.values.chunks_exact(4).any(|p| p[3] > 230));
}

#[test]
fn depth_is_told_and_painted_from_near_to_far() {
    let dir = folder("depth");
    let wall =
        |x: f32, z: f32| Dab { sigma: Vec3::new(0.5, 0.5, 0.001), ..Dab::ball(Vec3::new(x, 0.0, z), 1.0, Vec3::ONE) };
    write(&dir, "a.ply", &cloud(&[wall(-1.0, -1.0), wall(1.0, 1.0)], 0));
    let report = json(&dir, &format!("render a.ply -o d.png {AHEAD} --output depth16"));
    let (near, far) = (report["depth"][0].as_f64().unwrap(), report["depth"][1].as_f64().unwrap());
    assert!((far - near - 2.0).abs() < 1e-3, "{report}");
    done(&dir, &format!("render a.ply -o c.png {AHEAD} --output depth"));
    let (_, _, pixels) = picture(&dir.join("c.png"));
    let colors: std::collections::BTreeSet<[u8; 3]> = pixels.into_iter().collect();
    assert_eq!(colors.len(), 3, "near, far and none: {colors:?}");
}

#[test]
fn normals_face_the_viewer_and_ids_keep_their_colour_from_view_to_view() {
    let dir = folder("normals");
    let wall = Dab { sigma: Vec3::new(0.8, 0.8, 0.001), ..Dab::ball(Vec3::ZERO, 1.0, Vec3::ONE) };
    write(&dir, "a.ply", &cloud(&[wall], 0));
    let middle = |name: &str| picture(&dir.join(name)).2[30 * 120 + 60];
    done(&dir, &format!("render a.ply -o n.png {AHEAD} --output normals"));
    let towards_us = |[r, g, b]: [u8; 3]| r.abs_diff(128) <= 1 && g.abs_diff(128) <= 1 && b >= 254;
    assert!(towards_us(middle("n.png")));
    // The other side faces the viewer too.
    done(&dir, "render a.ply -o b.png --orbit 180,0,5 --size 120x60 --fov 60 --output normals");
    assert!(towards_us(middle("b.png")));
    done(&dir, &format!("render a.ply -o i.png {AHEAD} --output ids"));
    done(&dir, "render a.ply -o j.png --orbit 30,10,5 --size 120x60 --fov 60 --output ids");
    assert!(middle("i.png") == middle("j.png") && middle("i.png") != [0; 3]);
}

#[test]
fn a_selection_alone_is_drawn_and_an_empty_picture_is_told() {
    let dir = folder("alone");
    write(&dir, "a.ply", &three_heaps(0));
    done(&dir, "select a.ply --value \"x>1\" -o blue.npy");
    let alone = json(&dir, &format!("render a.ply -o a.png {AHEAD} --selection blue.npy --output alpha"));
    let all = json(&dir, &format!("render a.ply -o b.png {AHEAD} --output alpha"));
    let share = alone["covered"].as_f64().unwrap() / all["covered"].as_f64().unwrap();
    assert!((share - 1.0 / 3.0).abs() < 0.1, "{share}");
    done(&dir, "select a.ply --value \"x>9\" -o none.npy");
    let said = done(&dir, "render a.ply -o a.png --selection none.npy");
    assert!(said.err.contains("nothing is in the picture"), "{said:?}");
}

#[test]
fn the_empty_and_the_unusable_are_drawn_as_nothing() {
    let dir = folder("nothing");
    write(&dir, "empty.ply", &cloud(&[], 0));
    write(&dir, "nan.ply", &cloud(&[Dab::ball(Vec3::NAN, 1.0, Vec3::ONE); 3], 1));
    for file in ["empty.ply", "nan.ply"] {
        for output in ["color", "depth", "depth16", "ids", "normals", "alpha"] {
            done(&dir, &format!("render {file} -o {output}.png --size 16x16 --output {output}"));
            let (_, _, pixels) = picture(&dir.join(format!("{output}.png")));
            assert!(pixels.iter().all(|p| *p == [0; 3]), "{file} {output}");
        }
        json(&dir, &format!("info {file}"));
        json(&dir, &format!("check {file}"));
        json(&dir, &format!("bench {file} --size 8x8 --rounds 1"));
        done(&dir, &format!("select {file} --rect 0,0,9,9 --project depth --grow 1 --largest -o s.npy"));
    }
}
