//! [`Context`]: a device, and how the stages make pipelines, bind groups, buffers and dispatches with it.

use std::borrow::Cow;

use splat_shaders::Stage;
use splat_shaders::constants::{BLOCK, FOLD};

use super::GpuError;

/// How Gaussians are kept in the GPU's memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Half the memory: rotation in 47 bits, scales in 20 each, opacity in 21, colour coefficients as half floats; means stay
    /// f32. Colours differ by less than 1/255.
    #[default]
    Packed,
    /// Everything as f32.
    Full,
}

/// Whether threads of a subgroup may talk to each other without memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Subgroups {
    /// Where the device can.
    #[default]
    Auto,
    /// Never.
    Off,
}

/// How a [`Gpu`](super::Gpu) works.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// How clouds are kept.
    pub precision: Precision,
    /// What the sort may use.
    pub subgroups: Subgroups,
    /// Whether frames take the time of their stages, where the device has a clock.
    pub timings: bool,
}

/// Storage buffers a stage binds at most.
const STORAGE_BUFFERS: u32 = 12;

/// What a stage binds at one place of its group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Binding {
    /// `var<uniform>`
    Uniform,
    /// `var<storage, read>`
    Read,
    /// `var<storage, read_write>`
    Write,
    /// `texture_2d<f32>`, read with `textureLoad`.
    Texture,
    /// `texture_storage_2d<format, write>`
    Picture(wgpu::TextureFormat),
}

/// A compute pipeline with the layout of its only bind group.
#[derive(Clone, Debug)]
pub(crate) struct Pipeline {
    pub(crate) pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

/// A device with its options; what the stages are built with.
#[derive(Clone, Debug)]
pub(crate) struct Context {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) options: GpuOptions,
    pub(crate) limits: wgpu::Limits,
    /// Least and largest number of threads of a subgroup, where the device has the feature and the options allow it.
    pub(crate) subgroup: Option<(u32, u32)>,
}

