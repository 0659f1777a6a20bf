//! [`Selection`]: which Gaussians are meant.

/// How a new set changes the current one; the same four for 2D masks and for selections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SelectMode {
    /// Replaces the current set.
    #[default]
    New,
    /// Union.
    Add,
    /// Current set without the new one.
    Subtract,
    /// What both have.
    Intersect,
}

/// One bit per Gaussian of a cloud, in input order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Selection {
    words: Vec<u64>,
    len: usize,
}

impl Selection {
    /// Nothing selected, of `len` Gaussians.
    pub fn none(len: usize) -> Self {
        Self { words: vec![0; len.div_ceil(64)], len }
    }

    /// Everything selected, of `len` Gaussians.
    pub fn all(len: usize) -> Self {
        let mut s = Self { words: vec![u64::MAX; len.div_ceil(64)], len };
        s.clear_tail();
        s
    }

    /// Selected where `inside(i)`.
    pub fn from_fn(len: usize, mut inside: impl FnMut(usize) -> bool) -> Self {
        let mut s = Self::none(len);
        for i in 0..len {
            s.words[i / 64] |= u64::from(inside(i)) << (i % 64);
        }
        s
    }

    /// The Gaussians `ids` of `len`; ids at or beyond `len` are left out.
    pub fn from_ids(len: usize, ids: impl IntoIterator<Item = u32>) -> Self {
        let mut s = Self::none(len);
        for i in ids {
            if (i as usize) < len {
                s.insert(i as usize);
            }
        }
        s
    }

    /// The selection of `len` Gaussians with these bits, laid out as in [`Selection::words`]; missing words count as 0,
    /// bits beyond the end are dropped.
    pub fn from_words(len: usize, mut words: Vec<u64>) -> Self {
        words.resize(len.div_ceil(64), 0);
        let mut s = Self { words, len };
        s.clear_tail();
        s
    }

    /// Gives the memory of the bits back, to be used again.
    pub fn into_words(self) -> Vec<u64> {
        self.words
    }

    /// Number of Gaussians of the cloud this belongs to.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the cloud has no Gaussians; see [`Selection::count`] for "nothing is selected".
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of selected Gaussians.
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Whether Gaussian `i` is selected; `false` beyond the end.
    pub fn contains(&self, i: usize) -> bool {
        i < self.len && self.words[i / 64] >> (i % 64) & 1 == 1
    }

    /// Selects Gaussian `i`.
    ///
    /// # Panics
    /// If `i` is not below [`Selection::len`].
    pub fn insert(&mut self, i: usize) {
        assert!(i < self.len, "Gaussian {i} of {}", self.len);
        self.words[i / 64] |= 1 << (i % 64);
    }

    /// Deselects Gaussian `i`; nothing happens beyond the end.
    pub fn remove(&mut self, i: usize) {
        if i < self.len {
            self.words[i / 64] &= !(1 << (i % 64));
        }
    }

    /// The bits, 64 Gaussians a word, lowest bit first; bits beyond the end are 0.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Combines with another selection of the same cloud.
    ///
    /// # Panics
    /// If the lengths differ: selections of different clouds were mixed.
    pub fn apply(&mut self, mode: SelectMode, other: &Selection) {
        assert_eq!(self.len, other.len, "selections of different clouds");
        for (a, &b) in self.words.iter_mut().zip(&other.words) {
            *a = match mode {
                SelectMode::New => b,
                SelectMode::Add => *a | b,
                SelectMode::Subtract => *a & !b,
                SelectMode::Intersect => *a & b,
            };
        }
    }

    /// What is selected becomes unselected and the other way round.
    pub fn invert(&mut self) {
        for w in &mut self.words {
            *w = !*w;
        }
        self.clear_tail();
    }

    /// Inverts the Gaussians `range`.
    ///
    /// # Panics
    /// If the range ends beyond [`Selection::len`].
    pub fn toggle(&mut self, range: std::ops::Range<usize>) {
        assert!(range.end <= self.len, "Gaussians up to {} of {}", range.end, self.len);
        let mut at = range.start;
        while at < range.end {
            let (word, bit) = (at / 64, at % 64);
            let count = (64 - bit).min(range.end - at);
            self.words[word] ^= (u64::MAX >> (64 - count)) << bit;
            at += count;
        }
    }

