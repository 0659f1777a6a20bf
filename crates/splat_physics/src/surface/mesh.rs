//! [`SurfaceMesh`].

use std::collections::HashMap;

use glam::{DVec3, IVec3};

use super::net::Net;
use super::simplify::simplified;
use crate::Solid;

/// How far simplification moves the surface at most, in voxels.
const TOLERANCE: f64 = 0.1;
/// How far vertices are moved at most so that the mesh holds as much as its solid, in voxels.
const MOST_SHIFT: f64 = 0.5;
/// A net that holds less than this share of its solid has lost walls thinner than the smoothing.
const LEAST_HELD: f64 = 0.7;

/// Triangles around a body, in metres, in the body's frame; counter-clockwise seen from outside.
///
/// Of a [`Solid`] it is closed: each edge runs as often one way as the other (twice in all, and four times where voxels touch
/// along an edge only). The pieces of a capture's ground are open where they meet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceMesh {
    /// Places.
    pub vertices: Vec<DVec3>,
    /// Positions in [`vertices`](Self::vertices).
    pub triangles: Vec<[u32; 3]>,
}

impl SurfaceMesh {
    /// The surface of a solid, through the middle of its shell: it holds what the solid's weights say, not what its voxels do.
    /// Empty for a solid without voxels. Flat places have few, large triangles; none is degenerate.
    ///
    /// Naive surface nets (Gibson 1998) where the weight, smoothed at the shell, is one half.
    pub fn of(solid: &Solid) -> Self {
        Self::full(solid).simplified(TOLERANCE * solid.grid.voxel)
    }

    /// [`of`](Self::of) before it is simplified: a vertex in each cell that the surface runs through.
    pub(crate) fn full(solid: &Solid) -> Self {
        let volume = solid.volume();
        let mut mesh = Self::net_of(solid, &smoothed(solid));
        if !(mesh.volume() >= LEAST_HELD * volume) {
            let whole: Vec<f32> = solid.weights.iter().map(|&w| if w > 0.0 { 1.0 } else { 0.0 }).collect();
            mesh = Self::net_of(solid, &whole);
        }
        // Nets cut corners off, and smoothing pulls round things in: by as much as the volume says, evenly.
        let (area, most) = (mesh.area(), MOST_SHIFT * solid.grid.voxel);
        if area > 0.0 {
            let normals = mesh.normals();
            let shift = ((volume - mesh.volume()) / area).clamp(-most, most);
            mesh.vertices.iter_mut().zip(normals).for_each(|(vertex, normal)| *vertex += shift * normal);
        }
        mesh
    }

    fn net_of(solid: &Solid, values: &[f32]) -> Self {
        let grid = &solid.grid;
        let dims = grid.dims.as_ivec3();
        let value = |p: IVec3| {
            let known = p.cmpge(IVec3::ZERO).all() && p.cmplt(dims).all();
            if known { values[grid.index(p.as_uvec3())] } else { 0.0 }
        };
        let inside = (0..values.len()).filter(|&v| values[v] >= 0.5).map(|v| grid.at(v).as_ivec3());
        let net = Net::new(inside, value);
        let vertices = net.places.iter().map(|p| grid.origin + (*p + 0.5) * grid.voxel).collect();
        Self { vertices, triangles: net.triangles() }
    }

    /// With fewer triangles: vertices are merged with neighbours as long as no place of the surface moves by more than
    /// `tolerance` metres. Stays closed if it was; open borders stay as they are.
    pub fn simplified(&self, tolerance: f64) -> Self {
        simplified(self, tolerance)
    }

    /// What a closed mesh holds, in m^3; negative if it is inside out.
    pub fn volume(&self) -> f64 {
        let origin = self.vertices.first().copied().unwrap_or_default();
        let six = |t: &[u32; 3]| {
            let [a, b, c] = self.corners(t).map(|p| p - origin);
            a.dot(b.cross(c))
        };
        self.triangles.iter().map(six).sum::<f64>() / 6.0
    }

    /// In m^2.
    pub fn area(&self) -> f64 {
        self.triangles.iter().map(|t| 0.5 * self.cross(t).length()).sum()
    }

    /// Whether each edge runs as often one way as the other. An empty mesh is closed.
    pub fn closed(&self) -> bool {
        let mut balance: HashMap<(u32, u32), i32> = HashMap::new();
        for t in &self.triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *balance.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        balance.values().all(|&b| b == 0)
    }

    /// Unit normals of the vertices: means of the triangles around them by area; zero where these cancel.
    pub(crate) fn normals(&self) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; self.vertices.len()];
        for t in &self.triangles {
            let cross = self.cross(t);
            t.iter().for_each(|&v| sums[v as usize] += cross);
        }
        sums.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    pub(crate) fn corners(&self, triangle: &[u32; 3]) -> [DVec3; 3] {
        triangle.map(|v| self.vertices[v as usize])
    }

    /// Twice the area along the normal.
    pub(crate) fn cross(&self, triangle: &[u32; 3]) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }
}

/// The weights of a solid; around voxels that are partly inside, smoothed by (1 2 1)/4 along each axis. Elsewhere voxels end
/// at their faces, and smoothing would only round corners.
fn smoothed(solid: &Solid) -> Vec<f32> {
    let grid = &solid.grid;
    let dims = grid.dims.as_ivec3();
    let strides = [1, dims.x as usize, dims.x as usize * dims.y as usize];
    let mut values = solid.weights.clone();
    let mut near: Vec<bool> = values.iter().map(|&w| w > 0.0 && w < 1.0).collect();
    for (axis, stride) in strides.into_iter().enumerate() {
        let (before, marks) = (values.clone(), near.clone());
        for v in 0..values.len() {
            let at = grid.at(v)[axis];
            let low = (at > 0).then(|| v - stride);
            let high = (at + 1 < grid.dims[axis]).then(|| v + stride);
            let get = |k: Option<usize>| k.map_or(0.0, |k| before[k]);
            values[v] = 0.25 * (get(low) + get(high)) + 0.5 * before[v];
            near[v] = marks[v] || low.is_some_and(|k| marks[k]) || high.is_some_and(|k| marks[k]);
        }
    }
    values.iter().zip(&solid.weights).zip(near).map(|((&soft, &sharp), near)| if near { soft } else { sharp }).collect()
}
