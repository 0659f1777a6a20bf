//! [`DistanceField`].

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DQuat, DVec3, IVec3};
use rayon::prelude::*;

use super::lattice::{Lattice, PlaceMap};
use super::{Ground, GroundSurface};
use crate::SurfaceMesh;
use crate::surface::Net;
use crate::world::{Contact, ContactWorld};

/// Cells along the edge of a brick.
const CELLS: i32 = 8;
/// Nodes along the edge of a brick: neighbours share their borders, so that one brick answers a question.
const NODES: i32 = CELLS + 1;
/// Voxels from the surface within which distances are known.
const BAND: f64 = 4.0;
/// Steps of a stored distance in the band.
const STEPS: f64 = 32000.0;
/// No distance.
const UNKNOWN: i16 = i16::MIN;

/// How far points are from the [`Ground`], and which way is out; in metres, in the body's frame of the capture.
///
/// Known within four voxels of a mesh or of voxels, everywhere above and below a plane, and above, below and inside a
/// heightfield's borders. A question takes the time of looking up one brick, and no memory.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceField {
    /// Coulomb's coefficients, dynamic and static, of contacts; 0.5 and 0.6 at first.
    pub friction: [f64; 2],
    /// Of contacts, 0..=1; 0 at first.
    pub restitution: f64,
    kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Plane { normal: DVec3, offset: f64 },
    Heights { origin: DVec3, rotation: DQuat, spacing: f64, dims: [usize; 2], heights: Vec<f32> },
    Bricks { rotation: DQuat, voxel: f64, bricks: PlaceMap<Box<[i16]>> },
}

impl DistanceField {
    pub(super) fn of(ground: &Ground) -> Self {
        let kind = match ground.chunks.first().map(|chunk| &chunk.surface) {
            Some(GroundSurface::Plane { normal, offset }) => Kind::Plane { normal: *normal, offset: *offset },
            Some(GroundSurface::Heights { .. }) => heights(ground),
            _ => bricks(ground),
        };
        Self { friction: [0.5, 0.6], restitution: 0.0, kind }
    }

