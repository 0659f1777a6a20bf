//! Stage 3: which splats each tile blends, in order.

use std::ops::Range;

use rayon::prelude::*;

use super::shared::Shared;
use super::sort::{share, workers_for};
use super::splat::{Cover, Splat, row_of_tiles};
use super::timings::Watch;

/// Entries of all lists that are kept at once; beyond, the tiles are done in several rounds.
const LARGEST_ROUND: u64 = 1 << 27;

/// Lists of ids per tile.
#[derive(Debug)]
pub(super) struct Bins {
    /// Entries that are kept at once, at least those of one tile.
    pub(super) largest_round: u64,
    /// Covers in order of depth.
    covers: Vec<Cover>,
    /// Per worker and tile: entries, then where the next one goes.
    counters: Vec<u32>,
    /// Entries per tile.
    counts: Vec<u32>,
    /// Per tile of the round: where its list starts.
    starts: Vec<u32>,
    /// Lists of the tiles of the round.
    ids: Vec<u32>,
    /// Tiles of the round, those with long lists first.
    order: Vec<u32>,
    /// Tiles whose lists are there.
    pub(super) round: Range<usize>,
    workers: usize,
}

/// What is sorted into tiles.
#[derive(Clone, Copy)]
pub(super) struct Binning<'a> {
    /// In order of depth; ids in the low halves.
    pub(super) sorted: &'a [u64],
    /// By id.
    pub(super) splats: &'a [Splat],
    /// By id.
    pub(super) covers: &'a [Cover],
    /// Tiles across and down the picture.
    pub(super) tiles: (u32, u32),
}

impl Binning<'_> {
    /// Calls back with each tile and id of some of the sorted splats.
    #[inline(always)]
    fn each(&self, keys: &[u64], covers: &[Cover], mut entry: impl FnMut(usize, u32)) {
        for (&key, &cover) in keys.iter().zip(covers) {
            let id = key as u32;
            if cover.is_large() {
                let splat = &self.splats[id as usize];
                for y in splat.tiles[2]..=splat.tiles[3] {
                    let Some((first, last)) = row_of_tiles(splat, y.into()) else { continue };
                    for x in first..=last {
                        entry((u32::from(y) * self.tiles.0 + x) as usize, id);
                    }
                }
            } else {
                cover.each(self.tiles.0, |tile| entry(tile, id));
            }
        }
    }

    /// Covers of the sorted splats `keys`, in their order.
    ///
    /// A pass of its own: these reads miss the caches, and nothing here waits for one of them.
    fn gather(&self, keys: &[u64], to: &mut [Cover]) {
        for (to, &key) in to.iter_mut().zip(keys) {
            *to = self.covers[key as u32 as usize];
        }
    }
}

impl Default for Bins {
    fn default() -> Self {
        Self {
            largest_round: LARGEST_ROUND,
            covers: Vec::new(),
            counters: Vec::new(),
            counts: Vec::new(),
            starts: Vec::new(),
            ids: Vec::new(),
            order: Vec::new(),
            round: 0..0,
            workers: 1,
        }
    }
}

impl Bins {
    /// Counts the entries of all tiles and fills the lists of the first round.
    pub(super) fn start(&mut self, binning: Binning, watch: &Watch) {
        let tiles = binning.tiles.0 as usize * binning.tiles.1 as usize;
        // A row of counters per worker must stay small beside the lists.
        self.workers = workers_for(binning.sorted.len()).min((1 << 24) / tiles + 1);
        self.counters.clear();
        self.counters.resize(self.workers * tiles, 0);
        let workers = self.workers;
        let sorted = binning.sorted;
        self.covers.resize(sorted.len(), Cover::default());
        let covers = Shared::new(&mut self.covers);
        self.counters.par_chunks_mut(tiles).enumerate().for_each(|(worker, counters)| {
            let range = share(sorted.len(), workers, worker);
            // SAFETY: the shares of the workers do not overlap.
            let covers = unsafe { covers.part(range.start, range.len()) };
            watch.work(|| {
                let keys = &sorted[range];
                binning.gather(keys, covers);
                binning.each(keys, covers, |tile, _| counters[tile] += 1);
            });
        });
        self.counts.clear();
        self.counts.resize(tiles, 0);
        for counters in self.counters.chunks(tiles) {
            for (sum, count) in self.counts.iter_mut().zip(counters) {
                *sum += count;
            }
        }
        self.round = 0..0;
        self.fill(binning, watch);
    }

    /// Fills the lists of the next round of tiles.
    pub(super) fn fill(&mut self, binning: Binning, watch: &Watch) {
        let tiles = self.counts.len();
        let first = self.round.end;
        let mut sum = 0u64;
        self.starts.clear();
        let mut end = first;
        while end < tiles && (end == first || sum + u64::from(self.counts[end]) <= self.largest_round) {
            self.starts.push(sum as u32);
            let mut place = sum as u32;
            for worker in 0..self.workers {
                let counter = &mut self.counters[worker * tiles + end];
                (*counter, place) = (place, place + *counter);
            }
            sum += u64::from(self.counts[end]);
            end += 1;
        }
        self.starts.push(sum as u32);
        self.round = first..end;
        if self.ids.len() < sum as usize {
            self.ids.resize(sum as usize, 0);
        }
        let (round, workers) = (self.round.clone(), self.workers);
        let covers = &self.covers;
        let ids = Shared::new(&mut self.ids);
        self.counters.par_chunks_mut(tiles).enumerate().for_each(|(worker, counters)| {
            let range = share(binning.sorted.len(), workers, worker);
            let (keys, covers) = (&binning.sorted[range.clone()], &covers[range]);
            watch.work(|| {
                binning.each(keys, covers, |tile, id| {
                    if round.contains(&tile) {
                        // SAFETY: counters start at prefix sums of what each worker has for each tile, counted by the same
                        // walk, so that no two entries share a place and all places are below the sum.
                        unsafe { ids.write(counters[tile] as usize, id) };
                        counters[tile] += 1;
                    }
                })
            });
        });
        self.order.clear();
        self.order.extend(first as u32..end as u32);
        // By powers of two only: within a class, neighbours stay together and share what is in the caches.
        let counts = &self.counts;
        self.order.sort_unstable_by_key(|&tile| (counts[tile as usize].leading_zeros(), tile));
    }

    /// Whether all tiles have had their round.
    pub(super) fn done(&self) -> bool {
        self.round.end == self.counts.len()
    }

    /// Tiles of the round, in the order in which they are best begun.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Ids of the splats of a tile of the round, in order of depth.
    pub(super) fn list(&self, tile: usize) -> &[u32] {
        let k = tile - self.round.start;
        &self.ids[self.starts[k] as usize..self.starts[k + 1] as usize]
    }
}
