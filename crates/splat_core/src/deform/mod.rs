//! Bending Gaussians by a cage: what elastic parts move.
//!
//! A [`Cage`] says where the nodes rest, a [`Deformation`] where they are now. Every point in between has a place, a
//! deformation gradient F and the rotation R of F; a Gaussian there keeps its opacity, has the covariance `F S F^T`, and
//! is seen from directions turned by `R^T`.

mod bake;
mod cage;
mod deformation;
mod nodes;
mod splats;
#[cfg(test)]
mod tests;

pub use cage::{Cage, CagePoint};
pub use deformation::{Deformation, LocalDeformation};
pub use nodes::{FLATTEST, LARGEST_STRETCH, LEAST_STRETCH};
pub use splats::{DeformedSplats, deform_splats, deform_splats_parallel, packed_covariance};

/// Why nodes are no [`Deformation`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DeformError {
    /// The cage has no cells along an axis, or its place or the side of its cells is no usable number.
    #[error("the cage needs a cell along each axis, a finite origin, and a positive, finite cell side")]
    Cage,
    /// There are more or fewer nodes than the cage has.
    #[error("{found} nodes were given, but the cage has {expected}")]
    Length {
        /// Nodes given.
        found: usize,
        /// Nodes of the cage.
        expected: usize,
    },
    /// A node is nowhere, or so far from its neighbours that the stretch between them is no number.
    #[error("node {node} of the cage is not finite; freeze the part or set it back to its rest shape")]
    NotFinite {
        /// The first such node.
        node: usize,
    },
}
