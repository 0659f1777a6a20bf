//! [`GpuFrame`]: what one view needs on a GPU, and what was drawn.

use splat_core::{Mask2d, View};

use super::blend::{Blender, Blending, Targets};
use super::lists::{Counted, Lists};
use super::readback::Echo;
use super::timings::{Clock, GpuStage, GpuTimings, STAMP_BYTES};
use super::{Gpu, GpuError, GpuInstance, Precision};
use crate::RasterError;

/// Pixels of the largest picture: 16384 x 16384.
const LARGEST_PICTURE: u64 = 1 << 28;

/// Values per Gaussian of a scene on a GPU: the form of [`Features`](crate::Features).
#[derive(Debug)]
pub struct GpuFeatures {
    buffer: wgpu::Buffer,
    channels: u32,
    len: usize,
}

impl GpuFeatures {
    /// Copies values to the GPU: `channels` for each Gaussian of a scene.
    pub fn new(gpu: &Gpu, channels: usize, values: &[f32]) -> Self {
        let buffer = gpu.context.buffer_of("features", values, wgpu::BufferUsages::empty());
        Self { buffer, channels: channels as u32, len: values.len() }
    }
}

/// Masks of one view on a GPU.
#[derive(Debug)]
pub struct GpuMasks {
    buffer: wgpu::Buffer,
    count: u32,
    /// Of each of them.
    sizes: Vec<(u32, u32)>,
}

impl GpuMasks {
    /// Copies masks to the GPU.
    pub fn new(gpu: &Gpu, masks: &[&Mask2d]) -> Self {
        let mut bytes = Vec::new();
        for mask in masks {
            bytes.extend_from_slice(mask.values());
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        Self {
            buffer: gpu.context.buffer_of("masks", &bytes, wgpu::BufferUsages::empty()),
            count: masks.len() as u32,
            sizes: masks.iter().map(|m| (m.width(), m.height())).collect(),
        }
    }
}

/// What a frame shall contain: the form of [`Outputs`](crate::Outputs). The default asks for nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct GpuRequest<'a> {
    /// [`GpuFrame::color`].
    pub color: bool,
    /// [`GpuFrame::median_depth`].
    pub median_depth: bool,
    /// [`GpuFrame::expected_depth`].
    pub expected_depth: bool,
    /// [`GpuFrame::first_hits`] at this tau.
    pub first_hits: Option<f32>,
    /// [`GpuFrame::strongest`].
    pub strongest: bool,
    /// [`GpuFrame::visibility`] above this weight.
    pub visibility: Option<f32>,
    /// [`GpuFrame::features`] of these values.
    pub features: Option<&'a GpuFeatures>,
    /// [`GpuFrame::votes`] of these masks.
    pub votes: Option<&'a GpuMasks>,
    /// An R32Float texture of the view's size (its view must allow sampling): a Gaussian whose camera z is at or beyond a
    /// pixel's value adds nothing to that pixel. So meshes hide splats. Not NaN; infinite where there is no limit.
    pub limit: Option<&'a wgpu::TextureView>,
}

/// A picture on the GPU.
#[derive(Debug)]
struct Picture {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
}

/// Working memory and results of one view.
///
/// The lists of splats are kept from frame to frame: while scene and view stand still only the last stage is recorded.
/// What the last frame was made of (its clouds, masks, limit) is held until the next frame or [`GpuFrame::clear`].
///
/// How many pairs of tile and splat a frame needs is known only afterwards. It reaches the host some frames later and room
/// is made then; until that the farthest splats of crowded tiles are missing, and [`GpuFrame::is_complete`] says so.
#[derive(Debug)]
pub struct GpuFrame {
    lists: Lists,
    blender: Option<Blender>,
    echo: Echo,
    clock: Option<Clock>,
    timings: Option<GpuTimings>,
    counted: Counted,
    complete: bool,
    color: Option<Picture>,
    median: Option<Picture>,
    expected: Option<Picture>,
    hits: Option<wgpu::Buffer>,
    strongest: Option<wgpu::Buffer>,
    visible: Option<wgpu::Buffer>,
    features: Option<wgpu::Buffer>,
    votes: Option<wgpu::Buffer>,
}

