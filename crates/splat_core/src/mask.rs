//! [`Mask2d`]: which pixels of a view are meant, softly.

use crate::SelectMode;

mod distance;
mod measure;
mod pieces;
mod shapes;

pub use distance::Beyond;
pub use measure::{PixelBox, Sides};
pub use pieces::MaskPieces;

/// Why bytes do not make a [`Mask2d`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MaskError {
    /// The number of bytes is not `width * height`.
    #[error("a mask of {width}x{height} pixels needs {} bytes, {found} were given", u64::from(*width) * u64::from(*height))]
    Length {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// Bytes given.
        found: usize,
    },
    /// Two masks differ in size.
    #[error("the masks differ in size: {}x{} and {}x{}", left.0, left.1, right.0, right.1)]
    SizeMismatch {
        /// Width and height of the first.
        left: (u32, u32),
        /// Width and height of the second.
        right: (u32, u32),
    },
}

/// A soft mask over the pixels of a view: 0 is out, 255 is in, row-major from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask2d {
    width: u32,
    height: u32,
    values: Vec<u8>,
}

impl Mask2d {
    /// Value from which on a pixel counts as in, where a yes or no is needed.
    pub const HALF: u8 = 128;

    /// A mask from its bytes.
    ///
    /// # Errors
    /// [`MaskError::Length`] if `values` does not have `width * height` bytes.
    pub fn new(width: u32, height: u32, values: Vec<u8>) -> Result<Self, MaskError> {
        if values.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(MaskError::Length { width, height, found: values.len() });
        }
        Ok(Self { width, height, values })
    }

    /// A mask with nothing in it.
    pub fn empty(width: u32, height: u32) -> Self {
        Self { width, height, values: vec![0; width as usize * height as usize] }
    }

    /// A hard mask: pixel (x, y) is in where `inside(x, y)`.
    pub fn from_fn(width: u32, height: u32, mut inside: impl FnMut(u32, u32) -> bool) -> Self {
        let mut values = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                values.push(if inside(x, y) { 255 } else { 0 });
            }
        }
        Self { width, height, values }
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All values, row-major.
    pub fn values(&self) -> &[u8] {
        &self.values
    }

    /// All values, row-major, for painting.
    pub fn values_mut(&mut self) -> &mut [u8] {
        &mut self.values
    }

    /// Whether pixel (x, y) is in (at least half); pixels outside the mask are not.
    pub fn contains(&self, x: u32, y: u32) -> bool {
        x < self.width && y < self.height && self.values[y as usize * self.width as usize + x as usize] >= Self::HALF
    }

    /// Number of pixels that are in (at least half).
    pub fn count(&self) -> usize {
        self.values.iter().filter(|&&v| v >= Self::HALF).count()
    }

    /// Combines with another mask: the fuzzy set operations (maximum, minimum, complement), which are the usual ones on hard masks.
    ///
    /// # Errors
    /// [`MaskError::SizeMismatch`] if the sizes differ; this mask is unchanged then.
    pub fn apply(&mut self, mode: SelectMode, other: &Mask2d) -> Result<(), MaskError> {
        self.same_size(other)?;
        for (a, &b) in self.values.iter_mut().zip(&other.values) {
            *a = match mode {
                SelectMode::New => b,
                SelectMode::Add => (*a).max(b),
                SelectMode::Subtract => (*a).min(255 - b),
                SelectMode::Intersect => (*a).min(b),
            };
        }
        Ok(())
    }

    fn same_size(&self, other: &Mask2d) -> Result<(), MaskError> {
        let (left, right) = ((self.width, self.height), (other.width, other.height));
        if left == right { Ok(()) } else { Err(MaskError::SizeMismatch { left, right }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_must_fit_the_size() {
        assert_eq!(Mask2d::new(3, 2, vec![0; 5]), Err(MaskError::Length { width: 3, height: 2, found: 5 }));
        let huge = Mask2d::new(u32::MAX, u32::MAX, vec![0; 5]).unwrap_err().to_string();
        assert!(huge.contains("18446744065119617025"), "{huge}");
        let mut mask = Mask2d::new(3, 2, vec![0, 127, 128, 255, 1, 2]).unwrap();
        assert_eq!((mask.width(), mask.height(), mask.count()), (3, 2, 2));
        assert!(mask.contains(2, 0) && mask.contains(0, 1) && !mask.contains(1, 0));
        assert!(!mask.contains(3, 0) && !mask.contains(0, 2));
        mask.values_mut()[0] = 255;
        assert_eq!(mask.values()[0], 255);
    }

    #[test]
    fn modes_are_the_fuzzy_set_operations() {
        let a = Mask2d::new(4, 1, vec![0, 100, 200, 255]).unwrap();
        let b = Mask2d::new(4, 1, vec![255, 50, 255, 0]).unwrap();
        for (mode, wanted) in [
            (SelectMode::New, [255, 50, 255, 0]),
            (SelectMode::Add, [255, 100, 255, 255]),
            (SelectMode::Subtract, [0, 100, 0, 255]),
            (SelectMode::Intersect, [0, 50, 200, 0]),
        ] {
            let mut c = a.clone();
            c.apply(mode, &b).unwrap();
            assert_eq!(c.values(), wanted, "{mode:?}");
        }
        let mut c = a.clone();
        assert!(c.apply(SelectMode::Add, &Mask2d::empty(1, 4)).is_err());
        assert_eq!(c, a);
    }
}
