//! Shapes as masks: rectangle, polygon, brush stroke.

use glam::Vec2;

use crate::Mask2d;

impl Mask2d {
    /// A hard mask of the pixels from one corner to the opposite one, both included, clipped to the picture.
    pub fn rect(width: u32, height: u32, a: Vec2, b: Vec2) -> Self {
        let (from, to) = (a.min(b).floor(), a.max(b).floor());
        let inside = |v: u32, from: f32, to: f32| v as f32 >= from && v as f32 <= to;
        Self::from_fn(width, height, |x, y| inside(x, from.x, to.x) && inside(y, from.y, to.y))
    }

    /// A hard mask of the pixels whose centre is inside a polygon, by the even-odd rule; empty for fewer than three corners
    /// or one that is not finite.
    ///
    /// `corners`: in pixel coordinates, in order; the last is joined to the first.
    pub fn polygon(width: u32, height: u32, corners: &[Vec2]) -> Self {
        let mut mask = Self::empty(width, height);
        if corners.len() < 3 || !corners.iter().all(|c| c.is_finite()) || width == 0 {
            return mask;
        }
        let mut crossings = Vec::new();
        for (y, row) in mask.values_mut().chunks_exact_mut(width as usize).enumerate() {
            let y = y as f32 + 0.5;
            crossings.clear();
            let next = corners.iter().cycle().skip(1);
            for (a, b) in corners.iter().zip(next) {
                // Half open, so that a corner on the line counts once.
                if (a.y > y) != (b.y > y) {
                    crossings.push(a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x));
                }
            }
            crossings.sort_unstable_by(f32::total_cmp);
            for span in crossings.as_chunks::<2>().0 {
                // Pixels whose centre lies from the first crossing up to the second.
                let edge = |x: f32| ((x - 0.5).ceil().max(0.0) as usize).min(width as usize);
                row[edge(span[0])..edge(span[1])].fill(255);
            }
        }
        mask
    }

    /// A hard mask of a stroke: the pixels whose centre lies within `radius` pixels of the line through `points`. A single
    /// point is a disc.
    pub fn stroke(width: u32, height: u32, points: &[Vec2], radius: f32) -> Self {
        let mut mask = Self::empty(width, height);
        let single = points.first().map(|&p| (p, p));
        let segments = points.windows(2).map(|w| (w[0], w[1]));
        for (a, b) in single.into_iter().chain(segments) {
            if !(a.is_finite() && b.is_finite() && radius >= 0.0) {
                continue;
            }
            let first = (a.min(b) - radius).floor().max(Vec2::ZERO).as_uvec2();
            let last = (a.max(b) + radius).ceil().max(Vec2::ZERO).as_uvec2();
            for y in first.y..last.y.min(height) {
                for x in first.x..last.x.min(width) {
                    let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let along = b - a;
                    let t = ((p - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
                    if p.distance(a + t * along) <= radius {
                        mask.values_mut()[y as usize * width as usize + x as usize] = 255;
                    }
                }
            }
        }
        mask
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f32, y: f32) -> Vec2 {
        Vec2::new(x, y)
    }

    #[test]
    fn rectangles_include_both_corners_and_stop_at_the_edge() {
        assert_eq!(Mask2d::rect(20, 10, v(2.0, 3.0), v(5.0, 4.0)).count(), 4 * 2);
        assert_eq!(Mask2d::rect(20, 10, v(5.0, 4.0), v(2.0, 3.0)).count(), 4 * 2);
        assert_eq!(Mask2d::rect(20, 10, v(-9.0, -9.0), v(99.0, 99.0)).count(), 200);
        assert_eq!(Mask2d::rect(20, 10, v(50.0, 50.0), v(60.0, 60.0)).count(), 0);
        assert_eq!(Mask2d::rect(20, 10, v(f32::NAN, 0.0), v(9.0, f32::NAN)).width(), 20);
    }

    /// The definition, pixel by pixel: a ray to the left crosses the outline an odd number of times.
    fn polygon_slowly(width: u32, height: u32, corners: &[Vec2]) -> Mask2d {
        Mask2d::from_fn(width, height, |x, y| {
            let p = v(x as f32 + 0.5, y as f32 + 0.5);
            let crosses = |k: usize| {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                (a.y > p.y) != (b.y > p.y) && a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x) <= p.x
            };
            (0..corners.len()).filter(|&k| crosses(k)).count() % 2 == 1
        })
    }

    #[test]
    fn polygons_are_what_the_even_odd_rule_says() {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Quarters of pixels: corners and edges meet pixel centres often.
            ((state >> 50) % 140) as f32 * 0.25 - 4.0
        };
        for corners in 3..9 {
            for _ in 0..50 {
                let corners: Vec<Vec2> = (0..corners).map(|_| v(next(), next())).collect();
                assert_eq!(Mask2d::polygon(23, 17, &corners), polygon_slowly(23, 17, &corners), "{corners:?}");
            }
        }
    }

    #[test]
    fn what_is_no_polygon_is_empty() {
        for corners in [vec![], vec![v(1.0, 1.0), v(2.0, 2.0)], vec![v(0.0, 0.0), v(f32::NAN, 9.0), v(9.0, 9.0)]] {
            assert_eq!(Mask2d::polygon(9, 9, &corners).count(), 0);
        }
        assert_eq!(Mask2d::polygon(0, 0, &[v(0.0, 0.0), v(1.0, 0.0), v(0.0, 1.0)]).count(), 0);
    }

    #[test]
    fn strokes_cover_what_is_near_the_line() {
        assert_eq!(Mask2d::stroke(20, 10, &[v(5.0, 5.0)], 0.9).count(), 4);
        assert_eq!(Mask2d::stroke(20, 10, &[v(2.5, 5.0), v(8.5, 5.0)], 0.6).count(), 14);
        assert_eq!(Mask2d::stroke(20, 10, &[v(-5.0, -5.0), v(30.0, 30.0)], 100.0).count(), 200);
        assert_eq!(Mask2d::stroke(20, 10, &[v(f32::NAN, 1.0)], 3.0).count(), 0);
        assert_eq!(Mask2d::stroke(20, 10, &[], 3.0).count(), 0);
        assert_eq!(Mask2d::stroke(20, 10, &[v(5.5, 5.5)], f32::NAN).count(), 0);
    }
}
