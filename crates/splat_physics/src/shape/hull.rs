//! Convex hulls of few points.

use std::collections::HashMap;

use glam::DVec3;

/// Flatter hulls, in parts of their size cubed, are none.
const FLATTEST: f64 = 1e-9;
/// Points nearer to a face than this, in parts of the size, are on it.
const ON_FACE: f64 = 1e-9;

/// A convex polyhedron.
#[derive(Clone, Debug)]
pub(super) struct ConvexHull {
    /// Its corners.
    pub(super) points: Vec<DVec3>,
    /// In m^3.
    pub(super) volume: f64,
}

/// The hull of points, by adding one after the other; `None` if they lie in a plane or are not finite. Cost: points times faces.
pub(super) fn convex_hull(points: &[DVec3]) -> Option<ConvexHull> {
    let first = *points.first()?;
    if !points.iter().all(|p| p.is_finite()) {
        return None;
    }
    let farthest = |score: &dyn Fn(DVec3) -> f64| {
        let better = |best: usize, k: usize| if score(points[k]) > score(points[best]) { k } else { best };
        (0..points.len()).fold(0, better)
    };
    let b = farthest(&|p| p.distance_squared(first));
    let along = points[b] - first;
    let size = along.length();
    let c = farthest(&|p| (p - first).cross(along).length_squared());
    let across = along.cross(points[c] - first);
    let d = farthest(&|p| (p - first).dot(across).abs());
    let six = (points[d] - first).dot(across);
    if !(six.abs() > FLATTEST * size * size * size) {
        return None;
    }
    let (b, c) = if six > 0.0 { (c, b) } else { (b, c) };
    // Counter-clockwise seen from outside.
    let mut faces: Vec<[usize; 3]> = vec![[0, b, c], [0, d, b], [b, d, c], [c, d, 0]];
    let cross = |[a, b, c]: [usize; 3]| (points[b] - points[a]).cross(points[c] - points[a]);
    for k in 0..points.len() {
        let sees = |face: &[usize; 3]| {
            let normal = cross(*face).normalize_or_zero();
            normal.dot(points[k] - points[face[0]]) > ON_FACE * size
        };
        let (seen, hidden): (Vec<_>, Vec<_>) = faces.iter().copied().partition(sees);
        if seen.is_empty() {
            continue;
        }
        let mut edges: HashMap<(usize, usize), ()> = HashMap::new();
        seen.iter().flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])]).for_each(|e| {
            edges.insert(e, ());
        });
        faces = hidden;
        // In the order of the faces, not of the map.
        for face in seen {
            for (a, b) in [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])] {
                if !edges.contains_key(&(b, a)) {
                    faces.push([a, b, k]);
                }
            }
        }
    }
    let volume = faces.iter().map(|f| cross(*f).dot(points[f[0]] - first)).sum::<f64>() / 6.0;
    let mut corners: Vec<usize> = faces.into_iter().flatten().collect();
    corners.sort_unstable();
    corners.dedup();
    let points: Vec<DVec3> = corners.into_iter().map(|k| points[k]).collect();
    (volume > FLATTEST * size * size * size).then_some(ConvexHull { points, volume })
}

/// The points that are farthest in some of `count` directions: the axes, then a spiral from pole to pole.
pub(super) fn extremes(points: &[DVec3], count: usize) -> Vec<DVec3> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let direction = |k: usize| {
        let height = 1.0 - (2 * k + 1) as f64 / count as f64;
        let (sin, cos) = (golden * k as f64).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        DVec3::new(radius * cos, height, radius * sin)
    };
    let axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    let mut kept: Vec<usize> = Vec::new();
    for along in axes.chain((0..count).map(direction)) {
        let reach = |k: usize| points[k].dot(along);
        let farthest = (1..points.len()).fold(0, |best, k| if reach(k) > reach(best) { k } else { best });
        if !points.is_empty() && !kept.contains(&farthest) {
            kept.push(farthest);
        }
    }
    kept.into_iter().map(|k| points[k]).collect()
}
