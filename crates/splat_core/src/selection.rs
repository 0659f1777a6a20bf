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
        if !self.len.is_multiple_of(64) {
            if let Some(last) = self.words.last_mut() {
                *last &= (1 << (self.len % 64)) - 1;
            }
        }
    }
}