    /// Signed distance of a point to the surface, negative inside, and the unit normal away from it; `None` where neither is
    /// known, and for points that are not finite.
    pub fn nearest(&self, point: DVec3) -> Option<(f64, DVec3)> {
        match &self.kind {
            Kind::Plane { normal, offset } => {
                let gap = normal.dot(point) - offset;
                gap.is_finite().then_some((gap, *normal))
            }
            Kind::Heights { origin, rotation, spacing, dims, heights } => {
                let local = rotation.conjugate() * (point - *origin);
                let (x, z) = (local.x / spacing, local.z / spacing);
                let (i, j) = (x.floor(), z.floor());
                let most = |k: usize| (dims[k] - 2) as f64;
                let inside = x >= 0.0 && z >= 0.0 && x <= most(0) + 1.0 && z <= most(1) + 1.0;
                if !(inside && local.y.is_finite()) {
                    return None;
                }
                let (i, j) = (i.min(most(0)), j.min(most(1)));
                let (u, v) = (x - i, z - j);
                let at = i as usize + dims[0] * j as usize;
                let [a, b, c, d] = [at, at + 1, at + dims[0], at + dims[0] + 1].map(|k| f64::from(heights[k]));
                let height = (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v;
                let along_x = ((b - a) * (1.0 - v) + (d - c) * v) / spacing;
                let along_z = ((c - a) * (1.0 - u) + (d - b) * u) / spacing;
                let normal = DVec3::new(-along_x, 1.0, -along_z).normalize();
                Some(((local.y - height) * normal.y, *rotation * normal))
            }
            Kind::Bricks { rotation, voxel, bricks } => {
                // Nodes are in the middle of voxels: a wall one voxel thick has an inside.
                let p = rotation.conjugate() * point / *voxel - 0.5;
                if !(p.abs().max_element() < 1e8) {
                    return None;
                }
                let cell = p.floor().as_ivec3();
                let brick = bricks.get(&(cell >> 3i32))?;
                let t = p - cell.as_dvec3();
                let at = index(cell & (CELLS - 1));
                let mut d = [0.0; 8];
                for (k, d) in d.iter_mut().enumerate() {
                    let step = index(IVec3::new(k as i32 & 1, k as i32 >> 1 & 1, k as i32 >> 2));
                    let stored = brick[at + step];
                    if stored == UNKNOWN {
                        return None;
                    }
                    *d = f64::from(stored) * (BAND / STEPS) * voxel;
                }
                let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
                let x = [mix(d[0], d[1], t.x), mix(d[2], d[3], t.x), mix(d[4], d[5], t.x), mix(d[6], d[7], t.x)];
                let y = [mix(x[0], x[1], t.y), mix(x[2], x[3], t.y)];
                let slope = DVec3::new(
                    mix(mix(d[1] - d[0], d[3] - d[2], t.y), mix(d[5] - d[4], d[7] - d[6], t.y), t.z),
                    mix(x[1] - x[0], x[3] - x[2], t.z),
                    y[1] - y[0],
                );
                // Midway between two surfaces there is no way out.
                Some((mix(y[0], y[1], t.z), *rotation * slope.try_normalize()?))
            }
        }
    }
}

impl ContactWorld for DistanceField {
    fn contacts(&mut self, points: &[DVec3], reach: f64, out: &mut Vec<Contact>) {
        contacts(self, points, reach, out);
    }
}

impl ContactWorld for Arc<DistanceField> {
    fn contacts(&mut self, points: &[DVec3], reach: f64, out: &mut Vec<Contact>) {
        contacts(self, points, reach, out);
    }
}

fn contacts(field: &DistanceField, points: &[DVec3], reach: f64, out: &mut Vec<Contact>) {
    out.extend(points.iter().enumerate().filter_map(|(k, p)| {
        let (gap, normal) = field.nearest(*p)?;
        (gap < reach).then_some(Contact {
            point: k as u32,
            normal,
            gap,
            velocity: DVec3::ZERO,
            body: None,
            friction: field.friction,
            restitution: field.restitution,
        })
    }));
}

fn index(node: IVec3) -> usize {
    (node.x + NODES * (node.y + NODES * node.z)) as usize
}

/// The heights of all pieces in one grid.
fn heights(ground: &Ground) -> Kind {
    let mut pieces = Vec::new();
    let mut frame = None;
    for chunk in &ground.chunks {
        let GroundSurface::Heights { origin, rotation, spacing, dims, heights } = &chunk.surface else { continue };
        let (first, turn, step) = *frame.get_or_insert((*origin, *rotation, *spacing));
        let from = turn.conjugate() * (*origin - first) / step;
        pieces.push((from.x.round() as i64, from.z.round() as i64, dims.map(|d| d as usize), heights));
    }
    let (first, rotation, spacing) = frame.unwrap_or((DVec3::ZERO, DQuat::IDENTITY, 1.0));
    let low = |get: &dyn Fn(usize) -> i64| (0..pieces.len()).map(get).min().unwrap_or(0);
    let (x0, z0) = (low(&|k| pieces[k].0), low(&|k| pieces[k].1));
    let end = |get: &dyn Fn(usize) -> i64| (0..pieces.len()).map(get).max().unwrap_or(2) as usize;
    let dims = [end(&|k| pieces[k].0 - x0 + pieces[k].2[0] as i64), end(&|k| pieces[k].1 - z0 + pieces[k].2[1] as i64)];
    let mut all = vec![0.0; dims[0] * dims[1]];
    for (x, z, size, heights) in pieces {
        for (row, values) in heights.chunks_exact(size[0]).enumerate() {
            let at = (x - x0) as usize + dims[0] * ((z - z0) as usize + row);
            all[at..at + size[0]].copy_from_slice(values);
        }
    }
    let origin = first + rotation * DVec3::new(x0 as f64 * spacing, 0.0, z0 as f64 * spacing);
    Kind::Heights { origin, rotation, spacing, dims, heights: all }
}

/// Distances to the triangles of all pieces.
fn bricks(ground: &Ground) -> Kind {
    let voxel = ground.report.voxel;
    let mut rotation = DQuat::IDENTITY;
    let mut triangles: Vec<[DVec3; 3]> = Vec::new();
    let mut solid = Lattice::default();
    for chunk in &ground.chunks {
        match &chunk.surface {
            GroundSurface::Mesh(mesh) => triangles.extend(corners(mesh).map(|t| t.map(|p| p / voxel - 0.5))),
            GroundSurface::Voxels { origin, rotation: turn, cells, .. } => {
                rotation = *turn;
                let low = (turn.conjugate() * *origin / voxel).round().as_ivec3();
                cells.iter().for_each(|cell| solid.insert(low + cell.as_ivec3()));
            }
            _ => {}
        }
    }
    let net = Net::new(solid.all().into_iter(), |at| if solid.has(at) { 1.0 } else { 0.0 });
    let vertices = net.places.clone();
    triangles.extend(corners(&SurfaceMesh { vertices, triangles: net.triangles() }));
    let mut touched: BTreeMap<[i32; 3], Vec<u32>> = BTreeMap::new();
    for (k, [a, b, c]) in triangles.iter().enumerate() {
        let low: IVec3 = ((a.min(*b).min(*c) - BAND).floor().as_ivec3() - 1) >> 3i32;
        let high: IVec3 = (a.max(*b).max(*c) + BAND).ceil().as_ivec3() >> 3i32;
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    touched.entry([x, y, z]).or_default().push(k as u32);
                }
            }
        }
    }
    let touched: Vec<([i32; 3], Vec<u32>)> = touched.into_iter().collect();
    let bricks = touched
        .into_par_iter()
        .filter_map(|(at, near)| {
            let at = IVec3::from_array(at);
            Some((at, brick(at * CELLS, near.iter().map(|&k| &triangles[k as usize]))?))
        })
        .collect::<Vec<_>>();
    Kind::Bricks { rotation, voxel, bricks: bricks.into_iter().collect() }
}

