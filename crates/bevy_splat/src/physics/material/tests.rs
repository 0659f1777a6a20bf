use bevy::prelude::*;
use splat_core::PartId;
use splat_physics::Material;

use super::*;
use crate::testing;

#[test]
fn a_material_is_the_same_after_a_trip_through_the_solver_and_through_text() {
    for preset in PRESETS {
        let material = PhysicsMaterial::preset(preset.name).unwrap();
        assert_eq!(Material::from(material), preset.material);
        assert_eq!(PhysicsMaterial::from(preset.material), material);
        let text = ron::to_string(&material).unwrap();
        assert_eq!(ron::from_str::<PhysicsMaterial>(&text).unwrap(), material);
        material.check().unwrap();
    }
    assert_eq!(PhysicsMaterial::preset("unobtainium"), None);
}

#[test]
fn files_are_assets_and_wrong_ones_are_told() {
    let (mut app, files) = testing::app_with_files();
    plugin(&mut app);
    files.insert_asset("soft.material.ron".as_ref(), b"(preset: \"rubber\", density: 950.0)".to_vec());
    files.insert_asset("wrong.material.ron".as_ref(), b"(preset: \"rubber\", restitution: 3.0)".to_vec());
    let server = app.world().resource::<AssetServer>().clone();
    let (soft, wrong) = (server.load::<PhysicsMaterial>("soft.material.ron"), server.load("wrong.material.ron"));
    let soft = testing::finished(&mut app, &soft).unwrap();
    assert_eq!(soft, PhysicsMaterial { density: 950.0, ..PhysicsMaterial::preset("rubber").unwrap() });
    let told = testing::finished::<PhysicsMaterial>(&mut app, &wrong).unwrap_err();
    assert!(told.contains("restitution = 3") && told.contains("wrong.material.ron"), "{told}");
}

#[test]
fn what_is_nearest_to_a_part_says_what_it_is_made_of() {
    let mut app = testing::app();
    plugin(&mut app);
    let (seat, back) = (PartId(2), PartId(3));
    let world = app.world_mut();
    let listed = |name: &str| PartMaterials::default().with(seat, PartMaterial::preset(name));
    let capture = world.spawn(listed("foam_soft").with(back, PartMaterial::preset("wood_hard"))).id();
    let chair = world.spawn((PartOf(capture), SplatPart(PartId(1)), PartMaterial::preset("steel"))).id();
    let inner = world.spawn((PartOf(chair), SplatPart(seat))).id();
    let of = |world: &mut World, entity: Entity| {
        let mut state = bevy::ecs::system::SystemState::<Materials>::new(world);
        state.get(world).unwrap().of(entity, "plywood").map(Option::unwrap)
    };
    let named = |names: &[&str]| names.iter().map(|name| Material::preset(name).unwrap()).collect::<Vec<_>>();
    let world = app.world_mut();
    let found = of(world, chair).unwrap();
    assert_eq!((found.materials, found.labels), (named(&["steel", "foam_soft", "wood_hard"]), vec![2, 3]));
    // A part's own label means the part.
    let found = of(world, inner).unwrap();
    assert_eq!((found.materials, found.labels), (named(&["foam_soft", "wood_hard"]), vec![3]));
    assert_eq!(found.assumed, None);
    world.entity_mut(chair).insert(listed("cushion"));
    assert_eq!(of(world, inner).unwrap().materials, named(&["cushion", "wood_hard"]));
    let found = of(world, capture).unwrap();
    assert_eq!((found.materials[0], found.assumed), (Material::preset("plywood").unwrap(), Some("plywood")));
    world.entity_mut(inner).insert(PartMaterial::preset("cheese"));
    let told = of(world, inner).unwrap_err().to_string();
    assert!(told.starts_with("there is no material `cheese`"), "{told}");
}
