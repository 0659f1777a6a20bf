//! Which way is up, and which way an object lies: principal axes, the floor, and the rotations that follow from them.
//!
//! [`principal_axes`] gives the three directions in which Gaussians spread, [`align`] the rotation that lays them along the
//! world's axes. [`floor_plane`] finds the plane everything stands on, [`upright`] the transform that makes it level.
//! Sums run in `f64` in input order and random draws are seeded: the same cloud gives the same bits.

use glam::{DMat3, DVec3, Mat3, Quat, Vec3};
use rayon::prelude::*;

use crate::{Cloud, Selection, Similarity};

/// Neighbouring variances closer than this ratio do not tell their directions apart.
const AMBIGUOUS: f32 = 1.1;
/// Sets smaller than this count the extent of each Gaussian too: means alone may lie on a line or in a plane.
const SMALL: usize = 1000;
/// A plane with this share of the best one's area could be the floor as well.
const RIVAL: f32 = 0.5;
/// Planes whose normals have at least this dot product are the same (30 degrees).
const APART: f32 = 0.866;
/// What a flat Gaussian on a plane counts whose own normal is another.
const ASKEW: f64 = 0.25;
/// Candidates for the second and third Gaussian of a draw.
const CANDIDATES: usize = 12;

/// The directions in which a set of Gaussians spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipalAxes {
    /// Weighted mean, in scene units.
    pub center: Vec3,
    /// Unit vectors, right-handed, largest variance first.
    pub axes: [Vec3; 3],
    /// Variances along them, in scene units squared, falling.
    pub variances: [f32; 3],
    /// Gaussians that counted: drawable, and no outlier.
    pub count: usize,
}

impl PrincipalAxes {
    /// Whether the first two directions could as well be any others in their plane (the set is round seen along the third).
    pub fn first_two_ambiguous(&self) -> bool {
        self.variances[0] <= AMBIGUOUS * self.variances[1]
    }

    /// Whether the last two directions could as well be any others in their plane (the set is round seen along the first).
    pub fn last_two_ambiguous(&self) -> bool {
        self.variances[1] <= AMBIGUOUS * self.variances[2]
    }

    /// Least variance over middle one, 0..=1: near 0 for a sheet, above 0.5 there is no flat direction.
    pub fn flatness(&self) -> f32 {
        if self.variances[1] > 0.0 { self.variances[2] / self.variances[1] } else { 1.0 }
    }
}

/// Area-like weights of all Gaussians: `opacity * (s1 s2 s3)^(2/3)`, none above the 95th percentile; 0 for what is not
/// selected or cannot be drawn.
fn weights(cloud: &Cloud, selection: Option<&Selection>) -> Vec<f64> {
    let mut weights: Vec<f64> = (0..cloud.len())
        .into_par_iter()
        .map(|i| {
            let meant = selection.is_none_or(|s| s.contains(i)) && cloud.drawable(i);
            let volume_log = f64::from(cloud.log_scales()[i].element_sum());
            let weight = f64::from(cloud.opacity(i)) * (volume_log * 2.0 / 3.0).exp();
            if meant && weight.is_finite() { weight } else { 0.0 }
        })
        .collect();
    let mut sorted: Vec<f64> = weights.iter().copied().filter(|&w| w > 0.0).collect();
    if !sorted.is_empty() {
        let k = (sorted.len() - 1) * 95 / 100;
        let most = *sorted.select_nth_unstable_by(k, f64::total_cmp).1;
        weights.iter_mut().for_each(|w| *w = w.min(most));
    }
    weights
}

/// Mean and covariance of the weighted means `ids`, with the Gaussians' own covariances if `own`.
fn moments(cloud: &Cloud, weights: &[f64], ids: &[u32], own: bool) -> (DVec3, DMat3) {
    let (mut sum, mut mean) = (0.0, DVec3::ZERO);
    for &i in ids {
        let w = weights[i as usize];
        sum += w;
        mean += w * cloud.means()[i as usize].as_dvec3();
    }
    mean /= sum;
    let mut cov = DMat3::ZERO;
    for &i in ids {
        let d = cloud.means()[i as usize].as_dvec3() - mean;
        let outer = DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        let own = if own { cloud.covariance(i as usize).as_dmat3() } else { DMat3::ZERO };
        cov += (outer + own) * (weights[i as usize] / sum);
    }
    (mean, cov)
}

