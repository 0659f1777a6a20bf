//! In which order a tracker sees the views, and where each annotation enters.

use super::ViewSets;
use splat_core::Selection;

/// Position of the set most like `of` (largest Jaccard index, the lowest of equals); `None` of an empty list.
///
/// The paper prints the argmin of the Jaccard *index*, which is the least similar view; its text and its released
/// code take the most similar one.
pub fn most_similar(of: &Selection, among: &[Selection]) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for (k, set) in among.iter().enumerate() {
        let j = of.jaccard(set);
        if best.is_none_or(|(_, most)| j > most) {
            best = Some((k, j));
        }
    }
    best.map(|(k, _)| k)
}

/// The positions 0..count of a closed ring, starting at `start`.
pub fn ring_from(start: usize, count: usize) -> Vec<usize> {
    (0..count).map(|k| (start + k) % count).collect()
}

/// A path through unordered views: from `start` always on to the most similar view not yet taken (the lowest of equals).
pub fn chain(sets: &ViewSets, start: usize) -> Vec<usize> {
    let count = sets.sets.len();
    let mut left: Vec<usize> = (0..count).filter(|&k| k != start).collect();
    let mut path = Vec::with_capacity(count);
    if start < count {
        path.push(start);
    }
    while let Some(&last) = path.last().filter(|_| !left.is_empty()) {
        let mut best = (0, -1.0);
        for (k, &view) in left.iter().enumerate() {
            let j = sets.similarity(last, view);
            if j > best.1 {
                best = (k, j);
            }
        }
        path.push(left.remove(best.0));
    }
    path
}

/// How the views lie to one another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PlanKind {
    /// In order around the object, the last next to the first.
    #[default]
    Ring,
    /// In any order: a path is made from the most similar ones.
    Unordered,
}

/// An order of views, and where each reference is injected.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Positions of the views in the order of tracking.
    pub order: Vec<usize>,
    /// Per reference the position *in the order* before which it is injected: that of its most similar view.
    pub before: Vec<usize>,
}

impl Plan {
    /// Starts at the view most similar to the first reference; every reference enters before its own most similar view.
    ///
    /// `views` and `references`: what each sees.
    pub fn new(kind: PlanKind, views: &ViewSets, references: &[Selection]) -> Self {
        let count = views.sets.len();
        let nearest = |r: &Selection| most_similar(r, &views.sets).unwrap_or(0);
        let start = references.first().map_or(0, nearest);
        let order = match kind {
            _ if count == 0 => Vec::new(),
            PlanKind::Ring => ring_from(start, count),
            PlanKind::Unordered => chain(views, start),
        };
        let mut position = vec![0; count];
        for (k, &view) in order.iter().enumerate() {
            position[view] = k;
        }
        let before = references.iter().map(|r| if count == 0 { 0 } else { position[nearest(r)] }).collect();
        Self { order, before }
    }
}
