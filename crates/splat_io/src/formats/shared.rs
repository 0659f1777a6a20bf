//! Conversions that several quantising formats share.

use glam::Quat;
use splat_core::Cloud;

/// Smallest distance of a stored opacity from 0 and 1: bytes 0 and 255 would be infinite logits.
const ALPHA_EDGE: f64 = 1e-6;

/// Logit of every opacity byte `b / 255`, kept finite.
pub(crate) fn logit_of_byte() -> [f32; 256] {
    std::array::from_fn(|b| {
        let alpha = (b as f64 / 255.0).clamp(ALPHA_EDGE, 1.0 - ALPHA_EDGE);
        (alpha / (1.0 - alpha)).ln() as f32
    })
}

/// Opacity as the nearest byte; 0 for Gaussians that cannot be drawn, so that no reader shows them.
pub(crate) fn alpha_byte(cloud: &Cloud, i: usize) -> u8 {
    if cloud.drawable(i) { unit_byte(cloud.opacity(i)) } else { 0 }
}

/// A number in 0..=1 as the nearest byte; NaN becomes 0.
pub(crate) fn unit_byte(v: f32) -> u8 {
    (v * 255.0 + 0.5) as u8
}

/// A finite number; NaN and infinities become `other`.
pub(crate) fn finite_or(v: f32, other: f32) -> f32 {
    if v.is_finite() { v } else { other }
}

/// Components of a unit rotation in the order w, x, y, z, and the place of the largest; the identity for one without
/// direction.
pub(crate) fn wxyz(q: Quat) -> ([f32; 4], usize) {
    let length = q.length();
    let q = if length > 1e-12 && length.is_finite() { q / length } else { Quat::IDENTITY };
    let c = [q.w, q.x, q.y, q.z];
    let mut largest = 0;
    for k in 1..4 {
        if c[k].abs() > c[largest].abs() {
            largest = k;
        }
    }
    (c, largest)
}

/// Sentences about what a format without extras, comments or high SH degrees cannot hold.
pub(crate) fn usual_losses(cloud: &Cloud, highest_degree: u8) -> Vec<String> {
    let mut losses = Vec::new();
    if cloud.sh_degree() > highest_degree {
        losses.push(match highest_degree {
            0 => "view-dependent colour (spherical harmonics) was left out".to_owned(),
            d => format!("spherical harmonics above degree {d} were left out"),
        });
    }
    if !cloud.extras().is_empty() {
        let names: Vec<&str> = cloud.extras().iter().map(|e| e.name.as_str()).collect();
        losses.push(format!("extra properties were left out: {}", names.join(", ")));
    }
    let hidden = (0..cloud.len()).filter(|&i| !cloud.drawable(i)).count();
    if hidden > 0 {
        losses.push(format!("{hidden} Gaussians with NaN or infinite values became invisible ones"));
    }
    losses
}
