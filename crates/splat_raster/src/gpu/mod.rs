//! Draws on a GPU through `wgpu`, on a device of its own or one that is handed in.
//!
//! The same stages as on the CPU, as compute passes: project (a thread per Gaussian, records in place), compact (keys of
//! what may be seen, in order of ids), a stable radix sort by depth, pairs of tile and splat in that order, a stable sort
//! by tile, and a workgroup per tile of 16x16 pixels that blends it. Nothing is read back inside a frame. No float is added
//! up by atomics: the same input gives the same bits.
//!
//! [`GpuRasterizer`] draws as [`CpuRasterizer`](crate::cpu::CpuRasterizer) does and waits for the picture:
//!
//! ```
//! use std::sync::Arc;
//! use splat_core::glam::Vec3;
//! use splat_core::{Cloud, Pose, View};
//! use splat_raster::gpu::{Gpu, GpuError, GpuOptions, GpuRasterizer};
//! use splat_raster::{Rasterizer, Scene};
//!
//! let gpu = match Gpu::headless(GpuOptions::default()) {
//!     Ok(gpu) => gpu,
//!     Err(GpuError::NoAdapter { .. }) => return Ok(()), // Draw with the CPU.
//!     Err(e) => return Err(e.into()),
//! };
//! let mut rasterizer = GpuRasterizer::new(gpu);
//! let scene = Scene::of(Arc::new(Cloud::default()));
//! let view = View::perspective(Pose::look_at(Vec3::NEG_Z, Vec3::ZERO, Vec3::NEG_Y), 0.9, 64, 48);
//! assert_eq!(rasterizer.render(&scene, &view)?.len(), 64 * 48);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! In a program with a device of its own (Bevy's, say): [`Gpu::new`] once, a [`GpuCloud`] per cloud, a [`GpuFrame`] per
//! view, and [`GpuFrame::encode`] into a command encoder each frame; the results are textures and buffers.

mod bin;
mod blend;
mod cloud;
mod compact;
mod context;
mod deformation;
mod error;
mod frame;
mod lists;
mod project;
mod rasterizer;
mod readback;
mod scan;
mod scene;
mod sort;
mod timings;

pub use cloud::{GpuBits, GpuCloud, GpuIds, GpuTint};
pub use context::{GpuOptions, Precision, Subgroups};
pub use deformation::GpuDeformation;
pub use error::GpuError;
pub use frame::{GpuFeatures, GpuFrame, GpuMasks, GpuRequest};
pub use rasterizer::GpuRasterizer;
pub use scene::GpuInstance;
pub use timings::GpuTimings;

use bin::BinKernels;
use blend::BlendKernels;
use compact::CompactKernels;
use context::Context;
use project::ProjectKernels;
use scan::ScanKernels;
use sort::SortKernels;

/// A device with all stages compiled.
#[derive(Debug)]
pub struct Gpu {
    context: Context,
    stages: Stages,
}

/// The compiled kernels of all stages.
#[derive(Debug)]
struct Stages {
    project: ProjectKernels,
    compact: CompactKernels,
    scan: ScanKernels,
    sort: SortKernels,
    bin: BinKernels,
    blend: BlendKernels,
}

impl Stages {
    fn new(context: &Context) -> Result<Self, GpuError> {
        Ok(Self {
            project: ProjectKernels::new(context)?,
            compact: CompactKernels::new(context)?,
            scan: ScanKernels::new(context)?,
            sort: SortKernels::new(context)?,
            bin: BinKernels::new(context)?,
            blend: BlendKernels::new(context)?,
        })
    }

    /// Those that a binner goes through.
    fn binning(&self) -> bin::Kernels<'_> {
        bin::Kernels { bin: &self.bin, scan: &self.scan, sort: &self.sort }
    }
}

impl Gpu {
    /// Compiles the stages for a device, which may be another library's.
    ///
    /// # Errors
    /// [`GpuError::Limit`] where the device was opened with too little, [`GpuError::Shader`] where its driver fails.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, options: GpuOptions) -> Result<Self, GpuError> {
        Self::from_context(Context::new(device, queue, options)?)
    }

    /// Opens the fastest device there is; the environment's `WGPU_BACKEND` is heeded.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] and [`GpuError::NoDevice`] where there is none, else as [`Gpu::new`].
    pub fn headless(options: GpuOptions) -> Result<Self, GpuError> {
        Self::from_context(Context::headless(options)?)
    }

    fn from_context(context: Context) -> Result<Self, GpuError> {
        let stages = Stages::new(&context)?;
        Ok(Self { context, stages })
    }

    /// What the device is called.
    pub fn name(&self) -> String {
        self.context.device.adapter_info().name
    }

    /// Whether the device is a CPU that runs shaders: our CPU back end is faster then.
    pub fn is_software(&self) -> bool {
        self.context.device.adapter_info().device_type == wgpu::DeviceType::Cpu
    }
}
