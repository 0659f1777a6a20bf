//! Distances in a mask, and what follows from them: growing, shrinking, the band inside the contour.

use super::Mask2d;

/// What lies beyond the picture's edge, where that decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Beyond {
    /// Nothing of the mask: the picture's edge is a contour.
    #[default]
    Out,
    /// More of what lies at the edge: a mask cut off by the picture is not worn away there.
    Same,
}

/// No pixel in reach.
const NONE: u32 = u32::MAX;

impl Mask2d {
    /// Distance in pixels from every pixel's centre to the centre of the nearest pixel that is in (at least half): 0 inside, infinite
    /// if nothing is. Row-major.
    ///
    /// Exact: distances along columns, then the lower envelope of parabolas along rows (Felzenszwalb and Huttenlocher 2012), in
    /// integers.
    pub fn distances(&self) -> Vec<f32> {
        let squared = squared_distances(self.width as usize, &self.values, |v| v >= Self::HALF);
        squared.into_iter().map(|d| d.map_or(f32::INFINITY, |d| (d as f64).sqrt() as f32)).collect()
    }

    /// Distance in pixels from every pixel's centre to the centre of the nearest pixel that is not in: 0 outside. With
    /// [`Beyond::Out`] the pixels around the picture count as such, with [`Beyond::Same`] they do not, and all is infinite where the
    /// whole picture is in.
    pub fn depths(&self, beyond: Beyond) -> Vec<f32> {
        let (width, height) = (self.width as usize, self.height as usize);
        let squared = squared_distances(width, &self.values, |v| v < Self::HALF);
        let to_edge = |i: usize| {
            let (x, y) = (i % width, i / width);
            (x + 1).min(width - x).min(y + 1).min(height - y) as u64
        };
        let depth = |(i, d): (usize, Option<u64>)| {
            let edge = (beyond == Beyond::Out).then(|| to_edge(i) * to_edge(i));
            let nearest = [d, edge].into_iter().flatten().min();
            nearest.map_or(f32::INFINITY, |d| (d as f64).sqrt() as f32)
        };
        squared.into_iter().enumerate().map(depth).collect()
    }

    /// The pixels within `radius` pixels of the mask, as a hard mask. Softness is cut at half first.
    pub fn dilated(&self, radius: f32) -> Self {
        self.hard(&self.distances(), |d| d <= radius.max(0.0))
    }

    /// The pixels of the mask farther than `radius` pixels from everything that is not in it, as a hard mask.
    pub fn eroded(&self, radius: f32, beyond: Beyond) -> Self {
        self.hard(&self.depths(beyond), |d| d > radius.max(0.0))
    }

    /// The pixels of the mask within `width` pixels of something that is not in it: the band inside its contour, as a hard mask.
    pub fn boundary_band(&self, width: f32, beyond: Beyond) -> Self {
        self.hard(&self.depths(beyond), |d| d > 0.0 && d <= width)
    }

    fn hard(&self, distances: &[f32], inside: impl Fn(f32) -> bool) -> Self {
        let values = distances.iter().map(|&d| if inside(d) { 255 } else { 0 }).collect();
        Self { width: self.width, height: self.height, values }
    }
}

