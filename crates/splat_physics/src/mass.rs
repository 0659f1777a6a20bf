//! [`MassProperties`].

use glam::{DMat3, DVec3};

/// Mass, centre of mass and inertia of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// In kg.
    pub mass: f64,
    /// Centre of mass, in metres, in the body's frame.
    pub center: DVec3,
    /// Inertia tensor about the centre of mass, along the axes of the body's frame, in kg m^2.
    pub inertia: DMat3,
}
