//! [`PartSurface`]: the surface of an elastic part, as what touches it sees it.
//!
//! The contact points with the surface's normals there; between them the surface is what moving least squares make of the
//! planes through the near ones (Adamson and Alexa, "Approximating and intersecting surfaces from points", 2003).

use std::collections::HashMap;

use bevy::math::DVec3;
use splat_physics::Solid;

/// Neighbours looked at for each point.
const NEIGHBOURS: usize = 10;

/// What of the surface does not change.
#[derive(Clone, Debug)]
pub(super) struct RestSurface {
    /// For each contact point: outward, a unit vector, in the body's frame.
    normals: Vec<DVec3>,
    /// For each contact point, two others on the same side: `(a - p) x (b - p)` points outward. The point itself where there
    /// are none.
    corners: Vec<[u32; 2]>,
    /// How far from a point the surface is known, in metres.
    radius: f64,
}

impl RestSurface {
    /// `points`: on the surface of the solid, in the body's frame.
    pub(super) fn new(solid: &Solid, points: &[DVec3]) -> Self {
        let normals: Vec<DVec3> = points.iter().map(|&p| outward(solid, p)).collect();
        let mut spacing = Vec::new();
        let mut corners = Vec::with_capacity(points.len());
        let mut near: Vec<(f64, u32)> = Vec::with_capacity(points.len());
        for (k, (&p, n)) in points.iter().zip(&normals).enumerate() {
            near.clear();
            near.extend(
                points.iter().enumerate().filter(|&(j, _)| j != k).map(|(j, q)| (p.distance_squared(*q), j as u32)),
            );
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            near.truncate(NEIGHBOURS);
            spacing.extend(near.get(3).or(near.last()).map(|(d, _)| d.sqrt()));
            corners.push(best_corners(k as u32, p, *n, &near, points, &normals));
        }
        spacing.sort_unstable_by(f64::total_cmp);
        // The fourth neighbour is about one and a half spacings away: three of these see a dozen points.
        let radius = 1.75 * spacing.get(spacing.len() / 2).copied().unwrap_or(0.0);
        Self { normals, corners, radius }
    }

    /// The surface while its points are at `positions`; `turn`: how the part as a whole is turned.
    pub(super) fn at(&self, positions: Vec<DVec3>, turn: bevy::math::DQuat) -> PartSurface {
        let normal = |(k, p): (usize, &DVec3)| {
            let [a, b] = self.corners[k].map(|c| positions[c as usize] - p);
            let by_corners = a.cross(b).normalize_or_zero();
            let by_turn = turn * self.normals[k];
            if by_corners == DVec3::ZERO { by_turn } else { by_corners }
        };
        let normals = positions.iter().enumerate().map(normal).collect();
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        for (k, p) in positions.iter().enumerate() {
            cells.entry(cell(*p, self.radius)).or_default().push(k as u32);
        }
        PartSurface { positions, normals, cells, radius: self.radius }
    }
}

/// Away from the weight around a point of the surface.
fn outward(solid: &Solid, point: DVec3) -> DVec3 {
    const REACH: i64 = 3;
    let grid = &solid.grid;
    let dims = grid.dims.as_i64vec3();
    let at = ((point - grid.origin) / grid.voxel).floor().as_i64vec3();
    let mut sum = DVec3::ZERO;
    for z in (at.z - REACH).max(0)..=(at.z + REACH).min(dims.z - 1) {
        for y in (at.y - REACH).max(0)..=(at.y + REACH).min(dims.y - 1) {
            for x in (at.x - REACH).max(0)..=(at.x + REACH).min(dims.x - 1) {
                let weight = solid.weights[(x + dims.x * (y + dims.y * z)) as usize];
                let center = grid.origin + (DVec3::new(x as f64, y as f64, z as f64) + 0.5) * grid.voxel;
                let away = center - point;
                if away.length_squared() < (REACH as f64 * grid.voxel).powi(2) {
                    sum -= away * f64::from(weight);
                }
            }
        }
    }
    sum.normalize_or(DVec3::Y)
}

/// The two neighbours that tell the normal best.
fn best_corners(k: u32, p: DVec3, n: DVec3, near: &[(f64, u32)], points: &[DVec3], normals: &[DVec3]) -> [u32; 2] {
    let mut best = (0.5, [k, k]);
    let same_side: Vec<u32> = near.iter().map(|&(_, j)| j).filter(|&j| normals[j as usize].dot(n) > 0.5).collect();
    for (i, &a) in same_side.iter().enumerate() {
        for &b in &same_side[i + 1..] {
            let (u, v) = (points[a as usize] - p, points[b as usize] - p);
            let along = u.cross(v).dot(n) / (u.length() * v.length());
            if along.abs() > best.0 {
                best = (along.abs(), if along > 0.0 { [a, b] } else { [b, a] });
            }
        }
    }
    best.1
}

/// The surface of a part at a moment, in world space.
#[derive(Clone, Debug)]
pub(super) struct PartSurface {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    cells: HashMap<[i64; 3], Vec<u32>>,
    radius: f64,
}

impl PartSurface {
    /// Distance and normal of the surface at a point, if it is nearer than `reach`; negative inside. What is deeper inside than
    /// the points of the surface are apart is not found.
    pub(super) fn nearest(&self, point: DVec3, reach: f64) -> Option<(f64, DVec3)> {
        if !(self.radius > 0.0) || !point.is_finite() {
            return None;
        }
        let middle = cell(point, self.radius);
        let mut near: Vec<(f64, u32)> = Vec::new();
        for dz in -1..=1 {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let Some(ids) = self.cells.get(&[middle[0] + dx, middle[1] + dy, middle[2] + dz]) else { continue };
                    near.extend(ids.iter().map(|&k| (self.positions[k as usize].distance_squared(point), k)));
                }
            }
        }
        near.retain(|(d, _)| *d < self.radius * self.radius);
        let nearest = near.iter().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        let side = self.normals[nearest.1 as usize];
        let (mut weight, mut gap, mut normal) = (0.0, 0.0, DVec3::ZERO);
        // In the order of the grid, which is the same for the same points.
        for &(d, k) in &near {
            let n = self.normals[k as usize];
            // The other side of a thin part is no part of this surface.
            if n.dot(side) > 0.2 {
                let w = (1.0 - d / (self.radius * self.radius)).powi(4);
                weight += w;
                gap += w * n.dot(point - self.positions[k as usize]);
                normal += n * w;
            }
        }
        let gap = gap / weight;
        let normal = normal.normalize_or_zero();
        (gap < reach && normal != DVec3::ZERO).then_some((gap, normal))
    }
}

fn cell(point: DVec3, side: f64) -> [i64; 3] {
    (point / side.max(f64::MIN_POSITIVE)).floor().to_array().map(|v| v as i64)
}
