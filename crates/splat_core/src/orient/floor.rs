//! The plane that everything stands on: [`floor_plane`], and what makes it level: [`upright`].

use glam::{DMat3, DVec3, Quat, Vec3};
use rayon::prelude::*;

use super::{about, eigen, weights};
use crate::{Cloud, Selection, Similarity};

/// A plane with this share of the best one's area could be the floor as well.
pub(super) const RIVAL: f32 = 0.5;
/// Planes whose normals have at least this dot product are the same (30 degrees).
pub(super) const APART: f32 = 0.866;
/// What a flat Gaussian on a plane counts whose own normal is another.
const ASKEW: f64 = 0.25;
/// Candidates for the second and third Gaussian of a draw.
const CANDIDATES: usize = 12;

/// How the floor is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorSettings {
    /// Planes through three Gaussians that are tried, 1500 by default.
    pub draws: usize,
    /// Seed of the draws.
    pub seed: u64,
    /// Distance from the plane within which a Gaussian belongs to it, as a share of the scene's radius, 0.01 by default.
    pub tolerance: f32,
    /// Largest angle between the plane's normal and that of a flat Gaussian on it, in radians, 20 degrees by default.
    pub angle: f32,
    /// Largest share of the scene that may lie clearly (five tolerances) below the floor, 0.05 by default: captures end in
    /// haze, and grass has roots.
    pub below: f32,
}

impl Default for FloorSettings {
    fn default() -> Self {
        Self { draws: 1500, seed: 1, tolerance: 0.01, angle: 20f32.to_radians(), below: 0.05 }
    }
}

/// A plane that everything stands on: `normal . x = offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// Unit vector towards the side where the scene is.
    pub normal: Vec3,
    /// Distance of the plane from the origin along the normal, in scene units.
    pub offset: f32,
    /// Share of the scene's area on the plane, 0..=1; flat Gaussians that lie askew (blades of grass) count a quarter.
    pub share: f32,
    /// Share of the scene's area clearly below it, 0..=1.
    pub below: f32,
    /// Another plane, more than 30 degrees off, that could be the floor as well: its normal, and its share.
    pub rival: Option<(Vec3, f32)>,
}

/// What a plane is tested against.
pub(super) struct Grain {
    pub(super) mean: Vec3,
    /// Direction of the shortest axis, if the Gaussian is flat.
    normal: Option<Vec3>,
    weight: f32,
}

impl Grain {
    /// Whether its own normal, if it has one, is within the angle of this cosine of a plane's.
    fn lies(&self, normal: Vec3, least: f32) -> bool {
        self.normal.is_none_or(|n| n.dot(normal).abs() >= least)
    }
}

/// Three Gaussians for a plane: any first one; the others are the best of a few for the plane that its own normal spans.
pub(super) fn draw(grains: &[Grain], random: &mut Random) -> [usize; 3] {
    let first = random.below(grains.len());
    let mut other = || {
        let candidates: [usize; CANDIDATES] = std::array::from_fn(|_| random.below(grains.len()));
        let Some(normal) = grains[first].normal else { return candidates[0] };
        // Sine of the angle out of the plane; a Gaussian makes no plane with itself.
        let out = |k: usize| {
            let d = grains[k].mean - grains[first].mean;
            let length = d.length();
            if length > 0.0 { normal.dot(d).abs() / length } else { f32::INFINITY }
        };
        candidates.into_iter().min_by(|&a, &b| out(a).total_cmp(&out(b))).unwrap_or(first)
    };
    [first, other(), other()]
}

