//! From 3D Gaussian splats to bodies: solids, masses, elastic parts, collision surfaces. No engine, no GPU, no window.
//!
//! | step | what | where |
//! |---|---|---|
//! | material | [`Material`], [`PRESETS`]: how things weigh, bend, slide | `material/` |
//! | solid | [`Solid`]: a filled volume of the shell that a part's Gaussians are | `solid/` |
//! | surface | [`SurfaceMesh`], [`surface_points`]: triangles around it, points on it | `surface/` |
//! | shape | [`Shape`]: what an engine collides with | `shape/` |
//! | ground | [`Ground`], [`DistanceField`]: what is left of a capture, to stand on | `ground/` |
//! | basis | [`skinning_weights`]: what an elastic part moves by, exchangeable ([`BasisKind`]) | `basis/` |
//! | elastic | [`ElasticModel`], [`ElasticBody`]: reduced, implicit elasticity with contact | `elastic/` |
//! | bake | files of what was worked out | `bake/` |
//! | world | [`world::ContactWorld`]: what an elastic part asks its surroundings | `world.rs` |
//!
//! # Example
//!
//! A block of foam falls on a floor:
//!
//! ```
//! use splat_physics::world::PlaneWorld;
//! use splat_physics::{ElasticBody, ElasticModel, ElasticSettings, Frame, Loads, Material, NoProgress, Solid};
//! use splat_physics::glam::DVec3;
//!
//! let block = Solid::cuboid(DVec3::new(-0.2, 0.3, -0.1), DVec3::new(0.2, 0.5, 0.1), 0.02);
//! let foam = Material::preset("foam_firm").unwrap();
//! let settings = ElasticSettings { handles: 8, ..ElasticSettings::default() };
//! let model = ElasticModel::build(&block, &[foam], &settings, &NoProgress)?;
//!
//! let mut body = ElasticBody::new(model.into(), Frame::IDENTITY);
//! let mut floor = PlaneWorld { normal: DVec3::Y, offset: 0.0, friction: [0.6, 0.5], restitution: 0.0 };
//! while !body.asleep() {
//!     body.step(1.0 / 60.0, &Loads::default(), &mut floor);
//! }
//! assert!((body.center().y - 0.1).abs() < 0.02);
//! # Ok::<(), splat_physics::ElasticError>(())
//! ```
//!
//! # Conventions
//!
//! SI units: metres, kilograms, seconds, pascals. The *body's frame* has the axes and the origin of the cloud, with lengths in metres:
//! `p_body = p_cloud * metres_per_unit`. The same input gives the same bits on one machine, on any number of threads.

mod bake;
mod basis;
mod elastic;
mod ground;
mod linear;
mod mass;
mod material;
mod shape;
mod solid;
mod surface;
pub mod world;

pub use bake::*;
pub use basis::*;
pub use elastic::*;
pub use glam;
pub use ground::*;
pub use mass::MassProperties;
pub use material::*;
pub use shape::*;
pub use solid::*;
pub use surface::{SurfaceMesh, surface_points};