    /// Selected where `inside(i)`, asked on several threads.
    pub fn from_fn_parallel(len: usize, inside: impl Fn(usize) -> bool + Sync) -> Self {
        use rayon::prelude::*;
        let word = |k: usize| {
            let first = k * 64;
            (first..len.min(first + 64)).fold(0, |word, i| word | u64::from(inside(i)) << (i - first))
        };
        let words = (0..len.div_ceil(64)).into_par_iter().with_min_len(64).map(word).collect();
        Self { words, len }
    }

    /// Selected positions, rising.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.words.iter().enumerate().flat_map(|(k, &w)| {
            let mut w = w;
            std::iter::from_fn(move || {
                (w != 0).then(|| {
                    let bit = w.trailing_zeros() as usize;
                    w &= w - 1;
                    k * 64 + bit
                })
            })
        })
    }

    /// Selected ids, rising, as for [`Cloud::pick`](crate::Cloud::pick).
    pub fn ids(&self) -> Vec<u32> {
        self.iter().map(|i| i as u32).collect()
    }

    /// Jaccard index with another selection of the same cloud: |both| / |either|, 1 where both are empty.
    pub fn jaccard(&self, other: &Selection) -> f64 {
        let (mut both, mut either) = (0u64, 0u64);
        for (a, b) in self.words.iter().zip(&other.words) {
            both += u64::from((a & b).count_ones());
            either += u64::from((a | b).count_ones());
        }
        if either == 0 { 1.0 } else { both as f64 / either as f64 }
    }

    fn clear_tail(&mut self) {
        if !self.len.is_multiple_of(64)
            && let Some(last) = self.words.last_mut()
        {
            *last &= (1 << (self.len % 64)) - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some(seed: usize, len: usize) -> Selection {
        Selection::from_fn(len, |i| (i * 7 + seed * 13) % 5 < 2)
    }

    #[test]
    fn modes_are_the_set_operations_they_are_named_after() {
        for len in [0, 1, 64, 65, 200] {
            let (a, b) = (some(1, len), some(2, len));
            for mode in [SelectMode::New, SelectMode::Add, SelectMode::Subtract, SelectMode::Intersect] {
                let mut fast = a.clone();
                fast.apply(mode, &b);
                let slow = Selection::from_fn(len, |i| match mode {
                    SelectMode::New => b.contains(i),
                    SelectMode::Add => a.contains(i) || b.contains(i),
                    SelectMode::Subtract => a.contains(i) && !b.contains(i),
                    SelectMode::Intersect => a.contains(i) && b.contains(i),
                });
                assert_eq!(fast, slow);
            }
        }
    }

    #[test]
    fn bits_beyond_the_end_stay_clear() {
        for len in [0, 1, 63, 64, 65, 130] {
            let mut s = some(3, len);
            let count = s.count();
            s.invert();
            assert_eq!(s.count(), len - count);
            assert_eq!(Selection::all(len).count(), len);
            assert_eq!(Selection::from_words(len, vec![u64::MAX; 9]), Selection::all(len));
            assert_eq!(Selection::from_words(len, Vec::new()), Selection::none(len));
            assert_eq!(Selection::from_fn_parallel(len, |i| s.contains(i)), s);
            assert_eq!(Selection::from_ids(len, s.ids().into_iter().chain([9999])), s);
            assert_eq!(Selection::from_words(len, s.clone().into_words()), s);
            assert_eq!((s.len(), s.is_empty(), s.contains(len)), (len, len == 0, false));
        }
    }

    #[test]
    fn ranges_toggle_what_is_in_them() {
        for (start, end) in [(0, 0), (0, 200), (3, 5), (60, 70), (64, 128), (63, 129), (199, 200)] {
            let mut fast = some(1, 200);
            fast.toggle(start..end);
            assert_eq!(fast, Selection::from_fn(200, |i| some(1, 200).contains(i) != (start..end).contains(&i)));
        }
    }

    #[test]
    fn single_gaussians_come_and_go() {
        let mut s = Selection::none(70);
        s.insert(69);
        s.insert(3);
        assert_eq!((s.ids(), s.words()[1]), (vec![3, 69], 1 << 5));
        s.remove(69);
        s.remove(1000);
        assert_eq!(s.iter().collect::<Vec<_>>(), [3]);
    }

    #[test]
    fn jaccard_is_the_share_of_either_that_both_have() {
        let (a, b) = (Selection::from_ids(9, [1, 2, 3]), Selection::from_ids(9, [2, 3, 4]));
        assert_eq!(a.jaccard(&b), 0.5);
        assert_eq!(Selection::none(9).jaccard(&Selection::none(9)), 1.0);
        assert_eq!(a.jaccard(&Selection::none(9)), 0.0);
    }
}
