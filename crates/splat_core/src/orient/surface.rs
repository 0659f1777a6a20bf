//! The plane of a surface that somebody selected: [`surface_plane`].

use glam::Vec3;
use rayon::prelude::*;

use super::Floor;
use super::floor::{APART, FloorSettings, RIVAL, Random, draw, grains, least_squares, measure, spread};
use super::weights;
use crate::{Cloud, Selection};

/// What is told about the plane of a selected surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The plane; shares are of the selected area, and `below` is what of it lies clearly under the plane.
    pub plane: Floor,
    /// Shares of the rest of the capture clearly above and below the plane, each 0..=1; 0 where everything is selected.
    pub rest: (f32, f32),
    /// Whether neither `up` nor the rest of the capture says which side is up.
    pub side_ambiguous: bool,
}

/// The plane that most of the selected Gaussians lie on; `None` if fewer than three can be drawn or they lie on a line.
///
/// Planes through three opaque Gaussians of the selection, drawn at random; the one with the most area on it wins, and is refined
/// by least squares: what was selected along with the surface does not tilt it. Of its sides the one within 60 degrees of `up` (a
/// unit vector) is up; if there is none, the one with more of the rest of the capture.
///
/// # Panics
/// If the selection belongs to a cloud of another length.
pub fn surface_plane(cloud: &Cloud, selection: &Selection, up: Vec3, settings: &FloorSettings) -> Option<Surface> {
    assert!(selection.len() == cloud.len(), "a selection of another cloud");
    let grains = grains(cloud, Some(selection));
    let reach = spread(&grains)?;
    let tolerance = settings.tolerance * reach;
    let least = settings.angle.cos();
    let mut random = Random(settings.seed);
    let draws: Vec<[usize; 3]> = (0..settings.draws).map(|_| draw(&grains, &mut random)).collect();
    let plane = |normal: Vec3, offset: f32| {
        let (on, _, below) = measure(&grains, normal, offset, tolerance, least);
        Floor { normal, offset, share: on as f32, below: below as f32, rival: None }
    };
    let mut found: Vec<(usize, Floor)> = draws
        .par_iter()
        .enumerate()
        .filter_map(|(k, &[a, b, c])| {
            let (a, b, c) = (grains[a].mean, grains[b].mean, grains[c].mean);
            let across = (b - a).cross(c - a);
            // A sliver of a triangle is no plane.
            if !(across.length() > 1e-4 * reach * reach) {
                return None;
            }
            let normal = across.normalize();
            Some((k, plane(normal, normal.dot(a))))
        })
        .filter(|(_, floor)| floor.share > 0.0)
        .collect();
    found.sort_by(|a, b| b.1.share.total_cmp(&a.1.share).then(a.0.cmp(&b.0)));
    let mut best = found.first()?.1;
    for reach in [3.0, 2.0, 1.0, 1.0] {
        let Some((normal, offset)) = least_squares(&grains, &best, reach * tolerance, least) else { break };
        let next = plane(normal, offset);
        if next.share >= 0.98 * best.share {
            best = next;
        }
    }
    let other = |(_, floor): &&(usize, Floor)| floor.normal.dot(best.normal).abs() < APART;
    let rival = found.iter().find(other).map(|(_, p)| (p.normal, p.share)).filter(|p| p.1 >= RIVAL * best.share);

    let (mut above, mut below) = (0.0f64, 0.0f64);
    let weights = weights(cloud, None);
    let total: f64 = (0..cloud.len()).filter(|&i| !selection.contains(i)).map(|i| weights[i]).sum();
    for i in (0..cloud.len()).filter(|&i| !selection.contains(i) && weights[i] > 0.0) {
        let height = best.normal.dot(cloud.means()[i]) - best.offset;
        if height > 5.0 * tolerance {
            above += weights[i];
        } else if height < -5.0 * tolerance {
            below += weights[i];
        }
    }
    let share = |part: f64| if total > 0.0 { (part / total) as f32 } else { 0.0 };
    let (above, below) = (share(above), share(below));
    let along = best.normal.dot(up);
    let (turned, side_ambiguous) = if along.abs() > 0.5 {
        (along < 0.0, false)
    } else if above.max(below) >= 2.0 * above.min(below) && above.max(below) > 0.0 {
        (below > above, false)
    } else {
        (along < 0.0, true)
    };
    let (on, higher, lower) = measure(&grains, best.normal, best.offset, tolerance, least);
    let facing = if turned {
        Floor { normal: -best.normal, offset: -best.offset, share: on as f32, below: higher as f32, rival }
    } else {
        Floor { share: on as f32, below: lower as f32, rival, ..best }
    };
    let rest = if turned { (below, above) } else { (above, below) };
    Some(Surface { plane: facing, rest, side_ambiguous })
}
