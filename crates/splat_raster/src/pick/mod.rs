//! What lies under one pixel, without drawing a frame: the hit that [`Rasterizer::first_hits`](crate::Rasterizer::first_hits)
//! names there, with position and normal.
//!
//! A [`PickIndex`] of a cloud finds the few hundred Gaussians near a pixel's ray; they are projected and blended by the same
//! code as those of a frame. Without an index every Gaussian is projected: some ten milliseconds for 600 k, and the same answer.

mod index;

pub use index::PickIndex;

use std::sync::Arc;

use glam::{DVec3, Mat3, Vec2, Vec3};
use splat_core::{Cloud, View};

use crate::cpu::{LEAST_TRANSMITTANCE, Sample, samples};
use crate::{Instance, RasterError, Scene};

/// Where to pick, and what counts as a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PickQuery {
    /// A point of the picture; the hit is that of the centre of its pixel.
    pub pixel: Vec2,
    /// The hit is the Gaussian at which T first falls to `1 - tau` or below.
    pub tau: f32,
    /// Camera z at and beyond which nothing is hit, such as that of a mesh.
    pub limit: f32,
}

impl PickQuery {
    /// The first solid hit: tau 0.5, no limit.
    pub fn at(pixel: Vec2) -> Self {
        Self { pixel, tau: 0.5, limit: f32::INFINITY }
    }
}

/// What lies under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Scene-wide id.
    pub id: u32,
    /// Which instance of the scene.
    pub instance: usize,
    /// Id in that instance's cloud.
    pub gaussian: u32,
    /// Camera z of the Gaussian's mean.
    pub depth: f32,
    /// Where the ray is deepest inside the Gaussian, in the scene's space: the peak of its density along the ray.
    pub position: Vec3,
    /// Unit normal towards the camera, in the scene's space: the shortest axes of all that is blended up to the hit, by weight.
    pub normal: Vec3,
    /// The hit's weight at the pixel, `alpha T`.
    pub weight: f32,
}

/// Picks at a pixel; `indices` has that of each instance's cloud, in order, or fewer: what has none is searched through.
///
/// # Errors
/// As [`Rasterizer::draw`](crate::Rasterizer::draw), and [`RasterError::Length`] for an index of another cloud.
pub fn pick(
    scene: &Scene,
    indices: &[Option<&PickIndex>],
    view: &View,
    query: PickQuery,
) -> Result<Option<Pick>, RasterError> {
    crate::cpu::check(scene, view, &crate::Outputs::default())?;
    if !view.contains(query.pixel) {
        return Ok(None);
    }
    let pixel = query.pixel.floor() + 0.5;
    // Camera z, scene-wide id, instance, Gaussian, alpha.
    let mut found: Vec<(f32, u32, usize, u32, f32)> = Vec::new();
    let mut first = 0u32;
    for (k, instance) in scene.instances.iter().enumerate() {
        let candidates = match indices.get(k).copied().flatten() {
            Some(index) => Some(candidates(index, instance, view, pixel)?),
            None => None,
        };
        let id_of = |gaussian: u32| match &instance.subset {
            Some(ids) => ids.binary_search(&gaussian).map_or(0, |position| position as u32),
            None => gaussian,
        };
        let mut add = |Sample { z, alpha, .. }: Sample, gaussian: u32| {
            if z < query.limit {
                found.push((z, first + id_of(gaussian), k, gaussian, alpha));
            }
        };
        match candidates {
            Some(ids) => {
                let near = Instance { subset: Some(Arc::clone(&ids)), tint: None, ..instance.clone() };
                for sample in samples(&near, view, pixel.into()) {
                    add(sample, ids[sample.position as usize]);
                }
            }
            None => {
                for sample in samples(instance, view, pixel.into()) {
                    // Positions come from the instance itself.
                    add(sample, instance.cloud_id(sample.position as usize).unwrap_or_default());
                }
            }
        }
        first += instance.len() as u32;
    }
    found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));

    let (mut transmittance, mut normal) = (1.0f32, Vec3::ZERO);
    for (z, id, k, gaussian, alpha) in found {
        let after = transmittance - alpha * transmittance;
        if after < LEAST_TRANSMITTANCE {
            break;
        }
        let weight = alpha * transmittance;
        let instance = &scene.instances[k];
        normal += weight * shortest_axis(instance, gaussian, view, z, pixel);
        if after <= 1.0 - query.tau.max(1e-3) {
            let depth = peak(instance, gaussian, view, pixel).unwrap_or(z);
            let position = view.unproject(pixel, depth);
            let normal = normal.try_normalize().unwrap_or(-view.forward());
            return Ok(Some(Pick { id, instance: k, gaussian, depth: z, position, normal, weight }));
        }
        transmittance = after;
    }
    Ok(None)
}

