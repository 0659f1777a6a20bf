//! Bent clouds: pictures against laws, baked poses and moved instances; picks against frames.

#![expect(clippy::unwrap_used, reason = "a test ends where something is missing")]
#![cfg_attr(feature = "gpu", expect(clippy::print_stdout, reason = "what is skipped says so"))]

use std::sync::Arc;

use splat_core::deform::{Cage, Deformation};
use splat_core::glam::{Quat, UVec3, Vec2, Vec3};
use splat_core::{Cloud, CloudArrays, Pose, Selection, Similarity, View};
use splat_raster::cpu::CpuRasterizer;
use splat_raster::pick::{PickIndex, PickQuery, pick};
use splat_raster::{Frame, Instance, Outputs, Rasterizer, Scene};

fn cage() -> Cage {
    Cage { origin: Vec3::splat(-1.3), cell: 0.13, cells: UVec3::splat(20) }
}

/// A solid ball of Gaussians of SH degree 3 within the cage; some outside it.
fn ball(seed: u64, count: usize) -> Arc<Cloud> {
    let mut state = seed;
    let mut next = |low: f32, high: f32| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (state >> 40) as f32 / (1u64 << 24) as f32 * (high - low)
    };
    let mut a = CloudArrays { sh_degree: 3, ..CloudArrays::default() };
    for i in 0..count {
        let reach = if i % 40 == 0 { 1.5 } else { 1.1 };
        a.means.push(Vec3::new(next(-reach, reach), next(-reach, reach), next(-reach, reach)));
        a.log_scales.push(Vec3::new(next(-4.5, -2.0), next(-4.5, -2.0), next(-4.5, -2.0)));
        let q = [next(-1.0, 1.0), next(-1.0, 1.0), next(-1.0, 1.0), next(0.1, 1.0)];
        a.rotations.push(Quat::from_array(q).normalize());
        a.opacity_logits.push(next(-2.0, 4.0));
        a.sh.extend((0..48).map(|k| if k < 3 { next(-1.0, 1.5) } else { next(-0.3, 0.3) }));
    }
    Arc::new(Cloud::new(a).unwrap())
}

fn view() -> View {
    let pose = Pose::look_at(Vec3::new(0.6, -0.8, -4.2), Vec3::ZERO, Vec3::NEG_Y);
    View::perspective(pose, 0.9, 160, 120)
}

/// Bent along x to an arc, and twisted.
fn bent(p: Vec3) -> Vec3 {
    let twisted = Quat::from_rotation_x(0.5 * p.x) * p;
    let (angle, r) = (twisted.x / 1.8, 1.8 - twisted.y * 0.8);
    Vec3::new(r * angle.sin(), 1.8 - r * angle.cos(), twisted.z)
}

fn scene(cloud: &Arc<Cloud>, map: impl Fn(Vec3) -> Vec3) -> Scene {
    let deformation = Some(Arc::new(Deformation::from_fn(cage(), map).unwrap()));
    Scene { instances: vec![Instance { deformation, ..Instance::new(cloud.clone()) }] }
}

fn psnr(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    let square = |(x, y): (&f32, &f32)| f64::from(x.clamp(0.0, 1.0) - y.clamp(0.0, 1.0)).powi(2);
    let sum: f64 = a.as_flattened().iter().zip(b.as_flattened()).map(square).sum();
    -10.0 * (sum / (4 * a.len()) as f64).max(1e-12).log10()
}

