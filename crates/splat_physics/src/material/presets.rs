//! [`PRESETS`]: materials by name.

use super::Material;

/// A material with its name and where its values are from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialPreset {
    /// As [`Material::preset`] takes it.
    pub name: &'static str,
    /// The values: something to begin with, for no material is the same twice.
    pub material: Material,
    /// Where they are from.
    pub source: &'static str,
    /// Whether they are a guess within the range of such things, in no book.
    pub guess: bool,
}

const BOOKS: &str = "density and elasticity: J. M. Gere, Mechanics of Materials, 5th ed., M. F. Ashby, Engineering Materials 1, \
    Halliday/Resnick/Walker, table 13-1; friction: The Engineering Toolbox, Serway/Beichner; restitution: The Physics Factbook; \
    damping: Cremer/Heckl, Adams/Askenazi";
const GUESS: &str = "a guess within the usual range";

/// The materials there are. Adding one is a row here.
///
/// Density in kg/m^3, Young's modulus in Pa, Poisson's ratio, friction (static, dynamic) against a neutral dry surface, coefficient
/// of restitution, damping ratio of the lowest swing. The softwood is fir, the hardwood oak, the hard plastic ABS or polystyrene, the
/// soft one polyethylene, the soft foam polyurethane.
pub const PRESETS: &[MaterialPreset] = &[
    row("steel", 7850.0, 2.0e11, 0.29, [0.6, 0.5], 0.6, 0.005, BOOKS),
    row("aluminium", 2700.0, 7.0e10, 0.33, [0.6, 0.45], 0.55, 0.005, BOOKS),
    row("brass", 8500.0, 1.0e11, 0.34, [0.5, 0.4], 0.55, 0.005, BOOKS),
    row("glass", 2500.0, 7.0e10, 0.22, [0.6, 0.4], 0.66, 0.005, BOOKS),
    row("ceramic", 2400.0, 7.0e10, 0.22, [0.6, 0.45], 0.6, 0.005, GUESS),
    row("concrete", 2350.0, 2.5e10, 0.18, [0.7, 0.6], 0.3, 0.04, BOOKS),
    row("stone", 2600.0, 5.0e10, 0.25, [0.7, 0.6], 0.4, 0.02, GUESS),
    row("wood_soft", 525.0, 1.2e10, 0.35, [0.5, 0.4], 0.5, 0.02, BOOKS),
    row("wood_hard", 700.0, 1.15e10, 0.35, [0.5, 0.4], 0.6, 0.02, BOOKS),
    row("plywood", 600.0, 8.0e9, 0.3, [0.5, 0.4], 0.45, 0.03, GUESS),
    row("plastic_hard", 1050.0, 2.5e9, 0.36, [0.4, 0.3], 0.69, 0.02, BOOKS),
    row("plastic_soft", 950.0, 9.0e8, 0.42, [0.3, 0.25], 0.55, 0.05, BOOKS),
    row("nylon", 1140.0, 2.7e9, 0.4, [0.35, 0.25], 0.6, 0.03, BOOKS),
    row("rubber", 1100.0, 1.0e7, 0.48, [1.0, 0.8], 0.8, 0.05, BOOKS),
    row("silicone_soft", 1100.0, 1.0e6, 0.48, [0.9, 0.7], 0.6, 0.08, GUESS),
    row("foam_firm", 60.0, 1.0e5, 0.25, [0.6, 0.5], 0.35, 0.15, GUESS),
    row("foam_soft", 30.0, 2.0e4, 0.2, [0.6, 0.5], 0.2, 0.2, GUESS),
    row("plush", 120.0, 1.0e4, 0.2, [0.6, 0.5], 0.1, 0.3, GUESS),
    row("cushion", 50.0, 1.5e4, 0.2, [0.6, 0.5], 0.15, 0.3, GUESS),
    row("leather", 900.0, 5.0e7, 0.4, [0.6, 0.5], 0.3, 0.1, GUESS),
    row("cardboard", 200.0, 2.0e8, 0.2, [0.45, 0.35], 0.25, 0.1, GUESS),
    row("gelatin", 1050.0, 1.0e4, 0.47, [0.4, 0.3], 0.2, 0.1, GUESS),
    row("plant_stem", 800.0, 5.0e7, 0.35, [0.5, 0.4], 0.2, 0.15, GUESS),
    row("leaf", 700.0, 1.0e7, 0.3, [0.5, 0.4], 0.1, 0.2, GUESS),
    row("fruit", 900.0, 3.0e6, 0.35, [0.5, 0.4], 0.4, 0.1, GUESS),
];

#[expect(clippy::too_many_arguments, reason = "a row of a table")]
const fn row(
    name: &'static str,
    density: f32,
    youngs_modulus: f32,
    poisson_ratio: f32,
    friction: [f32; 2],
    restitution: f32,
    damping_ratio: f32,
    source: &'static str,
) -> MaterialPreset {
    let [friction_static, friction_dynamic] = friction;
    let material = Material {
        density,
        youngs_modulus,
        poisson_ratio,
        friction_static,
        friction_dynamic,
        restitution,
        damping_ratio,
    };
    MaterialPreset { name, material, source, guess: matches!(source.as_bytes()[0], b'a') }
}
