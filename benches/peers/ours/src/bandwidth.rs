//! How fast the device moves memory: the bound that no stage of a frame can beat.

use std::time::Instant;

use peer_common::{Failure, Report, Stage, memory_mib};
use wgpu29 as wgpu;

use crate::device::{self, Device};
use crate::failed;

/// Bytes of a buffer: far beyond any cache.
const BYTES: u64 = 512 << 20;
/// Copies of which the fastest counts.
const ROUNDS: usize = 5;
/// Copies that are submitted together, so that submitting does not count.
const TOGETHER: u32 = 16;

/// Copies one large buffer into another, over and over.
pub(crate) fn run() -> Result<(), Failure> {
    let Device { device, queue, info, name } = device::open()?;
    let bytes = BYTES.min(device.limits().max_buffer_size / 4 * 4);
    // Copying on a processor is slow enough as it is.
    let together = if info.device_type == wgpu::DeviceType::Cpu { 1 } else { TOGETHER };
    let buffer = || {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes,
            usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    };
    let (from, to) = (buffer(), buffer());
    let mut least = f64::INFINITY;
    for _ in 0..ROUNDS {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for _ in 0..together {
            encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes);
        }
        let begun = Instant::now();
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely()).map_err(failed)?;
        least = least.min(begun.elapsed().as_secs_f64() * 1e3);
    }
    Report {
        device: name,
        // Read once and written once.
        stages: vec![Stage {
            name: "copy".to_owned(),
            ms: least,
            bytes: Some(2.0 * bytes as f64 * f64::from(together)),
        }],
        memory_mib: memory_mib(),
        ..Report::default()
    }
    .print()
}
