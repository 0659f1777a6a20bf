//! What a user waits for: preparing a capture, a click, a correcting click, a mask. On the generated room.
//!
//! `cargo bench -p splat_segment --bench clicks`

use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use splat_core::glam::Vec2;
use splat_core::{Mask2d, View};
use splat_raster::Scene;
use splat_raster::cpu::CpuRasterizer;
use splat_segment::Run;
use splat_segment::graph::clicks::{ClickKind, ClickState};
use splat_segment::graph::look::Look;
use splat_segment::graph::masks::{MaskCutSettings, outside_in_sight};
use splat_segment::graph::prepared::Prepared;
use splat_segment::votes::{ViewVotes, VoteSums};

/// The camera that looks at the teddy bear, and pixels of the bear and of its hat.
const CAMERA: usize = 27;
const BEAR: Vec2 = Vec2::new(434.5, 408.5);
const HAT: Vec2 = Vec2::new(436.5, 320.5);

fn clicks(c: &mut Criterion) {
    let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/room");
    let cloud = Arc::new(splat_io::read(room.join("scene.spz")).expect("the room reads").0);
    let cameras = splat_io::cameras::read(room.join("cameras.json")).expect("its cameras read");
    let views: Vec<View> = cameras.views.into_iter().map(|v| v.view).collect();
    let scene = Scene::of(cloud);
    let mut raster = CpuRasterizer::new();
    let mut group = c.benchmark_group("room");
    group.sample_size(10);
    group.bench_function("prepare", |b| {
        b.iter(|| Prepared::new(&scene, &views, &mut raster, &Run::new()).expect("it prepares"));
    });
    let prepared = Prepared::new(&scene, &views, &mut raster, &Run::new()).expect("it prepares");
    let view = views[CAMERA];
    group.bench_function("look", |b| b.iter(|| Look::draw(&prepared, &scene, &view, &mut raster)));
    let look = Look::draw(&prepared, &scene, &view, &mut raster).expect("it draws");
    let patch = prepared.graph.of[look.gaussian(BEAR).expect("the bear is there") as usize];
    group.bench_function("click", |b| b.iter(|| prepared.hypotheses(black_box(&look), patch, BEAR)));
    let found = prepared.hypotheses(&look, patch, BEAR);
    let bear = &found.ranked[found.proposals[0]].patches;
    group.bench_function("correcting click", |b| {
        b.iter(|| {
            let mut state = ClickState::new(bear.clone(), patch);
            state.correct(&prepared, black_box(&look), HAT, ClickKind::Negative);
            state.selection(&prepared)
        });
    });
    let chosen = prepared.gaussians(bear);
    let mask = Mask2d::from_fn(view.width, view.height, |x, y| {
        chosen.contains(look.solid[(y * view.width + x) as usize] as usize)
    });
    let mut sums = VoteSums::new(chosen.len());
    sums.add(&ViewVotes::draw(&mut raster, &scene, &view, &mask, None).expect("it votes"), 1);
    let outside = outside_in_sight(&scene, &view, &mask, &mut raster).expect("it draws");
    group.bench_function("mask", |b| {
        b.iter(|| prepared.object_from_votes(black_box(&sums), Some(&outside), &MaskCutSettings::default()));
    });
    group.finish();
}

criterion_group!(benches, clicks);
criterion_main!(benches);
