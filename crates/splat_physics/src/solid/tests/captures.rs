//! Labelled objects of captures.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::solid::hull::hull;
use crate::solid::morphology::Mask;
use crate::solid::{Solid, SolidError, SolidSettings};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// Builds a solid of each labelled object of a capture and checks that it is one; how many objects there are, how many are
/// closed, and how many of these are plump: they fill at least 0.3 of their convex hull.
fn check(folder: &Path, file: &str, up: DVec3) -> (usize, usize, usize) {
    let (cloud, _) = splat_io::read(folder.join(file)).unwrap();
    let labels = splat_io::npy::read_u8(folder.join("labels.npy")).unwrap();
    let objects: BTreeSet<u8> = labels.iter().copied().filter(|label| ![0, 255].contains(label)).collect();
    let (mut closed, mut plump) = (0, 0);
    for &object in &objects {
        let ids: Vec<u32> = (0..labels.len() as u32).filter(|&id| labels[id as usize] == object).collect();
        let solid = match Solid::build(&cloud, &ids, 1.0, None, &SolidSettings { up, ..Default::default() }) {
            Ok(solid) => solid,
            // Carpets and pictures are.
            Err(SolidError::TooThin { .. }) => continue,
            Err(error) => panic!("object {object} of {}: {error}", folder.display()),
        };
        let report = &solid.report;
        let filled = solid.weights.iter().map(|&weight| u8::from(weight > 0.0)).collect();
        let filled = Mask { dims: solid.grid.dims, voxels: filled };
        let share = report.voxels as f64 / hull(&filled, &solid.grid).count() as f64;
        let (low, high) = solid.bounds();
        let of_box = solid.volume() / (high - low).element_product();
        println!("{} object {object}: {share:.2} of its hull, {of_box:.2} of its box, {report:?}", folder.display());
        assert!(share > 0.1 && share <= 1.0 && of_box > 0.03 && of_box < 1.0, "object {object}: {share} {of_box}");
        assert!(2 * report.used > ids.len() && report.volume < report.voxels as f64 * solid.grid.voxel_volume());
        closed += usize::from(!report.leaked);
        plump += usize::from(!report.leaked && share >= 0.3);
    }
    (objects.len(), closed, plump)
}

#[test]
fn objects_of_the_generated_room_are_solids() {
    let (objects, closed, _) = check(&Path::new(ROOT).join("assets/room"), "scene.spz", DVec3::NEG_Y);
    assert!(objects > 20 && 2 * closed > objects, "{closed} of {objects}");
}

#[test]
fn objects_of_captures_are_closed() {
    let folder = std::env::var_os("SPLAT_SCENES").map_or_else(|| Path::new(ROOT).join("target/scenes"), PathBuf::from);
    if !folder.join("plaza/labels.npy").is_file() {
        println!("skipped: needs the captures of ../shared/scenes");
        return;
    }
    // y points down in all of them.
    for name in ["plaza", "desk"] {
        let (objects, closed, plump) = check(&folder.join(name), "scene.ply", DVec3::NEG_Y);
        assert!(10 * closed >= 8 * objects && 10 * plump >= 8 * objects, "{name}: {closed}, {plump} of {objects}");
    }
    for name in ["bench/tumblewood", "bench/trumpeter", "bench/cardbox"] {
        let (objects, closed, _) = check(&folder.join(name), "scene.ply", DVec3::NEG_Y);
        assert!(2 * closed >= objects, "{name}: {closed} of {objects}");
    }
}
