//! Selections changed by what lies beside what: grow, shrink, connected pieces, islands, holes, a smoother edge.

use glam::Vec3;

use crate::{Cloud, NO_NEIGHBOUR, Neighbours, Selection};

impl Neighbours {
    /// These neighbours without those across a gap: a neighbour stays where its distance is at most `factor` times what the two
    /// Gaussians reach towards each other (one standard deviation each, along the line between them), or `factor` times the
    /// spacing of either's surroundings, the smaller one (distance of the fourth neighbour).
    ///
    /// `factor`: 2 to 3 keeps a surface together and parts things that stand apart. Lists stay in order, filled up with
    /// [`NO_NEIGHBOUR`] at infinite distance.
    ///
    /// # Panics
    /// If the neighbours belong to a cloud of another length.
    pub fn touching(&self, cloud: &Cloud, factor: f32) -> Self {
        assert_eq!(self.len(), cloud.len(), "neighbours of another cloud");
        let spacing = |i: usize| self.of(i).1.get(3).copied().unwrap_or(f32::INFINITY);
        self.filtered(|i, j, distance| {
            // Where there are fewer than four neighbours, the spacing is unknown and reach alone decides.
            let spacing = Some(spacing(i).min(spacing(j))).filter(|s| s.is_finite()).unwrap_or(0.0);
            let line = cloud.means()[j] - cloud.means()[i];
            distance <= factor * spacing
                || distance * distance <= factor * (reach(cloud, i, line) + reach(cloud, j, line))
        })
    }

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

    /// The selection without its pieces of fewer than `smallest` Gaussians; see [`Neighbours::pieces`].
    pub fn without_islands(&self, selection: &Selection, smallest: usize) -> Selection {
        let pieces = self.pieces(selection);
        let large = pieces.iter().take_while(|piece| piece.len() >= smallest);
        Selection::from_ids(selection.len(), large.flatten().copied())
    }

    /// The selection and its holes: pieces of what is not selected, of at most `largest` Gaussians, that lie beside something
    /// selected. (A piece has no other unselected neighbours, so that what is beside it encloses it.)
    pub fn filled(&self, selection: &Selection, largest: usize) -> Selection {
        let mut outside = selection.clone();
        outside.invert();
        let mut beside = Selection::none(selection.len());
        for i in 0..self.len() {
            for &j in self.of(i).0.iter().filter(|&&j| j != NO_NEIGHBOUR) {
                if selection.contains(i) != selection.contains(j as usize) {
                    beside.insert(i);
                    beside.insert(j as usize);
                }
            }
        }
        let mut filled = selection.clone();
        for hole in self.pieces(&outside) {
            if hole.len() <= largest && hole.iter().any(|&i| beside.contains(i as usize)) {
                hole.iter().for_each(|&i| filled.insert(i as usize));
            }
        }
        filled
    }

    /// The selection with a smoother edge: whoever is of another mind than more than `share` of its neighbours follows them; all at
    /// once, `times` times.
    ///
    /// `share`: 0.5 is the plain majority, more changes less.
    pub fn smoothed(&self, selection: &Selection, share: f32, times: u32) -> Selection {
        assert_eq!(self.len(), selection.len(), "a selection of another cloud");
        let mut now = selection.clone();
        for _ in 0..times {
            let next = Selection::from_fn_parallel(self.len(), |i| {
                let here = now.contains(i);
                let all = self.of(i).0.iter().filter(|&&j| j != NO_NEIGHBOUR);
                let others = all.clone().filter(|&&j| now.contains(j as usize) != here).count();
                here != (others as f32 > share * all.count() as f32)
            });
            if next == now {
                break;
            }
            now = next;
        }
        now
    }
}

