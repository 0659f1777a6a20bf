//! Neighbour search and what selections do with it.
//!
//! `cargo bench -p splat_core`. On a generated cloud, and on the real captures where they are (`SPLAT_SCENES`, else
//! `target/scenes` of the workspace). Wall time on all cores.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion as Bench, criterion_group, criterion_main};
use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays, Criterion, KdTree, Likeness, Neighbours, Selection, SelectionDelta, similar};

/// Neighbours per Gaussian.
const K: usize = 12;

/// A ball in a box: Gaussians along surfaces, as captures have them.
fn generated(count: usize) -> Cloud {
    let mut random = 1u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    };
    let mut a = CloudArrays::default();
    for i in 0..count {
        let direction = Vec3::new(next(), next(), next()).normalize_or(Vec3::Z);
        a.means.push(if i % 3 == 0 { direction } else { 4.0 * direction / direction.abs().max_element() });
        a.log_scales.push(Vec3::new(-4.5 + next(), -4.5 + next(), -7.0));
        a.rotations.push(Quat::from_rotation_arc(Vec3::Z, direction));
        a.opacity_logits.push(2.0 + 3.0 * next());
        a.sh.extend([next(), next(), next()]);
    }
    Cloud::new(a).expect("arrays that fit")
}

/// The floats of a capture's PLY, as its README lays them out: this crate lies below the one that reads files.
fn capture(file: PathBuf) -> Option<Cloud> {
    let bytes = std::fs::read(file).ok()?;
    let body = bytes.windows(11).position(|w| w == b"end_header\n")? + 11;
    let header = std::str::from_utf8(&bytes[..body]).ok()?;
    let names: Vec<&str> = header.lines().filter_map(|l| l.strip_prefix("property float ")).collect();
    let columns = |wanted: &[&str]| -> Option<Vec<usize>> {
        wanted.iter().map(|name| names.iter().position(|n| n == name)).collect()
    };
    let wanted = "x y z scale_0 scale_1 scale_2 rot_1 rot_2 rot_3 rot_0 opacity f_dc_0 f_dc_1 f_dc_2";
    let columns = columns(&wanted.split(' ').collect::<Vec<_>>())?;
    let mut a = CloudArrays::default();
    for row in bytes[body..].chunks_exact(4 * names.len()) {
        let v: Vec<f32> = columns.iter().map(|&k| f32::from_le_bytes([0, 1, 2, 3].map(|b| row[4 * k + b]))).collect();
        a.means.push(Vec3::from_slice(&v));
        a.log_scales.push(Vec3::from_slice(&v[3..]));
        a.rotations.push(Quat::from_slice(&v[6..]));
        a.opacity_logits.push(v[10]);
        a.sh.extend_from_slice(&v[11..]);
    }
    Cloud::new(a).ok()
}

/// The generated cloud and the real captures that are there.
fn clouds() -> Vec<(&'static str, Cloud)> {
    let folder = std::env::var_os("SPLAT_SCENES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../target/scenes"), PathBuf::from);
    let read = |name: &'static str| Some((name, capture(folder.join(name).join("scene.ply"))?));
    [Some(("generated", generated(300_000)))].into_iter().chain(["desk", "plaza"].map(read)).flatten().collect()
}

fn searches(c: &mut Bench) {
    for (name, cloud) in clouds() {
        let mut group = c.benchmark_group(name);
        group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(4));
        group.bench_function("tree", |b| b.iter(|| KdTree::new(black_box(cloud.means()))));
        group.bench_function(BenchmarkId::new("neighbours", K), |b| {
            b.iter(|| Neighbours::build(black_box(cloud.means()), K));
        });
        let neighbours = Neighbours::build(cloud.means(), K);
        group.bench_function("touching", |b| b.iter(|| neighbours.touching(&cloud, 2.0)));
        let all = Selection::all(cloud.len());
        let half = cloud.means()[cloud.len() / 2];
        let ball = Criterion::Sphere { center: half, radius: 1.0 };
        group.bench_function("select sphere", |b| b.iter(|| ball.select(&cloud)));
        let selected = ball.select(&cloud);
        group.bench_function("similar", |b| b.iter(|| similar(&cloud, &selected, &Likeness::default())));
        group.bench_function("grown", |b| b.iter(|| neighbours.grown(&selected, 1)));
        group.bench_function("smoothed", |b| b.iter(|| neighbours.smoothed(&selected, 0.5, 1)));
        group.bench_function("filled", |b| b.iter(|| neighbours.filled(&selected, 200)));
        group.bench_function("pieces", |b| b.iter(|| neighbours.pieces(&all)));
        group.bench_function("delta", |b| b.iter(|| SelectionDelta::between(&all, &selected)));
    }
}

criterion_group!(benches, searches);
criterion_main!(benches);