/// Principal axes of the selected Gaussians (all without a selection); `None` if none has a weight.
///
/// Weights are area-like and clipped, so that neither a dense speck nor one huge Gaussian decides; three rounds leave out
/// what lies beyond a Mahalanobis distance of 3. Axes have the sign that makes their largest component positive, the
/// third follows from right-handedness.
///
/// # Panics
/// If the selection belongs to a cloud of another length.
pub fn principal_axes(cloud: &Cloud, selection: Option<&Selection>) -> Option<PrincipalAxes> {
    assert!(selection.is_none_or(|s| s.len() == cloud.len()), "a selection of another cloud");
    let weights = weights(cloud, selection);
    let all: Vec<u32> = (0..cloud.len() as u32).filter(|&i| weights[i as usize] > 0.0).collect();
    if all.is_empty() {
        return None;
    }
    let mut ids = all.clone();
    let (mut mean, mut cov) = moments(cloud, &weights, &ids, ids.len() < SMALL);
    for _ in 0..3 {
        // A flat set has no inverse: a share of its extent in every direction keeps the distance finite.
        let floor = 1e-9 * (cov.x_axis.x + cov.y_axis.y + cov.z_axis.z).max(1e-30);
        let inverse = (cov + DMat3::from_diagonal(DVec3::splat(floor))).inverse();
        let inside = |&&i: &&u32| {
            let d = cloud.means()[i as usize].as_dvec3() - mean;
            d.dot(inverse * d) <= 9.0
        };
        let kept: Vec<u32> = all.iter().filter(inside).copied().collect();
        if kept.is_empty() {
            break;
        }
        ids = kept;
        (mean, cov) = moments(cloud, &weights, &ids, ids.len() < SMALL);
    }
    let (variances, vectors) = eigen(cov);
    let positive = |v: DVec3| {
        let largest = v.abs().max_position();
        if v[largest] < 0.0 { -v } else { v }
    };
    let (first, second) = (positive(vectors[0]), positive(vectors[1]));
    Some(PrincipalAxes {
        center: mean.as_vec3(),
        axes: [first.as_vec3(), second.as_vec3(), first.cross(second).as_vec3()],
        variances: variances.map(|v| v.max(0.0) as f32),
        count: ids.len(),
    })
}

