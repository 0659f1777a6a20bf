//! [`GpuRasterizer`]: frames of the GPU, waited for and read back.

use std::sync::{Arc, Weak};

use splat_core::deform::Deformation;
use splat_core::{Cloud, Selection, View};

use super::lists::Counted;
use super::timings::GpuTimings;
use super::{
    Gpu, GpuBits, GpuCloud, GpuDeformation, GpuError, GpuFeatures, GpuFrame, GpuIds, GpuInstance, GpuMasks, GpuRequest,
    GpuTint,
};
use crate::{Frame, Instance, Outputs, RasterError, Rasterizer, Scene};

/// What was copied to the GPU, by the address of what it was made of; the weak references keep addresses from being used
/// again.
#[derive(Debug)]
struct Uploads<K: ?Sized, V> {
    known: Vec<(Weak<K>, Arc<V>)>,
}

impl<K: ?Sized, V> Default for Uploads<K, V> {
    fn default() -> Self {
        Self { known: Vec::new() }
    }
}

impl<K: ?Sized, V> Uploads<K, V> {
    fn get(&mut self, of: &Arc<K>, make: impl FnOnce(&Arc<K>) -> Result<V, GpuError>) -> Result<Arc<V>, GpuError> {
        let address = |k: *const K| k.cast::<()>();
        let known = self.known.iter().find(|(k, _)| address(k.as_ptr()) == address(Arc::as_ptr(of)));
        if let Some((_, made)) = known {
            return Ok(made.clone());
        }
        // Before memory is taken for more.
        self.known.retain(|(k, _)| k.strong_count() > 0);
        let made = Arc::new(make(of)?);
        self.known.push((Arc::downgrade(of), made.clone()));
        Ok(made)
    }
}

/// Draws on a GPU and waits for the picture; for tests and programs without a window.
///
/// Clouds stay on the GPU while they live. As with the [CPU's](crate::cpu::CpuRasterizer), drawing the same scene from the
/// same view again costs the last stage only. What needs more room than there was is drawn again with more: a frame that
/// comes back is whole.
#[derive(Debug)]
pub struct GpuRasterizer {
    gpu: Gpu,
    frame: GpuFrame,
    clouds: Uploads<Cloud, GpuCloud>,
    hidden: Uploads<Selection, GpuBits>,
    subsets: Uploads<[u32], GpuIds>,
    tints: Uploads<[[u8; 4]], GpuTint>,
    deformations: Uploads<Deformation, GpuDeformation>,
    timings: Option<GpuTimings>,
}

impl GpuRasterizer {
    /// A rasteriser on a device.
    pub fn new(gpu: Gpu) -> Self {
        Self {
            frame: GpuFrame::new(&gpu),
            gpu,
            clouds: Uploads::default(),
            hidden: Uploads::default(),
            subsets: Uploads::default(),
            tints: Uploads::default(),
            deformations: Uploads::default(),
            timings: None,
        }
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// What the stages of the last draw took on the GPU; none without [`GpuOptions::timings`](super::GpuOptions).
    pub fn timings(&self) -> Option<GpuTimings> {
        self.timings
    }

    fn instance(&mut self, instance: &Instance) -> Result<GpuInstance, GpuError> {
        let gpu = &self.gpu;
        Ok(GpuInstance {
            cloud: self.clouds.get(&instance.cloud, |cloud| GpuCloud::new(gpu, cloud))?,
            transform: instance.transform,
            hidden: (instance.hidden.as_ref())
                .map(|h| self.hidden.get(h, |bits| Ok(GpuBits::new(gpu, bits))))
                .transpose()?,
            subset: (instance.subset.as_ref())
                .map(|s| self.subsets.get(s, |ids| Ok(GpuIds::new(gpu, ids.clone()))))
                .transpose()?,
            tint: (instance.tint.as_ref())
                .map(|t| self.tints.get(t, |tint| Ok(GpuTint::new(gpu, tint))))
                .transpose()?,
            deformation: (instance.deformation.as_ref())
                .map(|d| self.deformations.get(d, |pose| Ok(GpuDeformation::new(gpu, pose))))
                .transpose()?,
        })
    }

    /// Draws until nothing is missing.
    fn draw_whole(
        &mut self,
        instances: &[GpuInstance],
        view: &View,
        request: &GpuRequest<'_>,
    ) -> Result<(), RasterError> {
        let context = &self.gpu.context;
        let mut needed = 0;
        loop {
            let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.frame.encode(&self.gpu, &mut encoder, instances, view, request)?;
            context.queue.submit([encoder.finish()]);
            let counted = Counted::of(&context.read(self.frame.counters(), 4)?);
            if self.frame.learn(counted) {
                self.timings = match self.frame.clock() {
                    Some(clock) => Some(clock.timings(&context.read(&clock.stamps, clock.stamps.size() as usize / 8)?)),
                    None => None,
                };
                return Ok(());
            }
            // The first frame told how many there are: room was made, unless the device has none.
            if needed == counted.pairs {
                return Err(GpuError::OutOfMemory {
                    what: "pairs of tile and splat",
                    bytes: 4 * u64::from(counted.pairs),
                }
                .into());
            }
            needed = counted.pairs;
        }
    }

    /// The pixels of a texture, row by row.
    fn pixels<T: bytemuck::Pod>(&self, texture: &wgpu::Texture) -> Result<Vec<T>, GpuError> {
        let context = &self.gpu.context;
        let (width, height) = (texture.width() as usize, texture.height() as usize);
        let row = width * size_of::<T>();
        let stride = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as usize);
        let staging = context.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture read back"),
            size: (stride * height) as u64,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(stride as u32),
                    rows_per_image: None,
                },
            },
            texture.size(),
        );
        context.queue.submit([encoder.finish()]);
        context.map(&staging, |bytes| {
            bytes.chunks(stride).flat_map(|line| bytemuck::pod_collect_to_vec::<u8, T>(&line[..row])).collect()
        })
    }

    /// A texture of depths; NaN where there is none.
    fn depths(&self, texture: Option<&wgpu::Texture>) -> Result<Vec<f32>, GpuError> {
        let Some(texture) = texture else { return Ok(Vec::new()) };
        let mut depths = self.pixels::<f32>(texture)?;
        for z in &mut depths {
            if !z.is_finite() {
                *z = f32::NAN;
            }
        }
        Ok(depths)
    }

    fn colors(&self) -> Result<Vec<[f32; 4]>, GpuError> {
        let Some(texture) = self.frame.color() else { return Ok(Vec::new()) };
        if texture.format() == wgpu::TextureFormat::Rgba32Float {
            return self.pixels(texture);
        }
        Ok(self.pixels::<[u16; 4]>(texture)?.into_iter().map(|c| c.map(from_half)).collect())
    }

    fn words(&self, buffer: Option<&wgpu::Buffer>, len: usize) -> Result<Vec<u32>, GpuError> {
        buffer.map_or(Ok(Vec::new()), |buffer| self.gpu.context.read(buffer, len))
    }

    /// A texture of limits; NaN stands for none.
    fn limit(&self, view: &View, limit: &[f32]) -> wgpu::TextureView {
        let context = &self.gpu.context;
        let size = wgpu::Extent3d { width: view.width, height: view.height, depth_or_array_layers: 1 };
        let texture = context.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("limit of depth"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let values: Vec<f32> = limit.iter().map(|z| if z.is_nan() { f32::INFINITY } else { *z }).collect();
        context.queue.write_texture(
            texture.as_image_copy(),
            bytemuck::cast_slice(&values),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * view.width), rows_per_image: None },
            size,
        );
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    }
}