impl GpuFrame {
    /// Memory for a view, small until the first frame.
    pub fn new(gpu: &Gpu) -> Self {
        let context = &gpu.context;
        let clock = Clock::new(&context.device, &context.queue).filter(|_| context.options.timings);
        let lists = Lists::new(context);
        Self {
            echo: Echo::new(context, lists.counters().size() + STAMP_BYTES),
            lists,
            blender: None,
            clock,
            timings: None,
            counted: Counted::default(),
            complete: true,
            color: None,
            median: None,
            expected: None,
            hits: None,
            strongest: None,
            visible: None,
            features: None,
            votes: None,
        }
    }

    /// Records a frame. Nothing is waited for and nothing is read back; results are there when the commands have run.
    ///
    /// The commands must be submitted before the next frame of this view is recorded.
    ///
    /// # Errors
    /// [`RasterError`] when the view is unusable, an input does not fit, or the GPU has no room; nothing was recorded then.
    pub fn encode(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        instances: &[GpuInstance],
        view: &View,
        request: &GpuRequest<'_>,
    ) -> Result<(), RasterError> {
        self.listen(gpu);
        let slots = check(instances, view, request)?;
        let stale = self.lists.prepare(&gpu.context, &gpu.stages, instances, view, request.color)?;
        let recorded = self.record(gpu, encoder, slots, stale, view, request);
        if recorded.is_err() {
            // The lists that were prepared are not made.
            self.lists.forget();
        }
        Ok(recorded?)
    }

    fn record(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        slots: u32,
        stale: bool,
        view: &View,
        request: &GpuRequest<'_>,
    ) -> Result<(), GpuError> {
        self.make_room(gpu, slots, view, request)?;
        let Some(lists) = self.lists.listed() else { return Ok(()) };
        fn when<T>(on: bool, of: &Option<T>) -> Option<&T> {
            of.as_ref().filter(|_| on)
        }
        let picture = |on: bool, of| when(on, of).map(|p: &Picture| &p.view);
        let targets = Targets {
            color: picture(request.color, &self.color),
            median: picture(request.median_depth, &self.median),
            expected: picture(request.expected_depth, &self.expected),
            hits: self.hits.as_ref().zip(request.first_hits),
            strongest: when(request.strongest, &self.strongest),
            visible: self.visible.as_ref().zip(request.visibility),
            features: request.features.zip(self.features.as_ref()).map(|(f, to)| (&f.buffer, to, f.channels)),
            votes: request.votes.zip(self.votes.as_ref()).map(|(m, to)| (&m.buffer, to, m.count)),
            limit: request.limit,
        };
        let blending = Blending { lists, size: [view.width, view.height], slots, targets };
        let blender = match self.blender.take().filter(|known| known.serves(&blending)) {
            Some(known) => known,
            None => Blender::new(&gpu.context, &gpu.stages.blend, &blending)?,
        };
        for sums in [targets.visible.map(|v| v.0), targets.votes.map(|v| v.1)].into_iter().flatten() {
            encoder.clear_buffer(sums, 0, None);
        }
        let clock = self.clock.as_ref();
        if stale {
            self.lists.encode(&gpu.stages, encoder, clock);
        }
        self.blender.insert(blender).encode(&mut Clock::pass(clock, encoder, GpuStage::Blend));
        if let Some(clock) = clock {
            clock.resolve(encoder, stale);
            self.echo.copy(encoder, &[self.lists.counters(), &clock.stamps]);
        } else {
            self.echo.copy(encoder, &[self.lists.counters()]);
        }
        Ok(())
    }

