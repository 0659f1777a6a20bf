//! What parts are made of: [`Material`], and the [`PRESETS`].

mod presets;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

pub use presets::{MaterialPreset, PRESETS};

/// From this Young's modulus on, in Pa, a part is better rigid: what it bends by cannot be seen.
const RIGID_FROM: f32 = 1e8;

/// How a part weighs, bends, slides and bounces. SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// In kg/m^3, above 0 and at most 1e5.
    pub density: f32,
    /// Young's modulus in Pa, above 0 and at most 1e13: stress over strain of a pulled rod.
    pub youngs_modulus: f32,
    /// Poisson's ratio, 0..0.5: how much a pulled rod gets thinner, over how much it gets longer.
    pub poisson_ratio: f32,
    /// Coulomb's coefficient against a neutral dry surface while nothing slides, 0..=10.
    pub friction_static: f32,
    /// The same while it slides, at most `friction_static`.
    pub friction_dynamic: f32,
    /// Coefficient of restitution, 0..=1: speed after a bounce over speed before.
    pub restitution: f32,
    /// Damping ratio of the lowest swing, 0..=10; at 1 nothing swings.
    pub damping_ratio: f32,
}

/// A value that no material has.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// A field is out of its range.
    #[error("a material cannot have {field} = {value}; it is {range}")]
    OutOfRange {
        /// Its name.
        field: &'static str,
        /// What it is.
        value: f32,
        /// What it may be.
        range: &'static str,
    },
}

/// Whether elastic motion would be seen, with a sentence that says why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Advice {
    /// It would.
    Elastic(String),
    /// It swings faster than steps can show: better a rigid part.
    Rigid(String),
}

impl Material {
    /// The material of a name in [`PRESETS`].
    pub fn preset(name: &str) -> Option<Self> {
        PRESETS.iter().find(|preset| preset.name == name).map(|preset| preset.material)
    }

    /// Whether every value is one that a material can have.
    ///
    /// # Errors
    /// [`MaterialError::OutOfRange`] for the first that is not; NaN never is.
    pub fn check(&self) -> Result<(), MaterialError> {
        let fields = [
            ("density", self.density, self.density > 0.0 && self.density <= 1e5, "above 0 and at most 1e5 kg/m^3"),
            (
                "youngs_modulus",
                self.youngs_modulus,
                self.youngs_modulus > 0.0 && self.youngs_modulus <= 1e13,
                "above 0 and at most 1e13 Pa",
            ),
            ("poisson_ratio", self.poisson_ratio, (0.0..0.5).contains(&self.poisson_ratio), "at least 0 and below 0.5"),
            ("friction_static", self.friction_static, (0.0..=10.0).contains(&self.friction_static), "0 to 10"),
            (
                "friction_dynamic",
                self.friction_dynamic,
                (0.0..=self.friction_static).contains(&self.friction_dynamic),
                "0 to friction_static",
            ),
            ("restitution", self.restitution, (0.0..=1.0).contains(&self.restitution), "0 to 1"),
            ("damping_ratio", self.damping_ratio, (0.0..=10.0).contains(&self.damping_ratio), "0 to 10"),
        ];
        match fields.into_iter().find(|field| !field.2) {
            Some((field, value, _, range)) => Err(MaterialError::OutOfRange { field, value, range }),
            None => Ok(()),
        }
    }

    /// Lame's constants `(lambda, mu)` in Pa.
    pub fn lame(&self) -> (f64, f64) {
        let (e, nu) = (f64::from(self.youngs_modulus), f64::from(self.poisson_ratio));
        (e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)))
    }

    /// Whether a part of it is elastic rather than rigid if nobody says which: below a Young's modulus of 1e8 Pa.
    pub fn elastic(&self) -> bool {
        self.youngs_modulus < RIGID_FROM
    }

    /// About the lowest frequency in Hz at which a part of `length` metres swings along itself, with both ends free:
    /// `sqrt(E / density) / (2 length)`. It bends at less than that.
    pub fn lowest_frequency(&self, length: f64) -> f64 {
        (f64::from(self.youngs_modulus) / f64::from(self.density)).sqrt() / (2.0 * length)
    }

    /// Whether elastic motion of a part of `length` metres would be seen at `rate` steps a second: if its
    /// [lowest frequency](Self::lowest_frequency) is at most half the rate.
    pub fn visible_motion(&self, length: f64, rate: f64) -> Advice {
        let (frequency, most) = (self.lowest_frequency(length), 0.5 * rate);
        let swings = format!("a part of {length:.3} m of this material swings at about {frequency:.0} Hz");
        if frequency <= most {
            Advice::Elastic(format!(
                "{swings}, which {rate:.0} steps a second can show: an elastic part would bend visibly"
            ))
        } else {
            let advice = format!("{swings}, but {rate:.0} steps a second show at most {most:.0} Hz");
            Advice::Rigid(format!("{advice}: a rigid part looks the same and costs less"))
        }
    }
}