/// Squared distance of every pixel to the nearest one whose value is a `target`; `None` if there is none.
fn squared_distances(width: usize, values: &[u8], target: impl Fn(u8) -> bool) -> Vec<Option<u64>> {
    if values.is_empty() {
        return Vec::new();
    }
    let height = values.len() / width;
    // Along columns: rows since the last target above, then below.
    let mut along: Vec<u32> = values.iter().map(|&v| if target(v) { 0 } else { NONE }).collect();
    for i in width..along.len() {
        along[i] = along[i].min(along[i - width].saturating_add(1));
    }
    for i in (0..along.len() - width).rev() {
        along[i] = along[i].min(along[i + width].saturating_add(1));
    }
    let mut out = vec![None; values.len()];
    // Columns whose parabolas are lowest somewhere, and the first x from which on each is.
    let mut lowest: Vec<(usize, usize)> = Vec::with_capacity(width);
    for y in 0..height {
        let row = &along[y * width..(y + 1) * width];
        let at = |column: usize, x: usize| {
            let (dx, dy) = (x.abs_diff(column) as u64, u64::from(row[column]));
            dx * dx + dy * dy
        };
        lowest.clear();
        for column in (0..width).filter(|&c| row[c] != NONE) {
            // The first x at which this parabola is lower than that of an earlier column.
            let from = |earlier: usize| {
                let own = (column * column) as i64 + i64::from(row[column]).pow(2);
                let other = (earlier * earlier) as i64 + i64::from(row[earlier]).pow(2);
                (own - other).div_euclid(2 * (column - earlier) as i64) + 1
            };
            let mut start = 0;
            while let Some(&(earlier, since)) = lowest.last() {
                let first = from(earlier).max(0) as usize;
                if first > since {
                    start = first;
                    break;
                }
                lowest.pop();
            }
            if start < width {
                lowest.push((column, start));
            }
        }
        for (k, &(column, start)) in lowest.iter().enumerate() {
            let end = lowest.get(k + 1).map_or(width, |next| next.1);
            for x in start..end {
                out[y * width + x] = Some(at(column, x));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn masks() -> Vec<Mask2d> {
        let mut state = 5u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let mut masks = Vec::new();
        for (w, h) in [(1, 1), (1, 7), (9, 1), (13, 8), (20, 31), (0, 0), (0, 4)] {
            for rare in [1, 2, 5, 40, 100_000] {
                masks.push(Mask2d::from_fn(w, h, |_, _| next().is_multiple_of(rare)));
            }
        }
        masks.push(Mask2d::new(2, 2, vec![0, 127, 128, 255]).unwrap());
        masks
    }

    /// The definition: the nearest of all pixels, those around the picture too if `rim`.
    fn slowly(mask: &Mask2d, inside: bool, rim: bool) -> Vec<f32> {
        let (w, h) = (i64::from(mask.width()), i64::from(mask.height()));
        let target = |x: i64, y: i64| match x >= 0 && y >= 0 && x < w && y < h {
            true => mask.contains(x as u32, y as u32) == inside,
            false => rim,
        };
        let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
        let nearest = |(x, y): (i64, i64)| {
            let all = (-1..=h).flat_map(|v| (-1..=w).map(move |u| (u, v)));
            let distances = all
                .filter(|&(u, v)| target(u, v))
                .map(|(u, v)| (((x - u).pow(2) + (y - v).pow(2)) as f64).sqrt() as f32);
            distances.fold(f32::INFINITY, f32::min)
        };
        pixels.map(nearest).collect()
    }

    #[test]
    fn distances_are_those_of_a_full_search() {
        for mask in masks() {
            assert_eq!(mask.distances(), slowly(&mask, true, false), "{mask:?}");
            assert_eq!(mask.depths(Beyond::Same), slowly(&mask, false, false), "{mask:?}");
            assert_eq!(mask.depths(Beyond::Out), slowly(&mask, false, true), "{mask:?}");
        }
    }

    #[test]
    fn growing_and_shrinking_by_discs() {
        let has_disc = |mask: &Mask2d, x: u32, y: u32, r: f32, wanted: bool, rim: bool| {
            let reach = r.floor() as i64;
            let disc = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
            let mut disc = disc.filter(|&(dx, dy)| ((dx * dx + dy * dy) as f32).sqrt() <= r);
            disc.any(|(dx, dy)| {
                let (u, v) = (i64::from(x) + dx, i64::from(y) + dy);
                let within = u >= 0 && v >= 0 && u < i64::from(mask.width()) && v < i64::from(mask.height());
                if within { mask.contains(u as u32, v as u32) == wanted } else { rim }
            })
        };
        for mask in masks() {
            let (w, h) = (mask.width(), mask.height());
            for r in [0.0, 1.0, 1.5, 3.0] {
                assert_eq!(mask.dilated(r), Mask2d::from_fn(w, h, |x, y| has_disc(&mask, x, y, r, true, false)));
                for (beyond, rim) in [(Beyond::Out, true), (Beyond::Same, false)] {
                    let eroded = Mask2d::from_fn(w, h, |x, y| !has_disc(&mask, x, y, r, false, rim));
                    let band = Mask2d::from_fn(w, h, |x, y| mask.contains(x, y) && !eroded.contains(x, y));
                    assert_eq!(mask.eroded(r, beyond), eroded);
                    assert_eq!(mask.boundary_band(r, beyond), band);
                }
            }
        }
        let disc = Mask2d::from_fn(9, 9, |x, y| x == 4 && y == 4);
        assert_eq!(disc.dilated(f32::NAN), disc, "no radius is none");
        assert_eq!(disc.dilated(-3.0), disc);
    }
}
