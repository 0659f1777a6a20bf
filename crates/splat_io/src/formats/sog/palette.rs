//! A palette of vectors of spherical harmonics: k-means in two levels, so that a palette of 65,536 entries costs two
//! searches among 256 per Gaussian and round instead of one among all.

use std::collections::HashMap;

use rayon::prelude::*;

/// Sizes of palettes: a power of two between these, at most the number of vectors.
const LEAST: usize = 1024;
const MOST: usize = 1 << 16;
/// Vectors that place the coarse centres.
const SAMPLE: usize = 1 << 14;
const COARSE_ROUNDS: usize = 6;
const FINE_ROUNDS: usize = 4;
/// Vectors per task.
const BLOCK: usize = 256;
/// Lanes of the inner loops; vectors are padded to a multiple.
const LANES: usize = 8;

/// Entries, and for every vector the number of its entry.
pub(super) struct Palette {
    /// `count * size` values, entry after entry.
    pub(super) entries: Vec<f32>,
    pub(super) labels: Vec<u16>,
    /// Whether every vector has its own values as entry.
    pub(super) exact: bool,
}

/// Fits a palette to vectors of `size` finite values each.
pub(super) fn fit(vectors: &[f32], size: usize) -> Palette {
    let count = vectors.len() / size;
    // Equal vectors (often zero) are one.
    let mut ids: HashMap<&[u8], u32> = HashMap::new();
    let mut distinct: Vec<usize> = Vec::new();
    let unique: Vec<u32> = vectors
        .chunks_exact(size)
        .enumerate()
        .map(|(i, vector)| {
            *ids.entry(bytemuck::cast_slice(vector)).or_insert_with(|| {
                distinct.push(i);
                (distinct.len() - 1) as u32
            })
        })
        .collect();
    drop(ids);
    let wanted = if count.is_power_of_two() { count } else { count.next_power_of_two() / 2 }.clamp(LEAST, MOST);
    if distinct.len() <= wanted {
        let entries = distinct.iter().flat_map(|&i| &vectors[i * size..(i + 1) * size]).copied().collect();
        return Palette { entries, labels: unique.iter().map(|&id| id as u16).collect(), exact: true };
    }
    let points = Points::new(vectors, size, &distinct);
    let (centers, nearest) = cluster(&points, wanted);
    let entries = centers.rows().flat_map(|row| &row[..size]).copied().collect();
    Palette { entries, labels: unique.iter().map(|&id| nearest[id as usize]).collect(), exact: false }
}

/// Vectors padded with zeros.
struct Points {
    width: usize,
    values: Vec<f32>,
}

impl Points {
    fn new(vectors: &[f32], size: usize, ids: &[usize]) -> Self {
        let width = size.next_multiple_of(LANES);
        let mut values = vec![0.0; ids.len() * width];
        for (row, &i) in values.chunks_exact_mut(width).zip(ids) {
            row[..size].copy_from_slice(&vectors[i * size..(i + 1) * size]);
        }
        Self { width, values }
    }

    fn len(&self) -> usize {
        self.values.len() / self.width
    }

    fn row(&self, i: usize) -> &[f32] {
        &self.values[i * self.width..(i + 1) * self.width]
    }

    fn rows(&self) -> impl Iterator<Item = &[f32]> {
        self.values.chunks_exact(self.width)
    }

    fn pick(&self, ids: impl Iterator<Item = usize>) -> Self {
        Self { width: self.width, values: ids.flat_map(|i| self.row(i)).copied().collect() }
    }
}

/// Centres and half their squared lengths.
struct Search<'a> {
    centers: &'a Points,
    half_squares: Vec<f32>,
}

impl<'a> Search<'a> {
    fn new(centers: &'a Points) -> Self {
        Self { centers, half_squares: centers.rows().map(|row| 0.5 * dot(row, row)).collect() }
    }

    /// The nearest centre; the first of several. Distances are compared as `c.c / 2 - x.c`.
    fn nearest(&self, x: &[f32]) -> usize {
        let mut best = (f32::INFINITY, 0);
        for (i, (center, half)) in self.centers.rows().zip(&self.half_squares).enumerate() {
            let distance = half - dot(x, center);
            if distance < best.0 {
                best = (distance, i);
            }
        }
        best.1
    }
}

/// Sums in lanes, in a fixed order.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for (lane, (a, b)) in lanes.iter_mut().zip(a.iter().zip(b)) {
            *lane += a * b;
        }
    }
    lanes.iter().sum()
}

/// Moves every centre to the mean of its points; one without points stays.
fn move_centers(centers: &mut Points, points: &Points, ids: impl Iterator<Item = usize>, nearest: &[u32]) {
    let width = centers.width;
    let mut sums = vec![0.0f64; centers.values.len()];
    let mut counts = vec![0u32; centers.len()];
    for (i, &center) in ids.zip(nearest) {
        let center = center as usize;
        counts[center] += 1;
        for (sum, value) in sums[center * width..(center + 1) * width].iter_mut().zip(points.row(i)) {
            *sum += f64::from(*value);
        }
    }
    for ((row, sums), &n) in centers.values.chunks_exact_mut(width).zip(sums.chunks_exact(width)).zip(&counts) {
        if n > 0 {
            for (value, sum) in row.iter_mut().zip(sums) {
                *value = (sum / f64::from(n)) as f32;
            }
        }
    }
}

