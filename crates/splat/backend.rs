//! `--backend`: what draws, the processor or the graphics card.

use clap::ValueEnum;
use serde::Serialize;
use splat_core::View;
use splat_raster::cpu::CpuRasterizer;
#[cfg(feature = "gpu")]
use splat_raster::gpu::{Gpu, GpuOptions, GpuRasterizer};
use splat_raster::{Frame, Outputs, RasterError, Rasterizer, Scene};

use crate::failure::Failure;

/// What draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Backend {
    /// The processor: the same picture on every machine
    Cpu,
    /// The graphics card
    Gpu,
    /// The graphics card if there is one, else the processor
    Auto,
}

/// A rasteriser of either kind.
pub(crate) enum Drawer {
    Cpu(CpuRasterizer),
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuRasterizer>),
}

/// Wall and processor time of the parts of a frame, in seconds: project, sort, raster.
pub(crate) type Parts = [(f64, f64); 3];

impl Drawer {
    /// The rasteriser that was asked for; one sentence where it cannot be had.
    pub(crate) fn new(backend: Backend) -> Result<Self, Failure> {
        match backend {
            Backend::Cpu => Ok(Self::Cpu(CpuRasterizer::new())),
            Backend::Gpu => Self::gpu(),
            Backend::Auto => Ok(Self::automatic()),
        }
    }

    #[cfg(feature = "gpu")]
    fn gpu() -> Result<Self, Failure> {
        Ok(Self::Gpu(Box::new(GpuRasterizer::new(Gpu::headless(GpuOptions {
            timings: true,
            ..GpuOptions::default()
        })?))))
    }

    #[cfg(not(feature = "gpu"))]
    fn gpu() -> Result<Self, Failure> {
        Err(Failure::failed(
            "this build draws on the processor only; build it with `cargo build --release --features gpu`, or use --backend cpu",
        ))
    }

    /// A device that is a processor in disguise is slower than ours.
    #[cfg(feature = "gpu")]
    fn automatic() -> Self {
        match Gpu::headless(GpuOptions { timings: true, ..GpuOptions::default() }) {
            Ok(gpu) if !gpu.is_software() => Self::Gpu(Box::new(GpuRasterizer::new(gpu))),
            _ => Self::Cpu(CpuRasterizer::new()),
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn automatic() -> Self {
        Self::Cpu(CpuRasterizer::new())
    }

    /// What draws, in words.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Cpu(raster) => format!("{:?}", raster.instruction_set()),
            #[cfg(feature = "gpu")]
            Self::Gpu(raster) => raster.gpu().name(),
        }
    }

    /// What the parts of the last frame took.
    pub(crate) fn parts(&self) -> Parts {
        match self {
            Self::Cpu(raster) => {
                let t = raster.timings();
                [t.project, t.sort, {
                    splat_raster::cpu::Stage { wall: t.bin.wall + t.raster.wall, cpu: t.bin.cpu + t.raster.cpu }
                }]
                .map(|stage| (stage.wall.as_secs_f64(), stage.cpu.as_secs_f64()))
            }
            #[cfg(feature = "gpu")]
            Self::Gpu(raster) => {
                let t = raster.timings().unwrap_or_default();
                [t.project + t.compact, t.sort, t.bin + t.blend].map(|wall| (wall.as_secs_f64(), wall.as_secs_f64()))
            }
        }
    }
}

impl Rasterizer for Drawer {
    fn draw(&mut self, scene: &Scene, view: &View, outputs: &Outputs, frame: &mut Frame) -> Result<(), RasterError> {
        match self {
            Self::Cpu(raster) => raster.draw(scene, view, outputs, frame),
            #[cfg(feature = "gpu")]
            Self::Gpu(raster) => raster.draw(scene, view, outputs, frame),
        }
    }
}
