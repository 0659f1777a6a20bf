//! What was drawn before the splats, for the CPU: its depth as limits, and its pixels.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bevy::math::{UVec2, Vec4};
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoder, CommandEncoderDescriptor, Extent3d, MapMode, Origin3d,
    PipelineCache, PollType, TexelCopyBufferInfo, TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect,
    TextureView,
};
use bevy::render::renderer::{FlushCommands, RenderDevice, RenderQueue};
use rayon::prelude::*;

use super::composite::{CompositePipelines, LimitView};
use super::prepare::Plan;

/// Stands for "no mesh" in limits.
const NO_LIMIT: f32 = 3.4e38;

/// Buffers for reading back one camera's targets, kept from frame to frame.
#[derive(Default)]
pub(super) struct ReadBack {
    depth: Option<Buffer>,
    color: Option<Buffer>,
    limit: LimitView,
    /// Camera z per pixel of the viewport at which meshes hide splats.
    pub(super) limits: Vec<f32>,
    /// The viewport's pixels, four bytes each, in rows of `stride` bytes.
    pub(super) pixels: Vec<u8>,
}

/// Where a camera draws.
pub(super) struct Drawn<'a> {
    /// The single-sampled colour, if it is wanted.
    pub(super) color: Option<&'a Texture>,
    /// The depth, if it is wanted.
    pub(super) depth: Option<(&'a Texture, &'a TextureView)>,
}

/// Bytes of a row in a buffer that a texture is copied from or to.
pub(super) fn stride(width: u32) -> u32 {
    RenderDevice::align_copy_bytes_per_row(4 * width as usize) as u32
}

impl ReadBack {
    /// Submits everything recorded so far, waits, and fills `limits` and `pixels`; whether that worked.
    pub(super) fn read(
        &mut self,
        plan: &Plan,
        drawn: &Drawn,
        pipelines: &CompositePipelines,
        cache: &PipelineCache,
        (device, queue): (&RenderDevice, &RenderQueue),
        flush: &mut FlushCommands,
    ) -> bool {
        let size = UVec2::new(plan.camera.view.width, plan.camera.view.height);
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("splat_read_back") });
        // Depth textures are copied whole or not at all.
        let mut layout = (size, UVec2::ZERO);
        if let Some((texture, view)) = drawn.depth {
            let source = if texture.sample_count() > 1 {
                let (with, depth) = ((device, queue, cache), (view, texture.sample_count()));
                if !pipelines.encode_limit(with, &mut encoder, plan, depth, &mut self.limit) {
                    return false;
                }
                let Some(limit) = &self.limit.limit else { return false };
                &limit.texture
            } else {
                layout = (UVec2::new(texture.width(), texture.height()), plan.corner);
                texture
            };
            copy(&mut encoder, device, source, Origin3d::ZERO, layout.0, &mut self.depth);
        }
        if let Some(texture) = drawn.color {
            let origin = Origin3d { x: plan.corner.x, y: plan.corner.y, z: 0 };
            copy(&mut encoder, device, texture, origin, size, &mut self.color);
        }
        flush.flush();
        let index = queue.submit([encoder.finish()]);

        let failed = Arc::new(AtomicBool::new(false));
        let wanted = [(drawn.depth.is_some(), &self.depth, layout.0), (drawn.color.is_some(), &self.color, size)];
        let mapped: Vec<_> = wanted
            .into_iter()
            .filter_map(|(wanted, buffer, size)| wanted.then_some((buffer.as_ref()?, size)))
            .map(|(buffer, size)| {
                let slice = buffer.slice(..u64::from(stride(size.x)) * u64::from(size.y));
                let failed = failed.clone();
                slice.map_async(MapMode::Read, move |result| {
                    failed.fetch_or(result.is_err(), Ordering::Relaxed);
                });
                (buffer, slice)
            })
            .collect();
        let waited = device.poll(PollType::Wait { submission_index: Some(index), timeout: None });
        if waited.is_err() || failed.load(Ordering::Relaxed) {
            return false;
        }
        let mut slices = mapped.iter().map(|(_, slice)| slice);
        if let Some((texture, _)) = drawn.depth
            && let Some(slice) = slices.next()
        {
            let bytes = slice.get_mapped_range();
            let row = stride(layout.0.x) as usize;
            if texture.sample_count() > 1 {
                gather(&bytes, row, size, &mut self.limits);
            } else {
                limits(&bytes, row, plan, &mut self.limits);
            }
        }
        if drawn.color.is_some()
            && let Some(slice) = slices.next()
        {
            self.pixels.clear();
            self.pixels.extend_from_slice(&slice.get_mapped_range());
        }
        for (buffer, _) in mapped {
            buffer.unmap();
        }
        true
    }
}

/// Records the copy of a part of a texture with four bytes a pixel into a buffer that can be mapped.
fn copy(
    encoder: &mut CommandEncoder,
    device: &RenderDevice,
    texture: &Texture,
    origin: Origin3d,
    size: UVec2,
    slot: &mut Option<Buffer>,
) {
    let bytes = u64::from(stride(size.x)) * u64::from(size.y);
    if slot.as_ref().is_some_and(|buffer| buffer.size() < bytes) {
        *slot = None;
    }
    let buffer = slot.get_or_insert_with(|| {
        device.create_buffer(&BufferDescriptor {
            label: Some("splat_read_back"),
            size: bytes,
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        })
    });
    encoder.copy_texture_to_buffer(
        TexelCopyTextureInfo { texture, mip_level: 0, origin, aspect: TextureAspect::All },
        TexelCopyBufferInfo {
            buffer,
            layout: TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(stride(size.x)), rows_per_image: None },
        },
        Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
    );
}

/// The floats of a picture in rows of `row` bytes.
fn gather(bytes: &[u8], row: usize, size: UVec2, to: &mut Vec<f32>) {
    let width = size.x as usize;
    to.resize(width * size.y as usize, 0.0);
    for (from, to) in bytes.chunks(row).zip(to.chunks_mut(width)) {
        to.copy_from_slice(bytemuck::cast_slice(&from[..4 * width]));
    }
}

/// Camera z of what Bevy's depth holds, over the viewport (`limit.wgsl`'s twin).
fn limits(depth: &[u8], row: usize, plan: &Plan, to: &mut Vec<f32>) {
    let view = &plan.camera.view;
    let (width, height) = (view.width as usize, view.height as usize);
    let inverse = plan.camera.view_from_clip();
    let (z_row, w_row) = (inverse.row(2), inverse.row(3));
    // Only tilted near planes depend on the pixel.
    let flat = [z_row.x, z_row.y, w_row.x, w_row.y] == [0.0; 4];
    to.resize(width * height, NO_LIMIT);
    to.par_chunks_mut(width).enumerate().for_each(|(y, to)| {
        let from = &depth[(plan.corner.y as usize + y) * row + 4 * plan.corner.x as usize..][..4 * width];
        for (x, (to, from)) in to.iter_mut().zip(from.as_chunks::<4>().0).enumerate() {
            let d = f32::from_le_bytes(*from);
            let z = if flat {
                (z_row.z * d + z_row.w) / (w_row.z * d + w_row.w)
            } else {
                let ndc = |at: usize, of: usize| (at as f32 + 0.5) / of as f32 * 2.0 - 1.0;
                let clip = Vec4::new(ndc(x, width), -ndc(y, height), d, 1.0);
                z_row.dot(clip) / w_row.dot(clip)
            };
            *to = if d > 0.0 { z } else { NO_LIMIT };
        }
    });
}
