//! [`PhysicsMaterialLoader`]: materials from `.material.ron` files.

use bevy::asset::{AssetLoader, LoadContext, io::Reader};
use bevy::prelude::*;
use ron::extensions::Extensions;
use serde::Deserialize;
use splat_physics::{Material, MaterialError};

use super::{PhysicsMaterial, known};

/// Loads [`PhysicsMaterial`]s from files that end in `.material.ron`.
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct PhysicsMaterialLoader;

/// Why a file did not become a [`PhysicsMaterial`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhysicsMaterialError {
    /// It cannot be read.
    #[error("the material cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// It is not what a material is written as.
    #[error("a material is written as `(preset: \"rubber\", density: 950.0)`; {reason}, at {place}: {path}")]
    Syntax {
        /// What was found and what was expected.
        reason: String,
        /// Line and column.
        place: String,
        /// Which file.
        path: String,
    },
    /// It names a preset that does not exist.
    #[error("there is no material `{name}`; known are {known}: {path}")]
    UnknownPreset {
        /// The name given.
        name: String,
        /// All names.
        known: String,
        /// Which file.
        path: String,
    },
    /// It names no preset and leaves a field out.
    #[error("`{field}` is missing; give all fields, or a preset that says the rest: {path}")]
    Missing {
        /// Which one.
        field: &'static str,
        /// Which file.
        path: String,
    },
    /// A number has no meaning.
    #[error("{source}: {path}")]
    Range {
        /// Which, and what it may be.
        source: MaterialError,
        /// Which file.
        path: String,
    },
}

/// As written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default, rename = "PhysicsMaterial")]
#[derive(Default)]
struct Written {
    preset: Option<String>,
    density: Option<f32>,
    youngs_modulus: Option<f32>,
    poisson_ratio: Option<f32>,
    friction_static: Option<f32>,
    friction_dynamic: Option<f32>,
    restitution: Option<f32>,
    damping_ratio: Option<f32>,
}

/// The material written in a file; `path` for what may be said about it.
fn parse(bytes: &[u8], path: &str) -> Result<PhysicsMaterial, PhysicsMaterialError> {
    let path = || path.to_owned();
    let syntax = |reason: String, place: String| PhysicsMaterialError::Syntax { reason, place, path: path() };
    let options = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    let written: Written = options.from_bytes(bytes).map_err(|e| syntax(e.code.to_string(), e.span.to_string()))?;
    let base = match &written.preset {
        None => None,
        Some(name) => Some(Material::preset(name).ok_or_else(|| PhysicsMaterialError::UnknownPreset {
            name: name.clone(),
            known: known(),
            path: path(),
        })?),
    };
    let field = |field: &'static str, written: Option<f32>, base: Option<f32>| {
        written.or(base).ok_or_else(|| PhysicsMaterialError::Missing { field, path: path() })
    };
    let material = PhysicsMaterial {
        density: field("density", written.density, base.map(|b| b.density))?,
        youngs_modulus: field("youngs_modulus", written.youngs_modulus, base.map(|b| b.youngs_modulus))?,
        poisson_ratio: field("poisson_ratio", written.poisson_ratio, base.map(|b| b.poisson_ratio))?,
        friction_static: field("friction_static", written.friction_static, base.map(|b| b.friction_static))?,
        friction_dynamic: field("friction_dynamic", written.friction_dynamic, base.map(|b| b.friction_dynamic))?,
        restitution: field("restitution", written.restitution, base.map(|b| b.restitution))?,
        damping_ratio: field("damping_ratio", written.damping_ratio, base.map(|b| b.damping_ratio))?,
    };
    material.check().map_err(|source| PhysicsMaterialError::Range { source, path: path() })?;
    Ok(material)
}

impl AssetLoader for PhysicsMaterialLoader {
    type Asset = PhysicsMaterial;
    type Settings = ();
    type Error = PhysicsMaterialError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<PhysicsMaterial, PhysicsMaterialError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        parse(&bytes, &context.path().to_string())
    }

    fn extensions(&self) -> &[&str] {
        &["material.ron"]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> String {
        parse(text.as_bytes(), "m.material.ron").unwrap_err().to_string()
    }

    #[test]
    fn a_file_is_a_preset_with_what_differs_or_all_of_its_fields() {
        let rubber = PhysicsMaterial::preset("rubber").unwrap();
        assert_eq!(parse(b"(preset: \"rubber\")", "m").unwrap(), rubber);
        let own = parse(b"PhysicsMaterial(preset: \"rubber\", density: 950)", "m").unwrap();
        assert_eq!(own, PhysicsMaterial { density: 950.0, ..rubber });
        let all = ron::to_string(&rubber).unwrap();
        assert_eq!(parse(all.as_bytes(), "m").unwrap(), rubber);
    }

    #[test]
    fn a_file_that_is_no_material_is_told_where_and_why() {
        assert!(told("(density: \"heavy\")").contains("1:1"), "{}", told("(density: \"heavy\")"));
        assert!(told("(colour: 3.0)").contains("colour"));
        assert!(told("\u{7f}").contains("written as"));
        assert!(told("(preset: \"rubbish\")").contains("no material `rubbish`; known are steel"));
        assert_eq!(
            told("(density: 1000.0)"),
            "`youngs_modulus` is missing; give all fields, or a preset that says the rest: m.material.ron"
        );
        for wrong in ["density: -1", "density: NaN", "poisson_ratio: 0.5", "restitution: 1.5", "youngs_modulus: inf"] {
            let sentence = told(&format!("(preset: \"rubber\", {wrong})"));
            assert!(sentence.contains(wrong.split(':').next().unwrap()), "{sentence}");
        }
    }
}
