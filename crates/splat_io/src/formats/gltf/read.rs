//! Primitives of a glTF document into one set of arrays.

use bytemuck::zeroed_vec;
use glam::{DMat3, DVec3, Mat3, Quat, Vec3};
use rayon::prelude::*;
use splat_core::{CloudArrays, sh};

use super::super::spz::{self, Axes};
use super::super::{limit, turn};
use super::buffers::{Buffers, Table, split};
use super::json::{Document, EXTENSION, Primitive};
use super::nodes::{Instance, instances, similarity};
use crate::format::{ReadReport, Siblings};
use crate::{ReadError, SourceName};

/// Gaussians of a block.
const BLOCK: usize = 4096;
/// Stands for a linear scale of 0, whose logarithm does not exist.
const LEAST_SCALE: f32 = 1e-12;
/// Smallest distance of an opacity from 0 and 1, where logits would be infinite.
const ALPHA_EDGE: f64 = 1e-6;
/// glTF is left, up, forward; the arrays are right, down, forward.
const RDF_FROM_LUF: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

pub(super) fn read(
    bytes: &[u8],
    name: &SourceName,
    files: &dyn Siblings,
    report: &mut ReadReport,
) -> Result<CloudArrays, ReadError> {
    let (text, binary) = split(bytes, name)?;
    let document = Document::parse(text, name)?;
    let mut buffers = Buffers::new(&document, binary, name);
    let mut file_len = bytes.len();
    let mut parts: Vec<(&Instance, &Primitive)> = Vec::new();
    let instances = instances(&document, name)?;
    for instance in &instances {
        for primitive in document.meshes[instance.mesh].primitives.iter().filter(|p| p.is_splats()) {
            for view in views(primitive, &document) {
                file_len += buffers.load(view, files)?;
            }
            parts.push((instance, primitive));
        }
    }
    report.bytes = file_len as u64;
    if parts.is_empty() {
        return Err(ReadError::Other {
            found: "meshes only".to_owned(),
            expected: format!("Gaussians (the extension `{EXTENSION}`)"),
            advice: "export the capture as splats".to_owned(),
            path: name.clone(),
        });
    }
    let mut whole: Option<CloudArrays> = None;
    let mut unpacked = 0;
    for (instance, primitive) in parts {
        note_settings(primitive, report);
        let mut arrays = match primitive.spz_view() {
            Some(view) => {
                let blob = buffers.bytes(usize::try_from(view).unwrap_or(usize::MAX))?;
                spz::read_arrays(blob, name, Axes::AsStored, report)?
            }
            None => attributes(primitive, &buffers, name)?,
        };
        // Many nodes may show the same small mesh.
        unpacked += arrays.means.len() as u64 * (20 + 3 * sh::coefficient_count(arrays.sh_degree)) as u64;
        limit::check("the unpacked size of all instances", unpacked, file_len, name)?;
        place(&mut arrays, instance, name, report)?;
        match &mut whole {
            None => whole = Some(arrays),
            Some(whole) => append(whole, arrays),
        }
    }
    let mut whole = whole.unwrap_or_default();
    whole.source.axes = "RDF".to_owned();
    report.notes.push(
        "the axes of glTF (left, up, forward) were turned to right, down, forward (RDF), those of PLY files".to_owned(),
    );
    report.notes.dedup();
    Ok(whole)
}

/// Numbers of the buffer views that a primitive needs.
fn views(primitive: &Primitive, document: &Document) -> Vec<usize> {
    if let Some(view) = primitive.spz_view() {
        return usize::try_from(view).into_iter().collect();
    }
    let accessors = primitive.attributes.iter().filter(|(name, _)| name.as_str() != "COLOR_0").map(|(_, a)| *a);
    accessors.filter_map(|a| document.accessors.get(a)?.buffer_view).collect()
}

fn note_settings(primitive: &Primitive, report: &mut ReadReport) {
    let mut note = |text: String| {
        if !report.notes.contains(&text) {
            report.notes.push(text);
        }
    };
    if primitive.setting("colorSpace") == Some("lin_rec709_display") {
        note(
            "the colours are linear (`lin_rec709_display`); they are kept as they are and appear darker here"
                .to_owned(),
        );
    }
    if let Some(kernel) = primitive.setting("kernel").filter(|k| *k != "ellipse") {
        note(format!("the kernel `{kernel}` is drawn as an ordinary Gaussian (`ellipse`)"));
    }
}

