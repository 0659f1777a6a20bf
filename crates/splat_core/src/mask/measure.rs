//! Where a mask is, how it compares with another, and at another size.

use super::{Mask2d, MaskError};

/// Pixels from a corner to the opposite one, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PixelBox {
    /// Leftmost column.
    pub x0: u32,
    /// Topmost row.
    pub y0: u32,
    /// Rightmost column.
    pub x1: u32,
    /// Lowest row.
    pub y1: u32,
}

/// The picture's sides that a mask comes near.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Sides {
    /// The left side.
    pub left: bool,
    /// The upper side.
    pub top: bool,
    /// The right side.
    pub right: bool,
    /// The lower side.
    pub bottom: bool,
}

impl Sides {
    /// Whether it is any.
    pub fn any(&self) -> bool {
        self.left || self.top || self.right || self.bottom
    }
}

impl Mask2d {
    /// The smallest box with all pixels that are in (at least half); `None` of an empty mask.
    pub fn bounding_box(&self) -> Option<PixelBox> {
        let mut found: Option<PixelBox> = None;
        for (y, row) in (0..).zip(self.values.chunks_exact(self.width.max(1) as usize)) {
            let first = row.iter().position(|&v| v >= Self::HALF).map(|x| x as u32);
            let last = row.iter().rposition(|&v| v >= Self::HALF).map(|x| x as u32);
            if let (Some(x0), Some(x1)) = (first, last) {
                let b = found.get_or_insert(PixelBox { x0, y0: y, x1, y1: y });
                *b = PixelBox { x0: b.x0.min(x0), y0: b.y0, x1: b.x1.max(x1), y1: y };
            }
        }
        found
    }

    /// Sides of the picture at most `margin` pixels away from a pixel that is in: 0 for those that touch.
    pub fn sides_near(&self, margin: u32) -> Sides {
        self.bounding_box().map_or(Sides::default(), |b| Sides {
            left: b.x0 <= margin,
            top: b.y0 <= margin,
            right: self.width - 1 - b.x1 <= margin,
            bottom: self.height - 1 - b.y1 <= margin,
        })
    }

    /// Intersection over union of the pixels that are in (at least half); 1 where both masks are empty.
    ///
    /// # Errors
    /// [`MaskError::SizeMismatch`] if the sizes differ.
    pub fn iou(&self, other: &Mask2d) -> Result<f64, MaskError> {
        self.same_size(other)?;
        let (mut both, mut either) = (0u64, 0u64);
        for (&a, &b) in self.values.iter().zip(&other.values) {
            let (a, b) = (a >= Self::HALF, b >= Self::HALF);
            both += u64::from(a && b);
            either += u64::from(a || b);
        }
        Ok(if either == 0 { 1.0 } else { both as f64 / either as f64 })
    }

    /// The mask at another size: averages where it shrinks, interpolates linearly where it grows; soft at its edges.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        if (width, height) == (self.width, self.height) {
            return self.clone();
        }
        if self.values.is_empty() {
            return Self::empty(width, height);
        }
        let (w, columns) = (self.width as usize, weights(self.width, width));
        let rows = weights(self.height, height);
        let narrow: Vec<f32> = self
            .values
            .chunks_exact(w)
            .flat_map(|row| {
                let sum = |(first, weights): &(usize, Vec<f32>)| {
                    weights.iter().zip(&row[*first..]).map(|(k, &v)| k * f32::from(v)).sum::<f32>()
                };
                columns.iter().map(sum).collect::<Vec<_>>()
            })
            .collect();
        let mut values = Vec::with_capacity(width as usize * height as usize);
        for (first, weights) in &rows {
            values.extend((0..width as usize).map(|x| {
                let at = |k: usize| narrow[(first + k) * width as usize + x];
                let sum: f32 = weights.iter().enumerate().map(|(k, weight)| weight * at(k)).sum();
                sum.round() as u8
            }));
        }
        Self { width, height, values }
    }
}

