//! Closing, flooding, and the pieces that are left.

use glam::{DVec3, IVec2};

use super::VoxelGrid;

/// Voxels within so many steps through faces of a marked one.
pub(super) fn dilated(grid: &VoxelGrid, marked: &[bool], steps: u32) -> Vec<bool> {
    let mut out = marked.to_vec();
    let mut front: Vec<usize> = (0..marked.len()).filter(|&v| marked[v]).collect();
    for _ in 0..steps {
        let mut next = Vec::new();
        for v in front {
            for n in grid.neighbours(v) {
                if !out[n] {
                    out[n] = true;
                    next.push(n);
                }
            }
        }
        front = next;
    }
    out
}

/// Voxels that cannot be reached from the border of the grid without passing a wall.
pub(super) fn enclosed(grid: &VoxelGrid, wall: &[bool]) -> Vec<bool> {
    let mut outside = vec![false; wall.len()];
    let mut front: Vec<usize> = (0..wall.len()).filter(|&v| !wall[v] && grid.at_border(v)).collect();
    front.iter().for_each(|&v| outside[v] = true);
    while let Some(v) = front.pop() {
        for n in grid.neighbours(v) {
            if !wall[n] && !outside[n] {
                outside[n] = true;
                front.push(n);
            }
        }
    }
    (0..wall.len()).map(|v| !outside[v] && !wall[v]).collect()
}

/// The shell with all that it encloses once gaps of `steps` voxels to each side are closed.
pub(super) fn filled(grid: &VoxelGrid, shell: &[bool], steps: u32) -> Vec<bool> {
    let wall = dilated(grid, shell, steps);
    let inside = enclosed(grid, &wall);
    let mut full: Vec<bool> = wall.iter().zip(&inside).map(|(&w, &i)| w || i).collect();
    // What was added around the outside goes again: the outside, grown by as much, takes it back.
    let outside: Vec<bool> = full.iter().map(|&f| !f).collect();
    let eaten = dilated(grid, &outside, steps);
    for v in 0..full.len() {
        full[v] = shell[v] || (full[v] && !eaten[v]);
    }
    full
}

/// Sizes of connected pieces (through faces) and the piece of each marked voxel, largest first, ties by the lowest voxel.
pub(super) fn pieces(grid: &VoxelGrid, marked: &[bool]) -> (Vec<usize>, Vec<u32>) {
    const NONE: u32 = u32::MAX;
    let mut label = vec![NONE; marked.len()];
    let mut sizes: Vec<usize> = Vec::new();
    let mut front = Vec::new();
    for begin in 0..marked.len() {
        if !marked[begin] || label[begin] != NONE {
            continue;
        }
        let piece = sizes.len() as u32;
        sizes.push(0);
        label[begin] = piece;
        front.push(begin);
        while let Some(v) = front.pop() {
            sizes[piece as usize] += 1;
            for n in grid.neighbours(v) {
                if marked[n] && label[n] == NONE {
                    label[n] = piece;
                    front.push(n);
                }
            }
        }
    }
    let mut order: Vec<u32> = (0..sizes.len() as u32).collect();
    order.sort_by_key(|&p| (std::cmp::Reverse(sizes[p as usize]), p));
    let mut rank = vec![0; order.len()];
    for (r, &p) in order.iter().enumerate() {
        rank[p as usize] = r as u32;
    }
    label.iter_mut().filter(|l| **l != NONE).for_each(|l| *l = rank[*l as usize]);
    (order.iter().map(|&p| sizes[p as usize]).collect(), label)
}

