//! Shapes for a physics engine: [`Shape::fit`].
//!
//! Shapes are fitted to the [`Solid`], whose floaters are gone and whose surface runs through the middle of the shell; none is fitted to
//! Gaussians. Mass and inertia come from the solid as well, not from the shape.

mod fit;
mod hull;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use glam::{DQuat, DVec3, UVec3};

use crate::{Solid, SurfaceMesh};
use fit::Body;
use hull::{convex_hull, extremes};

/// A hull is taken where the solid fills more than this share of it.
const CONVEX: f64 = 0.85;
/// A simple shape is taken where it and the solid share this much of what either holds.
const ALIKE: f64 = 0.9;
/// Directions whose farthest points are taken for corners when volumes are compared.
const DIRECTIONS: usize = 256;
/// Corners of a hull, at most.
const CORNERS: usize = 64;

/// Which shape is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ShapeChoice {
    /// A ball, box or capsule where one fits; else the hull of what is nearly convex; else a decomposition.
    #[default]
    Auto,
    /// The smallest box.
    Box,
    /// The ball of the same volume.
    Ball,
    /// A capsule along the longest axis.
    Capsule,
    /// The convex hull.
    Hull,
    /// Convex pieces.
    Decomposition,
    /// The voxels themselves.
    Voxels,
}

/// A shape that bodies collide with; in metres, in the body's frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A box.
    Box {
        /// Its middle.
        center: DVec3,
        /// Turns the body's axes to the box's.
        rotation: DQuat,
        /// Half its sides, all above 0.
        half: DVec3,
    },
    /// A ball.
    Ball {
        /// Its middle.
        center: DVec3,
        /// Above 0.
        radius: f64,
    },
    /// All that is near a segment.
    Capsule {
        /// One end of the segment.
        a: DVec3,
        /// The other, which is another point.
        b: DVec3,
        /// Above 0.
        radius: f64,
    },
    /// The hull of 4 to 64 points that do not lie in a plane.
    Hull(Vec<DVec3>),
    /// A closed surface that the engine cuts into convex pieces.
    Decomposition(SurfaceMesh),
    /// Voxels: cell (i, j, k) begins at `origin + voxel * (i, j, k)`.
    Voxels {
        /// Least corner of cell (0, 0, 0).
        origin: DVec3,
        /// Side of a cell.
        voxel: f64,
        /// Those that are filled, each once.
        cells: Vec<UVec3>,
    },
}

/// Why a solid has no such shape.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// There are no voxels.
    #[error("the solid is empty, so no shape fits it")]
    Empty,
    /// The grid is not finite.
    #[error("the solid's place or size is NaN or infinite")]
    NotFinite,
    /// The hull holds nothing.
    #[error("the hull of the solid holds nothing: its {points} outermost points lie in a plane; take a box")]
    Flat {
        /// How many there are.
        points: usize,
    },
}

impl Shape {
    /// The shape of a kind that fits a solid best.
    ///
    /// # Errors
    /// [`ShapeError`]: there is nothing to fit, or it is flat and no hull can be.
    ///
    /// Cost: some 10 ms for 64 voxels along the diagonal.
    pub fn fit(solid: &Solid, choice: ShapeChoice) -> Result<Self, ShapeError> {
        let body = Body::new(solid).ok_or_else(|| {
            let finite = solid.grid.origin.is_finite() && solid.grid.voxel.is_finite();
            let empty = !solid.weights.iter().any(|&w| w > 0.0 || w.is_nan());
            if finite && empty { ShapeError::Empty } else { ShapeError::NotFinite }
        })?;
        match choice {
            ShapeChoice::Auto => Self::simplest(&body),
            ShapeChoice::Box => Ok(body.cuboid()),
            ShapeChoice::Ball => Ok(body.ball()),
            ShapeChoice::Capsule => Ok(body.capsule()),
            ShapeChoice::Hull => Self::hull(&body).map(|(hull, _)| hull),
            ShapeChoice::Decomposition => Ok(Self::Decomposition(SurfaceMesh::of(solid))),
            ShapeChoice::Voxels => Ok(Self::voxels(solid)),
        }
    }

    fn simplest(body: &Body) -> Result<Self, ShapeError> {
        let simple = [body.ball(), body.cuboid(), body.capsule()];
        let fits = simple.into_iter().find(|shape| body.overlap(shape).is_some_and(|overlap| overlap >= ALIKE));
        if let Some(shape) = fits {
            return Ok(shape);
        }
        match Self::hull(body) {
            Ok((hull, volume)) if body.volume > CONVEX * volume => Ok(hull),
            Ok(_) => Ok(Self::Decomposition(SurfaceMesh::of(body.solid))),
            // What is flat has no hull, but it has a box.
            Err(_) => Ok(body.cuboid()),
        }
    }

    /// The hull with few corners, and the volume of the one with many.
    fn hull(body: &Body) -> Result<(Self, f64), ShapeError> {
        let many = extremes(&body.mesh.vertices, DIRECTIONS);
        let flat = ShapeError::Flat { points: many.len() };
        let full = convex_hull(&many).ok_or(flat.clone())?;
        let few = match full.points.len() {
            0..=CORNERS => full.points,
            // The six along the axes are among them.
            _ => convex_hull(&extremes(&full.points, CORNERS - 6)).ok_or(flat)?.points,
        };
        Ok((Self::Hull(few), full.volume))
    }

    /// Voxels of which at least half is inside; all of them where that leaves none.
    fn voxels(solid: &Solid) -> Self {
        let cells = |least: f32| {
            let cells = solid.occupied().filter(move |&v| solid.weights[v] >= least);
            cells.map(|v| solid.grid.at(v)).collect::<Vec<_>>()
        };
        let half = cells(0.5);
        let cells = if half.is_empty() { cells(0.0) } else { half };
        Self::Voxels { origin: solid.grid.origin, voxel: solid.grid.voxel, cells }
    }

    /// Volume of a box, ball or capsule, in m^3.
    fn simple_volume(&self) -> Option<f64> {
        match self {
            Self::Box { half, .. } => Some(8.0 * half.element_product()),
            Self::Ball { radius, .. } => Some(4.0 / 3.0 * PI * radius.powi(3)),
            Self::Capsule { a, b, radius } => Some(PI * radius * radius * (a.distance(*b) + 4.0 / 3.0 * radius)),
            _ => None,
        }
    }

    /// Whether a point is in a box, ball or capsule.
    fn holds(&self, point: DVec3) -> bool {
        match self {
            Self::Box { center, rotation, half } => (rotation.conjugate() * (point - *center)).abs().cmple(*half).all(),
            Self::Ball { center, radius } => point.distance_squared(*center) <= radius * radius,
            Self::Capsule { a, b, radius } => {
                let along = *b - *a;
                let t = ((point - *a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                point.distance_squared(*a + t * along) <= radius * radius
            }
            _ => false,
        }
    }
}
