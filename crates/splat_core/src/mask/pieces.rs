//! Connected pieces of a mask, and its holes.

use super::Mask2d;

/// The connected pieces of a mask.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskPieces {
    /// Piece of every pixel, row-major: 0 outside, 1 the largest, and so on; equal ones from the top left.
    pub labels: Vec<u32>,
    /// Pixels of every piece, falling: the first is that of label 1.
    pub counts: Vec<usize>,
}

/// The pixel sides that connect what is not in the mask; corners connect what is in.
const SIDES: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
const SIDES_AND_CORNERS: [(isize, isize); 8] = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)];

impl Mask2d {
    /// Pieces of the mask (pixels at least half in) that hang together by sides or corners.
    pub fn pieces(&self) -> MaskPieces {
        let (mut labels, sizes) = self.connected(true, &SIDES_AND_CORNERS);
        let mut order: Vec<usize> = (0..sizes.len()).collect();
        order.sort_by_key(|&k| std::cmp::Reverse(sizes[k]));
        let mut rank = vec![0; sizes.len() + 1];
        for (place, &k) in order.iter().enumerate() {
            rank[k + 1] = place as u32 + 1;
        }
        labels.iter_mut().for_each(|label| *label = rank[*label as usize]);
        MaskPieces { labels, counts: order.into_iter().map(|k| sizes[k]).collect() }
    }

    /// The largest piece of the mask with the values it has; nothing of an empty mask.
    pub fn largest_piece(&self) -> Self {
        let pieces = self.pieces();
        let values =
            self.values.iter().zip(&pieces.labels).map(|(&v, &label)| if label == 1 { v } else { 0 }).collect();
        Self { width: self.width, height: self.height, values }
    }

    /// The mask without pieces of fewer than `smallest` pixels; other values stay.
    pub fn without_specks(&self, smallest: usize) -> Self {
        let pieces = self.pieces();
        let kept = |label: u32| label == 0 || pieces.counts[label as usize - 1] >= smallest;
        let values =
            self.values.iter().zip(&pieces.labels).map(|(&v, &label)| if kept(label) { v } else { 0 }).collect();
        Self { width: self.width, height: self.height, values }
    }

    /// The mask with its holes filled: pixels from which no way by sides over pixels that are not in leads to the picture's edge.
    pub fn without_holes(&self) -> Self {
        let (labels, sizes) = self.connected(false, &SIDES);
        let (w, h) = (self.width as usize, self.height as usize);
        let mut open = vec![false; sizes.len() + 1];
        for (i, &label) in labels.iter().enumerate() {
            let (x, y) = (i % w, i / w);
            if x == 0 || y == 0 || x + 1 == w || y + 1 == h {
                open[label as usize] = true;
            }
        }
        let fill = |(&v, &label): (&u8, &u32)| if label != 0 && !open[label as usize] { 255 } else { v };
        let values = self.values.iter().zip(&labels).map(fill).collect();
        Self { width: self.width, height: self.height, values }
    }

    /// Numbers the connected pieces of the pixels that are in (or are not) from 1, by their first pixel; with their sizes.
    fn connected(&self, inside: bool, sides: &[(isize, isize)]) -> (Vec<u32>, Vec<usize>) {
        let (w, h) = (self.width as usize, self.height as usize);
        let wanted = |i: usize| (self.values[i] >= Self::HALF) == inside;
        let mut labels = vec![0u32; w * h];
        let mut sizes = Vec::new();
        let mut open = Vec::new();
        for start in 0..w * h {
            if labels[start] != 0 || !wanted(start) {
                continue;
            }
            let label = sizes.len() as u32 + 1;
            labels[start] = label;
            open.push(start);
            let mut size = 0;
            while let Some(i) = open.pop() {
                size += 1;
                for &(dx, dy) in sides {
                    let (x, y) = ((i % w).wrapping_add_signed(dx), (i / w).wrapping_add_signed(dy));
                    if x < w && y < h && labels[y * w + x] == 0 && wanted(y * w + x) {
                        labels[y * w + x] = label;
                        open.push(y * w + x);
                    }
                }
            }
            sizes.push(size);
        }
        (labels, sizes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(rows: &[&str]) -> Mask2d {
        Mask2d::from_fn(rows[0].len() as u32, rows.len() as u32, |x, y| rows[y as usize].as_bytes()[x as usize] == b'#')
    }

    #[test]
    fn pieces_hang_together_by_corners_and_come_by_size() {
        let mask = drawn(&["#..##", ".#...", "....#", "#...#", "....#"]);
        let pieces = mask.pieces();
        assert_eq!(pieces.counts, [3, 2, 2, 1]);
        #[rustfmt::skip]
        assert_eq!(pieces.labels, [
            2, 0, 0, 3, 3,
            0, 2, 0, 0, 0,
            0, 0, 0, 0, 1,
            4, 0, 0, 0, 1,
            0, 0, 0, 0, 1,
        ]);
        assert_eq!(mask.largest_piece(), drawn(&[".....", ".....", "....#", "....#", "....#"]));
        assert_eq!(mask.without_specks(2), drawn(&["#..##", ".#...", "....#", "....#", "....#"]));
        assert_eq!(mask.without_specks(0), mask);
        assert_eq!(Mask2d::empty(3, 3).largest_piece().count(), 0);
        assert!(Mask2d::empty(0, 0).pieces().counts.is_empty());
    }

    #[test]
    fn holes_are_what_the_outside_cannot_reach_by_sides() {
        let mask = drawn(&["......", ".###..", ".#.#..", ".##.#.", "..###.", "......"]);
        let whole = drawn(&["......", ".###..", ".####.", ".####.", "..###.", "......"]);
        // The corner at the upper right of the second hole is open only diagonally: closed.
        let filled = mask.without_holes();
        assert!(filled.contains(2, 2) && filled.contains(3, 3));
        assert_eq!(filled.count(), whole.count() - 1);
        let open = drawn(&["###", "#.#", "#.#"]);
        assert_eq!(open.without_holes(), open);
        assert_eq!(Mask2d::empty(4, 4).without_holes().count(), 0);
        assert_eq!(Mask2d::empty(0, 3).without_holes().width(), 0);
    }

    /// The definition: two pixels are of one piece if spreading from one reaches the other.
    #[test]
    fn pieces_are_what_spreading_reaches() {
        let mut state = 3u64;
        let mask = Mask2d::from_fn(24, 17, |_, _| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33).is_multiple_of(3)
        });
        let pieces = mask.pieces();
        let start = pieces.labels.iter().position(|&l| l == 2).unwrap();
        let mut reached = Mask2d::from_fn(24, 17, |x, y| y as usize * 24 + x as usize == start);
        loop {
            let near = |x: u32, y: u32| {
                (0..9).any(|k| reached.contains((x + k % 3).wrapping_sub(1), (y + k / 3).wrapping_sub(1)))
            };
            let next = Mask2d::from_fn(24, 17, |x, y| mask.contains(x, y) && near(x, y));
            if next == reached {
                break;
            }
            reached = next;
        }
        assert_eq!(reached, Mask2d::from_fn(24, 17, |x, y| pieces.labels[y as usize * 24 + x as usize] == 2));
        assert_eq!(pieces.counts.iter().sum::<usize>(), mask.count());
        assert_eq!(pieces.counts[1], reached.count());
    }
}
