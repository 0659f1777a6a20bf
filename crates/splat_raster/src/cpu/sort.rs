//! Stage 2: one order by depth over all splats, ties by id.

use rayon::prelude::*;

use super::project::Block;
use super::shared::Shared;
use super::timings::Watch;

/// Widest digit of the radix sort: 2048 counters stay in the first-level cache.
const DIGIT: u32 = 11;
/// Keys from which on a second thread is worth its start.
const PER_WORKER: usize = 1 << 14;

/// Sorts keys by their high halves; a stable radix sort from the lowest digit up, so that keys in order of ids stay so.
#[derive(Debug, Default)]
pub(super) struct Sorter {
    front: Vec<u64>,
    back: Vec<u64>,
    counters: Vec<u32>,
    cuts: Vec<usize>,
}

/// Where a pass reads: gaps between blocks before the first, none after it.
#[derive(Clone, Copy)]
enum Source<'a> {
    Blocks(&'a [u64], &'a [Block], &'a [usize]),
    Dense(&'a [u64], usize),
}

impl Source<'_> {
    /// The keys of one worker, in order.
    fn each(&self, worker: usize, mut keys: impl FnMut(&[u64])) {
        match *self {
            Self::Blocks(all, blocks, cuts) => {
                for block in &blocks[cuts[worker]..cuts[worker + 1]] {
                    keys(&all[block.start as usize..][..block.count as usize]);
                }
            }
            Self::Dense(all, workers) => keys(&all[share(all.len(), workers, worker)]),
        }
    }
}

/// The part of `len` things that is one worker's.
pub(super) fn share(len: usize, workers: usize, worker: usize) -> std::ops::Range<usize> {
    let at = |k: usize| (len as u128 * k as u128 / workers as u128) as usize;
    at(worker)..at(worker + 1)
}

/// Workers for so many keys; the result never depends on it.
pub(super) fn workers_for(count: usize) -> usize {
    (count / PER_WORKER).clamp(1, rayon::current_num_threads())
}

impl Sorter {
    /// Sorts the keys of all blocks.
    pub(super) fn sort(&mut self, keys: &[u64], blocks: &[Block], watch: &Watch) -> &[u64] {
        let count: usize = blocks.iter().map(|b| b.count as usize).sum();
        self.front.resize(count, 0);
        self.back.resize(count, 0);
        if count == 0 {
            return &self.front;
        }
        let workers = workers_for(count);
        cut(blocks, count, workers, &mut self.cuts);
        let (least, largest) = blocks.iter().fold((u32::MAX, 0), |d, b| (d.0.min(b.depths.0), d.1.max(b.depths.1)));
        let bits = (32 - (largest - least).leading_zeros()).max(1);
        let passes = bits.div_ceil(DIGIT);
        let digit = bits.div_ceil(passes);
        for pass in 0..passes {
            let (from, to) = (&mut self.back, &mut self.front);
            let source = match pass {
                0 => Source::Blocks(keys, blocks, &self.cuts),
                _ => Source::Dense(from, workers),
            };
            let pass = Pass { source, workers, least, shift: pass * digit, width: digit };
            pass.scatter(&mut self.counters, to, watch);
            std::mem::swap(&mut self.front, &mut self.back);
        }
        &self.back
    }

    /// What the last sort gave.
    pub(super) fn sorted(&self) -> &[u64] {
        &self.back
    }
}

/// Blocks of about equally many keys per worker.
fn cut(blocks: &[Block], count: usize, workers: usize, cuts: &mut Vec<usize>) {
    cuts.clear();
    cuts.push(0);
    let mut sum = 0;
    for (k, block) in blocks.iter().enumerate() {
        while cuts.len() < workers && sum >= count * cuts.len() / workers {
            cuts.push(k);
        }
        sum += block.count as usize;
    }
    cuts.resize(workers, blocks.len());
    cuts.push(blocks.len());
}

/// One stable pass over the digit of `width` bits at `shift` of `depth - least`.
struct Pass<'a> {
    source: Source<'a>,
    workers: usize,
    least: u32,
    shift: u32,
    width: u32,
}

impl Pass<'_> {
    fn scatter(&self, counters: &mut Vec<u32>, to: &mut [u64], watch: &Watch) {
        let Self { source, workers, least, shift, width } = *self;
        let values = 1usize << width;
        let digit = |key: u64| (((key >> 32) as u32).wrapping_sub(least) >> shift) as usize & (values - 1);
        counters.clear();
        counters.resize(workers * values, 0);
        counters.par_chunks_mut(values).enumerate().for_each(|(worker, counters)| {
            watch.work(|| {
                source.each(worker, |keys| {
                    for &key in keys {
                        counters[digit(key)] += 1;
                    }
                });
            });
        });
        let mut sum = 0;
        for value in 0..values {
            for worker in 0..workers {
                let counter = &mut counters[worker * values + value];
                (*counter, sum) = (sum, sum + *counter);
            }
        }
        assert_eq!(sum as usize, to.len(), "every key has a place");
        let to = Shared::new(to);
        counters.par_chunks_mut(values).enumerate().for_each(|(worker, counters)| {
            watch.work(|| {
                source.each(worker, |keys| {
                    for &key in keys {
                        let place = &mut counters[digit(key)];
                        // SAFETY: the counters start at prefix sums of what each worker has of each digit, counted above over
                        // the same keys, so that no two keys share a place and all places are below the total.
                        unsafe { to.write(*place as usize, key) };
                        *place += 1;
                    }
                });
            });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_sorted_by_depth_and_then_by_id_whatever_their_spread() {
        let mut random = 1u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) as u32
        };
        let mut sorter = Sorter::default();
        for (count, least, spread) in [(0, 0, 1), (1, 7, 1), (5000, 9, 1), (100_000, 1000, 50), (70_000, 0, u32::MAX)] {
            let (mut keys, mut blocks, mut all) = (Vec::new(), Vec::new(), Vec::new());
            while all.len() < count {
                let start = keys.len();
                let mut block = Block { start: start as u32, ..Block::default() };
                // Blocks are not full: what is between them must not be read.
                for k in 0..100.min(count - all.len()) {
                    let depth = least + next() % spread;
                    block.depths = (block.depths.0.min(depth), block.depths.1.max(depth));
                    block.count += 1;
                    let key = u64::from(depth) << 32 | (start + k) as u64;
                    keys.push(key);
                    all.push(key);
                }
                keys.resize(start + 128, u64::MAX);
                blocks.push(block);
            }
            all.sort_unstable();
            assert_eq!(sorter.sort(&keys, &blocks, &Watch::start()), all);
            assert_eq!(sorter.sorted(), all);
        }
    }
}
