//! Tests of the file as a whole: values that mean something else than its format says.
//!
//! Each of these would be a strange coincidence in a healthy file, and is repaired by reading the values as what they are.

use rayon::prelude::*;
use splat_core::glam::Vec3;
use splat_core::orient::{self, FloorSettings};
use splat_core::sh;

use super::findings::{Finding, Look, Repair};
use crate::camera::up_of;

/// Fewer Gaussians than this are no evidence for a convention.
const EVIDENCE: usize = 50;

pub(super) fn empty(look: &Look) -> Option<Finding> {
    look.cloud.is_empty().then(|| Finding {
        count: 0,
        what: "the capture has no Gaussians".to_owned(),
        repair: Repair::Nothing,
    })
}

/// Share of finite `values` for which a test holds; 0 without enough of them.
fn share(values: impl ParallelIterator<Item = f32>, test: impl Fn(f32) -> bool + Sync) -> f64 {
    let (all, hits) = values
        .filter(|v| v.is_finite())
        .map(|v| (1usize, usize::from(test(v))))
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    if all < EVIDENCE { 0.0 } else { hits as f64 / all as f64 }
}

/// Lengths are positive and small; as logarithms they make Gaussians of one unit and more, all about as large as each other.
pub(super) fn linear_scales(look: &Look) -> Option<Finding> {
    let (_, radius) = look.bulk?;
    let flat = || look.cloud.log_scales().par_iter().flat_map_iter(|s| s.to_array());
    // Below e^0 = 1 nothing is left, and one unit is no small part of the capture.
    let positive = share(flat(), |v| v >= 0.0);
    let small = share(flat(), |v| v < 0.5 * radius.max(1.0));
    let suspicious = look.cloud.len() >= EVIDENCE && positive > 0.999 && small > 0.99 && radius < 50.0;
    let count = if suspicious { look.cloud.len() } else { 0 };
    Finding::change(count, "every scale is stored as a length, not as its logarithm", |arrays| {
        for s in &mut arrays.log_scales {
            *s = s.max(Vec3::splat(1e-9)).map(f32::ln);
        }
        "took the logarithms of all scales".to_owned()
    })
}

/// Shares lie from 0 to 1; as logits they make opacities from 0.5 to 0.73.
pub(super) fn linear_opacity(look: &Look) -> Option<Finding> {
    let logits = look.cloud.opacity_logits();
    let inside = share(logits.par_iter().copied(), |v| (0.0..=1.0).contains(&v));
    // A cloud made in code may have one opacity for all.
    let varied = logits.iter().any(|&v| v != logits[0]);
    let count = if inside > 0.9999 && varied { logits.len() } else { 0 };
    Finding::change(count, "every opacity is stored as a share from 0 to 1, not as a logit", |arrays| {
        for v in &mut arrays.opacity_logits {
            let a = v.clamp(1e-6, 1.0 - 1e-6);
            *v = (a / (1.0 - a)).ln();
        }
        "turned all opacities into logits".to_owned()
    })
}

/// Colours from 0 to 1 (or 255) are never negative; as coefficients they make only pale colours, from grey up.
pub(super) fn plain_colors(look: &Look) -> Option<Finding> {
    let cloud = look.cloud;
    let stride = cloud.sh_stride();
    let dc = || cloud.sh().par_chunks_exact(stride).flat_map_iter(|c| [c[0], c[1], c[2]]);
    let positive = share(dc(), |v| v >= 0.0);
    let up_to_one = share(dc(), |v| v <= 1.0);
    let up_to_byte = share(dc(), |v| v <= 255.0);
    let varied = cloud.len() > 1 && (1..cloud.len()).any(|i| cloud.sh_of(i)[..3] != cloud.sh_of(0)[..3]);
    let full = match (up_to_one, up_to_byte) {
        (one, _) if one > 0.9999 => 1.0,
        // Values above 10 do not occur in trained coefficients.
        (_, byte) if byte > 0.9999 && share(dc(), |v| v > 10.0) > 0.5 => 255.0,
        _ => return None,
    };
    // A real scene of light colours only is possible, so nearly all evidence has to agree.
    let count = if positive > 0.9999 && varied && darkest_is_dark(look, full) { cloud.len() } else { 0 };
    Finding::change(
        count,
        format!("every colour is stored from 0 to {full}, not as an SH coefficient"),
        move |arrays| {
            let stride = 3 * sh::coefficient_count(arrays.sh_degree);
            for c in arrays.sh.chunks_exact_mut(stride) {
                c[..3].iter_mut().for_each(|v| *v = (*v / full - 0.5) / sh::C0);
            }
            "turned all colours into SH coefficients".to_owned()
        },
    )
}

/// Whether, read as plain colours, there are dark and light ones: a light scene, rightly stored, has no near-zero coefficients only.
fn darkest_is_dark(look: &Look, full: f32) -> bool {
    let stride = look.cloud.sh_stride();
    let mut first: Vec<f32> =
        look.cloud.sh().chunks_exact(stride).map(|c| c[0] / full).filter(|v| v.is_finite()).collect();
    first.sort_unstable_by(f32::total_cmp);
    let at = |share: f32| first[((first.len() - 1) as f32 * share) as usize];
    !first.is_empty() && at(0.99) - at(0.01) > 0.2
}

/// The floor, where there is one beyond doubt, tells what is up; most programs expect the file's own axes to say the same.
pub(super) fn tilted(look: &Look) -> Option<Finding> {
    if look.cloud.len() < 20 * EVIDENCE {
        return None;
    }
    let up = up_of(look.cloud);
    let floor = orient::floor_plane(look.cloud, None, up, &FloorSettings::default())?;
    let degrees = floor.normal.angle_between(up).to_degrees();
    (floor.rival.is_none() && floor.share > 0.1 && degrees > 10.0).then(|| Finding {
        count: look.cloud.len(),
        what: format!("what looks like the floor is {degrees:.0} degrees off level"),
        repair: Repair::Nothing,
    })
}
