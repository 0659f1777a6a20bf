//! 256 values that stand for many: k-means in one dimension.

use rayon::prelude::*;

/// Entries of a codebook.
pub(super) const CODES: usize = 256;
/// Bins of the histogram that spreads the first guess.
const BINS: usize = 4096;
/// Lloyd's algorithm stops at the latest then; it settles in about 30 rounds.
const ROUNDS: usize = 64;

/// Values in rising order, and the borders between them.
pub(super) struct Codebook {
    /// Exactly [`CODES`] of them; the last is repeated where fewer are needed.
    pub(super) values: Vec<f32>,
    /// Halfway between neighbours.
    borders: Vec<f32>,
}

impl Codebook {
    /// Fits a codebook; exact if there are at most 256 different values. All values must be finite.
    pub(super) fn fit(mut values: Vec<f32>) -> Self {
        values.par_sort_unstable_by(f32::total_cmp);
        let mut distinct = Vec::with_capacity(CODES + 1);
        for &value in &values {
            if distinct.last() != Some(&value) {
                distinct.push(value);
                if distinct.len() > CODES {
                    break;
                }
            }
        }
        let fitted = if distinct.len() <= CODES { distinct } else { lloyd(&values, first_guess(&values)) };
        Self::of(fitted)
    }

    fn of(mut values: Vec<f32>) -> Self {
        let last = values.last().copied().unwrap_or(0.0);
        values.resize(CODES, last);
        let borders = values.windows(2).map(|pair| pair[0] / 2.0 + pair[1] / 2.0).collect();
        Self { values, borders }
    }

    /// The nearest entry.
    pub(super) fn code(&self, value: f32) -> u8 {
        self.borders.partition_point(|border| *border < value).min(CODES - 1) as u8
    }
}

/// Entries as dense as the cube root of the data's density, which is nearly optimal for the mean square (Panter and
/// Dite 1951). `sorted` must hold two different values.
fn first_guess(sorted: &[f32]) -> Vec<f32> {
    let (low, high) = (f64::from(sorted[0]), f64::from(sorted[sorted.len() - 1]));
    let width = (high - low) / BINS as f64;
    let mut cumulative = Vec::with_capacity(BINS + 1);
    let mut sum = 0.0;
    let mut from = 0;
    cumulative.push(0.0);
    for bin in 1..=BINS {
        let border = (low + width * bin as f64) as f32;
        let to = if bin == BINS { sorted.len() } else { from + sorted[from..].partition_point(|v| *v < border) };
        sum += ((to - from) as f64).cbrt();
        cumulative.push(sum);
        from = to;
    }
    let mut guess = Vec::with_capacity(CODES);
    let mut bin = 0;
    for k in 0..CODES {
        let target = sum * (k as f64 + 0.5) / CODES as f64;
        while bin + 1 < BINS && cumulative[bin + 1] < target {
            bin += 1;
        }
        let share = (target - cumulative[bin]) / (cumulative[bin + 1] - cumulative[bin]).max(f64::MIN_POSITIVE);
        guess.push((low + width * (bin as f64 + share)) as f32);
    }
    guess
}

/// Moves every entry to the mean of the values nearest to it, until nothing changes.
fn lloyd(sorted: &[f32], mut entries: Vec<f32>) -> Vec<f32> {
    let mut sums = Vec::with_capacity(sorted.len() + 1);
    let mut sum = 0.0f64;
    sums.push(0.0);
    for value in sorted {
        sum += f64::from(*value);
        sums.push(sum);
    }
    for _ in 0..ROUNDS {
        let mut changed = false;
        let mut from = 0;
        for k in 0..entries.len() {
            let to = match entries.get(k + 1) {
                Some(next) => {
                    let border = entries[k] / 2.0 + next / 2.0;
                    from + sorted[from..].partition_point(|v| *v < border)
                }
                None => sorted.len(),
            };
            if to > from {
                let mean = ((sums[to] - sums[from]) / (to - from) as f64) as f32;
                changed |= mean != entries[k];
                entries[k] = mean;
            }
            from = to;
        }
        entries.sort_unstable_by(f32::total_cmp);
        if !changed {
            break;
        }
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_are_kept_as_they_are_and_many_are_near_an_entry() {
        let few: Vec<f32> = (0..1000).map(|i| (i * i % 97) as f32 - 40.0).collect();
        let book = Codebook::fit(few.clone());
        assert!(few.iter().all(|v| book.values[usize::from(book.code(*v))] == *v));
        let many: Vec<f32> = (0..100_000).map(|i| (i as f32 * 0.37).sin() * (i as f32 * 0.011).cos().powi(3)).collect();
        let book = Codebook::fit(many.clone());
        let error = |entries: &dyn Fn(f32) -> f32| many.iter().map(|v| f64::from(v - entries(*v)).powi(2)).sum::<f64>();
        let fitted = error(&|v| book.values[usize::from(book.code(v))]);
        let even = error(&|v| ((v + 1.0) * 127.5).round() / 127.5 - 1.0);
        assert!(fitted < 0.7 * even, "{fitted} against {even} with even steps");
        // The code is the nearest entry, found slowly.
        for v in many.iter().step_by(997) {
            let nearest = book.values.iter().map(|e| (e - v).abs()).fold(f32::INFINITY, f32::min);
            assert!((book.values[usize::from(book.code(*v))] - v).abs() <= nearest * 1.0001 + 1e-7);
        }
        assert_eq!(Codebook::fit(Vec::new()).values, [0.0; CODES]);
    }
}