/// The plane that the selected Gaussians (all without a selection) stand on; `None` if no plane has the scene on one side.
///
/// Planes through three opaque Gaussians, drawn at random; the one with the most area on it and hardly anything below wins, and
/// is refined by least squares. Where other planes have at least half as much (the walls of a room), the one whose normal is
/// nearest to `up` is taken and the best of the others told in [`Floor::rival`].
///
/// # Panics
/// If the selection belongs to a cloud of another length.
pub fn floor_plane(cloud: &Cloud, selection: Option<&Selection>, up: Vec3, settings: &FloorSettings) -> Option<Floor> {
    assert!(selection.is_none_or(|s| s.len() == cloud.len()), "a selection of another cloud");
    let grains = grains(cloud, selection);
    let tolerance = settings.tolerance * spread(&grains)?;
    let mut random = Random(settings.seed);
    let draws: Vec<[usize; 3]> = (0..settings.draws).map(|_| draw(&grains, &mut random)).collect();
    let least = settings.angle.cos();
    let measure = |normal: Vec3, offset: f32| measure(&grains, normal, offset, tolerance, least);
    // The side with more of the scene is above.
    let facing = |normal: Vec3, offset: f32| {
        let (on, above, below) = measure(normal, offset);
        if above >= below {
            Floor { normal, offset, share: on as f32, below: below as f32, rival: None }
        } else {
            Floor { normal: -normal, offset: -offset, share: on as f32, below: above as f32, rival: None }
        }
    };
    let mut found: Vec<(usize, Floor)> = draws
        .par_iter()
        .enumerate()
        .filter_map(|(draw, &[a, b, c])| {
            let (a, b, c) = (grains[a].mean, grains[b].mean, grains[c].mean);
            let normal = (b - a).cross(c - a).try_normalize()?;
            Some((draw, facing(normal, normal.dot(a))))
        })
        .filter(|(_, floor)| floor.below <= settings.below && floor.share > 0.0)
        .collect();
    found.sort_by(|a, b| b.1.share.total_cmp(&a.1.share).then(a.0.cmp(&b.0)));
    let refined = |rough: &Floor| {
        let mut floor = *rough;
        // A plane through three Gaussians may be askew by more than the tolerance far from them: the reach closes in.
        for reach in [3.0, 2.0, 1.0, 1.0] {
            let Some((normal, offset)) = least_squares(&grains, &floor, reach * tolerance, least) else { break };
            let next = facing(normal, offset);
            // The middle of what lies on it is worth a little; but refinement must not lose what made the plane a floor.
            if next.below <= settings.below && next.share >= 0.98 * floor.share {
                floor = next;
            }
        }
        floor
    };
    // A refinement costs as much as four measures: only a few of each direction get one.
    let enough = 0.5 * RIVAL * found.first()?.1.share;
    let mut directions: Vec<(Vec3, usize)> = Vec::new();
    found.retain(|(_, rough)| {
        let alike = |&&mut (normal, _): &&mut (Vec3, usize)| normal.dot(rough.normal) >= APART;
        match directions.iter_mut().find(alike) {
            Some((_, count)) => {
                *count += 1;
                *count <= 16 && rough.share >= enough
            }
            None => {
                directions.push((rough.normal, 1));
                rough.share >= enough
            }
        }
    });
    let mut refined: Vec<Floor> = found.par_iter().map(|(_, rough)| refined(rough)).collect();
    // The sort is stable: of equals the better rough one stays first.
    refined.sort_by(|a, b| b.share.total_cmp(&a.share));
    let enough = RIVAL * refined.first()?.share;
    let mut planes: Vec<Floor> = Vec::new();
    for plane in refined.iter().filter(|f| f.share >= enough) {
        if planes.iter().all(|p| p.normal.dot(plane.normal) < APART) {
            planes.push(*plane);
        }
    }
    // They come by falling share, and the first of equals wins.
    let mut chosen = 0;
    for k in 1..planes.len() {
        if planes[k].normal.dot(up) > planes[chosen].normal.dot(up) {
            chosen = k;
        }
    }
    let rival = planes.iter().enumerate().find(|&(k, _)| k != chosen).map(|(_, p)| (p.normal, p.share));
    Some(Floor { rival, ..planes[chosen] })
}

