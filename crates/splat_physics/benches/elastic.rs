//! A step of an elastic part that swings, and of one that lies on the floor: `cargo bench -p splat_physics --bench elastic`.
//!
//! One thread. A step is a sixtieth of a second.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DQuat, DVec3};
use splat_physics::world::{EmptyWorld, PlaneWorld};
use splat_physics::{ElasticBody, ElasticModel, ElasticSettings, Frame, Loads, Material, NoProgress, Solid};

fn model(handles: u16, cubature: u16) -> Arc<ElasticModel> {
    let solid = Solid::cuboid(DVec3::new(-0.3, -0.1, -0.15), DVec3::new(0.3, 0.1, 0.15), 0.01);
    let material = Material {
        density: 200.0,
        youngs_modulus: 1e5,
        poisson_ratio: 0.3,
        friction_static: 0.6,
        friction_dynamic: 0.5,
        restitution: 0.2,
        damping_ratio: 0.0,
    };
    let settings = ElasticSettings { handles, cubature, ..ElasticSettings::default() };
    Arc::new(ElasticModel::build(&solid, &[material], &settings, &NoProgress).expect("a box can be elastic"))
}

fn steps(c: &mut Criterion) {
    let mut group = c.benchmark_group("step");
    for (handles, cubature) in [(8, 512), (16, 1024), (32, 1024)] {
        let model = model(handles, cubature);
        // Turning and swinging in free space.
        let mut body = ElasticBody::new(model.clone(), Frame::IDENTITY);
        let free = Loads { gravity: DVec3::ZERO, springs: &[] };
        group.bench_function(format!("swinging {handles} handles {cubature} samples"), |b| {
            b.iter(|| {
                if body.kinetic_energy() < 0.5 {
                    body.kick(DVec3::ZERO, DVec3::new(0.0, 1.0, 0.5));
                    body.push(DVec3::new(0.3, 0.1, 0.15), DVec3::new(0.0, 0.3, 0.0));
                }
                black_box(body.step(1.0 / 60.0, &free, &mut EmptyWorld))
            });
        });
        // Falling on an edge, tumbling, coming to rest; thrown up again when it sleeps.
        let tilted = Frame { rotation: DQuat::from_rotation_x(0.5), translation: DVec3::Y * 0.4 };
        let mut body = ElasticBody::new(model, tilted);
        let mut floor = PlaneWorld { normal: DVec3::Y, offset: 0.0, friction: [0.5; 2], restitution: 0.2 };
        group.bench_function(format!("on the floor {handles} handles {cubature} samples"), |b| {
            b.iter(|| {
                if body.asleep() {
                    body.place(tilted);
                }
                black_box(body.step(1.0 / 60.0, &Loads::default(), &mut floor))
            });
        });
    }
    group.finish();
    c.bench_function("cage nodes 32 handles", |b| {
        let body = ElasticBody::new(model(32, 1024), Frame::IDENTITY);
        let mut nodes = Vec::new();
        b.iter(|| body.node_positions(black_box(&mut nodes)));
    });
}

criterion_group!(benches, steps);
criterion_main!(benches);
