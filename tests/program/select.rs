//! `select`: shapes over views, in the order in which they are given.

use std::path::Path;

use crate::common::{done, folder, json, picture, splat, three_heaps, write};

/// A camera that looks along +z from (0, 0, -5): the red heap is about pixel (39, 30), green (60, 30), blue (81, 30).
const AHEAD: &str = "--orbit 0,0,5 --size 120x60 --fov 60";

fn selected(dir: &Path, name: &str) -> Vec<usize> {
    let bits = splat_io::npy::read_u8(dir.join(name)).unwrap();
    assert_eq!(bits.len(), 180);
    (0..180).filter(|&i| bits[i] == 1).collect()
}

#[test]
fn a_rectangle_takes_what_lies_behind_it() {
    let dir = folder("rect");
    write(&dir, "a.ply", &three_heaps(0));
    let report = json(&dir, &format!("select a.ply {AHEAD} --rect 50,0,70,59 -o s.npy"));
    assert_eq!((report["selected"].as_u64(), report["gaussians"].as_u64()), (Some(60), Some(180)));
    assert_eq!(selected(&dir, "s.npy"), (60..120).collect::<Vec<_>>());
    for shape in ["--polygon \"50,0;70,0;70,59;50,59\"", "--brush \"60,30:12\""] {
        let report = json(&dir, &format!("select a.ply {AHEAD} {shape} -o t.npy"));
        assert_eq!(report["selected"], 60, "{shape}");
    }
}

#[test]
fn a_mask_of_the_picture_takes_what_it_covers() {
    let dir = folder("mask");
    write(&dir, "a.ply", &three_heaps(0));
    let mask = splat_core::Mask2d::from_fn(120, 60, |x, _| x > 70);
    splat_io::picture::write_mask(dir.join("m.png"), &mask).unwrap();
    done(&dir, &format!("select a.ply {AHEAD} --mask m.png -o s.npy"));
    assert_eq!(selected(&dir, "s.npy"), (120..180).collect::<Vec<_>>());
    let said = splat(&dir, "select a.ply --size 64x64 --mask m.png -o t.npy");
    assert!(said.code == 1 && said.err.contains("120x60") && said.err.contains("64x64"), "{said:?}");
}

#[test]
fn the_order_of_steps_is_the_order_of_the_command_line() {
    let dir = folder("order");
    write(&dir, "a.ply", &three_heaps(0));
    let (all, green) = ("--rect 0,0,119,59", "--rect 50,0,70,59");
    let count =
        |steps: &str| json(&dir, &format!("select a.ply {AHEAD} {steps} -o s.npy"))["selected"].as_u64().unwrap();
    assert_eq!(count(&format!("{all} {green} --mode subtract")), 120);
    assert_eq!(count(&format!("{green} {all} --mode subtract")), 0);
    assert_eq!(count(&format!("{all} {green} --mode intersect")), 60);
    assert_eq!(count(&format!("{all} {green} --mode new")), 60);
    assert_eq!(count(&format!("{green} --invert {green}")), 180);
    assert_eq!(count(&format!("{green} {green} --invert")), 120);
    assert_eq!(count("--value \"x<-1\" --value \"x>1\""), 120);
    assert_eq!(count("--value \"red>0.5\" --value \"opacity>=0.9\" --mode intersect"), 60);
}

#[test]
fn a_camera_holds_for_the_shapes_after_it() {
    let dir = folder("two-views");
    write(&dir, "a.ply", &three_heaps(0));
    // From the right (+x) the heaps lie behind each other; the rectangle over the middle of the picture takes all three.
    let side = "--orbit 90,0,8 --size 120x60 --fov 60";
    let report = json(&dir, &format!("select a.ply {side} --rect 40,0,80,59 -o s.npy"));
    assert_eq!(report["selected"], 180);
    let both =
        "--orbit 90,0,8 --rect 40,0,80,59 --orbit 0,0,5 --rect 50,0,70,59 --mode intersect --size 120x60 --fov 60";
    assert_eq!(json(&dir, &format!("select a.ply {both} -o s.npy"))["selected"], 60);
    // Seen from the side, only the nearest heap is at the depth that is seen.
    let near = json(&dir, &format!("select a.ply {side} --rect 40,0,80,59 --project depth -o s.npy"));
    let ids = selected(&dir, "s.npy");
    assert!(near["selected"].as_u64().unwrap() >= 10 && ids.iter().all(|&i| i >= 120), "{ids:?}");
    let surface = json(&dir, &format!("select a.ply {side} --rect 40,0,80,59 --project surface -o s.npy"));
    assert!(surface["selected"].as_u64().unwrap() >= 5 && selected(&dir, "s.npy").iter().all(|&i| i >= 120));
}

#[test]
fn growing_fills_a_heap_and_stops_at_its_end() {
    let dir = folder("grow");
    write(&dir, "a.ply", &three_heaps(0));
    let count = |steps: &str| json(&dir, &format!("select a.ply {steps} -o s.npy"))["selected"].as_u64().unwrap();
    let few = "--value \"x<-2.2\"";
    assert!(count(few) < 60);
    assert_eq!(count(&format!("{few} --grow 50")), 60);
    assert!(count(&format!("{few} --grow 1 --shrink 1")) < 60);
    assert_eq!(count("--value \"x<-1\" --value \"x>2\" --largest"), 60);
    assert_eq!(count("--value \"x<-1\" --shrink 100"), 60, "no neighbour is outside");
}

#[test]
fn object_rest_and_picture_are_written() {
    let dir = folder("object");
    write(&dir, "a.ply", &three_heaps(1));
    let line = "--rect 50,0,70,59 --object o.ply --rest r.splat --picture p.png -o s.npy";
    let report = json(&dir, &format!("select a.ply {AHEAD} {line}"));
    assert_eq!(report["written"].as_array().unwrap().len(), 4);
    let all = splat_io::read(dir.join("a.ply")).unwrap().0;
    let object = splat_io::read(dir.join("o.ply")).unwrap().0;
    assert!(
        object.len() == 60 && object.means() == &all.means()[60..120] && object.sh() == &all.sh()[60 * 12..120 * 12]
    );
    assert_eq!(splat_io::read(dir.join("r.splat")).unwrap().0.len(), 120);
    let (_, _, pixels) = picture(&dir.join("p.png"));
    assert!(pixels[30 * 120 + 60][0] > 100, "the green heap is tinted: {:?}", pixels[30 * 120 + 60]);

    done(&dir, "select a.ply --from s.npy --invert -o t.npy");
    assert_eq!(selected(&dir, "t.npy").len(), 120);
    done(&dir, "select a.ply --from s.npy --value \"x>1\" -o t.npy");
    assert_eq!(selected(&dir, "t.npy").len(), 120, "what begins with a selection adds to it");
}
