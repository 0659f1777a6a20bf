//! Slices that several threads write to, each in its own places.

use std::marker::PhantomData;
use std::sync::atomic::AtomicU64;

/// A slice whose elements are written by many threads, no element by two.
pub(super) struct Shared<'a, T> {
    start: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: access goes through `write` and `part`, whose callers promise that no element is used by two threads.
unsafe impl<T: Send> Send for Shared<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Send> Sync for Shared<'_, T> {}

impl<'a, T: Copy> Shared<'a, T> {
    pub(super) fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), slice: PhantomData }
    }

    /// Sets one element.
    ///
    /// # Safety
    /// `i` is in the slice and no other thread uses this element meanwhile.
    #[inline(always)]
    pub(super) unsafe fn write(&self, i: usize, value: T) {
        debug_assert!(i < self.len);
        // SAFETY: promised by the caller.
        unsafe { self.start.add(i).write(value) }
    }

    /// A part to write to.
    ///
    /// # Safety
    /// No other thread uses these elements while the part is borrowed.
    ///
    /// # Panics
    /// If the part is not inside.
    #[expect(clippy::mut_from_ref, reason = "the point of the type; its callers keep parts apart")]
    pub(super) unsafe fn part(&self, start: usize, len: usize) -> &mut [T] {
        assert!(start <= self.len && len <= self.len - start, "part {start} + {len} of {}", self.len);
        // SAFETY: inside the slice, and used by nobody else as promised by the caller.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(start), len) }
    }
}

/// The same words, to be added to by many threads.
pub(super) fn atomic(words: &mut [u64]) -> &[AtomicU64] {
    const { assert!(align_of::<AtomicU64>() == align_of::<u64>()) };
    // SAFETY: `AtomicU64` has the size of `u64` and, as just checked, its alignment, and the unique borrow is turned into
    // a shared one for its whole lifetime.
    unsafe { &*(std::ptr::from_mut(words) as *const [AtomicU64]) }
}
