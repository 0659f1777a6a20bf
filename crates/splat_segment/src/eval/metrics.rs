//! Scores of sets against sets.

use splat_core::{Mask2d, Selection};

/// Label that is left out of every score.
pub const IGNORE: u8 = 255;
/// A Gaussian counts as visible above this blending weight, in pixels over all cameras.
pub const VISIBLE_WEIGHT: f32 = 1.0;

/// |both| / |either|; 1 where both sets are empty.
fn ratio(both: f64, either: f64) -> f64 {
    if either > 0.0 { both / either } else { 1.0 }
}

/// Scores of a selection against an object's label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelectionIou {
    /// Over visible Gaussians, each counting 1.
    pub visible: f64,
    /// Over visible Gaussians, each counting its blending weight.
    pub weighted: f64,
}

/// Intersection over union of `selection` and the Gaussians of `label`, over Gaussians whose weight is above
/// [`VISIBLE_WEIGHT`] and whose label is not [`IGNORE`].
///
/// `labels`, `weight`: one entry per Gaussian. 1 where neither set has such a Gaussian.
pub fn selection_iou(selection: &Selection, labels: &[u8], weight: &[f32], label: u8) -> SelectionIou {
    let (mut both, mut either) = ((0u64, 0.0), (0u64, 0.0));
    for (i, (&l, &w)) in labels.iter().zip(weight).enumerate() {
        // A NaN weight is not visible.
        let visible = w > VISIBLE_WEIGHT;
        if l == IGNORE || !visible {
            continue;
        }
        let (p, o, w) = (selection.contains(i), l == label, f64::from(w));
        if p || o {
            either = (either.0 + 1, either.1 + w);
        }
        if p && o {
            both = (both.0 + 1, both.1 + w);
        }
    }
    SelectionIou { visible: ratio(both.0 as f64, either.0 as f64), weighted: ratio(both.1, either.1) }
}

/// Intersection over union of two masks of the same size, pixels counting as in from half on; 1 where both are empty.
pub fn mask_iou(a: &Mask2d, b: &Mask2d) -> f64 {
    let (mut both, mut either) = (0u64, 0u64);
    for (&x, &y) in a.values().iter().zip(b.values()) {
        let (x, y) = (x >= Mask2d::HALF, y >= Mask2d::HALF);
        both += u64::from(x && y);
        either += u64::from(x || y);
    }
    ratio(both as f64, either as f64)
}

/// Width of the band of [`boundary_iou`] as a share of the picture's diagonal.
const BAND: f64 = 0.02;

/// Boundary IoU: intersection over union of the bands of pixels that lie inside each mask at most 2 % of the picture's
/// diagonal from its contour, along the longer axis; the picture's edge is a contour. The masks have the same size.
///
/// Source: Cheng et al. 2021, "Boundary IoU", with the band as its authors take it: a mask without its erosion by as
/// many 3x3 squares as the band is wide.
pub fn boundary_iou(a: &Mask2d, b: &Mask2d) -> f64 {
    let (w, h) = (f64::from(a.width()), f64::from(a.height()));
    let width = ((BAND * w.hypot(h)).round() as u32).max(1);
    mask_iou(&band(a, width), &band(b, width))
}

/// Pixels of a mask within `width` steps, diagonal ones allowed, of a pixel that is not in it or of the picture's outside.
fn band(mask: &Mask2d, width: u32) -> Mask2d {
    let steps = steps_inside(mask);
    let columns = mask.width() as usize;
    Mask2d::from_fn(mask.width(), mask.height(), |x, y| (1..=width).contains(&steps[y as usize * columns + x as usize]))
}

