//! [`Blender`]: the splats of all tiles into pictures and sums (`blend.wgsl`).
//!
//! A dispatch for all pictures and visibility, one for every four channels of features, one for every [`VOTE_MASKS`] masks.
//! A kernel is compiled for each set of outputs when it is first asked for, so that what is not asked for costs nothing.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use splat_shaders::BLEND;
use splat_shaders::constants::{TILE, VOTE_MASKS};
use splat_shaders::layouts::BlendParams;

use super::GpuError;
use super::context::{Binding, Context, Pipeline, Precision};
use super::lists::Listed;

/// What a kernel does: names of switches of `blend.wgsl`.
type Switches = Vec<&'static str>;

/// The compiled kernels.
#[derive(Debug, Default)]
pub(crate) struct BlendKernels {
    compiled: Mutex<HashMap<Switches, Pipeline>>,
}

/// Where pictures and sums go; those that are there are made.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Targets<'a> {
    /// Premultiplied red, green, blue, and 1 - T; Rgba16Float, or Rgba32Float with [`Precision::Full`].
    pub(crate) color: Option<&'a wgpu::TextureView>,
    /// R32Float, infinite where there is none.
    pub(crate) median: Option<&'a wgpu::TextureView>,
    /// As `median`.
    pub(crate) expected: Option<&'a wgpu::TextureView>,
    /// A slot per pixel; tau.
    pub(crate) hits: Option<(&'a wgpu::Buffer, f32)>,
    /// A slot per pixel.
    pub(crate) strongest: Option<&'a wgpu::Buffer>,
    /// A bit per slot, zeros before; threshold.
    pub(crate) visible: Option<(&'a wgpu::Buffer, f32)>,
    /// Values by slot, by pixel; channels of both.
    pub(crate) features: Option<(&'a wgpu::Buffer, &'a wgpu::Buffer, u32)>,
    /// Masks, sums (zeros before); how many masks.
    pub(crate) votes: Option<(&'a wgpu::Buffer, &'a wgpu::Buffer, u32)>,
    /// R32Float, camera z.
    pub(crate) limit: Option<&'a wgpu::TextureView>,
}

/// What is blended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blending<'a> {
    pub(crate) lists: Listed<'a>,
    /// Of the picture.
    pub(crate) size: [u32; 2],
    pub(crate) slots: u32,
    pub(crate) targets: Targets<'a>,
}

impl BlendKernels {
    /// Compiles what nearly every frame needs.
    pub(crate) fn new(context: &Context) -> Result<Self, GpuError> {
        let kernels = Self::default();
        kernels.get(context, vec!["COLOR", "WIDE"])?;
        Ok(kernels)
    }

    fn get(&self, context: &Context, mut switches: Switches) -> Result<Pipeline, GpuError> {
        if context.options.precision == Precision::Packed {
            switches.retain(|s| *s != "WIDE");
        }
        let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = compiled.get(&switches) {
            return Ok(known.clone());
        }
        let pipeline = context.pipeline(&BLEND, &switches, "blend_tile", &bindings(&switches), &[])?;
        compiled.insert(switches, pipeline.clone());
        Ok(pipeline)
    }
}

/// In the order of the shader's declarations.
fn bindings(switches: &[&str]) -> Vec<Binding> {
    use Binding::{Picture, Read, Texture, Uniform, Write};
    let color =
        if switches.contains(&"WIDE") { wgpu::TextureFormat::Rgba32Float } else { wgpu::TextureFormat::Rgba16Float };
    let mut all = vec![Uniform, Read, Read, Read, Read, Read];
    for (switch, more) in [
        ("COLOR", &[Read][..]),
        ("DEPTH", &[Read]),
        ("LIMIT", &[Texture]),
        ("COLOR", &[Picture(color)]),
        ("MEDIAN", &[Picture(wgpu::TextureFormat::R32Float)]),
        ("EXPECTED", &[Picture(wgpu::TextureFormat::R32Float)]),
        ("HITS", &[Write]),
        ("STRONGEST", &[Write]),
        ("VISIBLE", &[Write]),
        ("FEATURES", &[Read, Write]),
        ("VOTES", &[Read, Write]),
    ] {
        if switches.contains(&switch) {
            all.extend(more);
        }
    }
    all
}

/// A dispatch.
#[derive(Debug)]
struct Step {
    pipeline: Pipeline,
    group: wgpu::BindGroup,
}

/// The dispatches of a frame, ready to be recorded.
#[derive(Debug)]
pub(crate) struct Blender {
    made_of: MadeOf,
    steps: Vec<Step>,
    tiles: u32,
}

/// What is bound and told to the shader: the same for the next frame, and nothing need be made anew.
#[derive(Debug, PartialEq)]
struct MadeOf {
    /// Each at its own place.
    buffers: [Option<wgpu::Buffer>; 14],
    views: [Option<wgpu::TextureView>; 4],
    numbers: [u32; 7],
}

impl MadeOf {
    fn new(blending: &Blending<'_>) -> Self {
        let Blending { lists, size, slots, targets: t } = *blending;
        let r = lists.records;
        let buffers = [
            Some(lists.tile_ranges),
            Some(lists.pair_slots),
            Some(&r.mean),
            Some(&r.shape_a),
            Some(&r.shape_b),
            Some(&r.color),
            Some(&r.z),
            t.hits.map(|h| h.0),
            t.strongest,
            t.visible.map(|v| v.0),
            t.features.map(|f| f.0),
            t.features.map(|f| f.1),
            t.votes.map(|v| v.0),
            t.votes.map(|v| v.1),
        ];
        Self {
            buffers: buffers.map(Option::<&wgpu::Buffer>::cloned),
            views: [t.color, t.median, t.expected, t.limit].map(Option::<&wgpu::TextureView>::cloned),
            numbers: [
                size[0],
                size[1],
                slots,
                t.hits.map_or(0, |h| h.1.to_bits()),
                t.visible.map_or(0, |v| v.1.to_bits()),
                t.features.map_or(0, |f| f.2),
                t.votes.map_or(0, |v| v.2),
            ],
        }
    }
}

