//! [`Shape`]: what is drawn over a view, as users type it.

use std::path::PathBuf;

use splat_core::glam::Vec2;
use splat_core::{Mask2d, View};

use crate::failure::Failure;
use crate::parse;

/// What is drawn over a view, in pixels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    /// Two opposite corners, both included.
    Rect(Vec2, Vec2),
    /// Corners in order; the inside by the even-odd rule.
    Polygon(Vec<Vec2>),
    /// A stroke through these points, and the radius of the brush.
    Brush(Vec<Vec2>, f32),
    /// A picture.
    Mask(PathBuf),
}

impl Shape {
    /// `X0,Y0,X1,Y1`.
    pub(crate) fn rect(text: &str) -> Result<Self, String> {
        let v = parse::numbers(text, &[4])?;
        let (a, b) = (Vec2::new(v[0], v[1]), Vec2::new(v[2], v[3]));
        Ok(Self::Rect(a, b))
    }

    /// `X,Y;X,Y;...`, three corners at least.
    pub(crate) fn polygon(text: &str) -> Result<Self, String> {
        let corners = parse::points(text)?;
        if corners.len() < 3 {
            return Err(format!("a polygon has at least 3 corners, {} were given", corners.len()));
        }
        Ok(Self::Polygon(corners))
    }

    /// `X,Y;...:R`.
    pub(crate) fn brush(text: &str) -> Result<Self, String> {
        let (points, radius) = text.rsplit_once(':').ok_or("X,Y;X,Y;...:RADIUS was expected")?;
        Ok(Self::Brush(parse::points(points)?, parse::positive(radius)?))
    }

    /// The pixels of a view that the shape covers.
    ///
    /// # Errors
    /// [`Failure::Failed`] if a picture cannot be read.
    pub(crate) fn mask(&self, view: &View) -> Result<Mask2d, Failure> {
        let (width, height) = (view.width, view.height);
        Ok(match self {
            Self::Mask(path) => splat_io::picture::read_mask(path)?,
            Self::Rect(a, b) => Mask2d::rect(width, height, *a, *b),
            Self::Polygon(corners) => Mask2d::polygon(width, height, corners),
            Self::Brush(points, radius) => Mask2d::stroke(width, height, points, *radius),
        })
    }
}

#[cfg(test)]
mod tests {
    use splat_core::glam::Vec3;
    use splat_core::{Pose, View};

    use super::*;

    #[test]
    fn shapes_cover_the_pixels_they_name() {
        let view = View::perspective(Pose::look_at(Vec3::ZERO, Vec3::Z, Vec3::NEG_Y), 1.0, 20, 10);
        let pixels = |shape: Shape| shape.mask(&view).unwrap().count();
        assert_eq!(pixels(Shape::rect("2,3,5,4").unwrap()), 4 * 2);
        assert_eq!(pixels(Shape::polygon("2,3;6,3;6,5;2,5").unwrap()), 4 * 2);
        assert_eq!(pixels(Shape::brush("5,5:0.9").unwrap()), 4);
        for bad in [Shape::polygon("1,1;2,2"), Shape::brush("1,1"), Shape::brush("1,1:0"), Shape::rect("1,2,3")] {
            assert!(bad.is_err());
        }
    }
}
