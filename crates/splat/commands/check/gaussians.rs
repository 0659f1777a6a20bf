//! Tests of single Gaussians.

use rayon::prelude::*;
use splat_core::glam::Quat;
use splat_core::{NO_NEIGHBOUR, sh};

use super::super::info::short;
use super::findings::{Finding, Look};

/// Distance from the middle, in radii of the bulk, beyond which a Gaussian is lost.
const FAR: f32 = 100.0;
/// Fewer Gaussians than this have no bulk that others could be outside of.
const BULK: usize = 10;

pub(super) fn not_finite(look: &Look) -> Option<Finding> {
    Finding::drop(look.ids(|i| !look.cloud.drawable(i)), "values are NaN or infinite")
}

pub(super) fn bad_colors(look: &Look) -> Option<Finding> {
    let stride = look.cloud.sh_stride();
    let bad = |c: &&[f32]| c.iter().any(|v| !v.is_finite());
    let count = look.cloud.sh().par_chunks_exact(stride).filter(bad).count();
    Finding::change(count, "SH coefficients are NaN or infinite", |arrays| {
        let bad = arrays.sh.iter_mut().filter(|v| !v.is_finite());
        let changed = bad.map(|v| *v = 0.0).count();
        format!("set {changed} coefficients to 0")
    })
}

fn zero(q: Quat) -> bool {
    let length = q.length_squared();
    // NaN and infinity are another check's.
    length <= 1e-24
}

pub(super) fn zero_rotations(look: &Look) -> Option<Finding> {
    let count = look.ids(|i| zero(look.cloud.rotations()[i])).len();
    Finding::change(count, "rotations are 0 0 0 0", |arrays| {
        let bad = arrays.rotations.iter_mut().filter(|q| zero(**q));
        format!("made {} rotations the identity", bad.map(|q| *q = Quat::IDENTITY).count())
    })
}

pub(super) fn unused_sh(look: &Look) -> Option<Finding> {
    let cloud = look.cloud;
    let (degree, stride) = (cloud.sh_degree(), cloud.sh_stride());
    let highest = |c: &[f32]| c.iter().rposition(|&v| v != 0.0).map_or(0, |k| k / 3);
    let coefficient = cloud.sh().par_chunks_exact(stride).map(highest).max()?;
    let used = (0..=degree).find(|&d| coefficient < sh::coefficient_count(d)).unwrap_or(degree);
    let count = if used < degree { cloud.len() } else { 0 };
    Finding::change(count, format!("SH degree is {degree}, above {used} every coefficient is 0"), move |arrays| {
        let kept = 3 * sh::coefficient_count(used);
        arrays.sh = arrays.sh.chunks_exact(stride).flat_map(|c| &c[..kept]).copied().collect();
        arrays.sh_degree = used;
        arrays.source.layout = None;
        format!("left out SH above degree {used}")
    })
}

pub(super) fn transparent(look: &Look) -> Option<Finding> {
    let ids = look.ids(|i| look.cloud.opacity(i) < 1.0 / 255.0);
    Finding::drop(ids, "opacities are below 1/255 and never seen")
}

pub(super) fn duplicates(look: &Look) -> Option<Finding> {
    let cloud = look.cloud;
    // Bits, not values: equal means equal, and NaN may sit anywhere.
    let key = |i: u32| {
        let i = i as usize;
        let (m, s, q) = (cloud.means()[i], cloud.log_scales()[i], cloud.rotations()[i]);
        let values = [m.x, m.y, m.z, s.x, s.y, s.z, q.x, q.y, q.z, q.w, cloud.opacity_logits()[i]];
        values.map(f32::to_bits)
    };
    let colors = |i: u32| cloud.sh_of(i as usize).iter().map(|v| v.to_bits());
    let mut order: Vec<u32> = (0..cloud.len() as u32).collect();
    order.par_sort_unstable_by(|&a, &b| {
        let first = cloud.means()[a as usize].x.to_bits().cmp(&cloud.means()[b as usize].x.to_bits());
        first.then_with(|| key(a).cmp(&key(b))).then_with(|| colors(a).cmp(colors(b))).then(a.cmp(&b))
    });
    let same = |a: u32, b: u32| key(a) == key(b) && colors(a).eq(colors(b));
    let mut ids: Vec<u32> = order.windows(2).filter(|w| same(w[0], w[1])).map(|w| w[1]).collect();
    ids.sort_unstable();
    Finding::drop(ids, "an earlier Gaussian is the same in every value")
}

pub(super) fn far(look: &Look) -> Option<Finding> {
    let (center, radius) = look.bulk.filter(|_| look.cloud.len() >= BULK)?;
    let far = |i: usize| look.cloud.means()[i].distance(center) > FAR * radius;
    Finding::drop(look.ids(far), format!("lie beyond {FAR} times the bulk's radius of {}", short(radius)))
}

pub(super) fn giants(look: &Look) -> Option<Finding> {
    let (_, radius) = look.bulk.filter(|_| look.cloud.len() >= BULK)?;
    let giant = |i: usize| look.cloud.drawable(i) && look.cloud.scale(i).max_element() > radius;
    Finding::drop(
        look.ids(giant),
        format!("a standard deviation is larger than the bulk's radius of {}", short(radius)),
    )
}

/// A Gaussian is a floater where its neighbours are much farther away than neighbours are in this capture, and too far
/// away for its own size and theirs: nothing it could be a surface with.
pub(super) fn floaters(look: &Look) -> Option<Finding> {
    let cloud = look.cloud;
    if cloud.len() < 100 {
        return None;
    }
    let neighbours = look.neighbours();
    let middle = |i: usize| neighbours.of(i).1[super::findings::NEIGHBOURS / 2];
    let mut distances: Vec<f32> = (0..cloud.len()).map(middle).filter(|d| d.is_finite()).collect();
    if distances.is_empty() {
        return None;
    }
    let at = (distances.len() - 1) / 2;
    let usual = *distances.select_nth_unstable_by(at, f32::total_cmp).1;
    let reach = |i: usize| 3.0 * cloud.scale(i).max_element();
    let alone = |i: usize| {
        let (ids, distances) = neighbours.of(i);
        let apart = |(&j, &d): (&u32, &f32)| j == NO_NEIGHBOUR || d > reach(i) + reach(j as usize);
        // More than half of the neighbours are out of reach.
        let lonely = ids.iter().zip(distances).filter(|&(j, d)| apart((j, d))).count() > ids.len() / 2;
        cloud.drawable(i) && middle(i) > 10.0 * usual && lonely
    };
    let ids: Vec<u32> = (0..cloud.len()).into_par_iter().filter(|&i| alone(i)).map(|i| i as u32).collect();
    Finding::drop(ids, format!("neighbours are more than 10 times the usual {} away", short(usual)))
}
