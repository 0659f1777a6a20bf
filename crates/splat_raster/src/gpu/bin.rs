//! [`Binner`]: which splats each tile blends, in order of depth (`bin.wgsl`).
//!
//! Per sorted splat the tiles of 16x16 pixels that its ellipse of alpha >= 1/255 reaches are counted exactly (its extent over
//! the pixel centres of each row of tiles, grown by what rounding may cost), the counts are summed up, a thread for every 8
//! pairs of tile and splat writes them, and one stable sort by tile alone leaves each tile's splats in order of depth.
//!
//! A thread finds its first pair's splat by a search in the sums and goes on from there, so that a splat of ten thousand tiles is
//! the work of a thousand threads. Splats whose box has at most 32 tiles keep a bit per tile between the two kernels; larger
//! ones are walked row by row again.
//!
//! Where there is no room for all pairs, the farthest are left out: the counters say how many there should be, and how many
//! there are.
//!
//! Moved: about 140 bytes a splat (its shape lies by slot, so that 24 bytes are three sectors of 32; sums, cover, slot) and, a
//! pair, 8 written, 21 per pass of the sort, of which there are two for pictures from 256 tiles up to 65535, and little else:
//! 50. So 600 000 splats with 3 M pairs are 234 MB: 0.9 ms at 250 GB/s, 0.25 ms at 1 TB/s. (A bound, computed; not measured on
//! such a device.) Limits: 2^32 - 1 pairs (larger sums stay there), 65535 pixels a side.

use splat_shaders::BIN;
use splat_shaders::constants::{BLOCK, COUNTER_KEPT, COUNTER_PAIRS, COUNTER_VISIBLE};

use super::GpuError;
use super::context::{Binding, Context, Pipeline};
use super::scan::{Count, ScanKernels, Scanner};
use super::sort::{SortKernels, Sorter, Sorting};

/// The compiled kernels.
#[derive(Clone, Debug)]
pub(crate) struct BinKernels {
    start: Pipeline,
    splats: Pipeline,
    prepare: Pipeline,
    pairs: Pipeline,
    ranges: Pipeline,
}

impl BinKernels {
    pub(crate) fn new(context: &Context) -> Result<Self, GpuError> {
        use Binding::{Read, Uniform, Write};
        let kernel = |switches, entry, bindings: &[_]| context.pipeline(&BIN, switches, entry, bindings, &[]);
        let pairs = [Uniform, Uniform, Read, Read, Read, Read, Read, Read, Write, Write];
        let splats = [Uniform, Read, Read, Read, Read, Read, Write, Write];
        Ok(Self {
            start: kernel(&["PREPARE"], "bin_start", &[Uniform, Write, Write])?,
            splats: kernel(&["SHAPES", "SPLATS"], "bin_splats", &splats)?,
            prepare: kernel(&["PREPARE"], "bin_prepare", &[Uniform, Write, Write])?,
            pairs: kernel(&["SHAPES", "PAIRS"], "bin_pairs", &pairs)?,
            ranges: kernel(&["RANGES"], "bin_ranges", &[Uniform, Read, Read, Write])?,
        })
    }
}

/// What is sorted into tiles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binning<'a> {
    /// Slots in order of depth, as many as `COUNTER_VISIBLE` of the counters.
    pub(crate) sorted: &'a wgpu::Buffer,
    /// By slot: mean in pixels.
    pub(crate) mean: &'a wgpu::Buffer,
    /// By slot: along, shear.
    pub(crate) shape_a: &'a wgpu::Buffer,
    /// By slot: across, level.
    pub(crate) shape_b: &'a wgpu::Buffer,
    /// Gets `COUNTER_PAIRS` and `COUNTER_KEPT`.
    pub(crate) counters: &'a wgpu::Buffer,
    /// The most splats that may be visible.
    pub(crate) splats: u32,
    /// Pairs to make room for.
    pub(crate) pairs: u32,
    /// Tiles across and down the picture.
    pub(crate) tiles: [u32; 2],
}

/// What grows with the splats and the pairs, whatever the picture's size.
#[derive(Clone, Debug)]
struct Memory {
    splats: u32,
    pairs: u32,
    /// Pairs before each sorted splat.
    offsets: wgpu::Buffer,
    /// Tiles of each sorted splat whose box is small.
    covers: wgpu::Buffer,
    /// Tiles of the pairs, and room to sort.
    tiles: [wgpu::Buffer; 2],
    /// Slots of the pairs, and room to sort.
    slots: [wgpu::Buffer; 2],
}

impl Memory {
    fn new(context: &Context, splats: u32, pairs: u32) -> Self {
        let two = |label| [0, 1].map(|_| context.words(label, pairs as usize));
        Self {
            splats,
            pairs,
            offsets: context.words("pairs before", splats as usize),
            covers: context.words("covers", 2 * splats.max(1) as usize),
            tiles: two("tiles of pairs"),
            slots: two("slots of pairs"),
        }
    }
}

