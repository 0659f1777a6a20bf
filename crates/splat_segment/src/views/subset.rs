//! A subset of ordered views.

/// `wanted` evenly spaced positions of `count` ordered views, first and last included; all of them if there are no more.
///
/// Position j is `round(j (count - 1) / (wanted - 1))`; one wanted view is the middle one.
pub fn evenly_spaced(count: usize, wanted: usize) -> Vec<usize> {
    match (count, wanted) {
        (0, _) | (_, 0) => Vec::new(),
        (n, m) if m >= n => (0..n).collect(),
        (n, 1) => vec![n / 2],
        // Rounded in integers: half a step up, as `round` does.
        (n, m) => (0..m).map(|j| (2 * j * (n - 1) + (m - 1)) / (2 * (m - 1))).collect(),
    }
}
