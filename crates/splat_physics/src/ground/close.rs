//! Closing what is open under parts that were taken out.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3, IVec3, Vec3};

use super::lattice::{PlaceMap, Seen};

/// Columns around a part's footprint that tell what it stood on.
const RING: i32 = 8;
/// Fewer columns tell nothing.
const LEAST: usize = 6;
/// Voxels that a support may be away from a part's underside, at least.
const REACH: f64 = 4.0;
/// The same as a share of the part's height.
const SHARE: f64 = 0.2;
/// A column is closed if something is within so many voxels of the support.
const THERE: f64 = 1.5;

/// Continues what a part stood on below its footprint; how many voxels that took, or `None` if nothing is there to continue.
pub(super) fn close(seen: &mut PlaceMap<Seen>, part: &PlaceMap<Seen>) -> Option<usize> {
    let mut footprint: BTreeMap<(i32, i32), i32> = BTreeMap::new();
    for at in part.keys() {
        for (dx, dz) in [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)] {
            let low = footprint.entry((at.x + dx, at.z + dz)).or_insert(at.y);
            *low = at.y.min(*low);
        }
    }
    // The underside, but for a few stray voxels.
    let mut heights: Vec<i32> = part.keys().map(|at| at.y).collect();
    heights.sort_unstable();
    let bottom = f64::from(*heights.get(heights.len() / 50)?);
    let top = f64::from(heights[heights.len() - 1]);
    let reach = REACH.max(SHARE * (top - bottom));
    let support = |x: i32, z: i32| {
        let rows = (bottom - reach).floor() as i32..=(bottom + reach).ceil() as i32;
        let found =
            rows.filter_map(|y| seen.get(&IVec3::new(x, y, z)).map(|s| (f64::from(y) + f64::from(s.offset.y), s)));
        let (mut sum, mut weight) = (0.0, 0.0);
        // Up to the first gap: what is above it is something else.
        let mut last = f64::NEG_INFINITY;
        for (height, s) in found {
            if weight > 0.0 && height - last > 2.0 {
                break;
            }
            last = height;
            sum += f64::from(s.weight) * height;
            weight += f64::from(s.weight);
        }
        (weight > 0.0).then(|| sum / weight)
    };
    let mut ring: BTreeMap<(i32, i32), ()> = BTreeMap::new();
    for &(x, z) in footprint.keys() {
        for dz in -RING..=RING {
            for dx in -RING..=RING {
                if !footprint.contains_key(&(x + dx, z + dz)) {
                    ring.insert((x + dx, z + dz), ());
                }
            }
        }
    }
    let points: Vec<DVec3> =
        ring.keys().filter_map(|&(x, z)| Some(DVec3::new(x.into(), support(x, z)?, z.into()))).collect();
    let plane = Plane::fit(&points)?;
    let mut added = Vec::new();
    for &(x, z) in footprint.keys() {
        let height = plane.at(x.into(), z.into());
        let rows = (height - THERE).floor() as i32..=(height + THERE).ceil() as i32;
        let there = rows.filter_map(|y| seen.get(&IVec3::new(x, y, z)).map(|s| f64::from(y) + f64::from(s.offset.y)));
        if there.into_iter().any(|y| (y - height).abs() <= THERE) {
            continue;
        }
        let row = height.round();
        let offset = Vec3::new(0.0, (height - row) as f32, 0.0);
        added.push((IVec3::new(x, row as i32, z), Seen { weight: 1.0, offset }));
    }
    let count = added.len();
    seen.extend(added);
    Some(count)
}

/// A height above each place that changes evenly.
struct Plane {
    middle: DVec3,
    slope: [f64; 2],
}

impl Plane {
    /// Through most of the points; `None` if there are few.
    fn fit(points: &[DVec3]) -> Option<Self> {
        if points.len() < LEAST {
            return None;
        }
        let mut heights: Vec<f64> = points.iter().map(|p| p.y).collect();
        let median = *heights.select_nth_unstable_by(points.len() / 2, f64::total_cmp).1;
        let mut plane = Self { middle: DVec3::new(0.0, median, 0.0), slope: [0.0; 2] };
        for tolerance in [6.0, 3.0, 1.5] {
            let near: Vec<DVec3> =
                points.iter().copied().filter(|p| (p.y - plane.at(p.x, p.z)).abs() <= tolerance).collect();
            if near.len() < LEAST {
                break;
            }
            let middle = near.iter().sum::<DVec3>() / near.len() as f64;
            let mut m = DMat3::ZERO;
            for p in &near {
                let d = *p - middle;
                m += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
            }
            let (xx, xz, zz) = (m.x_axis.x, m.x_axis.z, m.z_axis.z);
            let (xy, zy) = (m.x_axis.y, m.z_axis.y);
            let det = xx * zz - xz * xz;
            let slope = if det > 1e-3 * (xx + zz).powi(2) {
                [(xy * zz - zy * xz) / det, (zy * xx - xy * xz) / det]
            } else {
                [0.0; 2]
            };
            // Steeper is a wall, not a support.
            let flat = slope.iter().any(|s| s.abs() > 1.0);
            plane = Self { middle, slope: if flat { [0.0; 2] } else { slope } };
        }
        Some(plane)
    }

    fn at(&self, x: f64, z: f64) -> f64 {
        self.middle.y + self.slope[0] * (x - self.middle.x) + self.slope[1] * (z - self.middle.z)
    }
}
