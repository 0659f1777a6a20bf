//! What a user may set.

use bevy::camera::Hdr;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::TextureFormat;
use bevy::render::settings::WgpuSettings;
use bevy_splat::prelude::*;
use splat_raster::Scene;

use crate::harness::*;

#[test]
fn after_tone_mapping_colours_come_out_as_trained() {
    if !device() {
        return;
    }
    let cloud = ball(300, 1.5, [0.9, 0.3, 0.1]);
    for backend in backends() {
        for msaa in [Msaa::Off, Msaa::Sample4] {
            let mut stage = Stage::new(backend);
            stage.splats(&cloud, ());
            let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
            let settings = SplatCamera { order: SplatOrder::AfterTonemapping, ..default() };
            let camera = stage.camera(&canvas, (Hdr, Tonemapping::TonyMcMapface, settings, msaa));
            let name = format!("tonemapped_{msaa:?}_{backend:?}");
            let got = stage.picture(&canvas, &name);
            let corner = got[0];
            let clear = [0, 1, 2].map(|k| corner[k] / 255.0);
            let expected = over(&stage.expected(camera, &Scene::of(cloud.clone()), None), |_| clear);
            assert_near(&name, &got, &expected, 2.0, 0);

            stage.app.world_mut().entity_mut(camera).insert(SplatCamera::default());
            let mapped = stage.picture(&canvas, &format!("before_tonemapping_{msaa:?}_{backend:?}"));
            let middle = (SIZE.x * 32 + 48) as usize;
            assert!((mapped[middle][0] - got[middle][0]).abs() > 10.0, "tone mapping changes what is drawn before it");
        }
    }
}

#[test]
fn the_selection_gets_an_outline_and_no_other_pixel_changes() {
    if !device() {
        return;
    }
    let cloud = ball(500, 1.5, [0.1, 0.4, 0.9]);
    for backend in backends() {
        for msaa in [Msaa::Off, Msaa::Sample4] {
            let mut stage = Stage::new(backend);
            let selection = Selection::from_fn(cloud.len(), |i| cloud.means()[i].x < 0.0);
            let splats = stage.splats(&cloud, SplatSelection(selection));
            stage.app.world_mut().entity_mut(splats).insert(SplatHighlight::OFF);
            let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
            let background = SplatBackground::Read;
            let camera = stage.camera(&canvas, (msaa, SplatCamera { background, ..default() }));
            let without = stage.picture(&canvas, "no_outline");
            let outline = Some(SplatOutline { color: Srgba::new(1.0, 1.0, 0.0, 1.0), width_px: 2 });
            stage.app.world_mut().entity_mut(camera).insert(SplatCamera { outline, background, ..default() });
            let with = stage.picture(&canvas, &format!("outline_{msaa:?}_{backend:?}"));
            let changed: Vec<usize> =
                (0..with.len()).filter(|&i| (0..3).any(|k| (with[i][k] - without[i][k]).abs() > 1.0)).collect();
            let yellow = changed.iter().filter(|&&i| with[i][0] > 250.0 && with[i][1] > 250.0 && with[i][2] < 5.0);
            assert_eq!(yellow.count(), changed.len(), "only the line is new");
            assert!((60..400).contains(&changed.len()), "{} pixels", changed.len());
        }
    }
}

#[test]
fn subsets_and_tints_are_drawn() {
    if !device() {
        return;
    }
    let cloud = ball(300, 1.5, [0.1, 0.4, 0.9]);
    for backend in backends() {
        let mut stage = Stage::new(backend);
        let left = Selection::from_fn(cloud.len(), |i| cloud.means()[i].x < 0.0);
        let splats = stage.splats(&cloud, SplatSubset::of(&left));
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        let camera = stage.camera(&canvas, ());
        let got = stage.picture(&canvas, &format!("subset_{backend:?}"));
        let expected = over(&stage.expected(camera, &Scene::of_selected(cloud.clone(), &left), None), |_| CLEAR);
        assert_near("subset", &got, &expected, 2.0, 0);

        stage.app.world_mut().entity_mut(splats).insert(SplatSelection(left.clone())).insert(SplatHighlight {
            selection_color: Srgba::rgb(1.0, 0.0, 0.0),
            selection_strength: 1.0,
            ..default()
        });
        let got = stage.picture(&canvas, &format!("tint_{backend:?}"));
        let frame = stage.expected(camera, &Scene::of_selected(cloud.clone(), &left), None);
        let red: Vec<_> = over(&frame, |_| CLEAR)
            .iter()
            .zip(&frame.color)
            .map(|(_, c)| {
                let mix = |k: usize, own: f32| 255.0 * (own * c[3] + (1.0 - c[3]) * CLEAR[k]);
                [mix(0, 1.0), mix(1, 0.0), mix(2, 0.0), 255.0]
            })
            .collect();
        assert_near("tint", &got, &red, 2.0, 0);
    }
}

#[test]
fn an_app_without_a_graphics_adapter_runs_without_drawing() {
    let none = WgpuSettings { backends: None, ..default() };
    let render = RenderPlugin { render_creation: none.into(), ..default() };
    let mut stage = Stage::with(SplatBackend::Auto, render, false);
    let cloud = ball(20, 1.0, [0.5; 3]);
    let splats = stage.splats(&cloud, ());
    for _ in 0..3 {
        stage.app.update();
    }
    assert!(stage.app.world().resource::<SplatRenderStats>().views.is_empty());
    assert!(stage.app.world().get::<bevy::camera::primitives::Aabb>(splats).is_some());
}

#[test]
fn the_render_world_may_run_a_frame_behind() {
    if !device() {
        return;
    }
    let cloud = ball(50, 1.0, [0.5; 3]);
    for backend in backends() {
        let render = RenderPlugin { synchronous_pipeline_compilation: true, ..default() };
        let mut stage = Stage::with(backend, render, true);
        let splats = stage.splats(&cloud, ());
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        stage.camera(&canvas, ());
        for _ in 0..10 {
            stage.app.update();
        }
        let stats = stage.app.world().resource::<SplatRenderStats>();
        assert_eq!((stats.views.len(), stats.views[0].backend), (1, backend));
        stage.app.world_mut().despawn(splats);
        for _ in 0..4 {
            stage.app.update();
        }
        assert!(stage.app.world().resource::<SplatRenderStats>().views.is_empty());
    }
}

#[test]
fn what_the_stages_take_is_recorded() {
    if !device() {
        return;
    }
    for backend in backends() {
        let mut stage = Stage::new(backend);
        stage.splats(&ball(50, 1.0, [0.5; 3]), ());
        let canvas = stage.canvas(TextureFormat::Rgba8UnormSrgb);
        stage.camera(&canvas, SplatCamera { background: SplatBackground::Read, ..default() });
        stage.picture(&canvas, "recorded");
        for _ in 0..4 {
            stage.frame();
        }
        let store = stage.app.world().resource::<DiagnosticsStore>();
        let spans: &[&str] = match backend {
            SplatBackend::Gpu => &["draw", "composite"],
            _ => &["read_back", "rasterize", "copy"],
        };
        for span in spans {
            let path = DiagnosticPath::new(format!("render/splats/{span}/elapsed_cpu"));
            assert!(store.get(&path).and_then(|d| d.value()).is_some_and(|ms| ms > 0.0), "{span}");
        }
    }
}
