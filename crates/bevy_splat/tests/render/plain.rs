//! Splats over a plain background, in every kind of target.

use bevy::camera::{CompositingSpace, Hdr};
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;
use bevy_splat::prelude::*;
use splat_raster::{Instance, Scene};

use crate::harness::*;

#[test]
fn every_kind_of_target_shows_what_the_rasteriser_draws() {
    if !device() {
        return;
    }
    let cloud = ball(300, 1.5, [0.9, 0.3, 0.1]);
    let (eight, sixteen) = (TextureFormat::Rgba8UnormSrgb, TextureFormat::Rgba16Float);
    for backend in backends() {
        let mut stage = Stage::new(backend);
        stage.splats(&cloud, ());
        for (name, format, hdr, msaa, space) in [
            ("plain", eight, false, Msaa::Off, None),
            ("bgra", TextureFormat::Bgra8UnormSrgb, false, Msaa::Off, None),
            ("msaa", eight, false, Msaa::Sample4, None),
            ("hdr", eight, true, Msaa::Off, None),
            ("hdr_msaa", eight, true, Msaa::Sample4, None),
            ("encoded", eight, false, Msaa::Off, Some(CompositingSpace::Srgb)),
            ("encoded_msaa", eight, false, Msaa::Sample4, Some(CompositingSpace::Srgb)),
            ("encoded_hdr", eight, true, Msaa::Off, Some(CompositingSpace::Srgb)),
            ("oklab", eight, true, Msaa::Off, Some(CompositingSpace::Oklab)),
            ("floats", sixteen, false, Msaa::Off, None),
        ] {
            let canvas = stage.canvas(format);
            let camera = stage.camera(&canvas, msaa);
            if hdr {
                stage.app.world_mut().entity_mut(camera).insert(Hdr);
            }
            if let Some(space) = space {
                stage.app.world_mut().entity_mut(camera).insert(space);
            }
            let name = format!("{name}_{backend:?}");
            let got = stage.picture(&canvas, &name);
            let expected = over(&stage.expected(camera, &Scene::of(cloud.clone()), None), |_| CLEAR);
            assert_near(&name, &got, &expected, 2.0, 0);
            stage.app.world_mut().despawn(camera);
        }
    }
}

#[test]
fn reading_the_background_and_knowing_it_give_the_same_picture() {
    if !device() {
        return;
    }
    let cloud = ball(300, 1.5, [0.2, 0.8, 0.3]);
    for backend in backends() {
        let mut stage = Stage::new(backend);
        stage.splats(&cloud, ());
        for (name, msaa, hdr) in [("plain", Msaa::Off, false), ("msaa", Msaa::Sample4, false), ("hdr", Msaa::Off, true)]
        {
            let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
            let settings = SplatCamera { background: SplatBackground::Read, ..default() };
            let camera = stage.camera(&canvas, (msaa, settings));
            if hdr {
                stage.app.world_mut().entity_mut(camera).insert(Hdr);
            }
            let got = stage.picture(&canvas, &format!("read_{name}_{backend:?}"));
            let expected = over(&stage.expected(camera, &Scene::of(cloud.clone()), None), |_| CLEAR);
            assert_near(name, &got, &expected, 2.0, 0);
            stage.app.world_mut().despawn(camera);
        }
    }
}

#[test]
fn clouds_pass_through_each_other_in_one_order_of_depth() {
    if !device() {
        return;
    }
    let (red, blue) = (ball(300, 1.2, [0.9, 0.2, 0.1]), ball(300, 1.2, [0.1, 0.3, 0.9]));
    for backend in backends() {
        let mut stage = Stage::new(backend);
        let turned = Transform::from_xyz(0.5, 0.2, 0.3).with_rotation(Quat::from_rotation_y(0.7));
        stage.splats(&red, Transform::from_xyz(-0.5, 0.0, 0.0));
        stage.splats(&blue, turned.with_scale(Vec3::splat(1.3)));
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        let camera = stage.camera(&canvas, ());
        let got = stage.picture(&canvas, &format!("through_{backend:?}"));
        let place = |cloud: &std::sync::Arc<Cloud>, transform: Transform| Instance {
            transform: splat_core::Similarity::from_matrix(transform.to_matrix()).unwrap(),
            ..Instance::new(cloud.clone())
        };
        let scene = Scene {
            instances: vec![
                place(&red, Transform::from_xyz(-0.5, 0.0, 0.0)),
                place(&blue, turned.with_scale(Vec3::splat(1.3))),
            ],
        };
        let expected = over(&stage.expected(camera, &scene, None), |_| CLEAR);
        assert_near("through", &got, &expected, 2.0, 0);
    }
}

