//! [`Scanner`]: exclusive prefix sums on the GPU (`scan.wgsl`).
//!
//! Reduce, then scan: one dispatch sums up blocks of [`SCAN_BLOCK`] numbers, the next adds to each block the sums before it,
//! which every workgroup reads for itself (a few thousand words, from the caches), so that nothing is needed between the two
//! and no workgroup ever waits for another. Up to [`SCAN_BLOCK`] numbers are one dispatch.
//!
//! Moved: 12 bytes a number (read, read, write), 8 where one dispatch does. Limit: 2^32 - 1 numbers; fast up to 2^25, where
//! the sums before a block stop being few.

use splat_shaders::SCAN;
use splat_shaders::constants::{NO_PLACE, SCAN_BLOCK};

use super::GpuError;
use super::context::{Binding, Context, Pipeline};

/// How many entries a stage works on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    /// So many.
    Known(u32),
    /// What a word of the counters says, at most `limit`.
    At {
        /// The word.
        place: u32,
        /// The most that there is room for.
        limit: u32,
    },
}

impl Count {
    /// The most there can be.
    pub(crate) fn limit(self) -> u32 {
        match self {
            Self::Known(count) => count,
            Self::At { limit, .. } => limit,
        }
    }

    /// The word of the counters, or [`NO_PLACE`].
    fn place(self) -> u32 {
        match self {
            Self::Known(_) => NO_PLACE,
            Self::At { place, .. } => place,
        }
    }
}

/// The compiled kernels.
#[derive(Clone, Debug)]
pub(crate) struct ScanKernels {
    reduce: Pipeline,
    blocks: Pipeline,
}

impl ScanKernels {
    pub(crate) fn new(context: &Context) -> Result<Self, GpuError> {
        let bindings = [Binding::Uniform, Binding::Write, Binding::Write, Binding::Write];
        let kernel = |entry| context.pipeline(&SCAN, &[], entry, &bindings, &[]);
        Ok(Self { reduce: kernel("scan_reduce")?, blocks: kernel("scan_blocks")? })
    }
}

/// Replaces the numbers of a buffer by their exclusive prefix sums.
///
/// Sums that reach 2^32 - 1 stay there.
#[derive(Debug)]
pub(crate) struct Scanner {
    groups: u32,
    reduce: wgpu::BindGroup,
    blocks: wgpu::BindGroup,
}

impl Scanner {
    /// For the first `count` words of `data`; the sum of all goes to word `total_at` of `counters`, which also holds the count
    /// where that is known to the GPU only. A sum of no numbers is 0.
    pub(crate) fn new(
        context: &Context,
        kernels: &ScanKernels,
        data: &wgpu::Buffer,
        counters: &wgpu::Buffer,
        count: Count,
        total_at: u32,
    ) -> Self {
        let groups = count.limit().div_ceil(SCAN_BLOCK).max(1);
        let sums = context.words("sums of blocks", groups as usize);
        let parameters = context.uniforms("scan", &[count.limit(), count.place(), total_at, 0]);
        let bind = |kernel| {
            context.bind(
                kernel,
                &[
                    parameters.as_entire_binding(),
                    data.as_entire_binding(),
                    sums.as_entire_binding(),
                    counters.as_entire_binding(),
                ],
            )
        };
        Self { groups, reduce: bind(&kernels.reduce), blocks: bind(&kernels.blocks) }
    }

    /// Records the dispatches.
    pub(crate) fn encode(&self, kernels: &ScanKernels, pass: &mut wgpu::ComputePass<'_>) {
        if self.groups > 1 {
            kernels.reduce.dispatch(pass, &self.reduce, self.groups);
        }
        kernels.blocks.dispatch(pass, &self.blocks, self.groups);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The slow twin: what is before each number, and all.
    fn exclusive_sums(numbers: &[u32]) -> (Vec<u32>, u32) {
        let mut sum = 0u32;
        let before = numbers
            .iter()
            .map(|n| {
                let before = sum;
                sum = sum.saturating_add(*n);
                before
            })
            .collect();
        (before, sum)
    }

    fn scanned(
        context: &Context,
        numbers: &[u32],
        count: Count,
        counters: &[u32],
        total_at: u32,
    ) -> (Vec<u32>, Vec<u32>) {
        let kernels = ScanKernels::new(context).unwrap();
        let data = context.buffer_of("numbers", numbers, wgpu::BufferUsages::empty());
        let counter_buffer = context.buffer_of("counters", counters, wgpu::BufferUsages::empty());
        let scanner = Scanner::new(context, &kernels, &data, &counter_buffer, count, total_at);
        context.run(|pass| scanner.encode(&kernels, pass));
        (context.read(&data, numbers.len()).unwrap(), context.read(&counter_buffer, counters.len()).unwrap())
    }

    #[test]
    fn sums_of_any_number_of_numbers_are_those_of_a_loop() {
        let Some(context) = Context::for_test() else { return };
        let (n, block) = (1 << 20, SCAN_BLOCK as usize);
        for len in [0, 1, 2, 7, 8, 9, 255, 256, 257, block - 1, block, block + 1, 5 * block, 100_000, n, n + 3, 1 << 24]
        {
            let numbers: Vec<u32> = (0..len as u32).map(|i| i.wrapping_mul(2_654_435_761) >> 21).collect();
            let (before, sum) = exclusive_sums(&numbers);
            let (got, counters) = scanned(&context, &numbers, Count::Known(len as u32), &[7, 7, 7], 1);
            assert!(got == before, "{len} numbers");
            assert_eq!(counters, [7, sum, 7], "{len} numbers");
        }
    }

    #[test]
    fn a_count_on_the_gpu_ends_the_sum_and_never_passes_the_limit() {
        let Some(context) = Context::for_test() else { return };
        let numbers: Vec<u32> = (0..10_000).map(|i| i % 13).collect();
        for count in [0, 1, 256, 2047, 2048, 2049, 9999, 10_000, 10_001, u32::MAX] {
            let end = count.min(10_000) as usize;
            let (mut before, sum) = exclusive_sums(&numbers[..end]);
            before.extend(&numbers[end..]);
            let at = Count::At { place: 2, limit: 10_000 };
            let (got, counters) = scanned(&context, &numbers, at, &[1, 1, count], 0);
            assert!(got == before, "count {count}");
            assert_eq!(counters, [sum, 1, count]);
        }
    }

    #[test]
    fn sums_beyond_32_bits_stay_at_the_largest_number() {
        let Some(context) = Context::for_test() else { return };
        let mut numbers = vec![3_000_000_u32; 5000];
        numbers[4000] = u32::MAX;
        let (before, sum) = exclusive_sums(&numbers);
        assert!(sum == u32::MAX && before[1500] == u32::MAX && before[1400] != u32::MAX);
        assert_eq!(scanned(&context, &numbers, Count::Known(5000), &[0], 0), (before, vec![sum]));
    }
}
