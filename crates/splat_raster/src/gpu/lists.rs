//! [`Lists`]: a view's working memory of the stages before blending, and what they leave: splats, and which of them each
//! tile has, in order of depth.

use splat_core::View;
use splat_shaders::constants::{COUNTER_PAIRS, COUNTER_VISIBLE, COUNTERS, TILE};

use super::bin::{Binner, Binning};
use super::compact::Compactor;
use super::context::Context;
use super::project::{Projector, Records};
use super::sort::{Sorter, Sorting};
use super::timings::{Clock, GpuStage};
use super::{GpuError, GpuInstance, Stages};
use crate::RasterError;

/// Pairs to begin with, at least.
const FEWEST_PAIRS: u32 = 1 << 16;

/// Pairs that room is ever made for: a gibibyte.
const MOST_PAIRS: u64 = 1 << 26;

/// What the GPU counted in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counted {
    pub(crate) visible: u32,
    /// Pairs of tile and splat that the frame needs; 2^32 - 1 stands for more.
    pub(crate) pairs: u32,
}

impl Counted {
    pub(crate) fn of(counters: &[u32]) -> Self {
        Self { visible: counters[COUNTER_VISIBLE as usize], pairs: counters[COUNTER_PAIRS as usize] }
    }
}

/// What lists depend on.
#[derive(Debug)]
struct Key {
    instances: Vec<GpuInstance>,
    view: View,
    color: bool,
}

impl Key {
    fn has_sources_of(&self, instances: &[GpuInstance]) -> bool {
        self.instances.len() == instances.len()
            && self.instances.iter().zip(instances).all(|(a, b)| a.has_sources_of(b))
    }

    fn serves(&self, instances: &[GpuInstance], view: &View, color: bool) -> bool {
        self.view == *view
            && (self.color || !color)
            && self.has_sources_of(instances)
            && self.instances.iter().zip(instances).all(|(a, b)| a.is_placed_as(b))
    }
}

/// Buffers that grow with the number of slots.
#[derive(Debug)]
struct Slots {
    capacity: u32,
    records: Records,
    values: wgpu::Buffer,
    compactor: Compactor,
    sorter: Sorter,
}

/// Buffers that grow with the number of pairs.
#[derive(Debug)]
struct Pairs {
    capacity: u32,
    tiles: [u32; 2],
    binner: Binner,
}

/// Working memory of a view.
#[derive(Debug)]
pub(crate) struct Lists {
    counters: wgpu::Buffer,
    slots: Option<Slots>,
    pairs: Option<Pairs>,
    projector: Projector,
    key: Option<Key>,
    /// Pairs that a frame was found to need.
    needed: u32,
    /// Counts up whenever a buffer that is bound elsewhere was replaced.
    generation: u64,
}

/// A frame's lists, to be bound by later stages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Listed<'a> {
    pub(crate) records: &'a Records,
    /// Slots of all tiles.
    pub(crate) pair_slots: &'a wgpu::Buffer,
    /// Per tile, row by row: first and one past the last of its pairs.
    pub(crate) tile_ranges: &'a wgpu::Buffer,
}

impl Lists {
    pub(crate) fn new(context: &Context) -> Self {
        Self {
            counters: context.words("counters", COUNTERS as usize),
            slots: None,
            pairs: None,
            projector: Projector::default(),
            key: None,
            needed: 0,
            generation: 0,
        }
    }

    /// Makes room for a scene and a view; whether the lists must be made anew.
    pub(crate) fn prepare(
        &mut self,
        context: &Context,
        stages: &Stages,
        instances: &[GpuInstance],
        view: &View,
        color: bool,
    ) -> Result<bool, RasterError> {
        let count: usize = instances.iter().map(GpuInstance::len).sum();
        for instance in instances {
            instance.check()?;
        }
        // A slot takes 8 bytes in the widest binding; ids end at 2^32 - 2.
        let binding = context.limits.max_storage_buffer_binding_size.min(context.limits.max_buffer_size);
        let most = (binding / Records::WIDEST).min(u64::from(u32::MAX - 1)) as u32;
        let slots = u32::try_from(count)
            .ok()
            .filter(|slots| *slots <= most)
            .ok_or(GpuError::OutOfMemory { what: "splats", bytes: count as u64 * Records::WIDEST })?;
        let tiles = [view.width.div_ceil(TILE), view.height.div_ceil(TILE)];
        let (generation, grown) = (self.generation, self.room_for(context, stages, slots, most, tiles));
        if let Err(e) = grown {
            // Half of the buffers may be there: begin anew next time.
            (self.slots, self.pairs, self.key) = (None, None, None);
            return Err(e.into());
        }
        if generation == self.generation && self.key.as_ref().is_some_and(|k| k.serves(instances, view, color)) {
            return Ok(false);
        }
        let Some(memory) = &self.slots else { return Ok(false) };
        if generation != self.generation || !self.key.as_ref().is_some_and(|k| k.has_sources_of(instances)) {
            self.projector = Projector::new(context, &stages.project, &memory.records, instances);
            memory.compactor.set_slots(context, slots);
        }
        self.projector.place(context, instances, view, color);
        self.key = Some(Key { instances: instances.to_vec(), view: *view, color });
        Ok(true)
    }

