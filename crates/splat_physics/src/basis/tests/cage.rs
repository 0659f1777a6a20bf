use super::*;

fn occupied_volume(solid: &Solid) -> f64 {
    solid.weights.iter().map(|&weight| f64::from(weight)).sum::<f64>() * solid.grid.voxel.powi(3)
}

fn filled_volume(cage: &PartCage) -> f64 {
    cage.fill.iter().map(|&part| f64::from(part)).sum::<f64>() * cage.cell().powi(3)
}

#[test]
fn a_box_of_whole_cells_is_fitted_exactly() {
    let cage = PartCage::build(&beam(), 20, PartCage::MOST_NODES).unwrap();
    assert_eq!(cage.cage.cells, UVec3::new(20, 4, 4));
    assert_eq!(cage.cage.origin, glam::Vec3::ZERO);
    assert!((cage.cell() - 0.05).abs() < 1e-8);
    assert!(cage.active.iter().all(|&active| active));
    assert!(cage.fill.iter().all(|&part| part == 1.0));
    assert_eq!(cage.pieces(), 1);
}

#[test]
fn cells_larger_and_smaller_than_voxels_fit_the_same_box() {
    for (voxel, along) in [(0.1, 20), (0.0125, 20), (0.2, 5), (0.05, 10)] {
        let solid = Solid::cuboid(dvec3(3.0, -2.0, 0.5), dvec3(4.0, -1.8, 0.7), voxel);
        let cage = PartCage::build(&solid, along, PartCage::MOST_NODES).unwrap();
        assert_eq!(cage.cage.cells, UVec3::new(along, along / 5, along / 5));
        assert!((filled_volume(&cage) / 0.04 - 1.0).abs() < 1e-5);
    }
}

#[test]
fn anything_else_gets_a_ring() {
    let ball = carved(UVec3::splat(32), 0.02, |at| (at.as_dvec3() - 15.5).length() < 16.0);
    let cage = PartCage::build(&ball, 12, PartCage::MOST_NODES).unwrap();
    assert_eq!(cage.cage.cells, UVec3::splat(14));
    let (first, last) = (cage.node_position(0), cage.node_position(cage.cage.node_count() - 1));
    assert!((first + last - dvec3(0.64, 0.64, 0.64)).length() < 1e-6, "the ring is as wide on all sides");
    assert!((filled_volume(&cage) / occupied_volume(&ball) - 1.0).abs() < 1e-4);
    for cell in 0..cage.active.len() {
        let at = cage.cell_at(cell);
        assert_eq!(cage.cell_index(at), cell);
        if cage.fill[cell] > 0.0 {
            assert!(at.min_element() > 0 && (at + 1).cmplt(cage.cage.cells).all());
            for step in 0..27 {
                let other = at + UVec3::new(step % 3, step / 3 % 3, step / 9) - 1;
                assert!(cage.active[cage.cell_index(other)]);
            }
        }
        let shares: f32 = cage.regions(cell).iter().map(|part| part.share).sum();
        assert!((shares - f32::from(u8::from(cage.active[cell]))).abs() < 1e-6);
    }
    assert!(cage.active.iter().any(|&active| !active), "corners far from the ball are left out");
}

#[test]
fn half_cells_get_a_ring_and_half_the_fill() {
    let solid = Solid::cuboid(DVec3::ZERO, dvec3(1.0, 0.25, 0.2), 0.05);
    let cage = PartCage::build(&solid, 10, PartCage::MOST_NODES).unwrap();
    assert_eq!(cage.cage.cells, UVec3::new(12, 5, 4));
    assert!((filled_volume(&cage) / 0.05 - 1.0).abs() < 1e-5);
}

#[test]
fn cells_grow_until_the_nodes_are_few_enough() {
    let cube = Solid::cuboid(DVec3::ZERO, DVec3::ONE, 1.0 / 32.0);
    for most in [8000, 1000, 100, 27, 8] {
        let cage = PartCage::build(&cube, 20, most).unwrap();
        assert!(cage.cage.node_count() <= most);
    }
    assert_eq!(PartCage::build(&cube, 20, 7).unwrap_err(), BasisError::TooFewNodes { have: 7, least: 8 });
}

#[test]
fn impossible_numbers_of_cells_and_empty_solids_are_told() {
    assert!(matches!(PartCage::build(&beam(), 0, 8000), Err(BasisError::CellsOutOfRange { have: 0, .. })));
    assert!(matches!(PartCage::build(&beam(), u32::MAX, 8000), Err(BasisError::CellsOutOfRange { .. })));
    let empty = carved(UVec3::splat(4), 0.1, |_| false);
    assert_eq!(PartCage::build(&empty, 4, 8000).unwrap_err(), BasisError::EmptySolid);
}

#[test]
fn a_cell_knows_how_much_of_each_region_is_in_it() {
    let mut solid = beam();
    let dims = solid.grid.dims;
    for k in 0..solid.regions.len() {
        // The border lies in the middle of a cell of 10 along.
        solid.regions[k] = u8::from(k as u32 % dims.x >= 11);
    }
    let cage = PartCage::build(&solid, 10, 8000).unwrap();
    let shares = |x: u32| cage.regions(cage.cell_index(UVec3::new(x, 0, 0))).to_vec();
    assert_eq!(shares(4), [RegionShare { region: 0, share: 1.0 }]);
    assert_eq!(shares(6), [RegionShare { region: 1, share: 1.0 }]);
    let mixed = shares(5);
    assert_eq!((mixed[0].region, mixed[1].region), (0, 1));
    assert!((mixed[0].share - 0.5).abs() < 1e-6 && (mixed[1].share - 0.5).abs() < 1e-6);
}

#[test]
fn the_ring_is_made_of_what_it_surrounds() {
    let mut solid = carved(UVec3::new(16, 8, 8), 0.1, |at| at != UVec3::ZERO);
    solid.regions.iter_mut().enumerate().for_each(|(k, region)| *region = if k % 16 < 8 { 3 } else { 7 });
    let cage = PartCage::build(&solid, 16, 8000).unwrap();
    assert_eq!(cage.cage.cells, UVec3::new(18, 10, 10));
    assert_eq!(cage.regions(cage.cell_index(UVec3::new(0, 4, 4))), [RegionShare { region: 3, share: 1.0 }]);
    assert_eq!(cage.regions(cage.cell_index(UVec3::new(17, 0, 0))), [RegionShare { region: 7, share: 1.0 }]);
}

#[test]
fn pieces_that_share_no_node_are_counted() {
    let apart = |gap: u32| carved(UVec3::new(20 + gap, 10, 10), 0.1, |at| at.x < 10 || at.x >= 10 + gap);
    // A ring of one cell around each: they meet if at most two cells lie between.
    for (gap, pieces) in [(1, 1), (2, 1), (3, 2), (6, 2)] {
        let cage = PartCage::build(&apart(gap), 20 + gap, 20_000).unwrap();
        assert_eq!(cage.pieces(), pieces, "gap {gap}");
    }
}
