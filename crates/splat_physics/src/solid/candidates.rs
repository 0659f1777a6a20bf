//! Which Gaussians of a part say where its surface is.

use glam::{DMat3, DVec3};
use splat_core::Cloud;

use super::SolidError;

/// Fewer Gaussians have no shape.
const LEAST_SPLATS: usize = 50;
/// Less opaque ones are haze.
const LEAST_OPACITY: f32 = 0.1;
/// Larger ones, in parts of the diagonal, are background or monsters.
const LARGEST: f64 = 0.25;
/// Share of centres on each side of each axis that do not decide where the part ends.
const TAIL: f64 = 0.005;

/// A Gaussian that counts, in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    /// Position in the part's list.
    pub(super) position: u32,
    pub(super) mean: DVec3,
    /// Axes scaled by the standard deviations along them, longest first.
    pub(super) axes: DMat3,
    /// Standard deviations, falling.
    pub(super) sizes: DVec3,
    pub(super) opacity: f64,
}

/// What counts, and the box that all but the tails of its centres lie in.
pub(super) struct Candidates {
    pub(super) list: Vec<Candidate>,
    pub(super) least: DVec3,
    pub(super) most: DVec3,
}

pub(super) fn candidates(cloud: &Cloud, ids: &[u32], metres_per_unit: f64) -> Result<Candidates, SolidError> {
    if let Some(&id) = ids.iter().find(|&&id| id as usize >= cloud.len()) {
        return Err(SolidError::UnknownGaussian { id, len: cloud.len() });
    }
    let candidate = |(position, &id): (usize, &u32)| {
        let id = id as usize;
        let opacity = cloud.opacity(id);
        let mean = cloud.means()[id].as_dvec3() * metres_per_unit;
        let sizes = cloud.log_scales()[id].as_dvec3().exp() * metres_per_unit;
        let usable = cloud.drawable(id) && opacity >= LEAST_OPACITY && mean.is_finite() && sizes.is_finite();
        if !usable || sizes.max_element() <= 0.0 {
            return None;
        }
        let turn = DMat3::from_quat(cloud.rotations()[id].as_dquat().normalize());
        if !turn.is_finite() {
            return None;
        }
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| sizes[b].total_cmp(&sizes[a]));
        let sizes_falling = DVec3::new(sizes[order[0]], sizes[order[1]], sizes[order[2]]);
        let axis = |k: usize| turn.col(order[k]) * sizes[order[k]];
        let axes = DMat3::from_cols(axis(0), axis(1), axis(2));
        Some(Candidate { position: position as u32, mean, axes, sizes: sizes_falling, opacity: f64::from(opacity) })
    };
    let mut list: Vec<Candidate> = ids.iter().enumerate().filter_map(candidate).collect();
    let enough = |list: &[Candidate]| match list.len() {
        have if have < LEAST_SPLATS => Err(SolidError::TooFewSplats { have, need: LEAST_SPLATS }),
        _ => Ok(()),
    };
    enough(&list)?;
    let (least, most) = tails(&list);
    let diagonal = (most - least).length();
    // A part that is one point has no diagonal to compare with: then sizes decide by themselves.
    if diagonal > 0.0 {
        list.retain(|c| c.sizes.x <= LARGEST * diagonal);
        enough(&list)?;
    }
    let (least, most) = tails(&list);
    // Where Gaussians end, not where their centres do.
    let mut sizes: Vec<f64> = list.iter().map(|c| c.sizes.x).collect();
    sizes.sort_by(f64::total_cmp);
    let grow = 2.0 * sizes[sizes.len() / 2];
    Ok(Candidates { list, least: least - grow, most: most + grow })
}

/// The box of all centres but the tails.
fn tails(list: &[Candidate]) -> (DVec3, DVec3) {
    let (mut least, mut most) = (DVec3::ZERO, DVec3::ZERO);
    let cut = (list.len() as f64 * TAIL) as usize;
    for axis in 0..3 {
        let mut values: Vec<f64> = list.iter().map(|c| c.mean[axis]).collect();
        values.sort_by(f64::total_cmp);
        least[axis] = values[cut];
        most[axis] = values[values.len() - 1 - cut];
    }
    (least, most)
}