/// Rasterisers to try: the CPU's, and the GPU's where there is one.
fn rasterizers() -> Vec<(&'static str, Box<dyn Rasterizer>)> {
    #[cfg_attr(not(feature = "gpu"), expect(unused_mut, reason = "the GPU's is added where it is built"))]
    let mut all: Vec<(&'static str, Box<dyn Rasterizer>)> = vec![("cpu", Box::new(CpuRasterizer::new()))];
    #[cfg(feature = "gpu")]
    match splat_raster::gpu::Gpu::headless(splat_raster::gpu::GpuOptions::default()) {
        Ok(gpu) => all.push(("gpu", Box::new(splat_raster::gpu::GpuRasterizer::new(gpu)))),
        Err(error) => println!("skipped on the GPU: {error}"),
    }
    all
}

#[test]
fn a_cage_at_rest_changes_no_picture() {
    let cloud = ball(1, 1500);
    for (name, mut raster) in rasterizers() {
        let plain = raster.render(&Scene::of(cloud.clone()), &view()).unwrap();
        let rest = raster.render(&scene(&cloud, |p| p), &view()).unwrap();
        let largest =
            plain.as_flattened().iter().zip(rest.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(largest <= 1.0 / 255.0, "{name}: {largest}");
    }
}

#[test]
fn a_turned_cage_is_the_turned_instance_in_all_bands() {
    let cloud = ball(2, 1500);
    let rotation = Quat::from_euler(splat_core::glam::EulerRot::YXZ, 0.9, -0.4, 2.0);
    let transform = Similarity { rotation, scale: 1.0, translation: Vec3::new(0.1, -0.2, 0.3) };
    let moved = Scene { instances: vec![Instance { transform, ..Instance::new(cloud.clone()) }] };
    let mut parallel = view();
    parallel.projection = splat_core::Projection::Orthographic;
    (parallel.intrinsics.fx, parallel.intrinsics.fy) = (40.0, 40.0);
    for (name, mut raster) in rasterizers() {
        for view in [view(), parallel] {
            let wanted = raster.render(&moved, &view).unwrap();
            let found = raster.render(&scene(&cloud, |p| transform.apply(p)), &view).unwrap();
            let psnr = psnr(&wanted, &found);
            assert!(psnr > 45.0, "{name}: {psnr} dB");
            assert!(wanted.iter().any(|c| c[3] > 0.9));
        }
    }
}

#[test]
fn a_stretched_cage_stretches_what_is_seen() {
    let one = Arc::new(
        Cloud::new(CloudArrays {
            means: vec![Vec3::ZERO],
            log_scales: vec![Vec3::splat(-2.0)],
            rotations: vec![Quat::from_rotation_z(0.7)],
            opacity_logits: vec![4.0],
            sh: vec![1.0; 3],
            ..CloudArrays::default()
        })
        .unwrap(),
    );
    let pose = Pose::look_at(Vec3::new(0.0, 0.0, -4.0), Vec3::ZERO, Vec3::NEG_Y);
    let view = View::perspective(pose, 0.9, 160, 120);
    // Second moments of alpha about the centre, in px.
    let extents = |picture: &[[f32; 4]]| {
        let (mut sum, mut x2, mut y2) = (0.0, 0.0, 0.0);
        for (i, c) in picture.iter().enumerate() {
            let (x, y) = ((i % 160) as f64 - 79.5, (i / 160) as f64 - 59.5);
            sum += f64::from(c[3]);
            x2 += f64::from(c[3]) * x * x;
            y2 += f64::from(c[3]) * y * y;
        }
        ((x2 / sum).sqrt(), (y2 / sum).sqrt())
    };
    for (name, mut raster) in rasterizers() {
        let rest = extents(&raster.render(&scene(&one, |p| p), &view).unwrap());
        let wide = extents(&raster.render(&scene(&one, |p| p * Vec3::new(2.0, 0.5, 1.0)), &view).unwrap());
        assert!((wide.0 / rest.0 - 2.0).abs() < 0.05, "{name}: {rest:?} {wide:?}");
        assert!((wide.1 / rest.1 - 0.5).abs() < 0.05, "{name}: {rest:?} {wide:?}");
    }
}

#[test]
fn a_baked_pose_looks_as_the_bent_instance() {
    let cloud = ball(3, 1500);
    let bent = scene(&cloud, bent);
    let deformation = bent.instances[0].deformation.clone().unwrap();
    let baked = Scene::of(Arc::new(cloud.deformed(&deformation)));
    for (name, mut raster) in rasterizers() {
        let (a, b) = (raster.render(&bent, &view()).unwrap(), raster.render(&baked, &view()).unwrap());
        let psnr = psnr(&a, &b);
        assert!(psnr > 40.0, "{name}: {psnr} dB");
        let plain = raster.render(&Scene::of(cloud.clone()), &view()).unwrap();
        assert!(self::psnr(&a, &plain) < 25.0, "the bend shows");
    }
}

#[test]
fn another_pose_is_another_picture_of_the_same_scene() {
    let cloud = ball(4, 800);
    for (name, mut raster) in rasterizers() {
        let mut frames = Vec::new();
        for k in [0.0f32, 0.4, 0.0] {
            frames.push(raster.render(&scene(&cloud, |p| p + Vec3::X * k), &view()).unwrap());
        }
        assert_eq!(frames[0], frames[2], "{name}");
        assert!(psnr(&frames[0], &frames[1]) < 30.0, "{name}");
    }
}

#[test]
fn picks_are_the_first_hits_of_the_bent_frame() {
    let cloud = ball(5, 3000);
    let mut bent = scene(&cloud, bent);
    let transform = Similarity { rotation: Quat::from_rotation_y(0.5), scale: 1.2, translation: Vec3::X * 0.2 };
    bent.instances[0].transform = transform;
    let subset: Arc<[u32]> = (0..3000).filter(|i| i % 3 == 0).collect();
    bent.instances.push(Instance { subset: Some(subset), ..Instance::new(ball(6, 3000)) });
    let indices: Vec<PickIndex> = bent.instances.iter().map(|i| PickIndex::new(&i.cloud)).collect();
    let known: Vec<Option<&PickIndex>> = indices.iter().map(Some).collect();
    let mut frame = Frame::default();
    let outputs = Outputs { first_hits: Some(0.5), ..Outputs::default() };
    CpuRasterizer::new().draw(&bent, &view(), &outputs, &mut frame).unwrap();
    let mut hits = [0; 2];
    for k in 0..300u32 {
        let (x, y) = (k * 37 % 160, k * 53 % 120);
        let query = PickQuery::at(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
        let fast = pick(&bent, &known, &view(), query).unwrap();
        assert_eq!(fast, pick(&bent, &[], &view(), query).unwrap(), "with and without an index");
        let wanted = frame.first_hits[(y * 160 + x) as usize];
        assert_eq!(fast.map_or(Frame::NO_ID, |p| p.id), wanted, "{x} {y}");
        if let Some(pick) = fast {
            hits[pick.instance] += 1;
            assert_eq!(bent.locate(pick.id), Some((pick.instance, pick.gaussian)));
            // The place is on the Gaussian as it is bent, not as it was.
            let instance = &bent.instances[pick.instance];
            let (mean, c) = (instance.mean(pick.gaussian as usize), instance.covariance(pick.gaussian as usize));
            let reach = 3.4 * (c.x_axis.x + c.y_axis.y + c.z_axis.z).sqrt() + 0.1;
            assert!(pick.position.distance(mean) < reach, "{pick:?} {mean} {reach}");
        }
    }
    assert!(hits[0] > 40 && hits[1] > 10, "{hits:?}");
}

#[test]
fn wild_poses_do_not_fill_the_screen_or_break_the_frame() {
    let cloud = ball(7, 500);
    let crushed = scene(&cloud, |p| Vec3::new(p.x, 0.0, p.z));
    let flung = scene(&cloud, |p| p * 1e20);
    let inverted = scene(&cloud, |p| -p);
    for (name, mut raster) in rasterizers() {
        for scene in [&crushed, &flung, &inverted] {
            let picture = raster.render(scene, &view()).unwrap();
            assert!(picture.as_flattened().iter().all(|v| v.is_finite()), "{name}");
        }
    }
}

#[test]
fn every_back_end_shows_the_same_bent_frame() {
    let cloud = ball(8, 2000);
    let mut bent = scene(&cloud, bent);
    let transform = Similarity { rotation: Quat::from_rotation_y(-0.7), scale: 0.9, translation: Vec3::Y * 0.1 };
    bent.instances[0].transform = transform;
    let subset: Arc<[u32]> = (0..2000).filter(|i| i % 3 != 0).collect();
    let hidden = Arc::new(Selection::from_fn(2000, |i| i % 5 == 0));
    bent.instances[0].subset = Some(subset);
    bent.instances[0].hidden = Some(hidden);
    bent.instances.push(Instance::new(ball(9, 500)));
    let mut frames = Vec::new();
    for (name, mut raster) in rasterizers() {
        let mut frame = Frame::default();
        let outputs = Outputs { color: true, median_depth: true, first_hits: Some(0.5), ..Outputs::default() };
        raster.draw(&bent, &view(), &outputs, &mut frame).unwrap();
        frames.push((name, frame));
    }
    let (_, cpu) = &frames[0];
    for (name, frame) in &frames[1..] {
        let psnr = psnr(&cpu.color, &frame.color);
        assert!(psnr > 45.0, "{name}: {psnr} dB");
        let other = cpu.first_hits.iter().zip(&frame.first_hits).filter(|(a, b)| a != b).count();
        assert!(other * 100 < cpu.first_hits.len(), "{name}: {other} pixels are hit elsewhere");
    }
}
