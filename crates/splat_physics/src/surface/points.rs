//! [`surface_points`].

use glam::DVec3;

use crate::Solid;

/// Up to `count` points on the surface of a solid, as far from each other as they can be: each next one is the farthest from all
/// before it. In metres, in the body's frame.
///
/// The first is the one farthest from the middle, so that corners come early; `seed` breaks no tie, the lowest voxel does.
pub fn surface_points(solid: &Solid, count: usize, seed: u64) -> Vec<DVec3> {
    let _ = seed;
    let candidates: Vec<DVec3> = solid.occupied().filter_map(|v| surface_at(solid, v)).collect();
    if candidates.is_empty() || count == 0 {
        return Vec::new();
    }
    let (least, most) = solid.bounds();
    let middle = 0.5 * (least + most);
    let mut distance: Vec<f64> = candidates.iter().map(|p| p.distance_squared(middle)).collect();
    let farthest = |distance: &[f64]| {
        let better = |best: usize, k: usize| if distance[k] > distance[best] { k } else { best };
        (0..distance.len()).fold(0, better)
    };
    let first = farthest(&distance);
    distance.fill(f64::INFINITY);
    let mut next = first;
    let mut out = Vec::with_capacity(count.min(candidates.len()));
    while out.len() < count.min(candidates.len()) {
        let point = candidates[next];
        out.push(point);
        distance.iter_mut().zip(&candidates).for_each(|(d, p)| *d = d.min(p.distance_squared(point)));
        next = farthest(&distance);
        if distance[next] == 0.0 {
            break;
        }
    }
    out
}

/// Where the surface runs through a voxel; `None` where it does not.
fn surface_at(solid: &Solid, voxel: usize) -> Option<DVec3> {
    let grid = &solid.grid;
    let at = grid.at(voxel);
    // Half a voxel is solid where the surface runs through its middle; a whole one ends at its faces.
    let reach = (f64::from(solid.weights[voxel]) - 0.5) * grid.voxel;
    let mut offset = DVec3::ZERO;
    let mut open = false;
    for axis in 0..3 {
        for (sign, inside) in [(-1.0, at[axis] > 0), (1.0, at[axis] + 1 < grid.dims[axis])] {
            let mut other = at;
            let empty = !inside || {
                other[axis] = if sign < 0.0 { at[axis] - 1 } else { at[axis] + 1 };
                solid.weights[grid.index(other)] == 0.0
            };
            if empty {
                offset[axis] += sign * reach;
                open = true;
            }
        }
    }
    open.then(|| grid.center(voxel) + offset)
}
