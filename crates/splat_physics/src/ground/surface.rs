//! From voxels to the pieces of a ground.

use std::collections::{BTreeMap, VecDeque};

use glam::{DQuat, DVec3, IVec3, UVec3};
use rayon::prelude::*;

use super::fill::Run;
use super::lattice::{Lattice, PlaceMap, Seen};
use super::{GroundChunk, GroundSurface};
use crate::SurfaceMesh;
use crate::surface::Net;

/// How far simplification moves the surface at most, in voxels.
const TOLERANCE: f64 = 0.15;
/// Voxels that a surface may spread over.
const SPREAD: i32 = 3;

/// Where voxels are: in a frame whose y is up, turned from the body's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) body_from_grid: DQuat,
    pub(super) voxel: f64,
}

impl Place {
    /// Of a place in lattice units, where the middle of voxel 0 is 0.
    pub(super) fn body(&self, lattice: DVec3) -> DVec3 {
        self.body_from_grid * ((lattice + 0.5) * self.voxel)
    }
}

/// Voxels by the piece they are in, in rising order.
fn by_piece(solid: &Lattice, edge: i32) -> Vec<(IVec3, Vec<IVec3>)> {
    let mut pieces: BTreeMap<[i32; 3], Vec<IVec3>> = BTreeMap::new();
    for at in solid.all() {
        pieces.entry(at.div_euclid(IVec3::splat(edge)).to_array()).or_default().push(at);
    }
    pieces.into_iter().map(|(at, voxels)| (IVec3::from_array(at), voxels)).collect()
}

/// Triangles between what is solid and what is not, through the middle of what was seen.
pub(super) fn meshes(solid: &Lattice, seen: &PlaceMap<Seen>, place: &Place, edge: i32) -> Vec<GroundChunk> {
    let value = |at: IVec3| if solid.has(at) { 1.0 } else { 0.0 };
    let pieces = by_piece(solid, edge);
    let mesh = |(at, voxels): (IVec3, Vec<IVec3>)| {
        let net = Net::new(voxels.into_iter(), value);
        if net.quads.is_empty() {
            return None;
        }
        let vertex = |(p, cell): (&DVec3, &IVec3)| place.body(settled(*p, *cell, solid, seen));
        let vertices = net.places.iter().zip(&net.cells).map(vertex).collect();
        let mesh = SurfaceMesh { vertices, triangles: net.triangles() };
        Some(GroundChunk { at, surface: GroundSurface::Mesh(mesh.simplified(TOLERANCE * place.voxel)) })
    };
    pieces.into_par_iter().filter_map(mesh).collect()
}

/// Moves a vertex from the faces of voxels to the middle of the Gaussians behind it, as far as what is solid there is thick.
fn settled(p: DVec3, cell: IVec3, solid: &Lattice, seen: &PlaceMap<Seen>) -> DVec3 {
    let mut out = DVec3::ZERO;
    for k in 0..8 {
        let corner = IVec3::new(k & 1, k >> 1 & 1, k >> 2);
        let toward = corner.as_dvec3() - 0.5;
        out += if solid.has(cell + corner) { -toward } else { toward };
    }
    let Some(normal) = out.try_normalize() else { return p };
    let behind = |depth: f64| (p - depth * normal).round().as_ivec3();
    let (mut sum, mut weight) = (0.0, 0.0);
    let mut last = IVec3::MAX;
    for k in 0..2 * SPREAD {
        let at = behind(0.25 + 0.5 * f64::from(k));
        if at == last {
            continue;
        }
        last = at;
        match seen.get(&at) {
            Some(s) => {
                sum += f64::from(s.weight) * (at.as_dvec3() + s.offset.as_dvec3() - p).dot(normal);
                weight += f64::from(s.weight);
            }
            None if weight > 0.0 => break,
            None => {}
        }
    }
    if weight == 0.0 {
        return p;
    }
    let thick = (1..=2 * (SPREAD + 1)).take_while(|&k| solid.has(behind(0.5 * f64::from(k)))).count() as f64 * 0.5;
    // Something must be left between both sides, or the field has no inside.
    let most = if thick >= f64::from(SPREAD) { thick - 1.0 } else { (0.25 * (thick - 1.0)).max(0.0) };
    p + (sum / weight).clamp(-most, 0.25) * normal
}

/// The voxels themselves.
pub(super) fn voxels(solid: &Lattice, place: &Place, edge: i32) -> Vec<GroundChunk> {
    let chunk = |(at, voxels): (IVec3, Vec<IVec3>)| {
        let low = at * edge;
        let cells: Vec<UVec3> = voxels.into_iter().map(|v| (v - low).as_uvec3()).collect();
        let origin = place.body(low.as_dvec3() - 0.5);
        let surface = GroundSurface::Voxels { origin, rotation: place.body_from_grid, voxel: place.voxel, cells };
        GroundChunk { at, surface }
    };
    by_piece(solid, edge).into_iter().map(chunk).collect()
}

/// A height above each column, in pieces that share their borders; columns without one have that of the nearest.
pub(super) fn heights(columns: &BTreeMap<(i32, i32), Run>, place: &Place, edge: i32) -> Vec<GroundChunk> {
    let Some((&(z0, _), _)) = columns.first_key_value() else { return Vec::new() };
    let Some((&(z1, _), _)) = columns.last_key_value() else { return Vec::new() };
    let (x0, x1) = columns.keys().fold((i32::MAX, i32::MIN), |(l, h), &(_, x)| (l.min(x), h.max(x)));
    // A piece needs two rows.
    let (x1, z1) = (x1.max(x0 + 1), z1.max(z0 + 1));
    let width = (x1 - x0 + 1) as usize;
    let index = |x: i32, z: i32| (x - x0) as usize + width * (z - z0) as usize;
    let mut all = vec![f32::NAN; width * (z1 - z0 + 1) as usize];
    let mut front = VecDeque::new();
    for (&(z, x), run) in columns {
        all[index(x, z)] = ((run.top + 0.5) * place.voxel) as f32;
        front.push_back((x, z));
    }
    while let Some((x, z)) = front.pop_front() {
        let height = all[index(x, z)];
        for (i, j) in [(x - 1, z), (x + 1, z), (x, z - 1), (x, z + 1)] {
            if (x0..=x1).contains(&i) && (z0..=z1).contains(&j) && all[index(i, j)].is_nan() {
                all[index(i, j)] = height;
                front.push_back((i, j));
            }
        }
    }
    let mut out = Vec::new();
    for cz in z0.div_euclid(edge)..=(z1 - 1).div_euclid(edge) {
        for cx in x0.div_euclid(edge)..=(x1 - 1).div_euclid(edge) {
            let (left, right) = ((cx * edge).max(x0), (cx * edge + edge).min(x1));
            let (near, far) = ((cz * edge).max(z0), (cz * edge + edge).min(z1));
            let heights = (near..=far).flat_map(|z| (left..=right).map(move |x| (x, z))).map(|(x, z)| all[index(x, z)]);
            let surface = GroundSurface::Heights {
                origin: place.body(DVec3::new(left.into(), -0.5, near.into())),
                rotation: place.body_from_grid,
                spacing: place.voxel,
                dims: [(right - left + 1) as u32, (far - near + 1) as u32],
                heights: heights.collect(),
            };
            out.push(GroundChunk { at: IVec3::new(cx, 0, cz), surface });
        }
    }
    out
}