impl Blender {
    /// Compiles and binds what the targets need.
    pub(crate) fn new(context: &Context, kernels: &BlendKernels, blending: &Blending<'_>) -> Result<Self, GpuError> {
        let Blending { size, slots, targets, .. } = *blending;
        let across = [size[0].div_ceil(TILE), size[1].div_ceil(TILE)];
        let params = BlendParams {
            size,
            tiles_across: across[0],
            tiles: across[0] * across[1],
            // Thresholds at or above 1 would ask about the pixel before anything was drawn; 1/255 is the least that is.
            hit: 1.0 - targets.hits.map_or(2.0, |(_, tau)| tau).max(1e-3),
            unseen: targets.visible.map_or(0.0, |(_, threshold)| threshold),
            channel: 0,
            channels: targets.features.map_or(0, |(_, _, channels)| channels),
            mask: 0,
            masks: 0,
            slots,
            none: f32::INFINITY.to_bits(),
        };
        let mut steps = Vec::new();
        let pictures = Targets { features: None, votes: None, ..targets };
        let mut step = |targets: Targets<'_>, params: BlendParams| -> Result<(), GpuError> {
            steps.push(Step::new(context, kernels, &Blending { targets, ..*blending }, params)?);
            Ok(())
        };
        if !pictures.switches().is_empty() {
            step(pictures, params)?;
        }
        let limit = targets.limit;
        if let Some((_, _, channels)) = targets.features {
            for channel in (0..channels).step_by(4) {
                let targets = Targets { features: targets.features, limit, ..Targets::default() };
                step(targets, BlendParams { channel, ..params })?;
            }
        }
        if let Some((_, _, masks)) = targets.votes {
            // Without masks the totals are still wanted.
            for mask in (0..masks.max(1)).step_by(VOTE_MASKS as usize) {
                let targets = Targets { votes: targets.votes, limit, ..Targets::default() };
                step(targets, BlendParams { mask, masks: (masks - mask).min(VOTE_MASKS), ..params })?;
            }
        }
        Ok(Self { made_of: MadeOf::new(blending), steps, tiles: params.tiles })
    }

    /// Whether it is what [`Blender::new`] would make of this.
    pub(crate) fn serves(&self, blending: &Blending<'_>) -> bool {
        self.made_of == MadeOf::new(blending)
    }

    /// Records the dispatches.
    pub(crate) fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for step in &self.steps {
            step.pipeline.dispatch(pass, &step.group, self.tiles);
        }
    }
}

impl Targets<'_> {
    /// The outputs among the switches.
    fn switches(&self) -> Switches {
        let mut all = Switches::new();
        for (on, switch) in [
            (self.color.is_some(), "COLOR"),
            (self.median.is_some(), "MEDIAN"),
            (self.expected.is_some(), "EXPECTED"),
            (self.hits.is_some(), "HITS"),
            (self.strongest.is_some(), "STRONGEST"),
            (self.visible.is_some(), "VISIBLE"),
            (self.features.is_some(), "FEATURES"),
            (self.votes.is_some(), "VOTES"),
        ] {
            if on {
                all.push(switch);
            }
        }
        all
    }
}

impl Step {
    fn new(
        context: &Context,
        kernels: &BlendKernels,
        blending: &Blending<'_>,
        params: BlendParams,
    ) -> Result<Self, GpuError> {
        let Blending { lists, targets, .. } = *blending;
        let mut switches = targets.switches();
        let depth = targets.median.is_some() || targets.expected.is_some() || targets.limit.is_some();
        for (on, switch) in [
            (targets.limit.is_some(), "LIMIT"),
            (depth, "DEPTH"),
            (targets.visible.is_some() || targets.votes.is_some(), "SUMS"),
            (targets.color.is_some(), "WIDE"),
        ] {
            if on {
                switches.push(switch);
            }
        }
        let pipeline = kernels.get(context, switches)?;
        let params = context.uniforms("blend", &params);
        let r = lists.records;
        let fixed = [&params, lists.tile_ranges, lists.pair_slots, &r.mean, &r.shape_a, &r.shape_b];
        let mut bound: Vec<_> = fixed.into_iter().map(wgpu::Buffer::as_entire_binding).collect();
        if targets.color.is_some() {
            bound.push(lists.records.color.as_entire_binding());
        }
        if depth {
            bound.push(lists.records.z.as_entire_binding());
        }
        for view in [targets.limit, targets.color, targets.median, targets.expected].into_iter().flatten() {
            bound.push(wgpu::BindingResource::TextureView(view));
        }
        for buffer in [targets.hits.map(|h| h.0), targets.strongest, targets.visible.map(|v| v.0)].into_iter().flatten()
        {
            bound.push(buffer.as_entire_binding());
        }
        for (read, write, _) in [targets.features, targets.votes].into_iter().flatten() {
            bound.push(read.as_entire_binding());
            bound.push(write.as_entire_binding());
        }
        Ok(Self { group: context.bind(&pipeline, &bound), pipeline })
    }
}

#[cfg(test)]
mod tests;
