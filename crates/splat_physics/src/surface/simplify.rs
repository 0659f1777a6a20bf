//! Fewer triangles where a surface is flat.

use glam::DVec3;

use super::SurfaceMesh;

/// A triangle may turn by at most the angle of this cosine when a corner moves.
const LEAST_TURN: f64 = 0.7;
/// Triangles thinner than this (height over longest side) are not made.
const THINNEST: f64 = 0.02;
/// Rounds over all vertices, at most.
const ROUNDS: usize = 12;

/// Merges vertices with neighbours; see [`SurfaceMesh::simplified`].
pub(super) fn simplified(mesh: &SurfaceMesh, tolerance: f64) -> SurfaceMesh {
    let mut work = Work::new(mesh);
    for _ in 0..ROUNDS {
        if work.round(tolerance) * 50 < work.vertices.len() {
            break;
        }
    }
    work.finish()
}

struct Work<'a> {
    vertices: &'a [DVec3],
    triangles: Vec<Option<[u32; 3]>>,
    /// Triangles around each vertex.
    around: Vec<Vec<u32>>,
    /// How far the surface was moved near each vertex.
    error: Vec<f64>,
}

impl<'a> Work<'a> {
    fn new(mesh: &'a SurfaceMesh) -> Self {
        let mut around = vec![Vec::new(); mesh.vertices.len()];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            triangle.iter().for_each(|&v| around[v as usize].push(t as u32));
        }
        let triangles = mesh.triangles.iter().map(|&t| Some(t)).collect();
        Self { vertices: &mesh.vertices, triangles, around, error: vec![0.0; mesh.vertices.len()] }
    }

    /// Tries every vertex once; how many went.
    fn round(&mut self, tolerance: f64) -> usize {
        (0..self.vertices.len()).filter(|&v| self.merge(v as u32, tolerance)).count()
    }

    /// Neighbours of a vertex in rising order; `None` unless its triangles form one closed fan.
    fn ring(&self, v: u32) -> Option<Vec<u32>> {
        let fan = &self.around[v as usize];
        let mut ring = Vec::with_capacity(2 * fan.len());
        for &t in fan {
            ring.extend(self.triangles[t as usize]?.into_iter().filter(|&u| u != v));
        }
        ring.sort_unstable();
        let twice = ring.len().is_multiple_of(2) && ring.chunks(2).all(|pair| pair[0] == pair[1]);
        ring.dedup();
        (twice && ring.len() == fan.len() && ring.len() >= 3).then_some(ring)
    }

    fn merge(&mut self, v: u32, tolerance: f64) -> bool {
        if self.around[v as usize].is_empty() {
            return false;
        }
        let Some(ring) = self.ring(v) else { return false };
        let mut best: Option<(f64, u32)> = None;
        for &u in &ring {
            if let Some(error) = self.cost(v, u, &ring)
                && self.error[v as usize] + error <= tolerance
                && best.is_none_or(|(least, _)| error < least)
            {
                best = Some((error, u));
            }
        }
        let Some((error, u)) = best else { return false };
        let fan = std::mem::take(&mut self.around[v as usize]);
        let moved = self.error[v as usize] + error;
        for &near in &ring {
            self.error[near as usize] = self.error[near as usize].max(moved);
        }
        for t in fan {
            let Some(mut triangle) = self.triangles[t as usize] else { continue };
            if triangle.contains(&u) {
                self.triangles[t as usize] = None;
                triangle.iter().for_each(|&w| self.around[w as usize].retain(|&other| other != t));
            } else {
                triangle.iter_mut().filter(|w| **w == v).for_each(|w| *w = u);
                self.triangles[t as usize] = Some(triangle);
                self.around[u as usize].push(t);
            }
        }
        true
    }

    /// How far the surface moves when `v` goes to `u`; `None` where the mesh would not stay one.
    fn cost(&self, v: u32, u: u32, ring: &[u32]) -> Option<f64> {
        // Only the two triangles of the edge may share a third corner with both ends.
        let mut common = 0;
        let mut seen: Vec<u32> = Vec::with_capacity(16);
        for &t in &self.around[u as usize] {
            for w in self.triangles[t as usize]? {
                if w != u && w != v && ring.binary_search(&w).is_ok() && !seen.contains(&w) {
                    seen.push(w);
                    common += 1;
                }
            }
        }
        if common != 2 {
            return None;
        }
        let (from, to) = (self.vertices[v as usize], self.vertices[u as usize]);
        let mut error = 0.0f64;
        for &t in &self.around[v as usize] {
            let triangle = self.triangles[t as usize]?;
            if triangle.contains(&u) {
                continue;
            }
            let before = triangle.map(|w| self.vertices[w as usize]);
            let after = before.map(|p| if p == from { to } else { p });
            let cross = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
            let (old, new) = (cross(before), cross(after));
            let longest = (0..3).map(|k| after[k].distance(after[(k + 1) % 3])).fold(0.0, f64::max);
            if !(new.length() > THINNEST * longest * longest) || old.dot(new) < LEAST_TURN * old.length() * new.length()
            {
                return None;
            }
            // Both ends bound how far the two fans are apart.
            let unit = new.normalize();
            error = error.max((from - to).dot(unit).abs()).max((from - to).dot(old.normalize_or_zero()).abs());
        }
        Some(error)
    }

    fn finish(self) -> SurfaceMesh {
        let mut place = vec![u32::MAX; self.vertices.len()];
        let mut out = SurfaceMesh::default();
        for triangle in self.triangles.iter().flatten() {
            let corners = triangle.map(|v| {
                let slot = &mut place[v as usize];
                if *slot == u32::MAX {
                    *slot = out.vertices.len() as u32;
                    out.vertices.push(self.vertices[v as usize]);
                }
                *slot
            });
            out.triangles.push(corners);
        }
        out
    }
}
