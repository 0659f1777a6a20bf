//! [`GpuTimings`]: what the stages of a frame took on the GPU.

use std::time::Duration;

/// A stage that is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GpuStage {
    Project,
    Compact,
    Sort,
    Bin,
    Blend,
}

/// What the stages of one frame took; zero where a stage was skipped, because the lists of the frame before served.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GpuTimings {
    /// Gaussians to splats: culling, projection, colour.
    pub project: Duration,
    /// Keys of what may be seen.
    pub compact: Duration,
    /// One order by depth.
    pub sort: Duration,
    /// Which splats each tile has.
    pub bin: Duration,
    /// Splats to pixels.
    pub blend: Duration,
}

impl GpuTimings {
    /// All stages together.
    pub fn total(&self) -> Duration {
        self.project + self.compact + self.sort + self.bin + self.blend
    }
}

/// Timestamps: two a stage; the last stage is [`GpuStage::Blend`].
const STAMPS: u32 = 10;
/// Where those of the last stage are, in bytes: they are there in every frame, and copied to such places only.
const LAST_AT: u64 = wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT;
/// Bytes of the timestamps.
pub(crate) const STAMP_BYTES: u64 = LAST_AT + 16;

/// Takes the time of passes.
#[derive(Debug)]
pub(crate) struct Clock {
    queries: wgpu::QuerySet,
    /// Timestamps of the last frame; those of skipped stages are cleared.
    pub(crate) stamps: wgpu::Buffer,
    nanoseconds: f32,
}

impl Clock {
    /// A clock where the device has one.
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then(|| Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("stages"),
                ty: wgpu::QueryType::Timestamp,
                count: STAMPS,
            }),
            stamps: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: STAMP_BYTES,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            nanoseconds: queue.get_timestamp_period(),
        })
    }

    /// Begins the pass of a stage, timed if there is a clock.
    pub(crate) fn pass<'a>(
        clock: Option<&Self>,
        encoder: &'a mut wgpu::CommandEncoder,
        stage: GpuStage,
    ) -> wgpu::ComputePass<'a> {
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(match stage {
                GpuStage::Project => "project splats",
                GpuStage::Compact => "list visible splats",
                GpuStage::Sort => "sort splats",
                GpuStage::Bin => "splats of tiles",
                GpuStage::Blend => "blend splats",
            }),
            timestamp_writes: clock.map(|clock| wgpu::ComputePassTimestampWrites {
                query_set: &clock.queries,
                beginning_of_pass_write_index: Some(2 * stage as u32),
                end_of_pass_write_index: Some(2 * stage as u32 + 1),
            }),
        })
    }

    /// Records how the timestamps come to their buffer; without `all`, of the last stage only.
    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder, all: bool) {
        let last = 2 * GpuStage::Blend as u32;
        if all {
            encoder.resolve_query_set(&self.queries, 0..last, &self.stamps, 0);
        } else {
            encoder.clear_buffer(&self.stamps, 0, Some(LAST_AT));
        }
        encoder.resolve_query_set(&self.queries, last..STAMPS, &self.stamps, LAST_AT);
    }

    /// Timestamps as durations.
    pub(crate) fn timings(&self, stamps: &[u64]) -> GpuTimings {
        let of = |stage: GpuStage| {
            let at = if stage == GpuStage::Blend { LAST_AT as usize / 8 } else { 2 * stage as usize };
            let ticks = stamps[at + 1].saturating_sub(stamps[at]);
            Duration::from_nanos((ticks as f64 * f64::from(self.nanoseconds)) as u64)
        };
        GpuTimings {
            project: of(GpuStage::Project),
            compact: of(GpuStage::Compact),
            sort: of(GpuStage::Sort),
            bin: of(GpuStage::Bin),
            blend: of(GpuStage::Blend),
        }
    }
}