/// Eigenvalues, falling, and unit eigenvectors of a symmetric matrix, by Jacobi rotations.
fn eigen(mut m: DMat3) -> ([f64; 3], [DVec3; 3]) {
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..24 {
        let off = m.y_axis.x.abs() + m.z_axis.x.abs() + m.z_axis.y.abs();
        if off <= 1e-18 * (m.x_axis.x.abs() + m.y_axis.y.abs() + m.z_axis.z.abs()) {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = m.col(q)[p];
            if apq == 0.0 {
                continue;
            }
            let theta = (m.col(q)[q] - m.col(p)[p]) / (2.0 * apq);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut rotation = DMat3::IDENTITY;
            rotation.col_mut(p)[p] = c;
            rotation.col_mut(q)[q] = c;
            rotation.col_mut(q)[p] = s;
            rotation.col_mut(p)[q] = -s;
            m = rotation.transpose() * m * rotation;
            vectors *= rotation;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| m.col(b)[b].total_cmp(&m.col(a)[a]).then(a.cmp(&b)));
    (order.map(|k| m.col(k)[k]), order.map(|k| vectors.col(k).normalize()))
}

/// The rotation about [`PrincipalAxes::center`] that lays the axes along the world's.
///
/// `targets[k]`: the world axis (0 x, 1 y, 2 z) for principal axis k, each once; `None` chooses them. Of all rotations that do
/// so the one nearest to none is taken: an object that lies straight already is not turned over. Directions that the
/// set does not tell apart ([`PrincipalAxes::first_two_ambiguous`] and so on) stay as near to where they are as they can.
pub fn align(axes: &PrincipalAxes, targets: Option<[usize; 3]>) -> Similarity {
    const PERMUTATIONS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut best: Option<(f32, Mat3)> = None;
    let wanted = targets.map_or(PERMUTATIONS.to_vec(), |t| vec![t]);
    for targets in wanted {
        let own = told_apart(axes, targets);
        for signs in 0..8u8 {
            let sign = |k: usize| if signs >> k & 1 == 0 { 1.0 } else { -1.0 };
            // Rotation = sum over k of (world axis) (own axis)^T.
            let mut rotation = Mat3::ZERO;
            for k in 0..3 {
                let (to, from) = (Vec3::AXES[targets[k]], sign(k) * own[k]);
                rotation += Mat3::from_cols(to * from.x, to * from.y, to * from.z);
            }
            let trace = rotation.x_axis.x + rotation.y_axis.y + rotation.z_axis.z;
            if rotation.determinant() > 0.0 && best.is_none_or(|(most, _)| trace > most) {
                best = Some((trace, rotation));
            }
        }
    }
    let rotation = best.map_or(Quat::IDENTITY, |(_, m)| Quat::from_mat3(&m).normalize());
    about(axes.center, rotation)
}

/// The axes, those that are not told apart replaced by the nearest to their targets.
fn told_apart(axes: &PrincipalAxes, targets: [usize; 3]) -> [Vec3; 3] {
    let own = axes.axes;
    let world = targets.map(|t| Vec3::AXES[t]);
    let within = |known: Vec3, a: Vec3, b: Vec3| {
        let first = a.reject_from_normalized(known);
        // One of two different world axes is never parallel to the known one.
        let first = if first.length() > 0.1 { first } else { b.reject_from_normalized(known).cross(known) };
        let first = first.normalize();
        (first, known.cross(first))
    };
    match (axes.first_two_ambiguous(), axes.last_two_ambiguous()) {
        (true, true) => world,
        (true, false) => {
            let (a, b) = within(own[2], world[0], world[1]);
            [a, b, own[2]]
        }
        (false, true) => {
            let (b, c) = within(own[0], world[1], world[2]);
            [own[0], b, c]
        }
        (false, false) => own,
    }
}

fn about(center: Vec3, rotation: Quat) -> Similarity {
    Similarity { rotation, scale: 1.0, translation: center - rotation * center }
}

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
struct Grain {
    mean: Vec3,
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
fn draw(grains: &[Grain], random: &mut Random) -> [usize; 3] {
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
    let total: f64 = grains.iter().map(|g| f64::from(g.weight)).sum();
    let tolerance = settings.tolerance * spread(&grains)?;
    let mut random = Random(settings.seed);
    let draws: Vec<[usize; 3]> = (0..settings.draws).map(|_| draw(&grains, &mut random)).collect();
    let least = settings.angle.cos();
    let measure = |normal: Vec3, offset: f32| {
        let (mut on, mut above, mut below) = (0.0f64, 0.0f64, 0.0f64);
        for g in &grains {
            let (height, weight) = (normal.dot(g.mean) - offset, f64::from(g.weight));
            if height.abs() <= tolerance {
                on += if g.lies(normal, least) { weight } else { ASKEW * weight };
            } else if height > 5.0 * tolerance {
                above += weight;
            } else if height < -5.0 * tolerance {
                below += weight;
            }
        }
        (on / total, above / total, below / total)
    };
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

/// At most about 16,384 evenly spaced opaque Gaussians.
fn grains(cloud: &Cloud, selection: Option<&Selection>) -> Vec<Grain> {
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
fn spread(grains: &[Grain]) -> Option<f32> {
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
fn least_squares(grains: &[Grain], floor: &Floor, tolerance: f32, least: f32) -> Option<(Vec3, f32)> {
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
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((u128::from(z ^ (z >> 31)) * n as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests;
