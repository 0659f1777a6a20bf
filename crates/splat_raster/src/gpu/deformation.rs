//! [`GpuDeformation`]: a bent cage on the GPU.

use glam::Vec4;
use splat_core::deform::Deformation;

use super::Gpu;
use super::context::Context;

/// A [`Deformation`] on a GPU: 64 bytes a node, nothing per Gaussian. The projection finds each Gaussian's cell from its mean.
#[derive(Clone, Debug)]
pub struct GpuDeformation {
    pub(super) buffer: wgpu::Buffer,
}

impl GpuDeformation {
    /// Copies a deformation to the GPU.
    pub fn new(gpu: &Gpu, deformation: &Deformation) -> Self {
        Self::with(&gpu.context, deformation)
    }

    pub(super) fn with(context: &Context, deformation: &Deformation) -> Self {
        let bytes = (size_of::<[Vec4; 2]>() + size_of_val(deformation.packed())) as u64;
        let made = Self { buffer: context.buffer("a bent cage", bytes, wgpu::BufferUsages::empty()) };
        made.write(context, deformation);
        made
    }

    /// The next pose, in the memory of this one where it has the same number of nodes; this one is not to be drawn any more.
    pub fn next(&self, gpu: &Gpu, deformation: &Deformation) -> Self {
        let bytes = (size_of::<[Vec4; 2]>() + size_of_val(deformation.packed())) as u64;
        if self.buffer.size() != bytes {
            return Self::new(gpu, deformation);
        }
        self.write(&gpu.context, deformation);
        self.clone()
    }

    fn write(&self, context: &Context, deformation: &Deformation) {
        let cage = deformation.cage();
        // Counts of cells are below 2^20: exact.
        let head = [cage.origin.extend(cage.cell), cage.cells.as_vec3().extend(0.0)];
        context.write(&self.buffer, 0, &head);
        context.write(&self.buffer, size_of_val(&head) as u64, deformation.packed());
    }
}
