//! Physics against numbers.

mod accuracy;
mod baked;
mod contact;
mod coupling;
mod derivatives;
mod guards;
mod motion;
mod strain;

use std::sync::Arc;

use glam::DVec3;

use super::{ElasticModel, ElasticSettings, Spring};
use crate::{BasisKind, Material, NoProgress, Solid};

/// A material with nothing but elasticity.
pub(super) fn elastic(youngs_modulus: f32, poisson_ratio: f32, density: f32) -> Material {
    Material {
        density,
        youngs_modulus,
        poisson_ratio,
        friction_static: 0.5,
        friction_dynamic: 0.5,
        restitution: 0.0,
        damping_ratio: 0.0,
    }
}

/// A box of one material with its centre at the origin.
pub(super) fn cuboid(size: DVec3, voxel: f64) -> Solid {
    Solid::cuboid(size * -0.5, size * 0.5, voxel)
}

pub(super) fn model(solid: &Solid, materials: &[Material], settings: &ElasticSettings) -> Arc<ElasticModel> {
    Arc::new(ElasticModel::build(solid, materials, settings, &NoProgress).unwrap())
}

/// A cube of 0.2 m that can only stretch, shear and turn.
pub(super) fn affine_cube(material: Material) -> Arc<ElasticModel> {
    let settings = ElasticSettings { basis: BasisKind::Affine, most_poisson_ratio: 0.49, ..ElasticSettings::default() };
    model(&cuboid(DVec3::splat(0.2), 0.02), &[material], &settings)
}

/// The beam of the measured cases: 1 m long, 0.2 m square, from x = 0 on, split in the middle into two regions.
pub(super) fn beam() -> Solid {
    let mut solid = Solid::cuboid(DVec3::new(0.0, -0.1, -0.1), DVec3::new(1.0, 0.1, 0.1), 0.0125);
    for v in 0..solid.regions.len() {
        solid.regions[v] = u8::from(solid.grid.center(v).x > 0.5);
    }
    solid
}

/// 5 x 5 springs that hold the face x = 0 of the beam.
pub(super) fn clamp(stiffness: f64) -> Vec<Spring> {
    (0..25)
        .map(|k| {
            let point = DVec3::new(0.0, f64::from(k % 5) * 0.05 - 0.1, f64::from(k / 5) * 0.05 - 0.1);
            Spring { point, target: point, stiffness }
        })
        .collect()
}
