//! Which property of a PLY file is which value of a Gaussian.

use splat_core::sh;

use super::header::{Element, Kind, Scalar};
use crate::{ReadError, SourceName};

/// What a property means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Coordinate 0..3 of the mean.
    Mean(usize),
    /// Log scale of axis 0..3.
    Scale(usize),
    /// Component of the rotation in glam's order (x, y, z, w); `rot_0` is w.
    Rotation(usize),
    /// Opacity logit.
    Opacity,
    /// Place within the Gaussian's SH coefficients (coefficient-major, colour inner).
    Sh(usize),
    /// Strength of Mip-Splatting's 3D filter, fused into scales and opacity.
    Filter,
    /// Property number n of those beyond the standard ones.
    Extra(usize),
}

/// A property of the Gaussians' element.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// Offset within a binary record, in bytes.
    pub(super) offset: usize,
    pub(super) role: Role,
}

/// All properties of the Gaussians' element.
#[derive(Clone, Debug)]
pub(super) struct Schema {
    pub(super) fields: Vec<Field>,
    pub(super) stride: usize,
    pub(super) sh_degree: u8,
    /// 2D Gaussian splatting: `scale_2` is absent.
    pub(super) flat: bool,
    /// `f_rest` properties beyond the highest complete degree; kept as extras.
    pub(super) unused_rest: usize,
}

impl Schema {
    pub(super) fn of(vertex: &Element, name: &SourceName) -> Result<Self, ReadError> {
        check_kind_of_file(vertex, name)?;
        let rest = vertex.properties.iter().filter(|p| rest_index(&p.name).is_some()).count();
        let per_channel = rest / 3;
        // Counts between two degrees are read as the largest complete one if the channels can still be told apart.
        let whole = rest.is_multiple_of(3);
        let degree = (0..=sh::MAX_DEGREE).rev().find(|&d| sh::coefficient_count(d) - 1 <= per_channel).unwrap_or(0);
        let complete = (0..rest).all(|i| vertex.has(&format!("f_rest_{i}")));
        if !whole || !complete {
            return Err(ReadError::malformed(
                "the number of properties `f_rest_*`",
                "0, 9, 24, 45 or 72, numbered from 0",
                rest.to_string(),
                name,
            ));
        }
        let used = sh::coefficient_count(degree) - 1;
        let fuse = filter_fits(vertex);
        let mut fields = Vec::with_capacity(vertex.properties.len());
        let mut offset = 0;
        let mut extras = 0;
        for property in &vertex.properties {
            let Kind::One(scalar) = property.kind else {
                return Err(ReadError::unsupported(
                    format!("the list property `{}` among the Gaussians", property.name),
                    "remove it",
                    name,
                ));
            };
            let role = role(&property.name, per_channel, used, fuse).unwrap_or_else(|| {
                extras += 1;
                Role::Extra(extras - 1)
            });
            fields.push(Field { name: property.name.clone(), scalar, offset, role });
            offset += scalar.size();
        }
        let unused_rest = rest - 3 * used;
        Ok(Self { fields, stride: offset, sh_degree: degree, flat: !vertex.has("scale_2"), unused_rest })
    }

    pub(super) fn field(&self, role: Role) -> Option<&Field> {
        self.fields.iter().find(|f| f.role == role)
    }

    pub(super) fn extra_count(&self) -> usize {
        self.fields.iter().filter(|f| matches!(f.role, Role::Extra(_))).count()
    }
}

fn filter_fits(vertex: &Element) -> bool {
    // A surfel has no third scale for the filter to widen.
    let float = |kind: Kind| matches!(kind, Kind::One(Scalar::F32 | Scalar::F64));
    vertex.has("scale_2") && vertex.properties.iter().any(|p| p.name == "filter_3D" && float(p.kind))
}

fn rest_index(name: &str) -> Option<usize> {
    name.strip_prefix("f_rest_")?.parse().ok()
}

fn role(name: &str, per_channel: usize, used: usize, fuse: bool) -> Option<Role> {
    Some(match name {
        "x" => Role::Mean(0),
        "y" => Role::Mean(1),
        "z" => Role::Mean(2),
        "scale_0" => Role::Scale(0),
        "scale_1" => Role::Scale(1),
        "scale_2" => Role::Scale(2),
        "rot_0" => Role::Rotation(3),
        "rot_1" => Role::Rotation(0),
        "rot_2" => Role::Rotation(1),
        "rot_3" => Role::Rotation(2),
        "opacity" => Role::Opacity,
        "f_dc_0" => Role::Sh(0),
        "f_dc_1" => Role::Sh(1),
        "f_dc_2" => Role::Sh(2),
        "filter_3D" if fuse => Role::Filter,
        _ => {
            // The file has all red coefficients, then all green ones, then all blue ones.
            let i = rest_index(name)?;
            let (channel, k) = (i / per_channel.max(1), i % per_channel.max(1));
            if k >= used || channel > 2 {
                return None;
            }
            Role::Sh(3 * (k + 1) + channel)
        }
    })
}

/// Refuses ordinary point clouds and meshes with a sentence about what is missing.
fn check_kind_of_file(vertex: &Element, name: &SourceName) -> Result<(), ReadError> {
    let missing = |p: &&&str| !vertex.has(p);
    if let Some(p) = ["x", "y", "z"].iter().find(missing) {
        return Err(ReadError::malformed(format!("property `{p}`"), "a coordinate of every Gaussian", "missing", name));
    }
    let ours = ["f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "rot_0", "rot_1", "rot_2", "rot_3"];
    let absent: Vec<&str> = ours.iter().filter(missing).copied().collect();
    if absent.is_empty() {
        return Ok(());
    }
    if absent.len() > ours.len() / 2 {
        let coloured = if vertex.has("red") { "a coloured point cloud or mesh" } else { "a point cloud or mesh" };
        return Err(ReadError::Other {
            found: format!("{coloured} ({} vertices without scales, rotations or SH colours)", vertex.count),
            expected: "Gaussian splats".to_owned(),
            advice: "train splats from it, or choose the `point_cloud.ply` that the training wrote".to_owned(),
            path: name.clone(),
        });
    }
    Err(ReadError::malformed(format!("property `{}`", absent.join("`, `")), "one float per Gaussian", "missing", name))
}
