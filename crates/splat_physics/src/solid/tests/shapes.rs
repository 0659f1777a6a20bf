//! Boxes, an L, and what must not depend on where, how large and how turned they are.

use glam::{DQuat, DVec3, dvec3};

use super::*;
use crate::solid::{Solid, SolidSettings};
use crate::{MassProperties, Material};

fn material(density: f32) -> Material {
    Material { density, ..Material::preset("rubber").unwrap() }
}

fn near(a: f64, b: f64, share: f64) -> bool {
    (a / b - 1.0).abs() < share
}

#[test]
fn a_cuboid_is_exact() {
    let (low, high) = (dvec3(-0.3, 1.0, 2.0), dvec3(0.1, 1.2, 2.6));
    let solid = Solid::cuboid(low, high, 0.02);
    let MassProperties { mass, center, inertia } = solid.mass_properties(&[material(500.0)]);
    let size = high - low;
    assert!(near(solid.volume(), size.element_product(), 1e-12) && near(mass, 500.0 * size.element_product(), 1e-6));
    assert!(center.distance(0.5 * (low + high)) < 1e-12);
    let expected = mass / 12.0 * (size.length_squared() - size * size);
    for axis in 0..3 {
        assert!(near(inertia.col(axis)[axis], expected[axis], 1e-9), "{inertia} for {expected}");
    }
    let (l, h) = solid.bounds();
    assert!(l.distance(low) < 1e-12 && h.distance(high) < 1e-12);
    let grid = solid.grid;
    for voxel in [0, 17, grid.len() - 1] {
        assert_eq!(grid.index(grid.at(voxel)), voxel);
        assert_eq!(grid.locate(grid.center(voxel)), Some(grid.at(voxel)));
    }
    assert_eq!((grid.locate(low - 0.01), grid.locate(DVec3::NAN)), (None, None));
}

#[test]
fn a_box_and_an_l_have_their_volume_and_centre() {
    let cube = (DVec3::ZERO, dvec3(0.6, 0.4, 0.3));
    let l = [(DVec3::ZERO, dvec3(0.6, 0.2, 0.3)), (dvec3(0.0, 0.2, 0.0), dvec3(0.2, 0.6, 0.3))];
    let of = |(low, high): (DVec3, DVec3)| ((high - low).element_product(), 0.5 * (low + high));
    for boxes in [&[cube][..], &l] {
        let solid = Shell::boxes(boxes, 6000.0).solid(&settings()).unwrap();
        let volume: f64 = boxes.iter().map(|&b| of(b).0).sum();
        let center = boxes.iter().map(|&b| of(b).0 * of(b).1).sum::<DVec3>() / volume;
        let found = solid.mass_properties(&[material(1000.0)]);
        // Gaussians at the edges reach beyond them.
        assert!(near(solid.volume(), volume, 0.07), "{} for {volume}", solid.volume());
        assert!(found.center.distance(center) < 0.005, "{} for {center}", found.center);
        assert!(!solid.report.leaked && solid.report.pieces == 1);
    }
}

#[test]
fn where_how_large_and_how_turned_it_is_changes_only_that() {
    let l = [(DVec3::ZERO, dvec3(0.6, 0.2, 0.3)), (dvec3(0.0, 0.2, 0.0), dvec3(0.2, 0.6, 0.3))];
    let shell = Shell::boxes(&l, 6000.0);
    let still = shell.solid(&settings()).unwrap().mass_properties(&[material(1000.0)]);
    let turns = [DQuat::IDENTITY, DQuat::from_rotation_x(0.5), DQuat::from_axis_angle(dvec3(0.6, 0.0, 0.8), 2.0)];
    for (scale, turn) in [1e-3, 3.0, 1e4].into_iter().flat_map(|scale| turns.map(|turn| (scale, turn))) {
        let by = scale * dvec3(3.0, -2.0, 1.0);
        let up = turn * DVec3::Z;
        let solid = shell.clone().moved(scale, turn, by).solid(&SolidSettings { up, ..settings() }).unwrap();
        let moved = solid.mass_properties(&[material(1000.0)]);
        assert!(near(moved.mass, scale.powi(3) * still.mass, 0.03), "{} {}", moved.mass, still.mass);
        let center = turn * (scale * still.center) + by;
        assert!(moved.center.distance(center) < 0.006 * scale, "{} for {center}", moved.center);
        let back = glam::DMat3::from_quat(turn.inverse()) * moved.inertia * glam::DMat3::from_quat(turn);
        let worst = (back * scale.powi(-5) - still.inertia).abs().to_cols_array().into_iter().fold(0.0, f64::max);
        assert!(worst < 0.05 * still.inertia.z_axis.z, "{back} for {}", still.inertia);
    }
}

#[test]
fn metres_per_unit_is_as_a_larger_cloud() {
    let shell = Shell::sphere(5000, |_| true);
    let ids: Vec<u32> = (0..shell.len() as u32).collect();
    let solid = Solid::build(&shell.cloud(), &ids, 4.0, None, &settings()).unwrap();
    let larger = shell.clone().moved(4.0, DQuat::IDENTITY, DVec3::ZERO).solid(&settings()).unwrap();
    assert_eq!(solid.grid.dims, larger.grid.dims);
    assert!(near(solid.volume(), larger.volume(), 1e-3) && near(solid.grid.voxel, larger.grid.voxel, 1e-6));
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let shell = Shell::sphere(20_000, |p| p.z > -0.3).floaters(500, 2.0);
    let regions: Vec<u8> = shell.arrays.means.iter().map(|mean| u8::from(mean.x > 0.0)).collect();
    let (cloud, ids) = (shell.cloud(), (0..shell.len() as u32).collect::<Vec<_>>());
    let settings = SolidSettings { hollow: Some(0.1), ..settings() };
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Solid::build(&cloud, &ids, 1.0, Some(&regions), &settings).unwrap())
    };
    let one = build(1);
    assert_eq!(one, build(3));
    assert_eq!(one, build(8));
}

#[test]
fn regions_follow_the_gaussians_and_weigh_what_their_material_does() {
    // Two halves, of 1000 and 3000 kg/m^3: the centre of a half ball is 3/8 r from the middle.
    let shell = Shell::sphere(20_000, |_| true);
    let regions: Vec<u8> = shell.arrays.means.iter().map(|mean| if mean.x > 0.0 { 2 } else { 1 }).collect();
    let ids: Vec<u32> = (0..shell.len() as u32).collect();
    let solid = Solid::build(&shell.cloud(), &ids, 1.0, Some(&regions), &settings()).unwrap();
    let wrong = solid
        .occupied()
        .filter(|&voxel| solid.regions[voxel] != if solid.grid.center(voxel).x > 0.0 { 2 } else { 1 })
        .count();
    assert!(wrong < solid.report.voxels / 20, "{wrong} of {}", solid.report.voxels);
    let found = solid.checked_mass_properties(&[material(1.0), material(1000.0), material(3000.0)]).unwrap();
    assert!(near(found.mass, 2000.0 * solid.volume(), 0.02), "{}", found.mass);
    let expected = 0.375 * 0.5 * (3000.0 - 1000.0) / (3000.0 + 1000.0);
    assert!(near(found.center.x, expected, 0.06), "{} for {expected}", found.center);
    assert!(found.center.y.abs().max(found.center.z.abs()) < 0.005);
}