/// The attributes of a primitive, one Gaussian per vertex.
fn attributes(primitive: &Primitive, buffers: &Buffers<'_>, name: &SourceName) -> Result<CloudArrays, ReadError> {
    let missing = |what: &str| ReadError::malformed(format!("the attribute `{what}`"), "present", "missing", name);
    let own = |what: &str, components: usize| {
        buffers.table(primitive.attribute(what).ok_or_else(|| missing(what))?, what, components)
    };
    let position = *primitive.attributes.get("POSITION").ok_or_else(|| missing("POSITION"))?;
    let positions = buffers.table(position, "POSITION", 3)?;
    let (rotations, scales, opacities) = (own("ROTATION", 4)?, own("SCALE", 3)?, own("OPACITY", 1)?);
    let mut harmonics: Vec<Table<'_>> = vec![own("SH_DEGREE_0_COEF_0", 3)?];
    let mut degree = 0;
    for l in 1..=sh::MAX_DEGREE {
        if primitive.attribute(&format!("SH_DEGREE_{l}_COEF_0")).is_none() {
            break;
        }
        for n in 0..=2 * l {
            harmonics.push(own(&format!("SH_DEGREE_{l}_COEF_{n}"), 3)?);
        }
        degree = l;
    }
    let count = positions.count;
    for table in [&rotations, &scales, &opacities].into_iter().chain(&harmonics) {
        if table.count != count {
            let expected = count.to_string();
            return Err(ReadError::malformed("the length of an attribute", expected, table.count.to_string(), name));
        }
    }
    if u32::try_from(count).is_err() {
        return Err(ReadError::malformed("the number of Gaussians", "a 32-bit number", count.to_string(), name));
    }
    let stride = 3 * harmonics.len();
    let mut arrays = CloudArrays {
        means: zeroed_vec::<Vec3>(count),
        log_scales: zeroed_vec::<Vec3>(count),
        rotations: zeroed_vec::<Quat>(count),
        opacity_logits: zeroed_vec::<f32>(count),
        sh_degree: degree,
        sh: zeroed_vec::<f32>(count * stride),
        ..CloudArrays::default()
    };
    let columns = (
        arrays.means.par_chunks_mut(BLOCK),
        arrays.log_scales.par_chunks_mut(BLOCK),
        arrays.rotations.par_chunks_mut(BLOCK),
        arrays.opacity_logits.par_chunks_mut(BLOCK),
        arrays.sh.par_chunks_mut(stride * BLOCK),
    );
    columns.into_par_iter().enumerate().for_each(|(block, (means, log_scales, turns, logits, sh))| {
        let first = block * BLOCK;
        for k in 0..means.len() {
            means[k] = Vec3::from_array(positions.get(first + k));
            let scale: [f32; 3] = scales.get(first + k);
            log_scales[k] = Vec3::from_array(scale.map(|s| if s < LEAST_SCALE { LEAST_SCALE } else { s }.ln()));
            turns[k] = Quat::from_array(rotations.get(first + k));
            let [alpha] = opacities.get(first + k);
            logits[k] = logit(alpha);
        }
        for (at, table) in harmonics.iter().enumerate() {
            for (k, out) in sh.chunks_exact_mut(stride).enumerate() {
                out[3 * at..3 * at + 3].copy_from_slice(&table.get::<3>(first + k));
            }
        }
    });
    Ok(arrays)
}

fn logit(alpha: f32) -> f32 {
    let alpha = f64::from(alpha);
    let alpha = if alpha <= 0.0 { ALPHA_EDGE } else { alpha };
    let alpha = if alpha >= 1.0 { 1.0 - ALPHA_EDGE } else { alpha };
    (alpha / (1.0 - alpha)).ln() as f32
}

/// Moves the Gaussians of a mesh to their place, in the axes of the arrays.
fn place(
    arrays: &mut CloudArrays,
    instance: &Instance,
    name: &SourceName,
    report: &mut ReadReport,
) -> Result<(), ReadError> {
    let axes = DMat3::from_diagonal(RDF_FROM_LUF);
    let m = axes * DMat3::from_mat4(instance.world);
    let translation = axes * instance.world.w_axis.truncate();
    let Some((rotation, scale, whole)) = similarity(m) else {
        return Err(ReadError::malformed(
            "the transform of a node",
            "one that keeps volumes",
            "a flattening one",
            name,
        ));
    };
    let means = (!whole).then(|| arrays.means.clone());
    let matrix = Mat3::from_cols(rotation.x_axis.as_vec3(), rotation.y_axis.as_vec3(), rotation.z_axis.as_vec3());
    turn::apply(arrays, matrix, scale as f32, translation.as_vec3());
    if let Some(means) = means {
        for (out, mean) in arrays.means.iter_mut().zip(means) {
            *out = (m * mean.as_dvec3() + translation).as_vec3();
        }
        report.notes.push(
            "a node stretches or shears its Gaussians; places are exact, shapes are only turned and scaled".to_owned(),
        );
    }
    Ok(())
}

/// Puts the Gaussians of `more` behind those of `whole`; missing bands of harmonics are zero.
fn append(whole: &mut CloudArrays, mut more: CloudArrays) {
    let degree = whole.sh_degree.max(more.sh_degree);
    for arrays in [&mut *whole, &mut more] {
        let (old, new) = (3 * sh::coefficient_count(arrays.sh_degree), 3 * sh::coefficient_count(degree));
        if old != new {
            let mut wider = zeroed_vec::<f32>(arrays.means.len() * new);
            for (out, values) in wider.chunks_exact_mut(new).zip(arrays.sh.chunks_exact(old)) {
                out[..old].copy_from_slice(values);
            }
            arrays.sh = wider;
            arrays.sh_degree = degree;
        }
    }
    whole.means.append(&mut more.means);
    whole.log_scales.append(&mut more.log_scales);
    whole.rotations.append(&mut more.rotations);
    whole.opacity_logits.append(&mut more.opacity_logits);
    whole.sh.append(&mut more.sh);
    whole.source.antialiased |= more.source.antialiased;
}
