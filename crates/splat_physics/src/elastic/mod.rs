//! Elastic parts: one reduced solver, whatever the skinning weights come from.
//!
//! [`ElasticModel`] is made once of a [`Solid`](crate::Solid) and its materials: a cage, weights at its nodes, samples at which strain is
//! measured. [`ElasticBody`] is such a model in motion: [`step`](ElasticBody::step) minimises the energy of an implicit step
//! (inertia, elasticity, springs, contact and friction) by Newton's method with a line search.
//!
//! | file | holds |
//! |---|---|
//! | `settings` | [`ElasticSettings`], [`ElasticError`] |
//! | `cubature` | samples of a solid |
//! | `energy` | strain energies, stresses, Hessians |
//! | `orthonormal` | independent functions out of weights times 1, x, y, z |
//! | `model` | everything that does not change |
//! | `stiffness` | Hessians in reduced coordinates, the lowest frequency |
//! | `body` | positions, velocities, what can be asked and done |
//! | `terms` | forces on single points |
//! | `newton` | the solve of one step |
//! | `baked` | files |
//! | `step` | time stepping, contact, sleep, guards |

mod baked;
mod body;
mod cubature;
mod energy;
mod model;
mod newton;
mod orthonormal;
mod settings;
mod step;
mod stiffness;
mod terms;
#[cfg(test)]
mod tests;

pub use baked::BakedModelError;
pub use body::{ElasticBody, Frame};
pub use cubature::Sample;
pub use energy::Energy;
pub use model::ElasticModel;
pub use settings::{ElasticError, ElasticSettings, Integrator};
pub use step::{ContactForce, StepReport};
pub use terms::{Loads, Spring};

/// Rigid bodies that one elastic part pushes in one step; more are obstacles for that step.
const MOST_PUSHED: usize = 8;