/// Gaussians of the instance that may count at the pixel, rising.
fn candidates(index: &PickIndex, instance: &Instance, view: &View, pixel: Vec2) -> Result<Arc<[u32]>, RasterError> {
    if index.len() != instance.cloud.len() {
        return Err(RasterError::Length { what: "index", found: index.len(), expected: instance.cloud.len() });
    }
    let mut ids = index.near(instance, view, pixel);
    if let Some(subset) = &instance.subset {
        ids.retain(|id| subset.binary_search(id).is_ok());
    }
    Ok(ids.into())
}

/// The axis along which the Gaussian is thinnest, turned to the camera.
fn shortest_axis(instance: &Instance, gaussian: u32, view: &View, z: f32, pixel: Vec2) -> Vec3 {
    let (cloud, i): (&Cloud, _) = (&instance.cloud, gaussian as usize);
    let l = cloud.log_scales()[i];
    let axis = if l.x <= l.y && l.x <= l.z {
        Vec3::X
    } else if l.y <= l.z {
        Vec3::Y
    } else {
        Vec3::Z
    };
    let mut axis = cloud.rotation(i) * axis;
    if let Some(deformation) = &instance.deformation {
        // As normals go: by the inverse transposed, up to a factor.
        let f = deformation.at(cloud.means()[i]).gradient;
        let cofactors = Mat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis));
        axis = (cofactors * axis).try_normalize().unwrap_or(axis);
    }
    let axis = instance.transform.rotation_matrix() * axis;
    let ray = view.unproject(pixel, z) - view.unproject(pixel, 0.0);
    if axis.dot(ray) > 0.0 { -axis } else { axis }
}

/// Camera z of the Gaussian's peak along the pixel's ray: `(r^T S^-1 (mu - o)) / (r^T S^-1 r)` for covariance S.
fn peak(instance: &Instance, gaussian: u32, view: &View, pixel: Vec2) -> Option<f32> {
    let (cloud, i): (&Cloud, _) = (&instance.cloud, gaussian as usize);
    let to_cloud = instance.transform.inverse();
    let origin = to_cloud.apply(view.unproject(pixel, 0.0)).as_dvec3();
    let ray = to_cloud.apply(view.unproject(pixel, 1.0)).as_dvec3() - origin;
    let scale = cloud.scale(i).as_dvec3();
    // No axis is so thin that its square vanishes beside the longest one's.
    let scale = scale.max(DVec3::splat(1e-6 * scale.max_element()));
    let mut axes = Mat3::from_quat(cloud.rotation(i)).transpose().as_dmat3();
    let mut mean = cloud.means()[i];
    if let Some(deformation) = &instance.deformation {
        // The inverse of F S F^T is that of S, seen through the inverse of F.
        let local = deformation.at(mean);
        mean = local.position;
        axes *= local.gradient.as_dmat3().inverse();
    }
    let along = axes * ray / scale;
    let to_mean = axes * (mean.as_dvec3() - origin) / scale;
    let z = (along.dot(to_mean) / along.length_squared()) as f32;
    (z.is_finite() && z > view.near).then_some(z)
}
