//! Selections changed by what lies beside what: grow, shrink, connected pieces.

use crate::{NO_NEIGHBOUR, Neighbours, Selection};

impl Neighbours {
    /// The selection and the neighbours of what is selected, `times` times.
    ///
    /// # Panics
    /// If the selection belongs to a cloud of another length; so for all methods here.
    pub fn grown(&self, selection: &Selection, times: u32) -> Selection {
        assert_eq!(self.len(), selection.len(), "a selection of another cloud");
        let mut grown = selection.clone();
        let mut edge: Vec<u32> = selection.ids();
        for _ in 0..times {
            let mut next = Vec::new();
            for &i in &edge {
                for &j in self.of(i as usize).0 {
                    if j != NO_NEIGHBOUR && !grown.contains(j as usize) {
                        grown.insert(j as usize);
                        next.push(j);
                    }
                }
            }
            if next.is_empty() {
                break;
            }
            edge = next;
        }
        grown
    }

    /// The selection without what is a neighbour of anything unselected, `times` times: what is not selected grows.
    pub fn shrunk(&self, selection: &Selection, times: u32) -> Selection {
        let mut outside = selection.clone();
        outside.invert();
        let mut shrunk = self.grown(&outside, times);
        shrunk.invert();
        shrunk
    }

    /// Pieces of the selection that hang together, each by the rising ids of its Gaussians; the largest first, of equals the one
    /// with the lowest id. Two hang together where either is a neighbour of the other.
    pub fn pieces(&self, selection: &Selection) -> Vec<Vec<u32>> {
        assert_eq!(self.len(), selection.len(), "a selection of another cloud");
        let mut parent: Vec<u32> = (0..self.len() as u32).collect();
        for i in selection.iter() {
            for &j in self.of(i).0 {
                if j != NO_NEIGHBOUR && selection.contains(j as usize) {
                    let (a, b) = (root(&mut parent, i as u32), root(&mut parent, j));
                    // The lowest id of a piece is its root.
                    parent[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let mut piece_of_root = vec![usize::MAX; self.len()];
        let mut pieces: Vec<Vec<u32>> = Vec::new();
        for i in selection.ids() {
            let root = root(&mut parent, i) as usize;
            if piece_of_root[root] == usize::MAX {
                piece_of_root[root] = pieces.len();
                pieces.push(Vec::new());
            }
            pieces[piece_of_root[root]].push(i);
        }
        // Stable, and they come by their lowest id.
        pieces.sort_by_key(|piece| std::cmp::Reverse(piece.len()));
        pieces
    }

    /// The largest piece of the selection; see [`Neighbours::pieces`].
    pub fn largest(&self, selection: &Selection) -> Selection {
        let largest = self.pieces(selection).into_iter().next().unwrap_or_default();
        Selection::from_ids(selection.len(), largest)
    }
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        let above = parent[parent[i as usize] as usize];
        parent[i as usize] = above;
        i = above;
    }
    i
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Two rows of ten along x, a unit apart in a row, the rows a hundred units apart; two neighbours each.
    fn rows() -> Neighbours {
        let row = |y: f32| (0..10).map(move |i| Vec3::new(i as f32 + 0.01 * (i * i) as f32, y, 0.0));
        Neighbours::build(&row(0.0).chain(row(100.0)).collect::<Vec<_>>(), 2)
    }

    #[test]
    fn growing_takes_the_neighbours_of_the_selected() {
        let neighbours = rows();
        let start = Selection::from_ids(20, [4]);
        for times in 0..20 {
            // The definition, step by step.
            let mut slow = start.clone();
            for _ in 0..times {
                for i in slow.clone().iter() {
                    neighbours.of(i).0.iter().for_each(|&j| slow.insert(j as usize));
                }
            }
            assert_eq!(neighbours.grown(&start, times), slow);
        }
        assert_eq!(neighbours.grown(&start, 100), Selection::from_fn(20, |i| i < 10));
        assert_eq!(neighbours.grown(&Selection::none(20), 3).count(), 0);
    }

    #[test]
    fn shrinking_is_growing_of_the_rest() {
        let neighbours = rows();
        let block = Selection::from_fn(20, |i| (2..8).contains(&i));
        let shrunk = neighbours.shrunk(&block, 1);
        assert!(shrunk.count() < 6 && shrunk.contains(5));
        assert_eq!(neighbours.shrunk(&block, 100).count(), 0);
        assert_eq!(neighbours.shrunk(&Selection::all(20), 5), Selection::all(20), "nothing is outside");
    }

    #[test]
    fn pieces_are_disjoint_complete_and_in_order() {
        let neighbours = rows();
        let pieces = neighbours.pieces(&Selection::from_fn(20, |i| i != 3 && i != 19));
        let lengths: Vec<usize> = pieces.iter().map(Vec::len).collect();
        assert_eq!(lengths, [9, 6, 3]);
        assert_eq!((&pieces[1][..], &pieces[2][..]), (&[4, 5, 6, 7, 8, 9][..], &[0, 1, 2][..]));
        assert_eq!(neighbours.largest(&Selection::all(20)), Selection::from_fn(20, |i| i < 10), "the first of equals");
        assert_eq!(neighbours.largest(&Selection::none(20)).count(), 0);
        assert!(neighbours.pieces(&Selection::none(20)).is_empty());
    }

    #[test]
    fn gaussians_without_a_place_have_no_neighbours() {
        let neighbours = Neighbours::build(&[Vec3::ZERO, Vec3::NAN, Vec3::X], 2);
        assert_eq!(neighbours.grown(&Selection::from_ids(3, [0]), 9), Selection::from_ids(3, [0, 2]));
        assert_eq!(neighbours.pieces(&Selection::all(3)), [vec![0, 2], vec![1]]);
    }
}