    fn room_for(
        &mut self,
        context: &Context,
        stages: &Stages,
        slots: u32,
        most: u32,
        tiles: [u32; 2],
    ) -> Result<(), GpuError> {
        if self.slots.as_ref().is_none_or(|s| s.capacity < slots) {
            // A bit more, so that parts may be added one by one; the first time, what is asked for.
            let more = if self.slots.is_some() { slots / 4 } else { 0 };
            let capacity = slots.saturating_add(more).min(most).max(1);
            (self.slots, self.pairs) = (None, None);
            self.generation += 1;
            let counters = &self.counters;
            self.slots = Some(context.checked("splats", u64::from(capacity) * 52, || {
                let records = Records::new(context, capacity as usize);
                let words = |label| context.words(label, capacity as usize);
                let keys = [words("depth keys"), words("depth keys, turned")];
                let values = [words("slots"), words("slots, turned")];
                // z is positive: its sign is 0.
                let sorting = Sorting {
                    keys: keys.each_ref(),
                    values: values.each_ref(),
                    counters,
                    count_at: COUNTER_VISIBLE,
                    limit: capacity,
                    bits: 0..31,
                };
                let input = Sorter::input(&sorting.bits);
                let kernels = (&stages.compact, &stages.scan);
                let unsorted = [&keys[input], &values[input]];
                let compactor = Compactor::new(context, kernels, capacity, &records.z, counters, unsorted);
                let sorter = Sorter::new(context, &stages.sort, &sorting);
                let [values, _] = values;
                Slots { capacity, records, values, compactor, sorter }
            })?);
        }
        let Some(slots) = &self.slots else { return Ok(()) };
        let binding = context.limits.max_storage_buffer_binding_size.min(context.limits.max_buffer_size);
        let most = (binding / 4).min(MOST_PAIRS) as u32;
        let known = self.pairs.as_ref().map_or(0, |p| p.capacity);
        let needed = if self.needed > known { self.needed.saturating_add(self.needed / 4) } else { known };
        let first = slots.capacity.saturating_mul(2).clamp(FEWEST_PAIRS, 1 << 24);
        let capacity = needed.max(first).min(most);
        if known < capacity || self.pairs.as_ref().is_none_or(|p| p.tiles != tiles) {
            // A view of another size keeps its memory; too small memory goes before the larger is made.
            let old = self.pairs.take().filter(|pairs| pairs.capacity == capacity);
            self.generation += 1;
            let binning = Binning {
                sorted: &slots.values,
                mean: &slots.records.mean,
                shape_a: &slots.records.shape_a,
                shape_b: &slots.records.shape_b,
                counters: &self.counters,
                splats: slots.capacity,
                pairs: capacity,
                tiles,
            };
            let bytes = u64::from(capacity) * 16 + u64::from(slots.capacity) * 12;
            let binner = context.checked("pairs of tile and splat", bytes, || match &old {
                Some(old) => old.binner.renewed(context, stages.binning(), &binning),
                None => Binner::new(context, stages.binning(), &binning),
            })?;
            self.pairs = Some(Pairs { capacity, tiles, binner });
        }
        Ok(())
    }

    /// Records the stages.
    pub(crate) fn encode(&self, stages: &Stages, encoder: &mut wgpu::CommandEncoder, clock: Option<&Clock>) {
        let (Some(slots), Some(pairs)) = (&self.slots, &self.pairs) else { return };
        self.projector.encode(&stages.project, &mut Clock::pass(clock, encoder, GpuStage::Project));
        let kernels = (&stages.compact, &stages.scan);
        slots.compactor.encode(kernels, &mut Clock::pass(clock, encoder, GpuStage::Compact));
        slots.sorter.encode(&stages.sort, &mut Clock::pass(clock, encoder, GpuStage::Sort));
        pairs.binner.encode(stages.binning(), &mut Clock::pass(clock, encoder, GpuStage::Bin));
    }

    /// What later stages bind; none before [`Lists::prepare`].
    pub(crate) fn listed(&self) -> Option<Listed<'_>> {
        let (slots, pairs) = (self.slots.as_ref()?, self.pairs.as_ref()?);
        Some(Listed {
            records: &slots.records,
            pair_slots: pairs.binner.pair_slots(),
            tile_ranges: pairs.binner.tile_ranges(),
        })
    }

    /// Words that the stages counted.
    pub(crate) fn counters(&self) -> &wgpu::Buffer {
        &self.counters
    }

    /// Learns what a frame needed; whether there was room.
    pub(crate) fn learn(&mut self, counted: Counted) -> bool {
        let known = self.pairs.as_ref().map_or(0, |p| p.capacity);
        self.needed = self.needed.max(counted.pairs);
        counted.pairs <= known
    }

    /// Makes the next frame draw all stages.
    pub(crate) fn forget(&mut self) {
        self.key = None;
    }
}
