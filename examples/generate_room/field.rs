//! The whole room as one distance field, over a grid that names the solids near each cell.

use glam::DVec3;

use crate::math::v;
use crate::room::{BACK, FRONT, HIGH, LEFT, RIGHT};
use crate::shapes::Solid;

/// Side of a cell, in metres.
const CELL: f64 = 0.11;
/// Solids farther than this from a cell are summed up in one number.
const REACH: f64 = 0.40;

/// Distances to all solids.
#[derive(Debug)]
pub(crate) struct Field<'a> {
    /// The solids.
    pub(crate) solids: &'a [Solid],
    low: DVec3,
    size: [usize; 3],
    /// Per cell: where its list starts in `near`, and no more than the distance to all solids not in the list.
    cells: Vec<(u32, f32)>,
    near: Vec<u16>,
}

impl<'a> Field<'a> {
    /// A field of these solids.
    pub(crate) fn new(solids: &'a [Solid]) -> Self {
        let low = v(LEFT - 0.3, -0.2, BACK - 0.3);
        let high = v(RIGHT + 0.3, HIGH + 0.2, FRONT + 0.3);
        let n = ((high - low) / CELL).ceil();
        let size = [n.x as usize, n.y as usize, n.z as usize];
        let corner = CELL * 0.5 * 3f64.sqrt();
        let (mut cells, mut near) = (Vec::new(), Vec::new());
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let middle = low + (v(x as f64, y as f64, z as f64) + DVec3::splat(0.5)) * CELL;
                    let (start, mut rest) = (near.len() as u32, f64::MAX);
                    for (k, solid) in solids.iter().enumerate() {
                        let reach = solid.shape.half().length();
                        let far = (middle - solid.world(solid.shape.middle())).length() - reach - corner;
                        if far > REACH {
                            rest = rest.min(far);
                            continue;
                        }
                        let d = solid.distance(middle) - corner;
                        if d < REACH {
                            near.push(k as u16);
                        } else {
                            rest = rest.min(d);
                        }
                    }
                    cells.push((start, rest as f32));
                }
            }
        }
        cells.push((near.len() as u32, 0.0));
        Self { solids, low, size, cells, near }
    }

    fn cell(&self, p: DVec3) -> Option<usize> {
        let q = (p - self.low) / CELL;
        let inside = q.min_element() >= 0.0
            && (q.x as usize) < self.size[0]
            && (q.y as usize) < self.size[1]
            && (q.z as usize) < self.size[2];
        inside.then(|| (q.z as usize * self.size[1] + q.y as usize) * self.size[0] + q.x as usize)
    }

    /// Solids that may be within reach of a place.
    pub(crate) fn near(&self, p: DVec3) -> &[u16] {
        self.cell(p).map_or(&[], |c| &self.near[self.cells[c].0 as usize..self.cells[c + 1].0 as usize])
    }

    /// Signed distance to the nearest solid, or less; outside the grid a small positive number.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        let Some(c) = self.cell(p) else { return 0.3 };
        let mut best = f64::from(self.cells[c].1);
        for &k in &self.near[self.cells[c].0 as usize..self.cells[c + 1].0 as usize] {
            best = best.min(self.solids[usize::from(k)].distance(p));
        }
        best
    }

    /// Share of light that comes through from `p` along the unit vector `d` up to `far`; the larger `hard`, the sharper its edge.
    pub(crate) fn light_through(&self, p: DVec3, d: DVec3, far: f64, hard: f64) -> f64 {
        let (mut t, mut through) = (0.015, 1.0f64);
        for _ in 0..64 {
            if t >= far {
                break;
            }
            let h = self.distance(p + d * t);
            // Beyond its reach the field only knows a lower bound, which must not cast a shadow.
            through = through.min((0.5 + 0.5 * hard * h / t).max(h / REACH));
            if through <= 0.0 {
                return 0.0;
            }
            t += h.clamp(0.008, 0.25);
        }
        through * through * (3.0 - 2.0 * through)
    }

    /// Whether nothing stands between two places.
    pub(crate) fn clear(&self, from: DVec3, to: DVec3) -> bool {
        let (d, far) = ((to - from).normalize(), (to - from).length());
        let mut t = 0.012;
        for _ in 0..96 {
            if t >= far {
                return true;
            }
            let h = self.distance(from + d * t);
            if h < 0.0005 {
                return false;
            }
            t += h.max(0.003);
        }
        false
    }
}
