//! What a Gaussian looks like together with its neighbours: colour, surface direction, spacing.

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use splat_core::Cloud;
use splat_core::{Neighbours, color};

use super::evidence::Evidence;

/// Local features of one Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feature {
    /// Colour as seen, CIE Lab.
    pub lab: Vec3,
    /// Unit surface normal, turned to the side from which it is seen; zero where there is no direction.
    pub normal: Vec3,
    /// How sure the normal is, 0 to 1.
    pub confidence: f32,
    /// Distance to the 6th neighbour, in scene units.
    pub spacing: f32,
}

/// A Gaussian's own testimony counts like this many pixels at most, so that one large splat does not outvote its surroundings.
const OWN_PIXELS: f32 = 4.0;
/// Weight of a neighbour's testimony against a Gaussian's own.
const NEIGHBOUR_WEIGHT: f32 = 0.5;

/// Features of all Gaussians: from what the pictures show of each and its neighbours, and where they show nothing (inner
/// and hidden Gaussians) from the neighbours' base colours and shortest axes.
pub fn features(cloud: &Cloud, neighbours: &Neighbours, evidence: &Evidence) -> Vec<Feature> {
    let weight = |i: usize| (evidence.pixels[i] as f32).min(OWN_PIXELS);
    (0..cloud.len())
        .into_par_iter()
        .map(|i| {
            let (ids, distances) = neighbours.of(i);
            let ids = &ids[..ids.iter().position(|&j| j == u32::MAX).unwrap_or(ids.len())];
            let spacing = ids.len().checked_sub(1).map_or(0.0, |last| distances[last.min(5)]);
            let mut sum = weight(i);
            let mut lab = evidence.lab[i] * sum;
            let mut normal = evidence.normal[i] * sum;
            for &j in ids {
                let w = NEIGHBOUR_WEIGHT * weight(j as usize);
                sum += w;
                lab += evidence.lab[j as usize] * w;
                normal += evidence.normal[j as usize] * w;
            }
            if sum > 0.0 {
                let (lab, normal) = (lab / sum, normal / sum);
                let confidence = normal.length().min(1.0);
                return Feature { lab, normal: normal.normalize_or_zero(), confidence, spacing };
            }
            hidden(cloud, i, ids, spacing)
        })
        .collect()
}

/// Features of a Gaussian that no picture shows: opacity-weighted base colour and main direction of the shortest axes.
fn hidden(cloud: &Cloud, i: usize, neighbours: &[u32], spacing: f32) -> Feature {
    let (mut lab, mut weight, mut tensor) = (Vec3::ZERO, 0.0, [0.0f32; 6]);
    for j in std::iter::once(i).chain(neighbours.iter().map(|&j| j as usize)) {
        if !cloud.drawable(j) {
            continue;
        }
        let opacity = cloud.opacity(j);
        lab += color::lab_from_srgb(cloud.base_color(j).clamp(Vec3::ZERO, Vec3::ONE)) * opacity;
        weight += opacity;
        let a = shortest_axis(cloud, j) * opacity.max(0.0).sqrt();
        for (t, v) in tensor.iter_mut().zip([a.x * a.x, a.y * a.y, a.z * a.z, a.x * a.y, a.x * a.z, a.y * a.z]) {
            *t += v;
        }
    }
    let (normal, confidence) = main_direction(&tensor);
    let lab = if weight > 1e-9 { lab / weight } else { Vec3::new(50.0, 0.0, 0.0) };
    // Its sign is unknown, and so whether an edge is concave: it must not speak as loud as a seen one.
    Feature { lab, normal, confidence: 0.5 * confidence, spacing }
}

/// Unit shortest axis times the square root of the flatness.
fn shortest_axis(cloud: &Cloud, i: usize) -> Vec3 {
    let log = cloud.log_scales()[i];
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| log[a].total_cmp(&log[b]));
    let flatness = 1.0 - (log[order[0]] - log[order[1]]).exp();
    Mat3::from_quat(cloud.rotation(i)).col(order[0]) * flatness.max(0.0).sqrt()
}

/// Eigenvector of the largest eigenvalue of a symmetric positive matrix (xx, yy, zz, xy, xz, yz), and how far that
/// eigenvalue stands out: 0 (no direction) to 1 (a plane). Squaring the matrix six times makes the largest one dominate.
fn main_direction(t: &[f32; 6]) -> (Vec3, f32) {
    let trace = t[0] + t[1] + t[2];
    // Written so that NaN fails.
    if !(trace > 1e-12) {
        return (Vec3::ZERO, 0.0);
    }
    let columns = [Vec3::new(t[0], t[3], t[4]), Vec3::new(t[3], t[1], t[5]), Vec3::new(t[4], t[5], t[2])];
    let m = Mat3::from_cols(columns[0], columns[1], columns[2]) * (1.0 / trace);
    let mut p = m;
    for _ in 0..6 {
        p = p * p;
        let scale = p.x_axis.x + p.y_axis.y + p.z_axis.z;
        if !(scale > 1e-30) {
            return (Vec3::ZERO, 0.0);
        }
        p *= 1.0 / scale;
    }
    let columns = [p.x_axis, p.y_axis, p.z_axis];
    let longest = columns.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let v = longest.unwrap_or(Vec3::X).normalize_or_zero();
    (v, (1.5 * v.dot(m * v) - 0.5).clamp(0.0, 1.0))
}