/// For every new pixel the first old one it looks at and the weights from there on: a triangle about its centre, as wide as a new
/// pixel is, at least two old ones across; cut off at the picture's edge and scaled to a sum of 1.
fn weights(old: u32, new: u32) -> Vec<(usize, Vec<f32>)> {
    let scale = f64::from(old) / f64::from(new.max(1));
    let reach = scale.max(1.0);
    (0..new)
        .map(|x| {
            let center = (f64::from(x) + 0.5) * scale - 0.5;
            let first = (center - reach).ceil().max(0.0) as usize;
            let last = ((center + reach).floor() as usize).min(old as usize - 1);
            let raw: Vec<f64> = (first..=last).map(|k| (1.0 - (k as f64 - center).abs() / reach).max(0.0)).collect();
            let sum: f64 = raw.iter().sum();
            (first, raw.into_iter().map(|k| (k / sum) as f32).collect())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_hold_all_that_is_in_and_no_more() {
        let mask = Mask2d::from_fn(20, 10, |x, y| (x, y) == (3, 4) || (x, y) == (18, 2));
        assert_eq!(mask.bounding_box(), Some(PixelBox { x0: 3, y0: 2, x1: 18, y1: 4 }));
        assert_eq!(Mask2d::empty(5, 5).bounding_box(), None);
        assert_eq!(Mask2d::empty(0, 0).bounding_box(), None);
        let all = Mask2d::from_fn(7, 3, |_, _| true);
        assert_eq!(all.bounding_box(), Some(PixelBox { x0: 0, y0: 0, x1: 6, y1: 2 }));
    }

    #[test]
    fn sides_are_near_within_the_margin() {
        let mask = Mask2d::from_fn(20, 10, |x, y| (2..=17).contains(&x) && y == 5);
        let sides = |m| {
            let s = mask.sides_near(m);
            [s.left, s.top, s.right, s.bottom]
        };
        assert_eq!(sides(1), [false; 4]);
        assert_eq!(sides(2), [true, false, true, false]);
        assert_eq!(sides(4), [true, false, true, true]);
        assert!(mask.sides_near(5).any() && !Mask2d::empty(4, 4).sides_near(9).any());
    }

    #[test]
    fn iou_counts_pixels() {
        let (a, b) = (Mask2d::from_fn(10, 1, |x, _| x < 6), Mask2d::from_fn(10, 1, |x, _| x >= 3));
        assert_eq!(a.iou(&b), Ok(0.3));
        assert_eq!(Mask2d::empty(2, 2).iou(&Mask2d::empty(2, 2)), Ok(1.0));
        assert!(a.iou(&Mask2d::empty(1, 10)).is_err());
    }

    /// The definition: the triangle over all pixels, in f64.
    fn slowly(mask: &Mask2d, width: u32, height: u32) -> Vec<f64> {
        let (sx, sy) = (f64::from(mask.width()) / f64::from(width), f64::from(mask.height()) / f64::from(height));
        let triangle = |d: f64, reach: f64| (1.0 - d.abs() / reach).max(0.0);
        let mut out = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let (cx, cy) = ((f64::from(x) + 0.5) * sx, (f64::from(y) + 0.5) * sy);
                let (mut sum, mut total) = (0.0, 0.0);
                for (i, &v) in mask.values().iter().enumerate() {
                    let (u, w) = (i as u32 % mask.width(), i as u32 / mask.width());
                    let k =
                        triangle(f64::from(u) + 0.5 - cx, sx.max(1.0)) * triangle(f64::from(w) + 0.5 - cy, sy.max(1.0));
                    sum += k * f64::from(v);
                    total += k;
                }
                out.push(sum / total);
            }
        }
        out
    }

    #[test]
    fn other_sizes_average_and_interpolate() {
        let mask = Mask2d::from_fn(23, 17, |x, y| (x * 5 + y * 3) % 7 < 3);
        for (w, h) in [(23, 17), (46, 34), (11, 8), (1, 1), (5, 40), (100, 3)] {
            let resized = mask.resized(w, h);
            assert_eq!((resized.width(), resized.height()), (w, h));
            if (w, h) != (23, 17) {
                for (&fast, slow) in resized.values().iter().zip(slowly(&mask, w, h)) {
                    assert!((f64::from(fast) - slow).abs() < 0.51, "{w}x{h}: {fast} {slow}");
                }
            }
        }
        assert_eq!(mask.resized(0, 9).values().len(), 0);
        assert_eq!(Mask2d::empty(0, 0).resized(3, 2), Mask2d::empty(3, 2));
        assert_eq!(Mask2d::from_fn(9, 9, |_, _| true).resized(31, 4).count(), 31 * 4, "full stays full");
    }
}
