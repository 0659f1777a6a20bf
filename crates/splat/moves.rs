//! Similarity transforms, as users write them: seven numbers, or a file with a 4x4 matrix.

use std::path::Path;

use splat_core::Similarity;
use splat_core::glam::{EulerRot, Mat3, Mat4, Quat, Vec3};

use crate::failure::Failure;
use crate::parse;

/// What `--transform` means, for help texts.
pub(crate) const HELP: &str = "\
Move everything: YAW,PITCH,ROLL,SCALE,X,Y,Z, or a JSON file with a 4x4 matrix.

Seven numbers: angles in degrees about the file's own y, x and z axis (roll is done first, yaw last), a scale, a translation in \
scene units: x -> scale * Ry(yaw) Rx(pitch) Rz(roll) x + translation. Fewer may be given: 3 (a rotation), 4 (and a scale).

JSON: 16 numbers, four rows of four, or an object with a key `matrix` as `splat orient --json` prints it; for column vectors, \
translation in the last column. Rotation, uniform scale and translation only: Gaussians cannot be sheared or mirrored.";

/// The transform that the text means.
///
/// # Errors
/// [`Failure::Usage`] if it is neither numbers nor a file, [`Failure::Failed`] if the file holds no such matrix.
pub(crate) fn similarity(text: &str) -> Result<Similarity, Failure> {
    let path = Path::new(text);
    if path.is_file() {
        return from_file(path);
    }
    if Path::new(text).extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        return Err(Failure::failed(format!("there is no such file; name a JSON file with a 4x4 matrix: {text}")));
    }
    let v = parse::numbers(text, &[3, 4, 7]).map_err(|e| {
        Failure::usage(format!("--transform {text}: {e}; YAW,PITCH,ROLL,SCALE,X,Y,Z or a JSON file with a 4x4 matrix"))
    })?;
    let scale = v.get(3).copied().unwrap_or(1.0);
    if scale <= 0.0 {
        return Err(Failure::usage(format!("--transform {text}: the scale is {scale}; a number above 0 is needed")));
    }
    let [yaw, pitch, roll] = [v[0], v[1], v[2]].map(f32::to_radians);
    Ok(Similarity {
        rotation: Quat::from_euler(EulerRot::YXZ, yaw, pitch, roll),
        scale,
        translation: v.get(4..7).map_or(Vec3::ZERO, Vec3::from_slice),
    })
}

fn from_file(path: &Path) -> Result<Similarity, Failure> {
    let shown = path.display();
    let text = std::fs::read(path).map_err(|e| {
        Failure::failed(format!("the file cannot be read ({e}); check its name and permissions: {shown}"))
    })?;
    let json: serde_json::Value = serde_json::from_slice(&text)
        .map_err(|e| Failure::failed(format!("the file is no JSON ({e}); a 4x4 matrix was expected: {shown}")))?;
    let mut numbers = Vec::new();
    let whole = flatten(json.get("matrix").unwrap_or(&json), &mut numbers);
    let rows: Option<[f32; 16]> = whole.then(|| numbers.try_into().ok()).flatten();
    let Some(rows) = rows else {
        return Err(Failure::failed(format!(
            "the file does not hold 16 numbers; write a 4x4 matrix row by row: {shown}"
        )));
    };
    from_matrix(Mat4::from_cols_array(&rows).transpose()).map_err(|e| Failure::failed(format!("{e}: {shown}")))
}

/// Collects numbers of nested lists; `false` if there is anything else.
fn flatten(value: &serde_json::Value, out: &mut Vec<f32>) -> bool {
    match value {
        serde_json::Value::Array(list) => list.iter().all(|v| flatten(v, out)),
        serde_json::Value::Number(n) => {
            out.extend(n.as_f64().map(|n| n as f32));
            true
        }
        _ => false,
    }
}

fn from_matrix(m: Mat4) -> Result<Similarity, String> {
    let last = m.row(3);
    if !m.is_finite() || last.truncate().length() > 1e-6 || (last.w - 1.0).abs() > 1e-6 {
        return Err("the matrix's last row is not 0 0 0 1; write it for column vectors, row by row".to_owned());
    }
    let linear = Mat3::from_mat4(m);
    let scale = linear.determinant().cbrt();
    if scale <= 1e-12 {
        return Err("the matrix mirrors or flattens; Gaussians can be rotated, scaled uniformly and moved".to_owned());
    }
    let rotation = linear * (1.0 / scale);
    let off = (rotation * rotation.transpose() - Mat3::IDENTITY)
        .to_cols_array()
        .into_iter()
        .fold(0.0, |a: f32, v| a.max(v.abs()));
    if off > 1e-3 {
        return Err(
            "the matrix shears or scales unevenly; Gaussians can be rotated, scaled uniformly and moved".to_owned()
        );
    }
    Ok(Similarity { rotation: Quat::from_mat3(&rotation).normalize(), scale, translation: m.w_axis.truncate() })
}

/// The matrix of a similarity, row by row, for column vectors.
pub(crate) fn matrix(s: &Similarity) -> [[f32; 4]; 4] {
    let m = Mat4::from_scale_rotation_translation(Vec3::splat(s.scale), s.rotation, s.translation);
    std::array::from_fn(|row| m.row(row).to_array())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_comes_back_from_its_own_text() {
        let s = similarity("30,-20,10,2.5,1,2,3").unwrap();
        let rows: Vec<f32> = matrix(&s).into_iter().flatten().collect();
        let m = Mat4::from_cols_array(&rows.try_into().unwrap()).transpose();
        let back = from_matrix(m).unwrap();
        let x = Vec3::new(0.3, -4.0, 5.0);
        assert!(back.apply(x).distance(s.apply(x)) < 1e-4);
    }

    #[test]
    fn angles_turn_about_the_axes_they_name() {
        assert!(similarity("90,0,0").unwrap().apply(Vec3::Z).distance(Vec3::X) < 1e-6);
        assert!(similarity("0,90,0").unwrap().apply(Vec3::Y).distance(Vec3::Z) < 1e-6);
        assert!(similarity("0,0,90").unwrap().apply(Vec3::X).distance(Vec3::Y) < 1e-6);
    }

    #[test]
    fn mirrors_shears_and_projections_are_refused() {
        for m in [
            Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0)),
            Mat4::from_scale(Vec3::new(1.0, 2.0, 1.0)),
            Mat4::from_scale(Vec3::ZERO),
            Mat4::perspective_lh(1.0, 1.0, 0.1, 10.0),
            Mat4::from_translation(Vec3::NAN),
        ] {
            assert!(from_matrix(m).is_err(), "{m}");
        }
        for text in ["", "1,2", "1,2,3,0", "1,2,3,-1,0,0,0", "missing.json"] {
            assert!(similarity(text).is_err(), "{text}");
        }
    }
}
