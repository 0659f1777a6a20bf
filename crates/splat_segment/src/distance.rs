//! Distance of every pixel to a mask.

use splat_core::Mask2d;

/// Euclidean distance in pixels from every pixel's centre to the nearest pixel of the mask (at least half in); 0 inside,
/// infinite if the mask is empty.
///
/// Exact: lower envelope of parabolas per column, then per row (Felzenszwalb and Huttenlocher 2012).
pub(crate) fn distance_to(mask: &Mask2d) -> Vec<f32> {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let mut squared: Vec<f64> =
        mask.values().iter().map(|&v| if v >= Mask2d::HALF { 0.0 } else { f64::INFINITY }).collect();
    let mut scratch = Envelope::default();
    let mut line = Vec::new();
    for x in 0..width {
        line.clear();
        line.extend((0..height).map(|y| squared[y * width + x]));
        scratch.lower(&line, |y, v| squared[y * width + x] = v);
    }
    for y in 0..height {
        line.clear();
        line.extend_from_slice(&squared[y * width..(y + 1) * width]);
        scratch.lower(&line, |x, v| squared[y * width + x] = v);
    }
    squared.into_iter().map(|d| d.sqrt() as f32).collect()
}

/// Scratch of one line: positions of the parabolas in the envelope and where each begins to be lowest.
#[derive(Default)]
struct Envelope {
    tops: Vec<usize>,
    from: Vec<f64>,
}

impl Envelope {
    fn lower(&mut self, line: &[f64], mut put: impl FnMut(usize, f64)) {
        self.tops.clear();
        self.from.clear();
        for (q, &v) in line.iter().enumerate().filter(|(_, v)| v.is_finite()) {
            let height = |k: usize| line[k] + (k * k) as f64;
            while let (Some(&top), Some(&from)) = (self.tops.last(), self.from.last()) {
                let meet = (v + (q * q) as f64 - height(top)) / (2.0 * (q - top) as f64);
                if meet > from {
                    self.from.push(meet);
                    break;
                }
                self.tops.pop();
                self.from.pop();
            }
            if self.tops.is_empty() {
                self.from.push(f64::NEG_INFINITY);
            }
            self.tops.push(q);
        }
        if self.tops.is_empty() {
            return;
        }
        let mut k = 0;
        for x in 0..line.len() {
            while k + 1 < self.tops.len() && self.from[k + 1] < x as f64 {
                k += 1;
            }
            let d = x as f64 - self.tops[k] as f64;
            put(x, d * d + line[self.tops[k]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_equal_those_of_all_pairs() {
        let mut seed = 7u32;
        for (width, height) in [(1, 1), (9, 1), (1, 7), (13, 11)] {
            for _ in 0..20 {
                let mask = Mask2d::from_fn(width, height, |_, _| {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    seed >> 29 == 0
                });
                let fast = distance_to(&mask);
                for y in 0..height {
                    for x in 0..width {
                        let mut slow = f32::INFINITY;
                        for v in 0..height {
                            for u in (0..width).filter(|&u| mask.contains(u, v)) {
                                slow = slow.min((x as f32 - u as f32).hypot(y as f32 - v as f32));
                            }
                        }
                        let fast = fast[(y * width + x) as usize];
                        assert!(fast == slow || (fast - slow).abs() < 1e-5, "{fast} {slow}");
                    }
                }
            }
        }
    }
}
