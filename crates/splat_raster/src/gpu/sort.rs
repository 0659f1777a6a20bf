//! [`Sorter`]: a stable radix sort of keys with values on the GPU (`sort.wgsl`).
//!
//! From the lowest digit up, 8 bits at a time; per pass three dispatches: digits of each block of [`SORT_BLOCK`] keys, sums of
//! each digit over the blocks, and a block's keys to their places, put in order within the workgroup first so that whole lines
//! are written. How many keys there are is read on the GPU, dispatches are sized by it. No workgroup waits for another one,
//! so that no device can hang on it.
//!
//! Moved per key and pass: 4 bytes (digits) + 8 + 8 (key and value, read and written) + 1.2 (the table): 21; 84 for 32 bits.
//! So memory bounds it to bandwidth / 84 bytes: at 250 GB/s 3 G keys a second, at 1 TB/s 12 G; 0.6 M keys of a usual capture
//! take 0.2 ms at 250 GB/s and 10 M take 3.4 ms. (Bounds, computed; not measured on such a device.)
//!
//! Two ways to order a block. With subgroups: eight ballots per key find the threads with the same digit, for any size of
//! subgroup from 4 up; used wherever the device has them. Without: two stable passes over 4 bits each, with counters of every
//! thread in workgroup memory. 600 000 keys of 32 bits on lavapipe take 170 ms of CPU time without and 141 ms with subgroups of
//! 8 (`cargo test -p splat_raster --features gpu --lib -- --ignored --nocapture keys_per_second`; Mesa's
//! `LP_NATIVE_VECTOR_WIDTH=128` and `512` make them 4 and 16, to much the same effect). It is no device to sort on: std's
//! stable sort needs 23 ms on one thread.
//!
//! `wgpu` checks each indirect dispatch by a tiny dispatch of its own, unless the instance was opened without
//! `InstanceFlags::VALIDATION_INDIRECT_CALL`: eight of them for a sort by depth.

use std::ops::Range;

use splat_shaders::SORT;
use splat_shaders::constants::{BLOCK, SORT_BLOCK};

use super::GpuError;
use super::context::{Binding, Context, Pipeline};

/// Values of a digit.
const DIGITS: u32 = 256;
/// Sizes of subgroups that there is workgroup memory for, and bits in a ballot.
const SUBGROUP_SIZES: std::ops::RangeInclusive<u32> = 4..=128;

// What `sort.wgsl` takes for granted: numbers within a block have 12 bits, the memory of a block holds 2048 words of counters,
// and every thread has as many keys.
const _: () =
    assert!(SORT_BLOCK <= 1 << 12 && SORT_BLOCK >= 2048 && SORT_BLOCK.is_multiple_of(BLOCK) && BLOCK == DIGITS);

/// How a block of keys is put in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SortPath {
    /// By workgroup memory alone.
    Portable,
    /// By ballots of subgroups.
    Subgroups,
}

impl SortPath {
    /// What is faster on a device.
    fn for_device(context: &Context) -> Self {
        match context.subgroup {
            Some((least, most)) if SUBGROUP_SIZES.contains(&least) && SUBGROUP_SIZES.contains(&most) => Self::Subgroups,
            _ => Self::Portable,
        }
    }
}

/// The compiled kernels.
#[derive(Clone, Debug)]
pub(crate) struct SortKernels {
    prepare: Pipeline,
    histogram: Pipeline,
    rows: Pipeline,
    scatter: Pipeline,
}

impl SortKernels {
    /// The kernels that are fastest on the device.
    pub(crate) fn new(context: &Context) -> Result<Self, GpuError> {
        Self::with(context, SortPath::for_device(context))
    }

    /// The kernels of one path; subgroups need the device's feature.
    pub(crate) fn with(context: &Context, path: SortPath) -> Result<Self, GpuError> {
        use Binding::{Read, Uniform, Write};
        let scatter: &[_] = match path {
            SortPath::Portable => &["SCANS", "SCATTER"],
            SortPath::Subgroups => &["SCANS", "SCATTER", "SUBGROUPS"],
        };
        let kernel = |switches, entry, bindings: &[_]| context.pipeline(&SORT, switches, entry, bindings, &[]);
        Ok(Self {
            prepare: kernel(&["PREPARE"], "sort_prepare", &[Uniform, Read, Write])?,
            histogram: kernel(&["HISTOGRAM"], "sort_histogram", &[Uniform, Read, Write, Read])?,
            rows: kernel(&["SCANS", "ROWS"], "sort_rows", &[Uniform, Read, Write, Write])?,
            scatter: kernel(scatter, "sort_scatter", &[Uniform, Read, Write, Read, Read, Read, Write, Write])?,
        })
    }
}

