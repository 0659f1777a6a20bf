//! [`Shape2d`]: an area of a camera's picture.

use bevy::math::Vec2;
use splat_core::Mask2d;

/// An area of a camera's picture, in physical pixels of its viewport, from the top left; what lies beyond the picture's edge is
/// cut off.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape2d {
    /// The rectangle with these two corners.
    Rect(Vec2, Vec2),
    /// What the line through these corners and back to the first encloses; twice is outside (even-odd).
    Polygon(Vec<Vec2>),
    /// What a round brush covers along these points.
    Stroke {
        /// The way of its middle.
        points: Vec<Vec2>,
        /// Its radius, in pixels.
        radius: f32,
    },
    /// These pixels. A mask of another size than the picture is scaled to it.
    Mask(Mask2d),
}

impl Shape2d {
    /// The shape's pixels in a picture of `width` x `height`: those whose centres are inside.
    pub fn mask(&self, width: u32, height: u32) -> Mask2d {
        match self {
            // Between the corners and not of whole pixels, as polygons are.
            Self::Rect(a, b) => {
                let (from, to) = (a.min(*b), a.max(*b));
                Mask2d::polygon(width, height, &[from, Vec2::new(to.x, from.y), to, Vec2::new(from.x, to.y)])
            }
            Self::Polygon(corners) => Mask2d::polygon(width, height, corners),
            Self::Stroke { points, radius } => Mask2d::stroke(width, height, points, *radius),
            Self::Mask(mask) => mask.resized(width, height),
        }
    }

    /// Corners of its outline, to be drawn as a closed line; of a stroke, the way of its middle, which is not closed. Empty for
    /// masks.
    pub fn outline(&self) -> Vec<Vec2> {
        match self {
            Self::Rect(a, b) => vec![*a, Vec2::new(b.x, a.y), *b, Vec2::new(a.x, b.y)],
            Self::Polygon(points) | Self::Stroke { points, .. } => points.clone(),
            Self::Mask(_) => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_the_pixels_whose_centres_they_hold() {
        let corners = [Vec2::new(6.0, 1.0), Vec2::new(2.0, 4.0)];
        let rect = Shape2d::Rect(corners[0], corners[1]);
        assert_eq!(rect.mask(9, 5), Mask2d::from_fn(9, 5, |x, y| (2..6).contains(&x) && (1..4).contains(&y)));
        assert_eq!(Shape2d::Polygon(rect.outline()).mask(9, 5), rect.mask(9, 5));
        let dot = Shape2d::Stroke { points: vec![Vec2::new(4.5, 2.5)], radius: 1.0 };
        assert_eq!(dot.mask(9, 5).count(), 5);
        let all = Shape2d::Rect(Vec2::splat(-1e9), Vec2::splat(1e9));
        assert_eq!(all.mask(9, 5).count(), 45);
        let none = Shape2d::Rect(Vec2::splat(f32::NAN), Vec2::ONE);
        assert_eq!(none.mask(9, 5).count(), 0);
    }
}
