//! Large arrays on large pages.

use bytemuck::Zeroable;

/// Arrays below this size gain nothing.
const WORTH_BYTES: usize = 4 << 20;

/// Zeros, from memory the kernel has not touched yet: the thread that fills a block also pays for its pages. Large arrays
/// ask for large pages, which halves the time to load a capture and spares whoever reads the arrays in random order.
pub(crate) fn zeroed_vec<T: Zeroable>(count: usize) -> Vec<T> {
    let values = bytemuck::zeroed_vec::<T>(count);
    if std::mem::size_of_val(values.as_slice()) >= WORTH_BYTES {
        advise(values.as_ptr().cast(), std::mem::size_of_val(values.as_slice()));
    }
    values
}

#[cfg(target_os = "linux")]
fn advise(start: *const u8, bytes: usize) {
    const PAGE: usize = 4096;
    let inner = start.align_offset(PAGE);
    if inner < bytes {
        // SAFETY: the range lies within a live allocation of the caller, starts on a page, and this advice changes no
        // content. A kernel that does not know it returns an error, which changes nothing either.
        unsafe { libc::madvise(start.add(inner).cast_mut().cast(), bytes - inner, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn advise(_start: *const u8, _bytes: usize) {}

#[cfg(test)]
mod tests {
    #[test]
    fn arrays_of_any_size_are_zero_and_writable() {
        for count in [0, 1, 1000, (4 << 20) / 4, (4 << 20) / 4 + 1, 3_000_001] {
            let mut values = super::zeroed_vec::<f32>(count);
            assert!(values.len() == count && values.iter().all(|v| v.to_bits() == 0));
            values.fill(1.0);
            assert!(values.iter().all(|v| *v == 1.0));
        }
    }
}