/// Shares of the area on a plane, clearly (five tolerances) above and clearly below it.
pub(super) fn measure(grains: &[Grain], normal: Vec3, offset: f32, tolerance: f32, least: f32) -> (f64, f64, f64) {
    let (mut on, mut above, mut below, mut total) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for g in grains {
        let (height, weight) = (normal.dot(g.mean) - offset, f64::from(g.weight));
        total += weight;
        if height.abs() <= tolerance {
            on += if g.lies(normal, least) { weight } else { ASKEW * weight };
        } else if height > 5.0 * tolerance {
            above += weight;
        } else if height < -5.0 * tolerance {
            below += weight;
        }
    }
    (on / total, above / total, below / total)
}

/// At most about 16,384 evenly spaced opaque Gaussians.
pub(super) fn grains(cloud: &Cloud, selection: Option<&Selection>) -> Vec<Grain> {
    let weights = weights(cloud, selection);
    let ids: Vec<usize> = (0..cloud.len()).filter(|&i| weights[i] > 0.0 && cloud.opacity(i) > 0.5).collect();
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let grain = |&i: &usize| {
        let scale = cloud.scale(i);
        let shortest = scale.min_position();
        let mut rest = scale.to_array();
        rest.sort_by(f32::total_cmp);
        let flat = rest[0] < 0.4 * rest[1];
        Grain {
            mean: cloud.means()[i],
            normal: flat.then(|| cloud.rotation(i) * Vec3::AXES[shortest]),
            weight: (weights[i] / largest) as f32,
        }
    };
    ids.iter().step_by((ids.len() / 16_384).max(1)).map(grain).collect()
}

/// Distance from the median within which 90 % lie; `None` of fewer than three.
pub(super) fn spread(grains: &[Grain]) -> Option<f32> {
    if grains.len() < 3 {
        return None;
    }
    let median = |k: usize| {
        let mut v: Vec<f32> = grains.iter().map(|g| g.mean[k]).collect();
        let middle = v.len() / 2;
        *v.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    let center = Vec3::new(median(0), median(1), median(2));
    let mut distances: Vec<f32> = grains.iter().map(|g| g.mean.distance(center)).collect();
    let k = (distances.len() - 1) * 9 / 10;
    Some(*distances.select_nth_unstable_by(k, f32::total_cmp).1)
}

/// Normal and offset of the plane with the least squared distances to what lies on `floor`.
pub(super) fn least_squares(grains: &[Grain], floor: &Floor, tolerance: f32, least: f32) -> Option<(Vec3, f32)> {
    let on = |g: &&Grain| (floor.normal.dot(g.mean) - floor.offset).abs() <= tolerance && g.lies(floor.normal, least);
    let on: Vec<&Grain> = grains.iter().filter(on).collect();
    let sum: f64 = on.iter().map(|g| f64::from(g.weight)).sum();
    if on.len() < 3 || sum <= 0.0 {
        return None;
    }
    let mean = on.iter().map(|g| f64::from(g.weight) * g.mean.as_dvec3()).sum::<DVec3>() / sum;
    let mut cov = DMat3::ZERO;
    for g in &on {
        let d = g.mean.as_dvec3() - mean;
        cov += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * f64::from(g.weight);
    }
    let normal = eigen(cov).1[2];
    let normal = if normal.dot(floor.normal.as_dvec3()) < 0.0 { -normal } else { normal };
    Some((normal.as_vec3(), normal.dot(mean) as f32))
}

/// The shortest turn, about the foot of `center` on the floor, that makes the floor's normal `up` (a unit vector), and the
/// shift along `up` that brings the floor to height 0.
pub fn upright(floor: &Floor, up: Vec3, center: Vec3) -> Similarity {
    let rotation = Quat::from_rotation_arc(floor.normal, up);
    let foot = center - floor.normal * (floor.normal.dot(center) - floor.offset);
    let turned = about(foot, rotation);
    Similarity { translation: turned.translation - up * up.dot(foot), ..turned }
}

/// A counter-based generator: a 64-bit counter, mixed.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((u128::from(z ^ (z >> 31)) * n as u128) >> 64) as usize
    }
}