/// The voxels that close the footprint of the lowest layer, as seen along `up`.
///
/// A thing that stood on a table has a rim there and nothing inside it. The layer is as high as two voxels or a thirtieth of the
/// thing, since no rim is quite level.
pub(super) fn bottom(grid: &VoxelGrid, shell: &[bool], up: DVec3) -> Vec<usize> {
    let up = up.normalize();
    let (first, second) = up.any_orthonormal_pair();
    let heights = (0..shell.len()).filter(|&v| shell[v]).map(|v| up.dot(grid.center(v)));
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    heights.for_each(|h| (low, high) = (low.min(h), high.max(h)));
    if !(low < high) {
        return Vec::new();
    }
    let layer = (2.0 * grid.voxel).max((high - low) / 30.0);
    let cell = |p: DVec3| IVec2::new((first.dot(p) / grid.voxel).floor() as i32, (second.dot(p) / grid.voxel).floor() as i32);
    let members: Vec<usize> =
        (0..shell.len()).filter(|&v| shell[v] && up.dot(grid.center(v)) <= low + layer).collect();
    let cells: Vec<IVec2> = members.iter().map(|&v| cell(grid.center(v))).collect();
    let (mut least, mut most) = (IVec2::MAX, IVec2::MIN);
    cells.iter().for_each(|&c| (least, most) = (least.min(c), most.max(c)));
    // A flat grid of its own, with room to flood around and to close gaps of a rim.
    const CLOSING: u32 = 2;
    let margin = 2 + CLOSING as i32;
    let dims = (most - least + 1 + 2 * margin).as_uvec2();
    let plane = VoxelGrid { origin: DVec3::ZERO, voxel: 1.0, dims: dims.extend(3) };
    let middle = |c: IVec2| plane.index((c - least + margin).as_uvec2().extend(1));
    let mut rim = vec![false; plane.len()];
    for v in 0..plane.len() {
        // Floor and lid, so that the flood stays in the plane.
        rim[v] = plane.at(v).z != 1;
    }
    cells.iter().for_each(|&c| rim[middle(c)] = true);
    let flat = flat_filled(&plane, &rim, CLOSING);
    let height = low;
    let mut out = Vec::new();
    for v in (0..plane.len()).filter(|&v| plane.at(v).z == 1 && flat[v]) {
        let at = plane.at(v);
        let corner = IVec2::new(at.x as i32, at.y as i32) + least - margin;
        // Quarter cells: the planes' cells and the voxels lie across each other.
        for k in 0..9 {
            let a = f64::from(corner.x) + (f64::from(k % 3) + 0.5) / 3.0;
            let b = f64::from(corner.y) + (f64::from(k / 3) + 0.5) / 3.0;
            out.extend(grid.locate(first * (a * grid.voxel) + second * (b * grid.voxel) + up * height));
        }
    }
    out.sort_unstable();
    out.dedup();
    out
}

/// [`filled`] within one layer of a grid whose other layers are all wall.
fn flat_filled(plane: &VoxelGrid, rim: &[bool], steps: u32) -> Vec<bool> {
    let in_layer = |v: usize| plane.at(v).z == 1;
    let grow = |marked: &[bool]| -> Vec<bool> {
        let mut out = marked.to_vec();
        for v in (0..marked.len()).filter(|&v| in_layer(v) && marked[v]) {
            plane.neighbours(v).filter(|&n| in_layer(n)).for_each(|n| out[n] = true);
        }
        out
    };
    let mut wall = rim.to_vec();
    (0..steps).for_each(|_| wall = grow(&wall));
    let inside = enclosed(plane, &wall);
    let mut outside: Vec<bool> = (0..wall.len()).map(|v| in_layer(v) && !wall[v] && !inside[v]).collect();
    (0..steps).for_each(|_| outside = grow(&outside));
    (0..wall.len()).map(|v| in_layer(v) && (rim[v] || !outside[v])).collect()
}

/// The voxels inside the convex hull of the marked ones, as seen from 146 directions.
pub(super) fn hull(grid: &VoxelGrid, marked: &[bool]) -> Vec<bool> {
    let mut directions: Vec<DVec3> = Vec::new();
    let range = -2..=2;
    for x in range.clone() {
        for y in range.clone() {
            for z in range.clone() {
                let d = glam::IVec3::new(x, y, z);
                // Each direction once: the shortest of those along a line.
                let shortest = d != glam::IVec3::ZERO && !(x % 2 == 0 && y % 2 == 0 && z % 2 == 0);
                if shortest {
                    directions.push(d.as_dvec3());
                }
            }
        }
    }
    let mut ends = vec![f64::NEG_INFINITY; directions.len()];
    for v in (0..marked.len()).filter(|&v| marked[v]) {
        let p = grid.at(v).as_dvec3();
        ends.iter_mut().zip(&directions).for_each(|(end, d)| *end = end.max(d.dot(p)));
    }
    (0..marked.len())
        .map(|v| {
            let p = grid.at(v).as_dvec3();
            ends.iter().zip(&directions).all(|(&end, d)| d.dot(p) <= end + 1e-9)
        })
        .collect()
}
