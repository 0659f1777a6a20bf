//! What it costs to bend Gaussians by a cage.
//!
//! `cargo bench -p splat_core --bench deform`. 200 k Gaussians in a cage of 20 x 20 x 20 cells: in the order of a trained file
//! (none), and sorted by cell, both by the time that their thread works; the rest by wall time, `parallel` and `new` on all cores.

use std::hint::black_box;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use criterion::{Criterion as Bench, criterion_group, criterion_main};
use splat_core::deform::{Cage, Deformation, DeformedSplats, deform_splats, deform_splats_parallel};
use splat_core::glam::{Quat, UVec3, Vec3};
use splat_core::{Cloud, CloudArrays};

const COUNT: usize = 200_000;

fn bent(p: Vec3) -> Vec3 {
    Quat::from_rotation_y(0.6 * p.x) * (p * Vec3::new(1.0, 0.9 + 0.1 * p.z, 1.1))
}

/// What this thread has worked, so that other programs do not count; where the system does not say, what has passed.
fn worked() -> Duration {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    // The kernel brings the figure up to date when it looks at the thread.
    std::thread::yield_now();
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split(' ').next().and_then(|word| word.parse().ok());
    nanoseconds.map_or_else(|| START.elapsed(), Duration::from_nanos)
}

fn deformations(c: &mut Bench) {
    let mut random = 1u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    };
    let cage = Cage { origin: Vec3::splat(-1.0), cell: 0.1, cells: UVec3::splat(20) };
    let positions: Vec<Vec3> = (0..cage.node_count()).map(|i| bent(cage.node_position(i))).collect();
    let deformation = Deformation::new(cage, positions.clone()).expect("finite nodes");
    let means: Vec<Vec3> = (0..COUNT).map(|_| Vec3::new(next(), next(), next())).collect();
    let covariances: Vec<[f32; 6]> =
        (0..COUNT).map(|_| [2e-4 + 1e-4 * next(), 1e-5 * next(), 1e-5 * next(), 2e-4, 1e-5 * next(), 1e-4]).collect();
    let mut sorted = means.clone();
    sorted.sort_by_key(|p| cage.node_index(cage.locate(*p).node));

    let mut group = c.benchmark_group("deform 200k");
    group.sample_size(20).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3));
    let mut to = DeformedSplats::default();
    for (name, means) in [("unsorted", &means), ("sorted", &sorted)] {
        group.bench_function(name, |b| {
            b.iter_custom(|n| {
                let start = worked();
                for _ in 0..n {
                    deform_splats(black_box(&deformation), means, &covariances, &mut to);
                }
                worked() - start
            });
        });
    }
    group.bench_function("parallel", |b| {
        b.iter(|| deform_splats_parallel(black_box(&deformation), &means, &covariances, &mut to));
    });
    group.bench_function("one by one", |b| {
        b.iter(|| means.iter().map(|p| black_box(&deformation).at(*p).position).sum::<Vec3>());
    });
    group.bench_function("new, 9261 nodes", |b| b.iter(|| Deformation::new(cage, black_box(&positions).clone())));
    let cloud = Cloud::new(CloudArrays {
        log_scales: vec![Vec3::splat(-4.5); 20_000],
        rotations: vec![Quat::IDENTITY; 20_000],
        opacity_logits: vec![1.0; 20_000],
        sh_degree: 3,
        sh: vec![0.1; 48 * 20_000],
        means: means[..20_000].to_vec(),
        ..CloudArrays::default()
    })
    .expect("arrays that fit");
    group.sample_size(10);
    group.bench_function("bake 20k of degree 3", |b| b.iter(|| cloud.deformed(black_box(&deformation))));
}

criterion_group!(benches, deformations);
criterion_main!(benches);
