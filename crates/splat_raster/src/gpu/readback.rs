//! [`Echo`]: a few words of a frame that reach the host some frames later, without anyone waiting.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::context::Context;

const PENDING: u8 = 0;
const ARRIVED: u8 = 1;
const FAILED: u8 = 2;

#[derive(Debug)]
enum State {
    /// May be copied to.
    Free,
    /// A recorded copy goes to it; once that is submitted it can be mapped.
    Copied,
    /// Being mapped.
    Mapping(Arc<AtomicU8>),
}

/// A buffer that is copied to in a frame and read in a later one.
///
/// Between [`Echo::copy`] and the next [`Echo::poll`] the commands must be submitted.
#[derive(Debug)]
pub(crate) struct Echo {
    buffer: wgpu::Buffer,
    state: State,
}

impl Echo {
    pub(crate) fn new(context: &Context, bytes: u64) -> Self {
        let buffer = context.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("echo"),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { buffer, state: State::Free }
    }

    /// Records copies of whole buffers, one after the other, unless an earlier copy is still on its way.
    pub(crate) fn copy(&mut self, encoder: &mut wgpu::CommandEncoder, sources: &[&wgpu::Buffer]) {
        if !matches!(self.state, State::Free) {
            return;
        }
        let mut at = 0;
        for source in sources {
            encoder.copy_buffer_to_buffer(source, 0, &self.buffer, at, source.size());
            at += source.size();
        }
        self.state = State::Copied;
    }

    /// What was copied, once it has arrived; then the buffer is free again.
    pub(crate) fn poll<R>(&mut self, context: &Context, read: impl FnOnce(&[u8]) -> R) -> Option<R> {
        if matches!(self.state, State::Copied) {
            let arrived = Arc::new(AtomicU8::new(PENDING));
            let tell = arrived.clone();
            self.buffer.map_async(wgpu::MapMode::Read, .., move |result| {
                tell.store(if result.is_ok() { ARRIVED } else { FAILED }, Ordering::Release);
            });
            self.state = State::Mapping(arrived);
        }
        let State::Mapping(arrived) = &self.state else { return None };
        // Runs callbacks; a lost device fails the mapping, which is seen below.
        let _ = context.device.poll(wgpu::PollType::Poll);
        let result = match arrived.load(Ordering::Acquire) {
            PENDING => return None,
            ARRIVED => {
                let result = read(&self.buffer.get_mapped_range(..));
                self.buffer.unmap();
                Some(result)
            }
            _ => None,
        };
        self.state = State::Free;
        result
    }
}
