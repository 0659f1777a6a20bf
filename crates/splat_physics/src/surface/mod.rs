//! The surface of a solid: points on it.

mod points;

pub use points::surface_points;
