//! Picking at a pixel names what a drawn frame names there, with an index and without one.

mod common;

use std::path::Path;
use std::sync::Arc;

use splat_core::glam::{Vec2, Vec3};
use splat_core::{Selection, View};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::pick::{PickIndex, PickQuery, pick};
use splat_raster::{Frame, Instance, Outputs, Rasterizer, Scene};

const TAU: f32 = 0.5;

/// Compares every `step`-th pixel; at most one in a thousand may hang on rounding.
fn agree(what: &str, scene: &Scene, view: &View, limit: Option<&[f32]>, step: usize) {
    let mut frame = Frame::default();
    let outputs = Outputs { first_hits: Some(TAU), median_depth: true, limit, ..Outputs::default() };
    CpuRasterizer::new().draw(scene, view, &outputs, &mut frame).expect("a frame");
    let indices: Vec<PickIndex> = scene.instances.iter().map(|i| PickIndex::new(&i.cloud)).collect();
    let indices: Vec<Option<&PickIndex>> = indices.iter().map(Some).collect();
    let (mut tried, mut differ, mut hits) = (0, 0, 0);
    // Without an index all Gaussians are gone through: less often where there are many.
    let rarely = if scene.len() > 10_000 { 40 } else { 3 };
    for p in (0..frame.first_hits.len()).step_by(step) {
        let pixel = Vec2::new((p % view.width as usize) as f32 + 0.3, (p / view.width as usize) as f32 + 0.8);
        let query = PickQuery { pixel, tau: TAU, limit: limit.map_or(f32::INFINITY, |l| l[p]) };
        let found = pick(scene, &indices, view, query).expect("a pick");
        if tried % rarely == 0 {
            assert_eq!(found, pick(scene, &[], view, query).expect("a pick"), "{what}: without an index at {pixel}");
        }
        tried += 1;
        hits += usize::from(found.is_some());
        if found.map_or(Frame::NO_ID, |f| f.id) != frame.first_hits[p] {
            differ += 1;
            continue;
        }
        if let Some(found) = found {
            assert_eq!(scene.locate(found.id), Some((found.instance, found.gaussian)), "{what}: names at {pixel}");
            assert!((found.depth - frame.median_depth[p]).abs() < 1e-5 * found.depth, "{what}: depth at {pixel}");
            assert!((found.normal.length() - 1.0).abs() < 1e-4 && found.position.is_finite(), "{what}: {found:?}");
            let seen = view.project(found.position).map(|(at, _)| at).expect("before the camera");
            assert!(seen.distance(pixel.floor() + 0.5) < 0.05, "{what}: the position is seen at {seen}, not {pixel}");
        }
    }
    assert!(hits > 0, "{what}: nothing is hit");
    assert!(differ * 1000 <= tried, "{what}: {differ} of {tried} picks differ");
}

#[test]
fn a_pick_is_the_first_hit_of_a_frame_for_random_clouds() {
    for seed in 1..=8 {
        let cloud = common::cloud(seed, 3000, 0);
        let cloud = if seed % 3 == 0 { common::antialiased(cloud) } else { cloud };
        let view = common::view(seed, 160, 120);
        let view = if seed % 4 == 0 { common::orthographic(view) } else { view };
        agree(&format!("seed {seed}"), &Scene::of(Arc::new(cloud)), &view, None, 3);
    }
}

#[test]
fn a_pick_heeds_transforms_subsets_hidden_gaussians_and_limits() {
    for seed in 11..=14 {
        let mut r = common::Random(seed);
        let cloud = Arc::new(common::cloud(seed, 1500, 1));
        let instances = (0..3)
            .map(|k| Instance {
                transform: r.similarity(),
                hidden: (k > 0).then(|| Arc::new(Selection::from_fn(1500, |_| r.bits().is_multiple_of(3)))),
                subset: (k < 2).then(|| (0..1500).filter(|_| r.bits().is_multiple_of(2)).collect()),
                ..Instance::new(cloud.clone())
            })
            .collect();
        let limit: Vec<f32> = (0..160 * 120).map(|_| r.range(0.5, 6.0)).collect();
        let scene = Scene { instances };
        agree(&format!("instances seed {seed}"), &scene, &common::view(seed, 160, 120), None, 3);
        agree(&format!("limits seed {seed}"), &scene, &common::view(seed, 160, 120), Some(&limit), 3);
    }
}

#[test]
fn large_splats_floaters_and_damaged_gaussians_are_no_obstacle() {
    let mut arrays = common::cloud(21, 2000, 0).into_arrays();
    for i in 0..20 {
        arrays.log_scales[i] += 3.0;
        arrays.opacity_logits[i] = -2.0;
    }
    arrays.means[50] = Vec3::splat(1e9);
    arrays.log_scales[51] = Vec3::splat(14.0);
    arrays.means[52].x = f32::NAN;
    arrays.log_scales[53].y = f32::INFINITY;
    let scene = Scene::of(Arc::new(splat_core::Cloud::new(arrays).unwrap()));
    agree("damaged", &scene, &common::view(21, 160, 120), None, 3);
}

#[test]
fn nothing_is_hit_outside_the_picture_or_in_an_empty_scene() {
    let view = common::forward_view(40, 30);
    let cloud = common::plain(&[(Vec3::new(0.0, 0.0, 3.0), 0.5, 6.0)]);
    let scene = Scene::of(cloud.clone());
    assert!(pick(&scene, &[], &view, PickQuery::at(Vec2::new(20.0, 15.0))).unwrap().is_some());
    for outside in [Vec2::new(-1.0, 15.0), Vec2::new(40.5, 3.0), Vec2::NAN] {
        assert_eq!(pick(&scene, &[], &view, PickQuery::at(outside)).unwrap(), None);
    }
    assert_eq!(pick(&Scene::default(), &[], &view, PickQuery::at(Vec2::splat(9.0))).unwrap(), None);
    let other = PickIndex::new(&common::cloud(1, 7, 0));
    let error = pick(&scene, &[Some(&other)], &view, PickQuery::at(Vec2::splat(9.0))).unwrap_err();
    assert_eq!(error.to_string(), "`index` has 7 values, 1 were expected");
}

#[test]
fn a_flat_gaussian_is_hit_on_its_plane_and_faces_the_camera() {
    let mut arrays = Arc::unwrap_or_clone(common::plain(&[(Vec3::new(0.0, 0.0, 4.0), 1.0, 9.0)])).into_arrays();
    arrays.log_scales[0].z = -9.0;
    let scene = Scene::of(Arc::new(splat_core::Cloud::new(arrays).unwrap()));
    let hit = pick(&scene, &[], &common::forward_view(64, 64), PickQuery::at(Vec2::new(40.0, 20.0))).unwrap().unwrap();
    assert!((hit.position.z - 4.0).abs() < 1e-3, "{hit:?}");
    assert!(hit.normal.distance(Vec3::NEG_Z) < 1e-4, "{hit:?}");
}

#[test]
fn a_pick_is_the_first_hit_of_a_frame_in_the_room_and_in_captures() {
    let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/room");
    let mut scenes = vec![("room", room.join("scene.spz"), room)];
    for name in ["desk", "bench/trumpeter"] {
        if let Some(folder) = common::capture(name) {
            scenes.push((name, folder.join("scene.ply"), folder));
        }
    }
    for (name, file, folder) in scenes {
        let (cloud, _) = splat_io::read(file).unwrap();
        let views = splat_io::cameras::read(folder.join("cameras.json")).unwrap().views;
        agree(name, &Scene::of(Arc::new(cloud)), &views[2].view.resized(320, 240), None, 97);
    }
}
