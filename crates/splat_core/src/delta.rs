//! [`SelectionDelta`]: what changed from one selection to the next.

use crate::Selection;

/// The Gaussians that one selection has and another has not, as runs of ids: small for the gestures of a user, and its own inverse.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct SelectionDelta {
    len: usize,
    /// First id and length, rising, apart from each other.
    runs: Vec<(u32, u32)>,
}

impl SelectionDelta {
    /// What leads from `before` to `after`, and back.
    ///
    /// # Panics
    /// If the selections belong to clouds of different lengths.
    pub fn between(before: &Selection, after: &Selection) -> Self {
        assert_eq!(before.len(), after.len(), "selections of different clouds");
        let mut runs: Vec<(u32, u32)> = Vec::new();
        let mut put = |start: u32, count: u32| match runs.last_mut() {
            Some(run) if run.0 + run.1 == start => run.1 += count,
            _ => runs.push((start, count)),
        };
        for (k, (a, b)) in before.words().iter().zip(after.words()).enumerate() {
            let mut changed = a ^ b;
            let mut at = 0;
            while changed != 0 {
                let gap = changed.trailing_zeros();
                let run = (changed >> gap).trailing_ones();
                put(k as u32 * 64 + at + gap, run);
                at += gap + run;
                // A shift by all 64 bits would be none.
                changed = if gap + run == 64 { 0 } else { changed >> (gap + run) };
            }
        }
        Self { len: before.len(), runs }
    }

    /// Turns `before` into `after`, or `after` into `before`.
    ///
    /// # Panics
    /// If the selection belongs to a cloud of another length.
    pub fn apply(&self, selection: &mut Selection) {
        assert_eq!(self.len, selection.len(), "a selection of another cloud");
        for &(start, count) in &self.runs {
            selection.toggle(start as usize..start as usize + count as usize);
        }
    }

    /// Number of Gaussians that change.
    pub fn count(&self) -> usize {
        self.runs.iter().map(|run| run.1 as usize).sum()
    }

    /// Whether nothing changes.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Runs of changing ids, first and count, rising.
    pub fn runs(&self) -> &[(u32, u32)] {
        &self.runs
    }

    /// Memory of the runs, in bytes.
    pub fn size_bytes(&self) -> usize {
        std::mem::size_of_val(self.runs.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(seed: u64, len: usize, rare: u64) -> Selection {
        let mut state = seed;
        Selection::from_fn(len, |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33).is_multiple_of(rare)
        })
    }

    #[test]
    fn a_delta_leads_forth_and_back() {
        for len in [0, 1, 63, 64, 65, 128, 1000] {
            for rare in [1, 2, 9, 1_000_000] {
                let (before, after) = (random(3, len, 3), random(5, len, rare));
                let delta = SelectionDelta::between(&before, &after);
                let mut s = before.clone();
                delta.apply(&mut s);
                assert_eq!(s, after);
                delta.apply(&mut s);
                assert_eq!(s, before);
                assert_eq!(delta.count(), (0..len).filter(|&i| before.contains(i) != after.contains(i)).count());
                assert!(delta.runs().windows(2).all(|w| w[0].0 + w[0].1 < w[1].0), "runs that touch are one");
                assert_eq!(delta.is_empty(), before == after);
            }
        }
    }

    #[test]
    fn a_block_of_a_million_is_one_run() {
        let all = SelectionDelta::between(&Selection::none(1_000_001), &Selection::all(1_000_001));
        assert_eq!(all.runs(), [(0, 1_000_001)]);
        assert_eq!(all.size_bytes(), 8);
    }
}
