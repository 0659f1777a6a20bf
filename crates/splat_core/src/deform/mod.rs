//! Bending Gaussians by a cage: what elastic parts move.

mod cage;

pub use cage::{Cage, CagePoint};
