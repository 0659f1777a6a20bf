//! glTF in detail: component types, nodes, SPZ inside, files beside. Documents are put together here from the specification.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod common;

use common::random_cloud;
use serde_json::{Value, json};
use splat_core::glam::{Mat3, Quat, Vec3};
use splat_core::{Cloud, sh};
use splat_io::{InMemory, SourceName, WriteOptions, format_named, read_bytes, read_with, write_as};

/// left, up, forward to right, down, forward.
const RDF: Vec3 = Vec3::new(-1.0, -1.0, 1.0);

fn glb(mut json: Value, body: &[u8]) -> Vec<u8> {
    json["asset"] = json!({"version": "2.0"});
    if json["buffers"].is_null() {
        json["buffers"] = json!([{"byteLength": body.len()}]);
    }
    let mut text = serde_json::to_vec(&json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut body = body.to_vec();
    body.resize(body.len().next_multiple_of(4), 0);
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend(((28 + text.len() + body.len()) as u32).to_le_bytes());
    file.extend((text.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(text);
    file.extend((body.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(body);
    file
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Bytes of one value, component type, normalized.
type Raw<'a> = (&'a [u8], u32, bool);

/// One Gaussian with the given raw rotation, scale and opacity.
fn one(rotation: Raw<'_>, scale: Raw<'_>, opacity: Raw<'_>) -> (Value, Vec<u8>) {
    let parts: [(&str, &str, Raw<'_>); 5] = [
        ("POSITION", "VEC3", (&floats(&[1.0, 2.0, 3.0]), 5126, false)),
        ("KHR_gaussian_splatting:ROTATION", "VEC4", rotation),
        ("KHR_gaussian_splatting:SCALE", "VEC3", scale),
        ("KHR_gaussian_splatting:OPACITY", "SCALAR", opacity),
        ("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "VEC3", (&floats(&[0.5, -0.5, 0.0]), 5126, false)),
    ];
    let (mut body, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut attributes = json!({});
    for (number, (name, shape, (bytes, component, normalized))) in parts.into_iter().enumerate() {
        views.push(json!({"buffer": 0, "byteOffset": body.len(), "byteLength": bytes.len()}));
        accessors.push(json!({"bufferView": number, "componentType": component, "normalized": normalized, "count": 1, "type": shape}));
        attributes[name] = json!(number);
        body.extend(bytes);
        body.resize(body.len().next_multiple_of(4), 0);
    }
    let extension = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
    let primitive = json!({"mode": 0, "attributes": attributes, "extensions": {"KHR_gaussian_splatting": extension}});
    (json!({"bufferViews": views, "accessors": accessors, "meshes": [{"primitives": [primitive]}]}), body)
}

#[test]
fn every_component_type_is_read() {
    // The same values, as far as each type can say them: rotation (0, 0.6, 0, 0.8), scale (1, 0, 1) or (2, 0, 2), alpha 0.6.
    let rotations: [(Vec<u8>, u32, bool); 3] = [
        (floats(&[0.0, 0.6, 0.0, 0.8]), 5126, false),
        (vec![0, 76, 0, 102], 5120, true),
        ([0i16, 19660, 0, 26214].iter().flat_map(|v| v.to_le_bytes()).collect(), 5122, true),
    ];
    let scales: [(Vec<u8>, u32, bool); 5] = [
        (floats(&[1.0, 0.0, 1.0]), 5126, false),
        (vec![1, 0, 1], 5121, false),
        (vec![255, 0, 255], 5121, true),
        (vec![1, 0, 0, 0, 1, 0], 5123, false),
        (vec![255, 255, 0, 0, 255, 255], 5123, true),
    ];
    let opacities: [(Vec<u8>, u32, bool); 3] =
        [(floats(&[0.6]), 5126, false), (vec![153], 5121, true), (39321u16.to_le_bytes().to_vec(), 5123, true)];
    for k in 0..15 {
        let (rotation, scale, opacity) = (&rotations[k % 3], &scales[k % 5], &opacities[k / 5]);
        let (json, body) = one(
            (&rotation.0, rotation.1, rotation.2),
            (&scale.0, scale.1, scale.2),
            (&opacity.0, opacity.1, opacity.2),
        );
        let (cloud, report) = read_bytes(&glb(json, &body), "test.glb").unwrap();
        assert_eq!(report.format, "gltf");
        assert_eq!(cloud.means(), [Vec3::new(1.0, 2.0, 3.0) * RDF]);
        assert!((cloud.opacity(0) - 0.6).abs() < 1e-5);
        assert!(cloud.scale(0).abs_diff_eq(Vec3::new(1.0, 0.0, 1.0), 1e-5), "{}", cloud.scale(0));
        let q = cloud.rotation(0);
        assert!((q.y.abs() - 0.6).abs() < 0.005 && (q.w.abs() - 0.8).abs() < 0.005, "{q}");
    }
}

fn plain() -> (Value, Vec<u8>) {
    let (rotation, scale) = (floats(&[0.1, 0.2, 0.3, 0.9]), floats(&[0.5, 0.2, 0.1]));
    one((&rotation, 5126, false), (&scale, 5126, false), (&floats(&[0.25]), 5126, false))
}

#[test]
fn nodes_move_turn_and_scale_their_gaussians_and_a_mesh_may_be_shown_twice() {
    let (mut json, body) = plain();
    let (still, _) = read_bytes(&glb(json.clone(), &body), "still.glb").unwrap();
    let turn = Quat::from_xyzw(0.1, -0.3, 0.2, 0.8).normalize();
    json["nodes"] = json!([
        {"children": [1], "translation": [10.0, 0.0, 0.0], "scale": [2.0, 2.0, 2.0]},
        {"mesh": 0, "rotation": turn.to_array()},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
        {"mesh": 0, "name": "of no scene"},
    ]);
    json["scenes"] = json!([{"nodes": [0, 2]}]);
    let (cloud, _) = read_bytes(&glb(json.clone(), &body), "moved.glb").unwrap();
    assert_eq!(cloud.len(), 2);
    let axes = Mat3::from_diagonal(RDF);
    // The still one is in the arrays' axes already: back, through the node, and there again.
    let m = axes * Mat3::from_quat(turn) * axes;
    let expected = 2.0 * (m * still.means()[0]) + RDF * Vec3::new(10.0, 0.0, 0.0);
    assert!(cloud.means()[0].abs_diff_eq(expected, 1e-4), "{} {expected}", cloud.means()[0]);
    assert!(cloud.covariance(0).abs_diff_eq(m * still.covariance(0) * m.transpose() * 4.0, 1e-4));
    assert_eq!(cloud.means()[1], Vec3::new(1.0, 2.0, 3.0), "half a turn about z leaves the stored values");
    assert_eq!(cloud.rotations()[1], Quat::from_xyzw(0.1, 0.2, 0.3, 0.9));

    json["nodes"][1]["scale"] = json!([1.0, 3.0, 1.0]);
    let (_, report) = read_bytes(&glb(json.clone(), &body), "stretched.glb").unwrap();
    assert!(report.notes.iter().any(|n| n.contains("stretches")), "{:?}", report.notes);
    json["nodes"][1]["children"] = json!([0]);
    assert!(read_bytes(&glb(json.clone(), &body), "ring.glb").unwrap_err().to_string().contains("met twice"));
    json["nodes"] = json!([{"mesh": 0, "scale": [1.0, 0.0, 1.0]}]);
    json["scenes"] = json!([{"nodes": [0]}]);
    assert!(read_bytes(&glb(json, &body), "flat.glb").unwrap_err().to_string().contains("flattening"));
}

#[test]
fn linear_colours_are_noted_and_ordinary_meshes_refused() {
    let (mut json, body) = plain();
    let extension = &mut json["meshes"][0]["primitives"][0]["extensions"];
    extension["KHR_gaussian_splatting"]["colorSpace"] = json!("lin_rec709_display");
    let (_, report) = read_bytes(&glb(json.clone(), &body), "linear.glb").unwrap();
    assert!(report.notes.iter().any(|n| n.contains("lin_rec709_display")), "{:?}", report.notes);
    json["meshes"][0]["primitives"][0]["extensions"] = json!({});
    let error = read_bytes(&glb(json, &body), "mesh.glb").unwrap_err().to_string();
    assert!(error.contains("meshes only") && error.contains("mesh.glb"), "{error}");
}

#[test]
fn spz_inside_is_read_under_all_its_names_without_turning_its_axes() {
    let cloud = random_cloud(8, 60, 2);
    let mut blob = Vec::new();
    write_as(format_named("spz").unwrap(), &cloud, &WriteOptions::default(), &mut blob).unwrap();
    let (alone, _) = read_bytes(&blob, "alone.spz").unwrap();
    let view = json!({"bufferView": 0});
    let nested = |name: &str| json!({"KHR_gaussian_splatting": {"kernel": "ellipse", "extensions": {name: view}}});
    let places = [
        nested("KHR_gaussian_splatting_compression_spz_2"),
        nested("KHR_gaussian_splatting_compression_spz"),
        json!({"KHR_gaussian_splatting_compression_spz": view}),
        json!({"KHR_spz_gaussian_splats_compression": view}),
    ];
    for extensions in places {
        let primitive = json!({"attributes": {"POSITION": 0}, "extensions": extensions});
        let document = json!({
            "bufferViews": [{"buffer": 0, "byteLength": blob.len()}],
            "accessors": [{"componentType": 5126, "count": 60, "type": "VEC3"}],
            "meshes": [{"primitives": [primitive]}],
        });
        let (read, _) = read_bytes(&glb(document, &blob), "spz.glb").unwrap();
        assert_eq!(read.len(), alone.len());
        // Alone, right-up-back becomes right-down-forward; inside, left-up-forward does: half a turn about y apart.
        let m = Mat3::from_diagonal(Vec3::new(-1.0, 1.0, -1.0));
        for i in 0..read.len() {
            assert_eq!(read.means()[i], m * alone.means()[i]);
            assert!(read.covariance(i).abs_diff_eq(m * alone.covariance(i) * m, 1e-6));
            let direction = Vec3::new(0.36, -0.48, 0.8);
            let (a, b) = (sh::color(2, read.sh_of(i), m * direction), sh::color(2, alone.sh_of(i), direction));
            assert!(a.abs_diff_eq(b, 1e-5));
        }
    }
}

#[test]
fn buffers_may_lie_beside_the_file_or_in_its_text() {
    let (mut json, body) = plain();
    let (inside, _) = read_bytes(&glb(json.clone(), &body), "inside.glb").unwrap();
    json["asset"] = json!({"version": "2.0"});
    json["buffers"] = json!([{"byteLength": body.len(), "uri": "some%20data.bin"}]);
    let mut files = InMemory::default();
    files.files.insert("some data.bin".to_owned(), body.clone());
    let text = serde_json::to_vec(&json).unwrap();
    let (beside, report) = read_with(&text, &SourceName::from("beside.gltf"), &files).unwrap();
    assert_eq!((beside, report.bytes), (inside.clone(), (text.len() + body.len()) as u64));

    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut base64 = String::new();
    for three in body.chunks(3) {
        let bits = three.iter().fold(0u32, |bits, b| bits << 8 | u32::from(*b)) << (8 * (3 - three.len()));
        for k in 0..=three.len() {
            base64.push(char::from(digits[(bits >> (18 - 6 * k) & 63) as usize]));
        }
    }
    json["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{base64}"));
    let text = serde_json::to_vec(&json).unwrap();
    assert_eq!(read_bytes(&text, "text.gltf").unwrap().0, inside);
}

#[test]
fn written_values_are_those_of_the_cloud_and_the_node_turns_them() {
    let cloud: Cloud = random_cloud(9, 40, 3);
    let mut file = Vec::new();
    write_as(format_named("glb").unwrap(), &cloud, &WriteOptions::default(), &mut file).unwrap();
    let (back, _) = read_bytes(&file, "back.glb").unwrap();
    assert_eq!((back.means(), back.sh()), (cloud.means(), cloud.sh()), "to the bit");
    for i in 0..cloud.len() {
        assert!((back.log_scales()[i] - cloud.log_scales()[i]).abs().max_element() < 2e-6);
        assert!((back.opacity(i) - cloud.opacity(i)).abs() < 1e-6);
    }
    // The first view is the positions, unturned.
    let body = file.windows(4).position(|w| w == b"BIN\0").unwrap() + 4;
    let x = f32::from_le_bytes(file[body..body + 4].try_into().unwrap());
    assert_eq!(x, cloud.means()[0].x);
    let text = String::from_utf8_lossy(&file[20..body]).into_owned();
    assert!(text.contains(r#""rotation":[0.0,0.0,1.0,0.0]"#));
    let empty = Cloud::default();
    let mut file = Vec::new();
    write_as(format_named("glb").unwrap(), &empty, &WriteOptions::default(), &mut file).unwrap();
    assert!(read_bytes(&file, "empty.glb").unwrap().0.is_empty());
}