/// `wanted` centres (fewer if points coincide) and the number of the one nearest to each point.
fn cluster(points: &Points, wanted: usize) -> (Points, Vec<u16>) {
    let coarse_count = 1 << (wanted.ilog2() / 2);
    let step = points.len().div_ceil(SAMPLE);
    let sample = points.pick((0..points.len()).step_by(step));
    let mut coarse = sample.pick((0..coarse_count).map(|k| k * sample.len() / coarse_count));
    for _ in 0..COARSE_ROUNDS {
        let nearest = assign(&coarse, &sample);
        move_centers(&mut coarse, &sample, 0..sample.len(), &nearest);
    }
    let nearest = assign(&coarse, points);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); coarse.len()];
    for (i, &center) in nearest.iter().enumerate() {
        members[center as usize].push(i as u32);
    }
    let shares = shares(&coarse, points, &members, wanted);
    // One task per coarse centre: no sum is shared between threads.
    let fine: Vec<(Points, Vec<u32>)> =
        members.par_iter().zip(&shares).map(|(members, &share)| divide(points, members, share)).collect();
    let mut centers = Points { width: points.width, values: Vec::new() };
    let mut labels = vec![0; points.len()];
    for ((fine, nearest), members) in fine.iter().zip(&members) {
        let first = centers.len();
        centers.values.extend_from_slice(&fine.values);
        for (&i, &center) in members.iter().zip(nearest) {
            labels[i as usize] = (first + center as usize) as u16;
        }
    }
    (centers, labels)
}

fn assign(centers: &Points, points: &Points) -> Vec<u32> {
    let search = Search::new(centers);
    let mut nearest = vec![0; points.len()];
    nearest.par_chunks_mut(BLOCK).enumerate().for_each(|(block, out)| {
        for (k, out) in out.iter_mut().enumerate() {
            *out = search.nearest(points.row(block * BLOCK + k)) as u32;
        }
    });
    nearest
}

/// How many fine centres each coarse one gets: in proportion to the distances of its points, at most one per point.
fn shares(coarse: &Points, points: &Points, members: &[Vec<u32>], wanted: usize) -> Vec<usize> {
    let distances: Vec<f64> = members
        .par_iter()
        .enumerate()
        .map(|(k, members)| {
            let center = coarse.row(k);
            let distance = |i: &u32| {
                let square: f32 = points.row(*i as usize).iter().zip(center).map(|(a, b)| (a - b) * (a - b)).sum();
                f64::from(square).sqrt()
            };
            members.iter().map(distance).sum()
        })
        .collect();
    let total: f64 = distances.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mut shares: Vec<usize> = members
        .iter()
        .zip(&distances)
        .map(|(members, d)| ((d / total * wanted as f64) as usize).clamp(1, members.len().max(1)).min(members.len()))
        .collect();
    // Rounding and the limits leave some over or take too many: the largest groups give or take.
    let mut order: Vec<usize> = (0..members.len()).collect();
    order.sort_by(|a, b| distances[*b].total_cmp(&distances[*a]).then(a.cmp(b)));
    let mut used: usize = shares.iter().sum();
    while used > wanted {
        for &k in &order {
            if used > wanted && shares[k] > 1 {
                shares[k] -= 1;
                used -= 1;
            }
        }
    }
    let mut grown = true;
    while used < wanted && grown {
        grown = false;
        for &k in &order {
            if used < wanted && shares[k] < members[k].len() {
                shares[k] += 1;
                used += 1;
                grown = true;
            }
        }
    }
    shares
}

/// k-means among the points of one coarse centre.
fn divide(points: &Points, members: &[u32], share: usize) -> (Points, Vec<u32>) {
    let ids = || members.iter().map(|&i| i as usize);
    if share == members.len() {
        return (points.pick(ids()), (0..share as u32).collect());
    }
    let mut centers = points.pick((0..share).map(|k| members[k * members.len() / share] as usize));
    let mut nearest: Vec<u32> = Vec::new();
    for round in 0..=FINE_ROUNDS {
        let search = Search::new(&centers);
        nearest = ids().map(|i| search.nearest(points.row(i)) as u32).collect();
        if round < FINE_ROUNDS {
            move_centers(&mut centers, points, ids(), &nearest);
        }
    }
    (centers, nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(count: usize) -> Vec<f32> {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
        };
        (0..count).map(|_| next()).collect()
    }

    #[test]
    fn few_vectors_are_kept_as_they_are() {
        let vectors: Vec<f32> = (0..5000).flat_map(|i| [(i % 7) as f32; 9]).collect();
        let palette = fit(&vectors, 9);
        assert!(palette.exact && palette.entries.len() == 7 * 9);
        for (vector, &label) in vectors.chunks_exact(9).zip(&palette.labels) {
            assert_eq!(vector, &palette.entries[usize::from(label) * 9..][..9]);
        }
    }

    #[test]
    fn many_vectors_share_entries_near_them_on_any_number_of_threads() {
        let vectors = noise(9 * 6000);
        let error = |palette: &Palette| -> f64 {
            let entry = |label: u16| &palette.entries[usize::from(label) * 9..][..9];
            let pairs = vectors.chunks_exact(9).zip(&palette.labels);
            pairs.flat_map(|(v, &l)| v.iter().zip(entry(l)).map(|(a, b)| f64::from(a - b).powi(2))).sum()
        };
        let palette = fit(&vectors, 9);
        assert!(!palette.exact && palette.entries.len() == 4096 * 9);
        // The variance of the numbers is 1/12.
        assert!(error(&palette) < 0.2 * vectors.len() as f64 / 12.0, "{}", error(&palette));
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let alone = one.install(|| fit(&vectors, 9));
        assert!(alone.labels == palette.labels && alone.entries == palette.entries);
    }
}