/// One standard deviation of Gaussian `i` along `line`, times the line's length: `sqrt(line^T covariance line)`.
fn reach(cloud: &Cloud, i: usize, line: Vec3) -> f32 {
    (cloud.rotation(i).conjugate() * line * cloud.scale(i)).length()
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
    use glam::Quat;

    use super::*;
    use crate::CloudArrays;

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

    /// Points of a plane lattice, 30 by 30, a unit apart, jittered so that distances differ.
    fn plane() -> Vec<Vec3> {
        let jitter = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 1000) as f32 * 2e-4;
        (0..900).map(|i| Vec3::new((i % 30) as f32 + jitter(i, 1), (i / 30) as f32 + jitter(i, 2), 0.0)).collect()
    }

    fn at(x: usize, y: usize) -> usize {
        y * 30 + x
    }

    #[test]
    fn islands_go_and_holes_close() {
        let neighbours = Neighbours::build(&plane(), 6);
        let block = Selection::from_fn(900, |i| (5..20).contains(&(i % 30)) && (5..20).contains(&(i / 30)));
        let mut holed = block.clone();
        for (x, y) in [(8, 8), (9, 8), (15, 12)] {
            holed.remove(at(x, y));
        }
        let mut dirty = holed.clone();
        for (x, y) in [(27, 27), (27, 3), (28, 3)] {
            dirty.insert(at(x, y));
        }
        assert_eq!(neighbours.without_islands(&dirty, 3), holed);
        assert_eq!(neighbours.without_islands(&dirty, 2).count(), holed.count() + 2);
        assert_eq!(neighbours.without_islands(&dirty, 0), dirty);
        assert_eq!(neighbours.without_islands(&dirty, 10_000).count(), 0);
        assert_eq!(neighbours.filled(&holed, 2), block);
        let mut half = block.clone();
        half.remove(at(8, 8));
        half.remove(at(9, 8));
        assert_eq!(neighbours.filled(&holed, 1), half);
        assert_eq!(neighbours.filled(&holed, 0), holed);
        assert_eq!(neighbours.filled(&Selection::none(900), 9000).count(), 0, "nothing encloses");
        assert_eq!(
            neighbours.filled(&block, 900),
            Selection::all(900),
            "the outside is a hole if so large a one is filled"
        );
    }

    #[test]
    fn smoothing_follows_the_majority() {
        let neighbours = Neighbours::build(&plane(), 6);
        let half = Selection::from_fn(900, |i| i % 30 < 15);
        let mut rough = half.clone();
        for (x, y) in [(4, 4), (10, 20), (25, 9), (20, 21)] {
            rough.toggle(at(x, y)..at(x, y) + 1);
        }
        assert_eq!(neighbours.smoothed(&rough, 0.7, 1), half);
        assert_eq!(neighbours.smoothed(&rough, 0.7, 0), rough);
        // The definition.
        let slow = Selection::from_fn(900, |i| {
            let others =
                neighbours.of(i).0.iter().filter(|&&j| rough.contains(j as usize) != rough.contains(i)).count();
            rough.contains(i) != (others > 3)
        });
        assert_eq!(neighbours.smoothed(&rough, 0.5, 1), slow);
    }

    fn discs(means: Vec<Vec3>, scale: Vec3, rotation: Quat) -> Cloud {
        let n = means.len();
        Cloud::new(CloudArrays {
            means,
            log_scales: vec![Vec3::new(scale.x.ln(), scale.y.ln(), scale.z.ln()); n],
            rotations: vec![rotation; n],
            opacity_logits: vec![0.0; n],
            sh: vec![0.0; 3 * n],
            ..CloudArrays::default()
        })
        .unwrap()
    }

    #[test]
    fn neighbours_across_a_gap_do_not_touch() {
        // Two planes two and a half units apart; with twenty neighbours some at the rims look across.
        let planes: Vec<Vec3> =
            plane().into_iter().chain(plane().into_iter().map(|p| p + Vec3::new(0.0, 0.0, 2.5))).collect();
        let small = discs(planes.clone(), Vec3::splat(0.2), Quat::IDENTITY);
        let all = Neighbours::build(&planes, 20);
        assert_eq!(all.pieces(&Selection::all(1800)).len(), 1);
        assert_eq!(all.touching(&small, 1.0).pieces(&Selection::all(1800)).len(), 2);
        // Needles that stand upright bridge it; lying ones do not.
        let needle = Vec3::new(0.01, 0.01, 1.3);
        let upright = discs(planes.clone(), needle, Quat::IDENTITY);
        assert_eq!(all.touching(&upright, 1.0).pieces(&Selection::all(1800)).len(), 1);
        let lying = discs(planes, needle, Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
        assert_eq!(all.touching(&lying, 1.0).pieces(&Selection::all(1800)).len(), 2);
    }

    #[test]
    fn what_touches_is_what_the_definition_says() {
        let means = plane();
        let cloud = discs(means.clone(), Vec3::new(0.3, 0.1, 0.5), Quat::from_rotation_z(0.4));
        let all = Neighbours::build(&means, 8);
        let touching = all.touching(&cloud, 1.3);
        for i in 0..900 {
            let kept: Vec<u32> = touching.of(i).0.iter().copied().filter(|&j| j != NO_NEIGHBOUR).collect();
            let slow = all.of(i).0.iter().copied().filter(|&j| {
                let j = j as usize;
                let d = (means[j] - means[i]).normalize();
                let sigma = |i: usize| d.dot(cloud.covariance(i) * d).sqrt();
                let spacing = all.of(i).1[3].min(all.of(j).1[3]);
                means[i].distance(means[j]) <= 1.3 * spacing.max(sigma(i) + sigma(j))
            });
            assert_eq!(kept, slow.collect::<Vec<_>>());
            assert!(touching.of(i).1[kept.len()..].iter().all(|d| d.is_infinite()));
        }
    }
}
