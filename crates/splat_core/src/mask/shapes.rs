//! Shapes as masks: rectangle, ellipse, polygon, brush stroke.

use glam::Vec2;

use crate::Mask2d;

impl Mask2d {
    /// A hard mask of the pixels from one corner to the opposite one, both included, clipped to the picture.
    pub fn rect(width: u32, height: u32, a: Vec2, b: Vec2) -> Self {
        let (from, to) = (a.min(b).floor(), a.max(b).floor());
        let inside = |v: u32, from: f32, to: f32| v as f32 >= from && v as f32 <= to;
        Self::from_fn(width, height, |x, y| inside(x, from.x, to.x) && inside(y, from.y, to.y))
    }

    /// A hard mask of the pixels whose centre lies in an ellipse, its rim included; empty where a number is not finite or a radius
    /// is negative.
    ///
    /// `radii`: half its axes, in pixels, along x and y before it is turned by `angle` radians (from x towards y).
    pub fn ellipse(width: u32, height: u32, center: Vec2, radii: Vec2, angle: f32) -> Self {
        let mut mask = Self::empty(width, height);
        if !(center.is_finite() && radii.is_finite() && angle.is_finite() && radii.min_element() >= 0.0) {
            return mask;
        }
        let axis = Vec2::from_angle(angle);
        // A radius of 0 leaves a line: nothing but what lies on it exactly.
        let shrink = 1.0 / radii.max(Vec2::splat(1e-6));
        let back = Vec2::new(axis.x, -axis.y);
        let half = Vec2::new((axis.x * radii.x).hypot(axis.y * radii.y), (axis.y * radii.x).hypot(axis.x * radii.y));
        mask.paint(center - half, center + half, |p| {
            let d = back.rotate(p - center) * shrink;
            if d.length_squared() <= 1.0 { 255 } else { 0 }
        });
        mask
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
        Self::soft_stroke(width, height, points, radius, 0.0)
    }

    /// A mask of a stroke with a soft rim: full within `radius` pixels of the line through `points`, from there falling evenly to
    /// nothing `softness` pixels farther out. A single point is a disc. Segments with a point that is not finite are left out.
    pub fn soft_stroke(width: u32, height: u32, points: &[Vec2], radius: f32, softness: f32) -> Self {
        let mut mask = Self::empty(width, height);
        if !(radius >= 0.0 && softness >= 0.0) {
            return mask;
        }
        let single = points.first().map(|&p| (p, p));
        let segments = points.windows(2).map(|w| (w[0], w[1]));
        for (a, b) in single.into_iter().chain(segments).filter(|(a, b)| a.is_finite() && b.is_finite()) {
            let reach = radius + softness;
            let along = b - a;
            mask.paint(a.min(b) - reach, a.max(b) + reach, |p| {
                let t = ((p - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
                let beyond = p.distance(a + t * along) - radius;
                // NaN, of lengths that overflow, is outside.
                if beyond <= 0.0 {
                    255
                } else if beyond < softness {
                    ((1.0 - beyond / softness) * 255.0).round() as u8
                } else {
                    0
                }
            });
        }
        mask
    }

    /// Raises the pixels from one corner to the other to the value of their centre, where that is more.
    fn paint(&mut self, from: Vec2, to: Vec2, value: impl Fn(Vec2) -> u8) {
        let (first, last) = (from.floor().max(Vec2::ZERO).as_uvec2(), to.ceil().max(Vec2::ZERO).as_uvec2());
        let (width, height) = (self.width(), self.height());
        for y in first.y..last.y.min(height) {
            for x in first.x..last.x.min(width) {
                let there = &mut self.values_mut()[y as usize * width as usize + x as usize];
                *there = (*there).max(value(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)));
            }
        }
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

    #[test]
    fn ellipses_are_what_their_equation_says() {
        for (center, radii, angle) in [
            (v(10.0, 8.0), v(7.0, 3.0), 0.0f32),
            (v(10.2, 8.7), v(7.0, 2.0), 0.7),
            (v(-2.0, 3.0), v(9.0, 9.0), 2.0),
            (v(12.0, 9.0), v(2.0, 30.0), -1.2),
        ] {
            let slow = Mask2d::from_fn(24, 18, |x, y| {
                let d = v(x as f32 + 0.5, y as f32 + 0.5) - center;
                let (sin, cos) = angle.sin_cos();
                let (u, w) = ((cos * d.x + sin * d.y) / radii.x, (cos * d.y - sin * d.x) / radii.y);
                u * u + w * w <= 1.0
            });
            assert!(slow.count() > 20);
            assert_eq!(Mask2d::ellipse(24, 18, center, radii, angle), slow);
        }
        assert_eq!(Mask2d::ellipse(9, 9, v(4.0, 4.0), v(f32::NAN, 2.0), 0.0).count(), 0);
        assert_eq!(Mask2d::ellipse(9, 9, v(4.0, 4.0), v(-3.0, 2.0), 0.0).count(), 0);
        assert_eq!(Mask2d::ellipse(9, 9, v(4.5, 4.5), v(0.0, 0.0), 0.0).count(), 1);
    }

    #[test]
    fn soft_strokes_fall_from_full_to_nothing() {
        let (a, b) = (v(4.0, 5.0), v(21.0, 9.0));
        let mask = Mask2d::soft_stroke(28, 18, &[a, b], 2.0, 3.0);
        for y in 0..18 {
            for x in 0..28 {
                let p = v(x as f32 + 0.5, y as f32 + 0.5);
                // The nearest of many points of the line.
                let d = (0..=1000).map(|k| p.distance(a.lerp(b, k as f32 / 1000.0))).fold(f32::INFINITY, f32::min);
                let wanted = (1.0 - (d - 2.0) / 3.0).clamp(0.0, 1.0) * 255.0;
                assert!((f32::from(mask.values()[y * 28 + x]) - wanted).abs() < 2.0);
            }
        }
        assert_eq!(Mask2d::soft_stroke(9, 9, &[v(4.5, 4.5)], 1.0, f32::NAN).count(), 0);
    }
}
