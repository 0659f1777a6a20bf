//! The room of the repository: what is taken out looks as before where it stands, and leaves a hole where it does not.

use std::path::Path;

use splat_core::{Similarity, View};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Instance, Rasterizer, Scene};

use super::*;
use crate::SplatCloud;
use crate::asset::SplatCameras;

/// All that is shown, as the rasteriser sees it.
fn drawn(app: &mut App, view: &View) -> Vec<[f32; 4]> {
    let world = app.world_mut();
    let mut shown = world.query::<(&Splats, &Transform, Option<&SplatSubset>)>();
    let clouds = world.resource::<Assets<SplatCloud>>();
    let instances = shown.iter(world).map(|(handle, transform, subset)| Instance {
        transform: Similarity::from_matrix(transform.to_matrix()).unwrap(),
        subset: subset.map(|subset| subset.0.clone()),
        ..Instance::new(clouds.get(&handle.0).unwrap().cloud.clone())
    });
    let scene = Scene { instances: instances.collect() };
    CpuRasterizer::new().render(&scene, view).unwrap()
}

fn worst(a: &[[f32; 4]], b: &[[f32; 4]]) -> f32 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn a_room_taken_apart_looks_as_before() {
    let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/room");
    let mut app = testing::app_in(&room);
    app.add_plugins(SplatPartsPlugin);
    let server = app.world().resource::<AssetServer>().clone();
    let handle = server.load::<SplatCloud>("scene.spz");
    let cameras = server.load::<SplatCameras>("cameras.json");
    let cloud = testing::finished(&mut app, &handle).unwrap().cloud;
    let view = testing::finished(&mut app, &cameras).unwrap().views[0].view.resized(160, 120);
    let labels: Vec<u16> =
        splat_io::npy::read_u8(room.join("labels.npy")).unwrap().into_iter().map(u16::from).collect();
    assert_eq!(labels.len(), cloud.len());
    let parts = Parts::from_labels(labels);

    // Where the file's space is the world's, no rounding of a transform hides what differs.
    let whole = (Splats(handle), Transform::IDENTITY, SplatParts(parts.clone()));
    let capture = app.world_mut().spawn(whole).id();
    let before = drawn(&mut app, &view);
    assert!(before.iter().map(|c| c[3]).sum::<f32>() > 0.5 * before.len() as f32, "a picture of something");

    let ids: Vec<PartId> = parts.iter().map(|(id, _)| id).collect();
    let out: Vec<Entity> = ids.iter().filter_map(|&id| extract_part(app.world_mut(), capture, id).ok()).collect();
    assert!(out.len() > 1);
    let apart = drawn(&mut app, &view);
    // Gaussians of one depth to the bit, which are few, change places.
    assert!(worst(&before, &apart) < 2.0 / 255.0, "{}", worst(&before, &apart));
    let total: usize = std::iter::once(capture)
        .chain(out.iter().copied())
        .map(|e| app.world().get::<SplatSubset>(e).unwrap().0.len())
        .sum();
    assert_eq!(total, cloud.len(), "every Gaussian once");

    app.world_mut().entity_mut(out[0]).insert(Transform::from_xyz(1e4, 0.0, 0.0));
    assert!(worst(&before, &drawn(&mut app, &view)) > 0.2, "the part is gone from its place");
    for part in out {
        restore_part(app.world_mut(), part).unwrap();
    }
    assert_eq!(drawn(&mut app, &view), before);
}