fn corners(mesh: &SurfaceMesh) -> impl Iterator<Item = [DVec3; 3]> {
    mesh.triangles.iter().map(|t| mesh.corners(t))
}

/// Distances of the nodes of a brick in voxels; `None` if none is within the band.
fn brick<'a>(low: IVec3, triangles: impl Iterator<Item = &'a [DVec3; 3]>) -> Option<Box<[i16]>> {
    // Distance squared, signed height over the plane of the triangle.
    let mut best = vec![(f64::INFINITY, 0.0f64); (NODES * NODES * NODES) as usize];
    for triangle in triangles {
        let [a, b, c] = *triangle;
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let from = ((a.min(b).min(c) - BAND).floor().as_ivec3() - low).max(IVec3::ZERO);
        let to = ((a.max(b).max(c) + BAND).ceil().as_ivec3() - low).min(IVec3::splat(CELLS));
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    let node = IVec3::new(x, y, z);
                    let p = (low + node).as_dvec3();
                    let height = (p - a).dot(normal);
                    let best = &mut best[index(node)];
                    if height * height > best.0.min(BAND * BAND) * (1.0 + 1e-9) {
                        continue;
                    }
                    let distance = p.distance_squared(closest(p, triangle));
                    // At an edge, the triangle that faces the point tells the side it is on.
                    let same = (distance - best.0).abs() <= 1e-9 * (1e-6 + distance);
                    if if same { height.abs() > best.1.abs() } else { distance < best.0 } {
                        *best = (distance.min(best.0), height);
                    }
                }
            }
        }
    }
    let store = |&(distance, height): &(f64, f64)| {
        let distance = distance.sqrt();
        if distance > BAND { UNKNOWN } else { (distance.copysign(height) * STEPS / BAND).round() as i16 }
    };
    let stored: Box<[i16]> = best.iter().map(store).collect();
    stored.iter().any(|&d| d != UNKNOWN).then_some(stored)
}

/// The point of a triangle nearest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
pub(super) fn closest(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}
