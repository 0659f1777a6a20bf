//! How well the bases bend: a cantilever beam under its own weight against a fine finite element model.
//!
//! `cargo run --release -p splat_physics --example beam` prints a table. The beam is 1 m long, 0.2 m square, with Poisson's ratio 0.3
//! and 1000 kg/m^3, held at one end; A has one material (1e7 Pa), B is stiff near the clamp (1e8, then 1e7), C far from it (1e7, then
//! 1e9). Figures are how far the tip sinks, over what the finite elements (H8 with incompatible modes, 40 x 8 x 8) say.

#![expect(clippy::print_stdout, reason = "a table is what this is for")]

use std::time::Instant;

use splat_physics::glam::DVec3;
use splat_physics::{
    BasisKind, ElasticBody, ElasticError, ElasticModel, ElasticSettings, Frame, Loads, Material, NoProgress,
    SimplicitsSettings, Solid, Spring,
};

const CASES: [(&str, [f32; 2], f64); 3] =
    [("A", [1e7, 1e7], 0.037546), ("B", [1e8, 1e7], 0.006101), ("C", [1e7, 1e9], 0.034794)];

fn main() -> Result<(), ElasticError> {
    println!("| basis | handles | A | B | C | set-up of A, all of it (ms) |");
    println!("|---|---|---|---|---|---|");
    let eigenmodes = |exponent| BasisKind::Eigenmodes { exponent };
    let network = |steps| BasisKind::Simplicits(SimplicitsSettings { steps, ..SimplicitsSettings::default() });
    let rows = [
        ("affine", BasisKind::Affine, 1),
        ("eigenmodes", eigenmodes(0.5), 8),
        ("eigenmodes", eigenmodes(0.5), 16),
        ("eigenmodes", eigenmodes(0.5), 24),
        ("eigenmodes (default)", eigenmodes(0.5), 32),
        ("eigenmodes", eigenmodes(0.5), 48),
        ("eigenmodes, exponent 1", eigenmodes(1.0), 32),
        ("eigenmodes, exponent 0", eigenmodes(0.0), 32),
        ("network, 300 steps", network(300), 16),
    ];
    for (name, basis, handles) in rows {
        let settings =
            ElasticSettings { basis, handles, cubature: 1152.max(32 * handles), ..ElasticSettings::default() };
        let mut ratios = Vec::new();
        let mut milliseconds = 0.0;
        for (case, moduli, reference) in CASES {
            let begin = Instant::now();
            let model = beam(moduli, &settings)?;
            if case == "A" {
                milliseconds = begin.elapsed().as_secs_f64() * 1e3;
            }
            ratios.push(format!("{:.3}", sunk(model) / reference));
        }
        println!("| {name} | {handles} | {} | {milliseconds:.0} |", ratios.join(" | "));
    }
    Ok(())
}

fn beam(moduli: [f32; 2], settings: &ElasticSettings) -> Result<ElasticModel, ElasticError> {
    let mut solid = Solid::cuboid(DVec3::new(0.0, -0.1, -0.1), DVec3::new(1.0, 0.1, 0.1), 0.0125);
    for v in 0..solid.regions.len() {
        solid.regions[v] = u8::from(solid.grid.center(v).x > 0.5);
    }
    let materials = moduli.map(|youngs_modulus| Material {
        density: 1000.0,
        youngs_modulus,
        poisson_ratio: 0.3,
        friction_static: 0.5,
        friction_dynamic: 0.5,
        restitution: 0.0,
        damping_ratio: 0.0,
    });
    ElasticModel::build(&solid, &materials, settings, &NoProgress)
}

/// How far the tip sinks, in metres.
fn sunk(model: ElasticModel) -> f64 {
    let mut body = ElasticBody::new(model.into(), Frame::IDENTITY);
    let springs: Vec<Spring> = (0..25)
        .map(|k| {
            let point = DVec3::new(0.0, f64::from(k % 5) * 0.05 - 0.1, f64::from(k / 5) * 0.05 - 0.1);
            Spring { point, target: point, stiffness: 1e9 }
        })
        .collect();
    body.settle(&Loads { gravity: DVec3::new(0.0, 0.0, -9.81), springs: &springs });
    -body.point_position(DVec3::X).z
}
