//! Reading and writing, per format, in bytes and Gaussians per second.
//!
//! `cargo bench -p splat_io --bench load` reads the captures of `../shared/scenes` (expanded under `target/scenes`, or where
//! `SPLAT_SCENES` points); without them a generated cloud is measured in every writable format.

use std::hint::black_box;
use std::path::PathBuf;

use criterion::{Criterion, Throughput};
use splat_core::glam::{Quat, Vec3};
use splat_core::{Cloud, CloudArrays};
use splat_io::{FORMATS, WriteOptions};

fn scenes() -> PathBuf {
    std::env::var_os("SPLAT_SCENES")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/scenes")), PathBuf::from)
}

fn capture() -> Cloud {
    if let Ok((cloud, _)) = splat_io::read(scenes().join("plaza/scene.ply")) {
        return cloud;
    }
    let count = 200_000;
    let wave = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 10_007) as f32 / 10_007.0 - 0.5;
    let mut arrays = CloudArrays { sh_degree: 3, ..CloudArrays::default() };
    for i in 0..count {
        arrays.means.push(10.0 * Vec3::new(wave(i, 0), wave(i, 1), wave(i, 2)));
        arrays.log_scales.push(Vec3::new(wave(i, 3), wave(i, 4), wave(i, 5)) - 5.0);
        arrays.rotations.push(Quat::from_xyzw(wave(i, 6), wave(i, 7), wave(i, 8), 1.0).normalize());
        arrays.opacity_logits.push(8.0 * wave(i, 9));
        arrays.sh.extend((0..48).map(|k| wave(i, 10 + k)));
    }
    Cloud::new(arrays).expect("the arrays fit")
}

fn bench(criterion: &mut Criterion) {
    let cloud = capture();
    for format in FORMATS.iter().filter(|f| f.writable()) {
        let mut file = Vec::new();
        if splat_io::write_as(*format, &cloud, &WriteOptions::default(), &mut file).is_err() {
            continue;
        }
        let name = format!("capture.{}", format.extensions()[0]);
        let mut group = criterion.benchmark_group(format.name());
        group.sample_size(10);
        let both = Throughput::ElementsAndBytes { elements: cloud.len() as u64, bytes: file.len() as u64 };
        group.throughput(both);
        group.bench_function("read", |b| b.iter(|| black_box(splat_io::read_bytes(&file, &name))));
        group.bench_function("write", |b| {
            let mut sink = Vec::with_capacity(file.len());
            b.iter(|| {
                sink.clear();
                black_box(splat_io::write_as(*format, &cloud, &WriteOptions::default(), &mut sink))
            });
        });
        group.finish();
    }
    let mut files = vec![scenes().join("plaza/scene.ply"), scenes().join("formats/sample_sog_v2_dir")];
    if let Ok(folder) = std::fs::read_dir(scenes().join("formats")) {
        files.extend(folder.flatten().map(|f| f.path()).filter(|p| p.extension().is_some()));
    }
    files.sort();
    let mut group = criterion.benchmark_group("file");
    group.sample_size(10);
    for path in files {
        let Ok((cloud, report)) = splat_io::read(&path) else { continue };
        group.throughput(Throughput::ElementsAndBytes { elements: cloud.len() as u64, bytes: report.bytes });
        let name = path.strip_prefix(scenes()).unwrap_or(&path).display().to_string();
        group.bench_function(name, |b| b.iter(|| black_box(splat_io::read(&path))));
    }
    group.finish();
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    bench(&mut criterion);
    criterion.final_summary();
}
