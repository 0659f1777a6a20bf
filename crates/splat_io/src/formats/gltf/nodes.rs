//! Which meshes a glTF document shows, and where.

use glam::{DMat3, DMat4, DQuat, DVec3};

use super::json::{Document, Node};
use crate::{ReadError, SourceName};

/// A mesh at a place of the scene.
pub(super) struct Instance {
    pub(super) mesh: usize,
    /// From the mesh to the scene.
    pub(super) world: DMat4,
}

/// All instances of the default scene, depth first, in the order of the document.
pub(super) fn instances(document: &Document, name: &SourceName) -> Result<Vec<Instance>, ReadError> {
    if document.nodes.is_empty() {
        let meshes = 0..document.meshes.len();
        return Ok(meshes.map(|mesh| Instance { mesh, world: DMat4::IDENTITY }).collect());
    }
    let roots: Vec<usize> = match document.scenes.get(document.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => {
            let mut root = vec![true; document.nodes.len()];
            for child in document.nodes.iter().flat_map(|n| &n.children) {
                if let Some(root) = root.get_mut(*child) {
                    *root = false;
                }
            }
            (0..root.len()).filter(|&i| root[i]).collect()
        }
    };
    let mut seen = vec![false; document.nodes.len()];
    let mut stack: Vec<(usize, DMat4)> = roots.into_iter().rev().map(|node| (node, DMat4::IDENTITY)).collect();
    let mut instances = Vec::new();
    while let Some((number, parent)) = stack.pop() {
        let malformed = |expected: &str, found: &str| {
            Err(ReadError::malformed(format!("node {number} of the glTF file"), expected, found, name))
        };
        let Some(node) = document.nodes.get(number) else { return malformed("present", "missing") };
        // The specification asks for a tree; anything else could go on for ever.
        if std::mem::replace(&mut seen[number], true) {
            return malformed("the child of one node", "met twice");
        }
        let world = parent * local(node);
        if !world.is_finite() {
            return malformed("a finite transform", "an infinite one");
        }
        if let Some(mesh) = node.mesh {
            if mesh >= document.meshes.len() {
                return malformed("a mesh of the file", "a missing one");
            }
            instances.push(Instance { mesh, world });
        }
        stack.extend(node.children.iter().rev().map(|&child| (child, world)));
    }
    Ok(instances)
}

fn local(node: &Node) -> DMat4 {
    if let Some(matrix) = &node.matrix {
        return DMat4::from_cols_array(matrix);
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let length = rotation.length();
    let rotation = if length > 0.0 { rotation / length } else { DQuat::IDENTITY };
    let scale = DVec3::from_array(node.scale.unwrap_or([1.0; 3]));
    DMat4::from_scale_rotation_translation(scale, rotation, DVec3::from_array(node.translation.unwrap_or_default()))
}

/// The orthogonal matrix nearest to `m` and the uniform scale that go with it, and whether they are the whole of `m`;
/// `None` if `m` flattens space.
pub(super) fn similarity(m: DMat3) -> Option<(DMat3, f64, bool)> {
    let determinant = m.determinant();
    let scale = determinant.abs().cbrt();
    if !(scale > 1e-12 && scale.is_finite()) {
        return None;
    }
    // Newton's iteration for the polar decomposition; a rotation is its fixed point, to the bit if its entries are 0 or 1.
    let mut rotation = m * (1.0 / scale);
    for _ in 0..40 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    let rest = rotation * scale - m;
    let whole = rest.to_cols_array().iter().all(|v| v.abs() <= 1e-4 * scale);
    (rotation.is_finite() && (rotation.determinant().abs() - 1.0).abs() < 1e-6).then_some((rotation, scale, whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_and_uniform_scales_are_taken_apart() {
        let half_turn = DMat3::from_quat(DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0));
        assert_eq!(similarity(half_turn), Some((DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)), 1.0, true)));
        let turn = DMat3::from_quat(DQuat::from_xyzw(0.1, 0.7, -0.2, 0.4).normalize());
        let (rotation, scale, whole) = similarity(turn * 3.0).unwrap();
        assert!(rotation.abs_diff_eq(turn, 1e-12) && (scale - 3.0).abs() < 1e-12 && whole);
        let stretched = turn * DMat3::from_diagonal(DVec3::new(1.0, 2.0, 1.0));
        assert!(!similarity(stretched).unwrap().2);
        assert_eq!(similarity(DMat3::ZERO), None);
    }
}
