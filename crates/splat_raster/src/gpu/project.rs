//! [`Projector`]: Gaussians to splats on the GPU (`project.wgsl`).
//!
//! Slot = scene-wide id. A dispatch per page of each instance; records are written in place and nothing is counted, so that
//! no workgroup waits for another.

use glam::{DMat3, Mat3};
use splat_core::{Projection, View};
use splat_shaders::PROJECT;
use splat_shaders::constants::{
    BLOCK, FLAG_ANTIALIASED, FLAG_COLOR, FLAG_HIDDEN, FLAG_PARALLEL, FLAG_SUBSET, FLAG_TINT,
};
use splat_shaders::layouts::Job;

use super::context::{Binding, Context, Pipeline, Precision};
use super::{GpuError, GpuInstance};

/// What the projection of an instance depends on, but for the Gaussians; the numbers are those of `cpu/project.rs`.
fn placed(instance: &GpuInstance, view: &View, color: bool) -> Job {
    let transform = &instance.transform;
    let turn = transform.rotation_matrix().as_dmat3();
    let view_from_world: DMat3 = view.pose.world_from_view.transpose().as_dmat3();
    let position = view.pose.position.as_dvec3();
    let scale = f64::from(transform.scale);
    let translation = transform.translation.as_dvec3();
    let rows: Mat3 = (view_from_world * turn * scale).as_mat3();
    let origin = (view_from_world * (translation - position)).as_vec3();
    let parallel = view.projection == Projection::Orthographic;
    let camera = if parallel {
        turn.transpose() * view.forward().as_dvec3()
    } else {
        turn.transpose() * (position - translation) / scale
    };
    let size = [view.width as f32, view.height as f32];
    let i = &view.intrinsics;
    let limits = |size: f32, center: f32, focal: f32| {
        let margin = 0.3 * 0.5 * size / focal;
        [-(center / focal + margin), (size - center) / focal + margin]
    };
    let ([x0, x1], [y0, y1]) = (limits(size[0], i.cx, i.fx), limits(size[1], i.cy, i.fy));
    let flag = |on: bool, flag: u32| if on { flag } else { 0 };
    Job {
        row_x: rows.row(0).extend(origin.x).to_array(),
        row_y: rows.row(1).extend(origin.y).to_array(),
        row_z: rows.row(2).extend(origin.z).to_array(),
        camera: camera.as_vec3().to_array(),
        near: view.near,
        focal: [i.fx, i.fy],
        center: [i.cx, i.cy],
        limits: [x0, x1, y0, y1],
        size,
        flags: flag(color, FLAG_COLOR)
            | flag(parallel, FLAG_PARALLEL)
            | flag(instance.cloud.antialiased, FLAG_ANTIALIASED)
            | flag(instance.hidden.is_some(), FLAG_HIDDEN)
            | flag(instance.subset.is_some(), FLAG_SUBSET)
            | flag(instance.tint.is_some(), FLAG_TINT),
        sh_degree: instance.cloud.sh_degree.into(),
        ..Job::default()
    }
}

/// A page of an instance, of which some Gaussians are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part {
    instance: usize,
    page: usize,
    first_slot: u32,
    count: u32,
    first: u32,
    deformed: bool,
}

/// The pages that instances use, in order of slots.
fn parts(instances: &[GpuInstance]) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut slot = 0;
    for (i, instance) in instances.iter().enumerate() {
        for (k, page) in instance.cloud.pages.iter().enumerate() {
            let (first, count) = match &instance.subset {
                None => (page.first, page.count),
                Some(subset) => {
                    let before = |id: u32| subset.ids.partition_point(|&other| other < id) as u32;
                    let first = before(page.first);
                    (first, before(page.first + page.count) - first)
                }
            };
            if count > 0 {
                let deformed = instance.deformation.is_some();
                parts.push(Part { instance: i, page: k, first_slot: slot, count, first, deformed });
                slot += count;
            }
        }
    }
    parts
}

/// Splats by slot: what later stages read.
#[derive(Debug)]
pub(crate) struct Records {
    /// Mean in pixels, 2 floats.
    pub(crate) mean: wgpu::Buffer,
    /// Along, shear.
    pub(crate) shape_a: wgpu::Buffer,
    /// Across, level.
    pub(crate) shape_b: wgpu::Buffer,
    /// Red and green, blue and nothing, as half floats.
    pub(crate) color: wgpu::Buffer,
    /// Camera z; 0 where no pixel sees the Gaussian, and the rest is not written.
    pub(crate) z: wgpu::Buffer,
}

impl Records {
    /// Bytes of a slot in the largest of the buffers.
    pub(crate) const WIDEST: u64 = 8;

