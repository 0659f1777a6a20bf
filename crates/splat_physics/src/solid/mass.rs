//! Mass, centre and inertia of a [`Solid`], from its voxels.

use glam::{DMat3, DVec3};

use super::{Solid, SolidError};
use crate::{MassProperties, Material};

impl Solid {
    /// Mass properties with a material for each region; voxels of a region beyond the last material count as that one.
    ///
    /// Never NaN for finite densities: what weighs nothing has mass 0, inertia 0 and its centre in the middle of
    /// [`bounds`](Self::bounds).
    pub fn mass_properties(&self, materials: &[Material]) -> MassProperties {
        let last = materials.len().saturating_sub(1);
        let density = |region: u8| materials.get(usize::from(region).min(last)).map_or(0.0, |m| f64::from(m.density));
        let volume = self.grid.voxel_volume();
        let mass_of = |voxel: usize| f64::from(self.weights[voxel]) * density(self.regions[voxel]) * volume;

        let (low, high) = self.bounds();
        let middle = 0.5 * (low + high);
        let (mut mass, mut moment) = (0.0, DVec3::ZERO);
        for voxel in self.occupied() {
            let m = mass_of(voxel);
            mass += m;
            // About the middle, so that bodies far from the origin lose no digits.
            moment += m * (self.grid.center(voxel) - middle);
        }
        if mass <= 0.0 {
            return MassProperties { mass: 0.0, center: middle, inertia: DMat3::ZERO };
        }
        let center = middle + moment / mass;
        // Sum of m r r^T, plus that of a cube about its own centre: m h^2 / 12 along each axis.
        let mut second = DMat3::from_diagonal(DVec3::splat(mass * self.grid.voxel.powi(2) / 12.0));
        for voxel in self.occupied() {
            let r = self.grid.center(voxel) - center;
            let m = mass_of(voxel);
            second += DMat3::from_cols(m * r.x * r, m * r.y * r, m * r.z * r);
        }
        let trace = second.x_axis.x + second.y_axis.y + second.z_axis.z;
        MassProperties { mass, center, inertia: DMat3::from_diagonal(DVec3::splat(trace)) - second }
    }

    /// [`mass_properties`](Self::mass_properties) of a body that can move.
    ///
    /// # Errors
    /// [`SolidError::MaterialMissing`] if a region has no material, [`SolidError::ZeroDensity`] if one that is not empty has a
    /// density that is not above zero (NaN is not).
    pub fn checked_mass_properties(&self, materials: &[Material]) -> Result<MassProperties, SolidError> {
        let mut present = [false; 256];
        self.occupied().for_each(|voxel| present[usize::from(self.regions[voxel])] = true);
        for region in (0..=255u8).filter(|&region| present[usize::from(region)]) {
            let missing = SolidError::MaterialMissing { region, materials: materials.len() };
            let density = materials.get(usize::from(region)).ok_or(missing)?.density;
            if density.is_nan() || density <= 0.0 || density.is_infinite() {
                return Err(SolidError::ZeroDensity { region, density });
            }
        }
        Ok(self.mass_properties(materials))
    }
}
