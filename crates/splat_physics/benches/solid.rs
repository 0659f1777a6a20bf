//! A ball's shell of Gaussians to a solid: `cargo bench -p splat_physics --bench solid`.
//!
//! 64 voxels along the diagonal, all threads; Gaussians get smaller as they get more, as captures do it.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays};
use splat_physics::{Solid, SolidSettings};

/// Flat Gaussians on a sphere of radius 0.5, in spiral order.
fn ball(count: usize) -> Cloud {
    let size = (2.0 / (count as f32).sqrt()).ln();
    let normal = |k: usize| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
        let (sin, cos) = (k as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt())).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z).as_vec3()
    };
    Cloud::new(CloudArrays {
        means: (0..count).map(|k| 0.5 * normal(k)).collect(),
        log_scales: vec![Vec3::new(size, size, 0.002f32.ln()); count],
        rotations: (0..count).map(|k| Quat::from_rotation_arc(Vec3::Z, normal(k).normalize())).collect(),
        opacity_logits: vec![1.0; count],
        sh: vec![0.0; 3 * count],
        ..CloudArrays::default()
    })
    .expect("arrays of one length")
}

fn build(c: &mut Criterion) {
    let mut group = c.benchmark_group("solid");
    group.sample_size(10);
    for count in [20_000, 200_000] {
        let cloud = ball(count);
        let ids: Vec<u32> = (0..count as u32).collect();
        let regions: Vec<u8> = ids.iter().map(|id| (id % 2) as u8).collect();
        let settings = SolidSettings::default();
        group.bench_function(format!("{count} Gaussians"), |b| {
            b.iter(|| black_box(Solid::build(&cloud, &ids, 1.0, None, &settings)));
        });
        group.bench_function(format!("{count} Gaussians of two materials"), |b| {
            b.iter(|| black_box(Solid::build(&cloud, &ids, 1.0, Some(&regions), &settings)));
        });
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