/// Makes the lists of all tiles.
#[derive(Debug)]
pub(crate) struct Binner {
    memory: Memory,
    arguments: wgpu::Buffer,
    tile_ranges: wgpu::Buffer,
    scanner: Scanner,
    sorter: Sorter,
    start: wgpu::BindGroup,
    splats: wgpu::BindGroup,
    prepare: wgpu::BindGroup,
    pairs: wgpu::BindGroup,
    ranges: wgpu::BindGroup,
    tiles: u32,
}

/// Kernels of the stages that a [`Binner`] goes through.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kernels<'a> {
    pub(crate) bin: &'a BinKernels,
    pub(crate) scan: &'a ScanKernels,
    pub(crate) sort: &'a SortKernels,
}

impl Binner {
    /// Binds the buffers and makes those in between: 12 bytes a splat, 16 a pair, 8 a tile.
    pub(crate) fn new(context: &Context, kernels: Kernels<'_>, binning: &Binning<'_>) -> Self {
        Self::with(context, kernels, binning, Memory::new(context, binning.splats, binning.pairs))
    }

    /// As [`Binner::new`], with this one's memory where it has the room asked for: a window that is drawn larger makes new
    /// lists of tiles only.
    pub(crate) fn renewed(&self, context: &Context, kernels: Kernels<'_>, binning: &Binning<'_>) -> Self {
        if (self.memory.splats, self.memory.pairs) == (binning.splats, binning.pairs) {
            Self::with(context, kernels, binning, self.memory.clone())
        } else {
            Self::new(context, kernels, binning)
        }
    }

    fn with(context: &Context, kernels: Kernels<'_>, binning: &Binning<'_>, memory: Memory) -> Self {
        let Binning { splats, pairs, tiles: [across, down], counters, .. } = *binning;
        let tiles = across * down;
        let tile_ranges = context.words("pairs of tiles", 2 * tiles.max(1) as usize);
        let usage = wgpu::BufferUsages::INDIRECT | wgpu::BufferUsages::UNIFORM;
        let arguments = context.buffer("size of binning", 48, usage);
        let parameters = context.uniforms("bin", &[across, down, splats, pairs]);

        let count = Count::At { place: COUNTER_VISIBLE, limit: splats };
        let scanner = Scanner::new(context, kernels.scan, &memory.offsets, counters, count, COUNTER_PAIRS);
        // `tiles` itself is a key of what belongs to no tile.
        let sorting = Sorting {
            keys: memory.tiles.each_ref(),
            values: memory.slots.each_ref(),
            counters,
            count_at: COUNTER_KEPT,
            limit: pairs,
            bits: 0..32 - tiles.leading_zeros(),
        };
        let sorter = Sorter::new(context, kernels.sort, &sorting);
        let input = Sorter::input(&sorting.bits);
        let (unsorted_tiles, unsorted_slots) = (&memory.tiles[input], &memory.slots[input]);

        let bind = |kernel, buffers: &[&wgpu::Buffer]| {
            let all = std::iter::once(&parameters).chain(buffers.iter().copied());
            context.bind(kernel, &all.map(wgpu::Buffer::as_entire_binding).collect::<Vec<_>>())
        };
        let Binning { sorted, mean, shape_a, shape_b, .. } = *binning;
        let k = kernels.bin;
        Self {
            start: bind(&k.start, &[counters, &arguments]),
            splats: bind(&k.splats, &[counters, sorted, mean, shape_a, shape_b, &memory.offsets, &memory.covers]),
            prepare: bind(&k.prepare, &[counters, &arguments]),
            pairs: bind(
                &k.pairs,
                &[
                    &arguments,
                    &memory.offsets,
                    &memory.covers,
                    sorted,
                    mean,
                    shape_a,
                    shape_b,
                    unsorted_tiles,
                    unsorted_slots,
                ],
            ),
            ranges: bind(&k.ranges, &[counters, &memory.tiles[0], &tile_ranges]),
            memory,
            arguments,
            tile_ranges,
            scanner,
            sorter,
            tiles,
        }
    }

    /// Slots of all tiles, each tile's in order of depth: `COUNTER_KEPT` of them.
    pub(crate) fn pair_slots(&self) -> &wgpu::Buffer {
        &self.memory.slots[0]
    }

    /// Per tile, row by row: its first pair and one past its last, as two words; zeros where it has none.
    pub(crate) fn tile_ranges(&self) -> &wgpu::Buffer {
        &self.tile_ranges
    }

    /// Records the dispatches.
    pub(crate) fn encode(&self, kernels: Kernels<'_>, pass: &mut wgpu::ComputePass<'_>) {
        let k = kernels.bin;
        k.start.dispatch(pass, &self.start, 1);
        k.splats.dispatch_indirect(pass, &self.splats, &self.arguments, 0);
        self.scanner.encode(kernels.scan, pass);
        k.prepare.dispatch(pass, &self.prepare, 1);
        k.pairs.dispatch_indirect(pass, &self.pairs, &self.arguments, 16);
        self.sorter.encode(kernels.sort, pass);
        k.ranges.dispatch(pass, &self.ranges, self.tiles.div_ceil(BLOCK));
    }
}

#[cfg(test)]
mod tests;