/// Steps, diagonal ones allowed, from every pixel of a mask to the nearest that is not in it; beyond the picture nothing is.
/// 0 outside the mask. Two passes give this distance exactly.
fn steps_inside(mask: &Mask2d) -> Vec<u32> {
    let (w, h) = (mask.width() as usize, mask.height() as usize);
    let mut steps: Vec<u32> = mask.values().iter().map(|&v| if v >= Mask2d::HALF { u32::MAX } else { 0 }).collect();
    let pass = |steps: &mut Vec<u32>, k: usize, sides: [(isize, isize); 4]| {
        if steps[k] == 0 {
            return;
        }
        let (x, y) = ((k % w) as isize, (k / w) as isize);
        for (dx, dy) in sides {
            let (u, v) = (x + dx, y + dy);
            let within = u >= 0 && v >= 0 && u < w as isize && v < h as isize;
            let there = if within { steps[v as usize * w + u as usize] } else { 0 };
            steps[k] = steps[k].min(there.saturating_add(1));
        }
    };
    for k in 0..w * h {
        pass(&mut steps, k, [(-1, 0), (-1, -1), (0, -1), (1, -1)]);
    }
    for k in (0..w * h).rev() {
        pass(&mut steps, k, [(1, 0), (1, 1), (0, 1), (-1, 1)]);
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(side: u32, low: u32, high: u32) -> Mask2d {
        Mask2d::from_fn(side, side, |x, y| (low..high).contains(&x) && (low..high).contains(&y))
    }

    #[test]
    fn hidden_and_ignored_gaussians_do_not_count() {
        let labels = [1, 1, 1, 0, 0, IGNORE, 2];
        let weight = [2.0, 4.0, 0.5, 8.0, f32::NAN, 9.0, 1.0];
        // Chosen: one hit (weight 4), one false alarm (8); the rest of the choice is hidden, ignored or not a number.
        let selection = Selection::from_ids(7, [1, 2, 3, 4, 5, 6]);
        let iou = selection_iou(&selection, &labels, &weight, 1);
        assert_eq!(iou, SelectionIou { visible: 1.0 / 3.0, weighted: 4.0 / 14.0 });
        assert_eq!(
            selection_iou(&Selection::none(7), &labels, &weight, 2),
            SelectionIou { visible: 1.0, weighted: 1.0 }
        );
    }

    #[test]
    fn masks_overlap_by_pixels() {
        let (a, b) = (square(10, 0, 4), square(10, 2, 6));
        assert_eq!(mask_iou(&a, &b), 4.0 / 28.0);
        assert_eq!(mask_iou(&Mask2d::empty(3, 3), &Mask2d::empty(3, 3)), 1.0);
    }

    #[test]
    fn a_band_is_the_mask_without_its_erosion() {
        let mut seed = 5u32;
        for (w, h) in [(1, 1), (7, 1), (13, 9), (8, 20)] {
            for density in [2, 8, 40] {
                let mask = Mask2d::from_fn(w, h, |_, _| {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    !(seed >> 16).is_multiple_of(density)
                });
                for width in 1..4 {
                    let mut eroded = mask.clone();
                    for _ in 0..width {
                        let all = |x: u32, y: u32| {
                            // Wraps below 0, where nothing is in the mask.
                            (0..9).all(|k| eroded.contains((x + k % 3).wrapping_sub(1), (y + k / 3).wrapping_sub(1)))
                        };
                        eroded = Mask2d::from_fn(w, h, all);
                    }
                    let slow = Mask2d::from_fn(w, h, |x, y| mask.contains(x, y) && !eroded.contains(x, y));
                    assert_eq!(band(&mask, width), slow);
                }
            }
        }
    }

    #[test]
    fn a_wrong_edge_costs_the_boundary_more_than_the_area() {
        // Diagonal 141.4: bands of 3 pixels.
        let (a, b) = (square(100, 20, 80), square(100, 21, 79));
        let ring = |outer: f64, inner: f64| outer * outer - inner * inner;
        assert_eq!(boundary_iou(&a, &b), ring(58.0, 54.0) / ring(60.0, 52.0));
        assert!(boundary_iou(&a, &b) < mask_iou(&a, &b));
        assert_eq!(boundary_iou(&a, &a), 1.0);
    }
}