impl Context {
    /// Checks that a device can do what all stages need.
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue, options: GpuOptions) -> Result<Self, GpuError> {
        let limits = device.limits();
        let at_least = |what, found: u64, needed: u64| {
            if found < needed { Err(GpuError::Limit { what, found, needed }) } else { Ok(()) }
        };
        at_least(
            "max_storage_buffers_per_shader_stage",
            limits.max_storage_buffers_per_shader_stage.into(),
            STORAGE_BUFFERS.into(),
        )?;
        at_least(
            "max_compute_invocations_per_workgroup",
            limits.max_compute_invocations_per_workgroup.into(),
            BLOCK.into(),
        )?;
        at_least("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size.into(), 16 << 10)?;
        at_least(
            "max_compute_workgroups_per_dimension",
            limits.max_compute_workgroups_per_dimension.into(),
            FOLD.into(),
        )?;
        at_least("max_storage_buffer_binding_size", limits.max_storage_buffer_binding_size, 1 << 20)?;
        let info = device.adapter_info();
        let subgroup = (options.subgroups == Subgroups::Auto && device.features().contains(wgpu::Features::SUBGROUP))
            .then_some((info.subgroup_min_size, info.subgroup_max_size));
        Ok(Self { device: device.clone(), queue: queue.clone(), options, limits, subgroup })
    }

    /// Opens the best device there is.
    pub(crate) fn headless(options: GpuOptions) -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        }))
        .map_err(|e| GpuError::NoAdapter { reason: e.to_string() })?;
        let name = adapter.get_info().name;
        let wanted = wgpu::Features::SUBGROUP
            | wgpu::Features::TIMESTAMP_QUERY
            | wgpu::Features::FLOAT32_FILTERABLE
            | wgpu::Features::PIPELINE_CACHE;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("splat"),
            required_features: adapter.features() & wanted,
            required_limits: adapter.limits(),
            ..Default::default()
        }))
        .map_err(|e| GpuError::NoDevice { adapter: name, reason: e.to_string() })?;
        Self::new(&device, &queue, options)
    }

    /// A device for a test; without one the test says that it was skipped.
    #[cfg(test)]
    pub(crate) fn for_test() -> Option<Self> {
        Self::for_test_with(GpuOptions::default())
    }

    /// As [`Context::for_test`].
    #[cfg(test)]
    pub(crate) fn for_test_with(options: GpuOptions) -> Option<Self> {
        match Self::headless(options) {
            Ok(context) => Some(context),
            Err(GpuError::NoAdapter { .. }) => {
                println!("skipped: no Vulkan device");
                None
            }
            Err(e) => panic!("{e}"),
        }
    }

    /// Compiles an entry point of a stage with some switches, for bindings 0.. of group 0, with values for its `override`s.
    pub(crate) fn pipeline(
        &self,
        stage: &Stage,
        switches: &[&str],
        entry: &str,
        bindings: &[Binding],
        overrides: &[(&str, f64)],
    ) -> Result<Pipeline, GpuError> {
        let label = Some(entry);
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(stage.name),
            source: wgpu::ShaderSource::Wgsl(Cow::Owned(splat_shaders::variant(stage, switches))),
        });
        let entries: Vec<_> = bindings.iter().enumerate().map(|(i, b)| layout_entry(i as u32, *b)).collect();
        let layout =
            self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: overrides,
                // Every stage writes its workgroup memory before it reads it.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        match pollster::block_on(scope.pop()) {
            Some(e) => Err(GpuError::Shader { stage: stage.name, reason: e.to_string() }),
            None => Ok(Pipeline { pipeline, layout }),
        }
    }

    /// Binds resources to a pipeline's places 0.. in order.
    pub(crate) fn bind(&self, pipeline: &Pipeline, resources: &[wgpu::BindingResource<'_>]) -> wgpu::BindGroup {
        let entries: Vec<_> = resources
            .iter()
            .enumerate()
            .map(|(i, r)| wgpu::BindGroupEntry { binding: i as u32, resource: r.clone() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.layout,
            entries: &entries,
        })
    }

    /// A storage buffer of `len` zeros of 4 bytes each, at least one, to compute with, copy from and copy to.
    pub(crate) fn words(&self, label: &'static str, len: usize) -> wgpu::Buffer {
        self.buffer(label, 4 * len.max(1) as u64, wgpu::BufferUsages::empty())
    }

    /// A storage buffer, zeroed, that can be copied from and to, with further uses.
    pub(crate) fn buffer(&self, label: &'static str, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.next_multiple_of(4),
            usage: usage | wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// As [`Context::buffer`], with values; empty ones become one element of zeros.
    pub(crate) fn buffer_of<T: bytemuck::NoUninit>(
        &self,
        label: &'static str,
        values: &[T],
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        let buffer = self.buffer(label, size_of_val(values).max(size_of::<T>()).max(4) as u64, usage);
        self.write(&buffer, 0, values);
        buffer
    }

    /// Uniforms with values.
    pub(crate) fn uniforms<T: bytemuck::NoUninit>(&self, label: &'static str, values: &T) -> wgpu::Buffer {
        self.buffer_of(label, std::slice::from_ref(values), wgpu::BufferUsages::UNIFORM)
    }

    /// Makes something that takes memory, and says so where there is none.
    pub(crate) fn checked<R>(&self, what: &'static str, bytes: u64, make: impl FnOnce() -> R) -> Result<R, GpuError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let size = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        let errors = [pollster::block_on(size.pop()), pollster::block_on(memory.pop())];
        if errors.iter().any(Option::is_some) { Err(GpuError::OutOfMemory { what, bytes }) } else { Ok(made) }
    }

    /// Waits for all that was submitted.
    pub(crate) fn wait(&self) -> Result<(), GpuError> {
        match self.device.poll(wgpu::PollType::wait_indefinitely()) {
            Ok(_) => Ok(()),
            Err(e) => Err(GpuError::Lost { reason: e.to_string() }),
        }
    }

    /// Copies values to a buffer before the next submission; sizes are multiples of 4 bytes.
    pub(crate) fn write<T: bytemuck::NoUninit>(&self, buffer: &wgpu::Buffer, offset: u64, values: &[T]) {
        if !values.is_empty() {
            self.queue.write_buffer(buffer, offset, bytemuck::cast_slice(values));
        }
    }

    /// Submits what `record` records in one compute pass and waits for it.
    #[cfg(test)]
    pub(crate) fn run(&self, record: impl FnOnce(&mut wgpu::ComputePass<'_>)) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
        self.queue.submit([encoder.finish()]);
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    }

    /// Waits for all that was submitted and copies the first `len` elements of a buffer to the host.
    pub(crate) fn read<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer, len: usize) -> Result<Vec<T>, GpuError> {
        let bytes = (len * size_of::<T>()) as u64;
        if bytes == 0 {
            return Ok(Vec::new());
        }
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: bytes.next_multiple_of(4),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes.next_multiple_of(4));
        self.queue.submit([encoder.finish()]);
        self.map(&staging, |data| {
            let mut values = bytemuck::zeroed_vec(len);
            bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(&data[..bytes as usize]);
            values
        })
    }

    /// Waits for all that was submitted and shows the bytes of a buffer with `MAP_READ`.
    pub(crate) fn map<R>(&self, staging: &wgpu::Buffer, use_it: impl FnOnce(&[u8]) -> R) -> Result<R, GpuError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| {
            // Nobody listens only where the wait below has failed.
            let _ = sender.send(result);
        });
        let lost = |reason: String| GpuError::Lost { reason };
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| lost(e.to_string()))?;
        receiver.recv().map_err(|e| lost(e.to_string()))?.map_err(|e| lost(e.to_string()))?;
        let result = use_it(&staging.get_mapped_range(..));
        staging.unmap();
        Ok(result)
    }
}

fn layout_entry(binding: u32, kind: Binding) -> wgpu::BindGroupLayoutEntry {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: match kind {
            Binding::Uniform => buffer(wgpu::BufferBindingType::Uniform),
            Binding::Read => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
            Binding::Write => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
            Binding::Texture => wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: false },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            },
            Binding::Picture(format) => wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format,
                view_dimension: wgpu::TextureViewDimension::D2,
            },
        },
        count: None,
    }
}

impl Pipeline {
    /// Dispatches so many workgroups, folded into two dimensions; the shader tells them apart by `folded(workgroup_id)`
    /// and ignores those beyond the end.
    pub(crate) fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, group: &wgpu::BindGroup, workgroups: u32) {
        if workgroups > 0 {
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(workgroups.min(FOLD), workgroups.div_ceil(FOLD), 1);
        }
    }

    /// Dispatches as many workgroups as three words of a buffer say.
    pub(crate) fn dispatch_indirect(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        group: &wgpu::BindGroup,
        arguments: &wgpu::Buffer,
        offset: u64,
    ) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups_indirect(arguments, offset);
    }
}