impl Rasterizer for GpuRasterizer {
    fn draw(&mut self, scene: &Scene, view: &View, outputs: &Outputs, frame: &mut Frame) -> Result<(), RasterError> {
        crate::cpu::check(scene, view, outputs)?;
        let instances = scene.instances.iter().map(|i| self.instance(i)).collect::<Result<Vec<_>, _>>()?;
        let features = outputs.features.map(|f| GpuFeatures::new(&self.gpu, f.channels, f.values));
        let masks = outputs.votes.map(|masks| GpuMasks::new(&self.gpu, masks));
        let limit = outputs.limit.map(|limit| self.limit(view, limit));
        let request = GpuRequest {
            color: outputs.color,
            median_depth: outputs.median_depth,
            expected_depth: outputs.expected_depth,
            first_hits: outputs.first_hits,
            strongest: outputs.strongest,
            visibility: outputs.visibility,
            features: features.as_ref(),
            votes: masks.as_ref(),
            limit: limit.as_ref(),
        };
        self.draw_whole(&instances, view, &request)?;

        frame.reset(view, outputs, scene.len());
        let pixels = view.width as usize * view.height as usize;
        if outputs.color {
            frame.color = self.colors()?;
        }
        if outputs.median_depth {
            frame.median_depth = self.depths(self.frame.median_depth())?;
        }
        if outputs.expected_depth {
            frame.expected_depth = self.depths(self.frame.expected_depth())?;
        }
        if outputs.first_hits.is_some() {
            frame.first_hits = self.words(self.frame.first_hits(), pixels)?;
        }
        if outputs.strongest {
            frame.strongest = self.words(self.frame.strongest(), pixels)?;
        }
        if let Some(features) = outputs.features {
            let values = self.words(self.frame.features(), pixels * features.channels)?;
            frame.features = values.into_iter().map(f32::from_bits).collect();
        }
        if outputs.visibility.is_some() {
            let words = self.words(self.frame.visibility(), scene.len().div_ceil(32))?;
            let wide = |pair: &[u32]| u64::from(pair[0]) | u64::from(pair.get(1).copied().unwrap_or(0)) << 32;
            frame.visibility = Selection::from_words(scene.len(), words.chunks(2).map(wide).collect());
        }
        if let Some(masks) = outputs.votes {
            let words = self.words(self.frame.votes(), 2 * scene.len() * (1 + masks.len()))?;
            let sums: Vec<u64> = words.chunks(2).map(|w| u64::from(w[0]) | u64::from(w[1]) << 32).collect();
            let (total, inside) = sums.split_at(scene.len());
            frame.votes.total.copy_from_slice(total);
            for (to, sums) in frame.votes.inside.iter_mut().zip(inside.chunks(scene.len().max(1))) {
                for (to, sum) in to.iter_mut().zip(sums) {
                    *to = sum / 255;
                }
            }
        }
        Ok(())
    }
}

/// The number that a half float is.
fn from_half(bits: u16) -> f32 {
    let sign = u32::from(bits & 0x8000) << 16;
    let magnitude = u32::from(bits & 0x7fff);
    // Exponents are 112 apart; the product also turns the smallest numbers right. Infinities do not occur.
    let value = f32::from_bits(magnitude << 13) * f32::from_bits((254 - 15) << 23);
    f32::from_bits(value.to_bits() | sign)
}

#[cfg(test)]
mod tests {
    #[test]
    fn half_floats_become_the_numbers_they_are() {
        for (bits, value) in [
            (0, 0.0),
            (1, 2f32.powi(-24)),
            (0x3c00, 1.0),
            (0xbc00, -1.0),
            (0x3800, 0.5),
            (0x7bff, 65504.0),
            (0x03ff, 1023.0 * 2f32.powi(-24)),
        ] {
            assert_eq!(super::from_half(bits), value, "{bits:x}");
        }
    }
}