    pub(crate) fn new(context: &Context, slots: usize) -> Self {
        let pairs = |label| context.words(label, 2 * slots.max(1));
        Self {
            mean: pairs("means"),
            shape_a: pairs("shapes, along and shear"),
            shape_b: pairs("shapes, across and level"),
            color: pairs("colours"),
            z: context.words("depths", slots),
        }
    }
}

/// The compiled kernels.
#[derive(Clone, Debug)]
pub(crate) struct ProjectKernels {
    project: Pipeline,
    /// For instances that are bent.
    deform: Pipeline,
}

impl ProjectKernels {
    pub(crate) fn new(context: &Context) -> Result<Self, GpuError> {
        use Binding::{Read, Uniform, Write};
        let (switches, deform): (&[&str], &[&str]) = match context.options.precision {
            Precision::Packed => (&["PACKED"], &["PACKED", "DEFORM"]),
            Precision::Full => (&[], &["DEFORM"]),
        };
        let bindings = [Uniform, Read, Read, Read, Read, Write, Write, Write, Write, Write, Read];
        let (cage, plain) = (bindings.len(), bindings.len() - 1);
        Ok(Self {
            project: context.pipeline(&PROJECT, switches, "project", &bindings[..plain], &[])?,
            deform: context.pipeline(&PROJECT, deform, "project", &bindings[..cage], &[])?,
        })
    }

    fn of(&self, deformed: bool) -> &Pipeline {
        if deformed { &self.deform } else { &self.project }
    }
}

/// What a scene's Gaussians are projected with.
#[derive(Debug, Default)]
pub(crate) struct Projector {
    parts: Vec<Part>,
    groups: Vec<wgpu::BindGroup>,
    jobs: Option<wgpu::Buffer>,
    /// Between jobs, in bytes.
    stride: usize,
}

impl Projector {
    /// Binds the buffers of a scene's instances.
    pub(crate) fn new(
        context: &Context,
        kernels: &ProjectKernels,
        records: &Records,
        instances: &[GpuInstance],
    ) -> Self {
        let parts = parts(instances);
        let stride = size_of::<Job>().next_multiple_of(context.limits.min_uniform_buffer_offset_alignment as usize);
        let bytes = (stride * parts.len().max(1)) as u64;
        let jobs = context.buffer("what to project", bytes, wgpu::BufferUsages::UNIFORM);
        // Something must be bound where an instance has nothing.
        let nothing = context.words("nothing", 1);
        let groups = parts
            .iter()
            .enumerate()
            .map(|(k, part)| {
                let instance = &instances[part.instance];
                let hidden = instance.hidden.as_ref().map_or(&nothing, |b| &b.buffer);
                let subset = instance.subset.as_ref().map_or(&nothing, |b| &b.buffer);
                let tint = instance.tint.as_ref().map_or(&nothing, |b| &b.buffer);
                let page = &instance.cloud.pages[part.page].buffer;
                let r = records;
                let buffers = [page, hidden, subset, tint, &r.mean, &r.shape_a, &r.shape_b, &r.color, &r.z];
                let job = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: &jobs,
                    offset: (k * stride) as u64,
                    size: std::num::NonZeroU64::new(size_of::<Job>() as u64),
                });
                let cage = instance.deformation.as_ref().map(|d| &d.buffer);
                let buffers = buffers.into_iter().chain(cage).map(wgpu::Buffer::as_entire_binding);
                context.bind(kernels.of(part.deformed), &std::iter::once(job).chain(buffers).collect::<Vec<_>>())
            })
            .collect();
        Self { parts, groups, jobs: Some(jobs), stride }
    }

    /// Tells the shader where the instances and the camera are: before the next submission.
    pub(crate) fn place(&self, context: &Context, instances: &[GpuInstance], view: &View, color: bool) {
        let Some(jobs) = &self.jobs else { return };
        let mut bytes = vec![0u8; self.stride * self.parts.len()];
        for (part, to) in self.parts.iter().zip(bytes.chunks_mut(self.stride.max(1))) {
            let instance = &instances[part.instance];
            let job = Job {
                first_slot: part.first_slot,
                count: part.count,
                first: part.first,
                page_first: instance.cloud.pages[part.page].first,
                ..placed(instance, view, color)
            };
            to[..size_of::<Job>()].copy_from_slice(bytemuck::bytes_of(&job));
        }
        context.write(jobs, 0, &bytes);
    }

    /// Records the dispatches.
    pub(crate) fn encode(&self, kernels: &ProjectKernels, pass: &mut wgpu::ComputePass<'_>) {
        for (part, group) in self.parts.iter().zip(&self.groups) {
            kernels.of(part.deformed).dispatch(pass, group, part.count.div_ceil(BLOCK));
        }
    }
}

#[cfg(test)]
mod tests;