#[test]
fn what_moves_and_changes_is_drawn_where_it_is() {
    if !device() {
        return;
    }
    let cloud = ball(200, 1.2, [0.7, 0.6, 0.2]);
    for backend in backends() {
        let mut stage = Stage::new(backend);
        let splats = stage.splats(&cloud, ());
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        let camera = stage.camera(&canvas, ());
        stage.picture(&canvas, "still");
        for step in 1..5 {
            let eye = Vec3::new(step as f32, 0.5 * step as f32, 5.0);
            *stage.app.world_mut().get_mut::<Transform>(camera).unwrap() =
                Transform::from_translation(eye).looking_at(Vec3::ZERO, Vec3::Y);
            stage.frame();
            let got = stage.read(&canvas, &format!("moving_{step}_{backend:?}"));
            let expected = over(&stage.expected(camera, &Scene::of(cloud.clone()), None), |_| CLEAR);
            assert_near("moving", &got, &expected, 2.0, 0);
        }
        // Standing still the picture is taken again, and is the same.
        let last = stage.picture(&canvas, "still");
        stage.frame();
        assert_eq!(stage.read(&canvas, "still"), last);
        let stats = stage.app.world().resource::<SplatRenderStats>();
        assert_eq!((stats.views.len(), stats.views[0].backend), (1, backend));
        assert_eq!(stats.gpu_clouds, usize::from(backend == SplatBackend::Gpu));
        assert!(backend == SplatBackend::Gpu || stats.views[0].reused, "{stats:?}");

        let flags = SplatFlags { hidden: Selection::from_fn(cloud.len(), |i| i % 2 == 0), ..default() };
        let shown = Selection::from_fn(cloud.len(), |i| i % 2 == 1);
        stage.app.world_mut().entity_mut(splats).insert(flags);
        stage.frame();
        let got = stage.read(&canvas, &format!("hidden_{backend:?}"));
        let expected = over(&stage.expected(camera, &Scene::of_selected(cloud.clone(), &shown), None), |_| CLEAR);
        assert_near("hidden", &got, &expected, 2.0, 0);

        stage.app.world_mut().entity_mut(splats).insert(Visibility::Hidden);
        stage.frame();
        let blank = [CLEAR.map(|v| 255.0 * v); 1].map(|[r, g, b]| [r, g, b, 255.0])[0];
        assert_near("gone", &stage.read(&canvas, "gone"), &vec![blank; got.len()], 1.0, 0);
    }
}

#[test]
fn damaged_and_monstrous_gaussians_do_no_harm() {
    if !device() {
        return;
    }
    let whole = ball(200, 1.2, [0.7, 0.6, 0.2]);
    let mut means = whole.means().to_vec();
    let mut scales = whole.log_scales().to_vec();
    (means[3], means[50]) = (Vec3::NAN, Vec3::new(0.0, f32::INFINITY, 1.0));
    (scales[7], scales[9]) = (Vec3::new(f32::NAN, 0.0, 0.0), Vec3::splat(1e6f32.ln()));
    (means[11], scales[12]) = (Vec3::splat(3e38), Vec3::splat(f32::INFINITY));
    let cloud = Cloud::new(CloudArrays {
        means,
        log_scales: scales,
        rotations: whole.rotations().to_vec(),
        opacity_logits: whole.opacity_logits().to_vec(),
        sh: whole.sh().to_vec(),
        ..CloudArrays::default()
    });
    let cloud = std::sync::Arc::new(cloud.unwrap());
    for backend in backends() {
        let mut stage = Stage::new(backend);
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        stage.splats(&cloud, ());
        let camera = stage.camera(&canvas, ());
        for z in [6.0, 0.1] {
            stage.app.world_mut().get_mut::<Transform>(camera).unwrap().translation.z = z;
            let name = format!("damaged_{z}_{backend:?}");
            let got = stage.picture(&canvas, &name);
            let expected = over(&stage.expected(camera, &Scene::of(cloud.clone()), None), |_| CLEAR);
            assert_near(&name, &got, &expected, 4.0, 0);
        }
    }
}