/// What is sorted.
#[derive(Clone, Debug)]
pub(crate) struct Sorting<'a> {
    /// Where keys are, and room for as many.
    pub(crate) keys: [&'a wgpu::Buffer; 2],
    /// As the keys.
    pub(crate) values: [&'a wgpu::Buffer; 2],
    /// A word of it says how many there are.
    pub(crate) counters: &'a wgpu::Buffer,
    /// The word.
    pub(crate) count_at: u32,
    /// The most there can be; what the word says beyond is ignored.
    pub(crate) limit: u32,
    /// Bits of the keys to sort by.
    pub(crate) bits: Range<u32>,
}

/// Sorts keys and values by some bits of the keys; equal ones keep their order.
///
/// The result is in the first of both pairs of buffers. The input is expected in [`Sorter::input`] of them.
#[derive(Debug)]
pub(crate) struct Sorter {
    arguments: wgpu::Buffer,
    prepare: wgpu::BindGroup,
    passes: Vec<Pass>,
}

#[derive(Debug)]
struct Pass {
    histogram: wgpu::BindGroup,
    rows: wgpu::BindGroup,
    scatter: wgpu::BindGroup,
    /// Values of its digit.
    digits: u32,
}

impl Sorter {
    /// Binds the buffers; makes what is needed in between, about a third of a byte per key.
    pub(crate) fn new(context: &Context, kernels: &SortKernels, sorting: &Sorting<'_>) -> Self {
        let blocks = sorting.limit.div_ceil(SORT_BLOCK).max(1);
        let table = context.words("digits of blocks", (DIGITS * blocks) as usize);
        let totals = context.words("digits", DIGITS as usize);
        let arguments = context.buffer("size of a sort", 16, wgpu::BufferUsages::INDIRECT);
        let counters = sorting.counters.as_entire_binding();
        let count = passes(&sorting.bits);
        // Digits of equal width: fewer, longer runs in each pass than with whole digits and a rest.
        let width = (sorting.bits.end.saturating_sub(sorting.bits.start)).div_ceil(count.max(1));
        let mut from = Self::input(&sorting.bits);
        let mut parameters = context.uniforms("sort", &[sorting.limit, sorting.count_at, 0, 0]);
        let prepare = context
            .bind(&kernels.prepare, &[parameters.as_entire_binding(), counters.clone(), arguments.as_entire_binding()]);
        let passes = (0..count)
            .map(|pass| {
                let shift = sorting.bits.start + pass * width;
                let mask = (1u32 << width.min(sorting.bits.end - shift)) - 1;
                parameters = context.uniforms("sort", &[sorting.limit, sorting.count_at, shift, mask]);
                let to = 1 - from;
                let [keys, values] = [&sorting.keys, &sorting.values].map(|b| b.map(wgpu::Buffer::as_entire_binding));
                let common = [parameters.as_entire_binding(), counters.clone(), table.as_entire_binding()];
                let bind = |kernel, more: &[wgpu::BindingResource<'_>]| {
                    context.bind(kernel, &[common.as_slice(), more].concat())
                };
                let totals = totals.as_entire_binding();
                let pass = Pass {
                    histogram: bind(&kernels.histogram, &[keys[from].clone()]),
                    rows: bind(&kernels.rows, std::slice::from_ref(&totals)),
                    scatter: bind(
                        &kernels.scatter,
                        &[totals, keys[from].clone(), values[from].clone(), keys[to].clone(), values[to].clone()],
                    ),
                    digits: mask + 1,
                };
                from = to;
                pass
            })
            .collect();
        Self { arguments, prepare, passes }
    }

    /// Which of the two pairs of buffers holds the input of a sort by some bits: with an odd number of passes the second.
    pub(crate) fn input(bits: &Range<u32>) -> usize {
        (passes(bits) % 2) as usize
    }

    /// Records the dispatches.
    pub(crate) fn encode(&self, kernels: &SortKernels, pass: &mut wgpu::ComputePass<'_>) {
        kernels.prepare.dispatch(pass, &self.prepare, 1);
        for p in &self.passes {
            kernels.histogram.dispatch_indirect(pass, &p.histogram, &self.arguments, 0);
            kernels.rows.dispatch(pass, &p.rows, p.digits);
            kernels.scatter.dispatch_indirect(pass, &p.scatter, &self.arguments, 0);
        }
    }
}

/// Passes for a range of bits.
fn passes(bits: &Range<u32>) -> u32 {
    (bits.end.saturating_sub(bits.start)).div_ceil(8)
}

#[cfg(test)]
pub(super) mod tests {
    use std::time::Instant;

    use super::*;

    /// Numbers without order.
    fn random(len: usize) -> Vec<u32> {
        let mut state = 5u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 32) as u32
        };
        (0..len).map(|_| next()).collect()
    }

    /// The slow twin: a stable sort by some bits.
    fn sorted(keys: &[u32], bits: &Range<u32>) -> Vec<(u32, u32)> {
        let mut pairs: Vec<_> = keys.iter().copied().zip(0..).collect();
        pairs.sort_by_key(|(key, _)| (u64::from(*key) & ((1 << bits.end) - 1)) >> bits.start);
        pairs
    }

    /// Buffers of a sort, the keys with their places as values.
    struct Bench {
        keys: [wgpu::Buffer; 2],
        values: [wgpu::Buffer; 2],
        counters: wgpu::Buffer,
        sorter: Sorter,
        input: usize,
    }

    impl Bench {
        fn new(context: &Context, kernels: &SortKernels, keys: &[u32], count: u32, bits: Range<u32>) -> Self {
            let input = Sorter::input(&bits);
            let two = |name| [0, 1].map(|_| context.words(name, keys.len()));
            let (key_buffers, values) = (two("keys"), two("values"));
            let counters = context.buffer_of("counters", &[0, 0, count], wgpu::BufferUsages::empty());
            let sorting = Sorting {
                keys: key_buffers.each_ref(),
                values: values.each_ref(),
                counters: &counters,
                count_at: 2,
                limit: keys.len() as u32,
                bits,
            };
            let sorter = Sorter::new(context, kernels, &sorting);
            let bench = Self { keys: key_buffers, values, counters, sorter, input };
            bench.fill(context, keys);
            bench
        }

        fn fill(&self, context: &Context, keys: &[u32]) {
            context.write(&self.keys[self.input], 0, keys);
            let places: Vec<u32> = (0..keys.len() as u32).collect();
            context.write(&self.values[self.input], 0, &places);
        }

        fn result(&self, context: &Context, count: usize) -> Vec<(u32, u32)> {
            let keys = context.read(&self.keys[0], count).unwrap();
            keys.into_iter().zip(context.read(&self.values[0], count).unwrap()).collect()
        }
    }

    /// Both paths where the device has subgroups, whatever pays on it.
    fn paths(context: &Context) -> Vec<(SortPath, SortKernels)> {
        let mut paths = vec![SortPath::Portable];
        if context.subgroup.is_some() {
            paths.push(SortPath::Subgroups);
        }
        paths.into_iter().map(|path| (path, SortKernels::with(context, path).unwrap())).collect()
    }

    fn check(context: &Context, kernels: &SortKernels, keys: &[u32], count: u32, bits: Range<u32>, what: &str) {
        let bench = Bench::new(context, kernels, keys, count, bits.clone());
        context.run(|pass| bench.sorter.encode(kernels, pass));
        let end = keys.len().min(count as usize);
        assert!(bench.result(context, end) == sorted(&keys[..end], &bits), "{what}, {bits:?}");
        assert_eq!(context.read::<u32>(&bench.counters, 3).unwrap(), [0, 0, count], "{what}");
    }

    #[test]
    fn keys_of_any_number_and_order_are_sorted_and_equal_ones_keep_their_order() {
        let Some(context) = Context::for_test() else { return };
        for (path, kernels) in paths(&context) {
            let block = SORT_BLOCK as usize;
            for len in [0, 1, 2, 255, 256, 257, block - 1, block, block + 1, 3 * block + 77, 100_000] {
                let keys = random(len);
                check(&context, &kernels, &keys, len as u32, 0..32, &format!("{path:?}, {len} random keys"));
            }
            let few: Vec<u32> = random(10_000).iter().map(|k| (k % 3) << 9).collect();
            check(&context, &kernels, &few, 10_000, 0..32, &format!("{path:?}, three keys"));
            for key in [0, 7, u32::MAX] {
                check(&context, &kernels, &[key; 9000], 9000, 0..32, &format!("{path:?}, all keys {key}"));
            }
            let rising: Vec<u32> = (0..20_000).map(|i| i * 200_000).collect();
            check(&context, &kernels, &rising, 20_000, 0..32, &format!("{path:?}, sorted keys"));
            let falling: Vec<u32> = rising.iter().rev().copied().collect();
            check(&context, &kernels, &falling, 20_000, 0..32, &format!("{path:?}, keys in reverse"));
        }
    }

    #[test]
    fn only_the_bits_asked_for_count() {
        let Some(context) = Context::for_test() else { return };
        let keys = random(8000);
        for (path, kernels) in paths(&context) {
            for bits in [0..0, 0..1, 0..7, 0..8, 3..9, 0..11, 0..13, 8..24, 5..22, 24..32, 0..31] {
                check(&context, &kernels, &keys, 8000, bits, &format!("{path:?}"));
            }
        }
    }

    #[test]
    fn the_count_is_read_on_the_gpu_and_nothing_beyond_it_is_touched() {
        let Some(context) = Context::for_test() else { return };
        let keys = random(12_000);
        for (path, kernels) in paths(&context) {
            for count in [0, 1, 5000, 11_999, 12_000, 12_001, u32::MAX] {
                check(&context, &kernels, &keys, count, 0..32, &format!("{path:?}, {count} of 12000 keys"));
            }
            // After a sort of more: what that left in the tables must not matter.
            let bench = Bench::new(&context, &kernels, &keys, 12_000, 0..32);
            context.run(|pass| bench.sorter.encode(&kernels, pass));
            bench.fill(&context, &keys);
            context.write(&bench.counters, 8, &[5000]);
            context.run(|pass| bench.sorter.encode(&kernels, pass));
            assert!(bench.result(&context, 5000) == sorted(&keys[..5000], &(0..32)), "{path:?}");
            let rest: Vec<_> = keys.iter().copied().zip(0..).skip(5000).collect();
            assert!(bench.result(&context, 12_000)[5000..] == rest, "{path:?}");
        }
    }

    #[test]
    fn many_blocks_of_keys_are_sorted() {
        // 17 blocks for each thread that sums up a digit, the last ones without any.
        let Some(context) = Context::for_test() else { return };
        let keys = random(1030 * SORT_BLOCK as usize);
        let (path, kernels) = paths(&context).pop().unwrap();
        check(&context, &kernels, &keys, keys.len() as u32, 20..26, &format!("{path:?}"));
    }

    /// Seconds by the clock and of CPU time of the whole process, the least of some runs: on a software device the second one
    /// does not depend on what else the machine does.
    pub(in crate::gpu) fn best(mut run: impl FnMut()) -> (f64, f64) {
        let mut best = (f64::MAX, f64::MAX);
        for _ in 0..7 {
            let cpu = || {
                let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
                // SAFETY: `time` is valid for writes and outlives the call.
                unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) };
                time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
            };
            let (wall, start) = (Instant::now(), cpu());
            run();
            best = (best.0.min(wall.elapsed().as_secs_f64()), best.1.min(cpu() - start));
        }
        best
    }

    #[test]
    #[ignore = "prints figures: cargo test -p splat_raster --features gpu --lib -- --ignored --nocapture keys_per_second"]
    fn keys_per_second() {
        let Some(context) = Context::for_test() else { return };
        let info = context.device.adapter_info();
        println!("{} ({:?}), subgroups of {:?}", info.name, info.device_type, context.subgroup);
        for len in [100_000, 600_000, 4_000_000] {
            let keys = random(len);
            let mut lines = Vec::new();
            for (path, kernels) in paths(&context) {
                let bench = Bench::new(&context, &kernels, &keys, len as u32, 0..32);
                lines.push((format!("{path:?}"), best(|| context.run(|pass| bench.sorter.encode(&kernels, pass)))));
                for (what, kernel, group) in [
                    ("histogram", &kernels.histogram, &bench.sorter.passes[0].histogram),
                    ("rows", &kernels.rows, &bench.sorter.passes[0].rows),
                    ("scatter", &kernels.scatter, &bench.sorter.passes[0].scatter),
                ] {
                    let groups = if what == "rows" { DIGITS } else { (len as u32).div_ceil(SORT_BLOCK) };
                    let time = best(|| context.run(|pass| kernel.dispatch(pass, group, groups)));
                    lines.push((format!("  {what} of one pass"), time));
                }
            }
            let mut pairs: Vec<(u32, u32)> = Vec::new();
            let time = best(|| {
                pairs = keys.iter().copied().zip(0..).collect();
                pairs.sort_by_key(|(key, _)| *key);
            });
            lines.push(("std's stable sort, one thread of the CPU".into(), time));
            for (what, (wall, cpu)) in lines {
                let speed = len as f64 / wall / 1e6;
                println!("{len:8} keys: {:8.2} ms, {speed:8.1} M keys/s, {:8.2} ms CPU  {what}", wall * 1e3, cpu * 1e3);
            }
        }
    }
}
