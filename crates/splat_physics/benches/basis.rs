//! What a part's cage and weights cost, and reading them back: `cargo bench -p splat_physics --bench basis`.
//!
//! `modes/*` and `read` run on one thread; `training` takes as many as there are, `RAYON_NUM_THREADS=1` for one.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, UVec3};
use splat_physics::{
    BakeError, BakeReader, BakeWriter, BasisKind, BasisWeights, Material, NoProgress, PartCage, SimplicitsSettings,
    SimplicitsTraining, Solid, tags,
};

/// Voxels along each axis.
const VOXELS: u32 = 38;

fn material(youngs_modulus: f32) -> Material {
    Material {
        density: 1000.0,
        youngs_modulus,
        poisson_ratio: 0.3,
        friction_static: 0.5,
        friction_dynamic: 0.4,
        restitution: 0.3,
        damping_ratio: 0.05,
    }
}

/// A cube of voxels with some of them taken out; `region` by voxel.
fn carved(inside: impl Fn(UVec3) -> bool, region: impl Fn(UVec3) -> u8) -> Solid {
    let mut solid = Solid::cuboid(DVec3::ZERO, DVec3::ONE, 1.0 / f64::from(VOXELS));
    for k in 0..solid.weights.len() {
        let index = k as u32;
        let at = UVec3::new(index % VOXELS, index / VOXELS % VOXELS, index / (VOXELS * VOXELS));
        solid.regions[k] = region(at);
        if !inside(at) {
            solid.weights[k] = 0.0;
        }
    }
    solid
}

/// Shapes whose cages have all the nodes that are allowed, and the measured beam.
fn solids() -> Vec<(&'static str, Solid)> {
    let from_center = |at: UVec3| (at.as_dvec3() - 0.5 * f64::from(VOXELS - 1)).length();
    let all = |_: UVec3| true;
    vec![
        ("beam", Solid::cuboid(DVec3::ZERO, DVec3::new(1.0, 0.2, 0.2), 0.05)),
        ("cube", carved(all, |_| 0)),
        ("cube of two materials", carved(all, |at| u8::from(at.x >= VOXELS / 2))),
        ("ball", carved(|at| from_center(at) < 19.0, |_| 0)),
        ("shell", carved(|at| (15.0..19.0).contains(&from_center(at)), |_| 0)),
        ("sticks", carved(|at| at.z < 2 || at.x % 8 < 2 && at.y % 8 < 2, |_| 0)),
    ]
}

fn weights(kind: &BasisKind, cage: &PartCage, handles: usize) -> BasisWeights {
    let materials = [material(1e5), material(1e7)];
    match splat_physics::skinning_weights(kind, cage, &materials, handles, 1, &NoProgress) {
        Ok(weights) => weights,
        Err(error) => unreachable!("{error}"),
    }
}

fn cage(solid: &Solid) -> PartCage {
    match PartCage::build(solid, 20, PartCage::MOST_NODES) {
        Ok(cage) => cage,
        Err(error) => unreachable!("{error}"),
    }
}

fn basis(c: &mut Criterion) {
    let mut group = c.benchmark_group("basis");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3));
    for (name, solid) in solids() {
        group.bench_function(format!("cage/{name}"), |b| b.iter(|| cage(black_box(&solid))));
        let cage = cage(&solid);
        group.bench_function(format!("modes/{name}"), |b| {
            b.iter(|| weights(&BasisKind::default(), black_box(&cage), 32))
        });
    }
    let beam = cage(&solids()[0].1);
    let kind = BasisKind::Simplicits(SimplicitsSettings::default());
    group.bench_function("training/16 handles, 300 steps", |b| b.iter(|| weights(&kind, black_box(&beam), 16)));
    let settings = SimplicitsSettings::default();
    if let Ok(mut training) = SimplicitsTraining::new(&beam, &[material(1e6)], 16, settings, 1) {
        group.bench_function("training/one step", |b| b.iter(|| training.step()));
    }

    let cube = cage(&solids()[1].1);
    let mut file = BakeWriter::new();
    file.put(tags::CAGE, &cube);
    file.put(tags::WEIGHTS, &weights(&BasisKind::default(), &cube, 32));
    let bytes = file.finish();
    group.bench_function("read", |b| {
        b.iter(|| {
            let file = BakeReader::new(black_box(&bytes))?;
            Ok::<_, BakeError>((file.get::<PartCage>(tags::CAGE)?, file.get::<BasisWeights>(tags::WEIGHTS)?))
        });
    });
    group.finish();
}

criterion_group!(benches, basis);
criterion_main!(benches);