    /// Takes in what has arrived of an earlier frame.
    fn listen(&mut self, gpu: &Gpu) {
        let clock = self.clock.as_ref();
        let counters = self.lists.counters().size() as usize;
        let heard = self.echo.poll(&gpu.context, |bytes| {
            // Mapped memory is aligned to 8 bytes, but a copy asks nothing of it.
            let words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes[..counters]);
            let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(&bytes[counters..]);
            (Counted::of(&words), clock.map(|clock| clock.timings(&stamps)))
        });
        if let Some((counted, timings)) = heard {
            self.learn(counted);
            self.timings = timings.or(self.timings);
        }
    }

    /// Learns what a frame needed; whether there was room.
    pub(super) fn learn(&mut self, counted: Counted) -> bool {
        self.counted = counted;
        self.complete = self.lists.learn(counted);
        self.complete
    }

    /// Buffers and textures for what is asked for.
    fn make_room(&mut self, gpu: &Gpu, slots: u32, view: &View, request: &GpuRequest<'_>) -> Result<(), GpuError> {
        let context = &gpu.context;
        let size = wgpu::Extent3d { width: view.width, height: view.height, depth_or_array_layers: 1 };
        let color = match context.options.precision {
            Precision::Packed => wgpu::TextureFormat::Rgba16Float,
            Precision::Full => wgpu::TextureFormat::Rgba32Float,
        };
        let depth = wgpu::TextureFormat::R32Float;
        for (on, picture, label, format) in [
            (request.color, &mut self.color, "splat colour", color),
            (request.median_depth, &mut self.median, "median depth of splats", depth),
            (request.expected_depth, &mut self.expected, "expected depth of splats", depth),
        ] {
            if on && picture.as_ref().is_none_or(|p| p.texture.size() != size) {
                *picture = None;
                let bytes = u64::from(view.width) * u64::from(view.height) * 16;
                *picture = Some(context.checked("a picture", bytes, || {
                    let texture = context.device.create_texture(&wgpu::TextureDescriptor {
                        label: Some(label),
                        size,
                        mip_level_count: 1,
                        sample_count: 1,
                        dimension: wgpu::TextureDimension::D2,
                        format,
                        usage: wgpu::TextureUsages::STORAGE_BINDING
                            | wgpu::TextureUsages::TEXTURE_BINDING
                            | wgpu::TextureUsages::COPY_SRC,
                        view_formats: &[],
                    });
                    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
                    Picture { texture, view }
                })?);
            }
        }
        let pixels = view.width as u64 * u64::from(view.height);
        let slots = u64::from(slots);
        let channels = request.features.map_or(0, |f| u64::from(f.channels));
        let sums = request.votes.map_or(0, |masks| 1 + u64::from(masks.count));
        for (on, buffer, label, words) in [
            (request.first_hits.is_some(), &mut self.hits, "first hits", pixels),
            (request.strongest, &mut self.strongest, "strongest splats", pixels),
            (request.visibility.is_some(), &mut self.visible, "visible splats", slots.div_ceil(32)),
            (request.features.is_some(), &mut self.features, "features of pixels", pixels * channels),
            (request.votes.is_some(), &mut self.votes, "votes", 2 * slots * sums),
        ] {
            let bytes = 4 * words.max(1);
            if on && buffer.as_ref().is_none_or(|b| b.size() != bytes) {
                *buffer = None;
                if bytes > context.limits.max_storage_buffer_binding_size {
                    return Err(GpuError::OutOfMemory { what: label, bytes });
                }
                *buffer =
                    Some(context.checked(label, bytes, || context.buffer(label, bytes, wgpu::BufferUsages::empty()))?);
            }
        }
        Ok(())
    }

    /// Premultiplied red, green, blue, sRGB-encoded, and alpha = 1 - T; Rgba16Float, or Rgba32Float with
    /// [`Precision::Full`]. Pictures are those of the last frame that asked for them.
    pub fn color(&self) -> Option<&wgpu::Texture> {
        self.color.as_ref().map(|p| &p.texture)
    }

    /// A view of [`GpuFrame::color`].
    pub fn color_view(&self) -> Option<&wgpu::TextureView> {
        self.color.as_ref().map(|p| &p.view)
    }

    /// Camera z at which T first falls to 0.5 or below, infinite where it never does; R32Float.
    pub fn median_depth(&self) -> Option<&wgpu::Texture> {
        self.median.as_ref().map(|p| &p.texture)
    }

    /// A view of [`GpuFrame::median_depth`].
    pub fn median_depth_view(&self) -> Option<&wgpu::TextureView> {
        self.median.as_ref().map(|p| &p.view)
    }

    /// Weighted mean of camera z, infinite where the weights sum to 1e-3 or less; R32Float.
    pub fn expected_depth(&self) -> Option<&wgpu::Texture> {
        self.expected.as_ref().map(|p| &p.texture)
    }

    /// A scene-wide id per pixel, row by row, or `NO_ID`.
    pub fn first_hits(&self) -> Option<&wgpu::Buffer> {
        self.hits.as_ref()
    }

    /// As [`GpuFrame::first_hits`].
    pub fn strongest(&self) -> Option<&wgpu::Buffer> {
        self.strongest.as_ref()
    }

    /// A bit per Gaussian of the scene.
    pub fn visibility(&self) -> Option<&wgpu::Buffer> {
        self.visible.as_ref()
    }

    /// Values per pixel, row by row: so many as there are channels.
    pub fn features(&self) -> Option<&wgpu::Buffer> {
        self.features.as_ref()
    }

    /// Sums of 64 bits, the low word first, per Gaussian of the scene: of all pixels, then times each mask's values (0 to
    /// 255), in units of 2^-16.
    pub fn votes(&self) -> Option<&wgpu::Buffer> {
        self.votes.as_ref()
    }

    /// Whether the last frame that is known of had room for all its splats. If not, draw again: there will be more.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Gaussians that the last frame that is known of may have seen, and pairs of tile and splat that it needed.
    pub fn counts(&self) -> (u32, u32) {
        (self.counted.visible, self.counted.pairs)
    }

    /// What the stages of the last frame that is known of took; none without [`GpuOptions::timings`](super::GpuOptions).
    pub fn timings(&self) -> Option<GpuTimings> {
        self.timings
    }

    /// Lets go of all memory and of the scene.
    pub fn clear(&mut self, gpu: &Gpu) {
        *self = Self::new(gpu);
    }

    pub(super) fn counters(&self) -> &wgpu::Buffer {
        self.lists.counters()
    }

    pub(super) fn clock(&self) -> Option<&Clock> {
        self.clock.as_ref()
    }
}

/// Everything that can be wrong with a request; slots of the scene.
fn check(instances: &[GpuInstance], view: &View, request: &GpuRequest<'_>) -> Result<u32, RasterError> {
    view.check()?;
    let too_large = RasterError::TooLarge { width: view.width, height: view.height };
    if u64::from(view.width) * u64::from(view.height) > LARGEST_PICTURE {
        return Err(too_large);
    }
    let found: usize = instances.iter().map(GpuInstance::len).sum();
    let slots = u32::try_from(found).map_err(|_| RasterError::TooMany { found })?;
    if let Some(features) = request.features {
        let expected = found * features.channels.max(1) as usize;
        if features.channels == 0 || features.len != expected {
            return Err(RasterError::Length { what: "features", found: features.len, expected });
        }
    }
    let size = (view.width, view.height);
    match request.votes.and_then(|masks| masks.sizes.iter().find(|mask| **mask != size)) {
        Some(&mask) => Err(RasterError::SizeMismatch { mask, view: size }),
        None => Ok(slots),
    }
}

#[cfg(test)]
mod tests;
