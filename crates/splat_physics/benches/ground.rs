//! The ground of a real capture, and questions to its field: `cargo bench -p splat_physics --bench ground`.
//!
//! The plaza without its labelled parts, at 5 cm, all threads; it is skipped where the captures (`SPLAT_SCENES`, else
//! `target/scenes`) are not there. Questions take one thread.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, Vec3};
use splat_core::Selection;
use splat_core::orient::{FloorSettings, floor_plane};
use splat_physics::world::ContactWorld;
use splat_physics::{Ground, GroundSettings, GroundSource};

fn ground(c: &mut Criterion) {
    let folder = std::env::var_os("SPLAT_SCENES")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/scenes")), PathBuf::from)
        .join("plaza");
    let Ok((cloud, _)) = splat_io::read(folder.join("scene.ply")) else { return };
    let Ok(labels) = splat_io::npy::read_u8(folder.join("labels.npy")) else { return };
    let of = |part: u8| -> Vec<u32> { (0..cloud.len() as u32).filter(|&id| labels[id as usize] == part).collect() };
    let parts: Vec<Vec<u32>> = (1..255).map(of).filter(|ids| !ids.is_empty()).collect();
    let rest: Vec<u32> = (0..cloud.len() as u32).filter(|&id| matches!(labels[id as usize], 0 | 255)).collect();
    let removed: Vec<&[u32]> = parts.iter().map(Vec::as_slice).collect();
    let kept = Selection::from_ids(cloud.len(), rest.iter().copied());
    let Some(floor) = floor_plane(&cloud, Some(&kept), Vec3::Y, &FloorSettings::default()) else { return };
    let up = floor.normal.as_dvec3().normalize();
    let settings = GroundSettings { source: GroundSource::Mesh, up, ..GroundSettings::default() };
    let build = || Ground::build(&cloud, &rest, &removed, 1.0, &settings);
    let Ok(ground) = build() else { return };
    let mut field = ground.field();

    let mut group = c.benchmark_group("ground of the plaza");
    group.sample_size(10).measurement_time(Duration::from_secs(10));
    group.bench_function("build", |b| b.iter(|| black_box(build())));
    group.bench_function("field", |b| b.iter(|| black_box(ground.field())));
    // Around the parts, where bodies move.
    let points: Vec<DVec3> = parts.iter().flatten().map(|&id| cloud.means()[id as usize].as_dvec3()).collect();
    let points: Vec<DVec3> = points.iter().copied().step_by((points.len() / 10_000).max(1)).take(10_000).collect();
    let mut out = Vec::with_capacity(points.len());
    group.bench_function("10,000 questions", |b| {
        b.iter(|| {
            out.clear();
            field.contacts(black_box(&points), 0.02, &mut out);
            out.len()
        });
    });
    group.finish();
}

criterion_group!(benches, ground);
criterion_main!(benches);
