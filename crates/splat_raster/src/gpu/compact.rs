//! [`Compactor`]: keys of the splats that may be seen, in order of slots (`compact.wgsl`).

use splat_shaders::COMPACT;
use splat_shaders::constants::{BLOCK, COUNTER_VISIBLE};

use super::GpuError;
use super::context::{Binding, Context, Pipeline};
use super::scan::{Count, ScanKernels, Scanner};

/// The compiled kernels.
#[derive(Clone, Debug)]
pub(crate) struct CompactKernels {
    count: Pipeline,
    compact: Pipeline,
}

impl CompactKernels {
    pub(crate) fn new(context: &Context) -> Result<Self, GpuError> {
        use Binding::{Read, Uniform, Write};
        Ok(Self {
            count: context.pipeline(&COMPACT, &["COUNT"], "count_visible", &[Uniform, Read, Write], &[])?,
            compact: context.pipeline(&COMPACT, &[], "compact_visible", &[Uniform, Read, Write, Write, Write], &[])?,
        })
    }
}

/// Lists what is visible.
#[derive(Debug)]
pub(crate) struct Compactor {
    slots: wgpu::Buffer,
    scanner: Scanner,
    count: wgpu::BindGroup,
    compact: wgpu::BindGroup,
    blocks: u32,
}

impl Compactor {
    /// Binds the buffers, with room for `capacity` slots. Gets `COUNTER_VISIBLE` and as many `keys` and `values`.
    pub(crate) fn new(
        context: &Context,
        kernels: (&CompactKernels, &ScanKernels),
        capacity: u32,
        z: &wgpu::Buffer,
        counters: &wgpu::Buffer,
        [keys, values]: [&wgpu::Buffer; 2],
    ) -> Self {
        let blocks = capacity.div_ceil(BLOCK).max(1);
        let counts = context.words("visible per block", blocks as usize);
        let slots = context.uniforms("slots", &[capacity, 0, 0, 0]);
        let (compact, scan) = kernels;
        let bind = |kernel, buffers: &[&wgpu::Buffer]| {
            context.bind(kernel, &buffers.iter().map(|b| b.as_entire_binding()).collect::<Vec<_>>())
        };
        Self {
            scanner: Scanner::new(context, scan, &counts, counters, Count::Known(blocks), COUNTER_VISIBLE),
            count: bind(&compact.count, &[&slots, z, &counts]),
            compact: bind(&compact.compact, &[&slots, z, &counts, keys, values]),
            slots,
            blocks,
        }
    }

    /// How many slots are in use: before the next submission.
    pub(crate) fn set_slots(&self, context: &Context, slots: u32) {
        context.write(&self.slots, 0, &[slots, 0, 0, 0]);
    }

    /// Records the dispatches.
    pub(crate) fn encode(&self, kernels: (&CompactKernels, &ScanKernels), pass: &mut wgpu::ComputePass<'_>) {
        kernels.0.count.dispatch(pass, &self.count, self.blocks);
        self.scanner.encode(kernels.1, pass);
        kernels.0.compact.dispatch(pass, &self.compact, self.blocks);
    }
}

#[cfg(test)]
mod tests {
    use splat_shaders::constants::COUNTERS;

    use super::*;

    /// The slow twin.
    fn compact_slow(z: &[f32]) -> Vec<(u32, u32)> {
        z.iter().enumerate().filter(|(_, z)| **z > 0.0).map(|(slot, z)| (z.to_bits(), slot as u32)).collect()
    }

    #[test]
    fn keys_are_those_of_visible_slots_in_order() {
        let Some(context) = Context::for_test() else { return };
        let kernels = (CompactKernels::new(&context).unwrap(), ScanKernels::new(&context).unwrap());
        let kernels = (&kernels.0, &kernels.1);
        for (slots, capacity, each) in
            [(0, 1, 1), (1, 1, 1), (255, 300, 2), (256, 256, 1), (257, 5000, 3), (5000, 5000, 999), (70_000, 70_001, 5)]
        {
            // Slots that are not in use hold what an earlier scene left.
            let mut z = vec![9.0f32; capacity];
            for (i, z) in z[..slots].iter_mut().enumerate() {
                *z = if i % each == 0 { 0.5 + (i * 37 % 101) as f32 } else { 0.0 };
            }
            let buffer = context.buffer_of("z", &z, wgpu::BufferUsages::empty());
            let counters = context.words("counters", COUNTERS as usize);
            let [keys, values] = ["keys", "values"].map(|label| context.words(label, capacity));
            let compactor = Compactor::new(&context, kernels, capacity as u32, &buffer, &counters, [&keys, &values]);
            // A larger scene before this one leaves its counts behind.
            for slots in [capacity, slots] {
                compactor.set_slots(&context, slots as u32);
                context.run(|pass| compactor.encode(kernels, pass));
            }
            let expected = compact_slow(&z[..slots]);
            let count = context.read::<u32>(&counters, 1).unwrap()[COUNTER_VISIBLE as usize] as usize;
            assert_eq!(count, expected.len(), "{slots} slots");
            let found = context.read::<u32>(&keys, count).unwrap().into_iter();
            let found: Vec<_> = found.zip(context.read::<u32>(&values, count).unwrap()).collect();
            assert_eq!(found, expected, "{slots} slots");
        }
    }
}
