//! Scores of sets against sets.

use splat_core::{Mask2d, Selection};

/// |both| / |either|; 1 where both are empty.
pub fn intersection_over_union(both: f64, either: f64) -> f64 {
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

/// Label that is left out of every score.
pub const IGNORE: u8 = 255;

/// Intersection over union of `selection` and the Gaussians of `label`, over Gaussians with `weight > 1.0` whose label is
/// not [`IGNORE`].
pub fn selection_iou(selection: &Selection, labels: &[u8], weight: &[f32], label: u8) -> SelectionIou {
    let mut plain = (0.0, 0.0);
    let mut weighted = (0.0, 0.0);
    for (i, (&l, &w)) in labels.iter().zip(weight).enumerate() {
        if l == IGNORE || !(w > 1.0) {
            continue;
        }
        let (p, o) = (selection.contains(i), l == label);
        if p || o {
            plain.1 += 1.0;
            weighted.1 += f64::from(w);
            if p && o {
                plain.0 += 1.0;
                weighted.0 += f64::from(w);
            }
        }
    }
    SelectionIou {
        visible: intersection_over_union(plain.0, plain.1),
        weighted: intersection_over_union(weighted.0, weighted.1),
    }
}

/// Intersection over union of two masks (at least half in) over the pixels that `counts` keeps.
pub fn mask_iou(a: &Mask2d, b: &Mask2d, counts: impl Fn(usize) -> bool) -> f64 {
    let (mut both, mut either) = (0u64, 0u64);
    for (k, (&x, &y)) in a.values().iter().zip(b.values()).enumerate() {
        if counts(k) {
            let (x, y) = (x >= Mask2d::HALF, y >= Mask2d::HALF);
            both += u64::from(x && y);
            either += u64::from(x || y);
        }
    }
    intersection_over_union(both as f64, either as f64)
}

/// Boundary IoU (Cheng et al. 2021): the IoU of the bands of pixels that lie inside each mask within 2 % of the picture's
/// diagonal of its contour. The picture's edge counts as contour only where the mask ends there.
pub fn boundary_iou(a: &Mask2d, b: &Mask2d, counts: impl Fn(usize) -> bool) -> f64 {
    let (w, h) = (f64::from(a.width()), f64::from(a.height()));
    let d = (0.02 * (w * w + h * h).sqrt()).round().max(1.0) as f32;
    let band = |m: &Mask2d| {
        // Distance to the nearest pixel that is out; within d of one means in the band.
        let distance = splat_core::mask::distance_inside(m);
        let mut out = m.clone();
        for (v, dist) in out.values_mut().iter_mut().zip(distance) {
            *v = if *v >= Mask2d::HALF && dist <= d { 255 } else { 0 };
        }
        out
    };
    mask_iou(&band(a), &band(b), counts)
}
