//! [`Baked`]: how a value becomes bytes and back.

use glam::{DMat3, DQuat, DVec3, UVec3, Vec3};

use super::{BakeError, Sink, Source};

/// A value that a `.splatphys` file can hold.
///
/// Reading what was written gives the same bits. Reading anything else gives a value that the type allows, or an error.
pub trait Baked: Sized {
    /// Bytes that any value takes, at least 1: what a list's length is checked against before there is room for it.
    const LEAST: usize;

    /// Appends the value.
    fn write(&self, to: &mut Sink);

    /// Reads a value.
    ///
    /// # Errors
    /// [`BakeError::Short`] and [`BakeError::Unsound`], by the source's methods.
    fn read(from: &mut Source<'_>) -> Result<Self, BakeError>;
}

macro_rules! numbers {
    ($($number:ty),*) => {$(
        impl Baked for $number {
            const LEAST: usize = size_of::<$number>();

            fn write(&self, to: &mut Sink) {
                to.bytes(&self.to_le_bytes());
            }

            fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
                let mut own = [0; size_of::<$number>()];
                own.copy_from_slice(from.bytes(size_of::<$number>())?);
                Ok(Self::from_le_bytes(own))
            }
        }
    )*};
}

numbers!(u8, u16, u32, u64, i32, f32, f64);

macro_rules! vectors {
    ($($vector:ty, $array:ty, $from:ident, $to:ident;)*) => {$(
        impl Baked for $vector {
            const LEAST: usize = <$array>::LEAST;

            fn write(&self, to: &mut Sink) {
                to.put(&self.$to());
            }

            fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
                Ok(Self::$from(from.get()?))
            }
        }
    )*};
}

vectors! {
    UVec3, [u32; 3], from_array, to_array;
    Vec3, [f32; 3], from_array, to_array;
    DVec3, [f64; 3], from_array, to_array;
    DQuat, [f64; 4], from_array, to_array;
}

impl Baked for DMat3 {
    const LEAST: usize = 3 * DVec3::LEAST;

    fn write(&self, to: &mut Sink) {
        to.put(&[self.x_axis, self.y_axis, self.z_axis]);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let [x, y, z] = from.get()?;
        Ok(Self::from_cols(x, y, z))
    }
}

impl Baked for bool {
    const LEAST: usize = 1;

    fn write(&self, to: &mut Sink) {
        to.put(&u8::from(*self));
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        match from.get::<u8>()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(from.unsound("a yes or no is neither")),
        }
    }
}

impl<T: Baked, const N: usize> Baked for [T; N] {
    const LEAST: usize = if N == 0 { 1 } else { N * T::LEAST };

    fn write(&self, to: &mut Sink) {
        self.iter().for_each(|value| to.put(value));
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let mut values = Vec::with_capacity(N);
        for _ in 0..N {
            values.push(from.get()?);
        }
        values.try_into().map_err(|_| from.short())
    }
}

impl<T: Baked> Baked for Option<T> {
    const LEAST: usize = 1;

    fn write(&self, to: &mut Sink) {
        to.put(&self.is_some());
        self.iter().for_each(|value| to.put(value));
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        Ok(if from.get()? { Some(from.get()?) } else { None })
    }
}

impl<T: Baked> Baked for Vec<T> {
    const LEAST: usize = 8;

    fn write(&self, to: &mut Sink) {
        to.put_all(self);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let count = usize::try_from(from.get::<u64>()?).unwrap_or(usize::MAX);
        // Room only for what can be there: a length is not believed.
        if count.checked_mul(T::LEAST).is_none_or(|bytes| bytes > from.left()) {
            return Err(from.short());
        }
        let mut values = Self::with_capacity(count);
        for _ in 0..count {
            values.push(from.get()?);
        }
        Ok(values)
    }
}

impl<A: Baked, B: Baked> Baked for (A, B) {
    const LEAST: usize = A::LEAST + B::LEAST;

    fn write(&self, to: &mut Sink) {
        to.put(&self.0);
        to.put(&self.1);
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        Ok((from.get()?, from.get()?))
    }
}
