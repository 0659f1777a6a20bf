//! The surface of a solid: triangles around it, and points on it.

mod mesh;
mod net;
mod points;
mod simplify;
#[cfg(test)]
mod tests;

pub use mesh::SurfaceMesh;
pub(crate) use net::Net;
pub use points::surface_points;
