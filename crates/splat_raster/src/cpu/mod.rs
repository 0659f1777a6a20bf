//! The CPU back end: project and cull in lanes, one sort by depth, stable scatter to tiles, blend 16 pixels at a time.
//!
//! [`CpuRasterizer`] keeps its memory from frame to frame, and the tile lists of the last scene and view: drawing the
//! same scene from the same view again, for other masks, features or thresholds, costs the last stage only.

mod bin;
mod blend;
mod canvas;
mod point;
mod project;
mod shared;
mod simd;
mod sort;
mod splat;
mod timings;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, Weak};

use rayon::prelude::*;
use splat_core::deform::Deformation;
use splat_core::{Cloud, Selection, Similarity, View};

use self::bin::{Binning, Bins};
pub(crate) use self::blend::LEAST_TRANSMITTANCE;
use self::blend::{Blend, LARGEST_ALPHA, Pixels, Request, SMALLEST_ALPHA, Sums};
use self::canvas::Canvas;
pub(crate) use self::point::{Sample, samples};
use self::project::{Block, Project, Setup};
pub use self::simd::InstructionSet;
use self::sort::Sorter;
use self::splat::{Cover, Splat, TILE};
use self::timings::Watch;
pub use self::timings::{Stage, Timings};
use crate::{Frame, Outputs, RasterError, Rasterizer, Scene};

/// Gaussians that one thread projects at a time; a multiple of 64, so that hidden bits come in whole words.
const BLOCK: usize = 2048;
/// Pixels of the largest picture: 16384 x 16384.
const LARGEST_PICTURE: u64 = 1 << 28;

/// Draws on the CPU, with all threads of the current rayon pool.
///
/// The result does not depend on the number of threads, to the bit, nor on whether AVX2 or AVX-512 is used.
///
/// The tile lists of the last draw are kept. A further draw of the same scene (the same `Arc`s and transforms) from an equal view skips all stages but the last: ask for `votes` of a repainted mask right after a frame of
/// that view, with the same rasteriser, and it costs only that. A draw that also needs colours reuses the lists only if
/// the earlier one had colours.
pub struct CpuRasterizer {
    set: InstructionSet,
    splats: Vec<Splat>,
    covers: Vec<Cover>,
    keys: Vec<u64>,
    blocks: Vec<Block>,
    sorter: Sorter,
    bins: Bins,
    pixels: Vec<Mutex<Pixels>>,
    /// What the lists were made for, while `fresh`.
    key: Key,
    fresh: bool,
    timings: Timings,
}

/// What the tile lists depend on.
#[derive(Default)]
struct Key {
    instances: Vec<InstanceKey>,
    view: Option<View>,
    color: bool,
}

/// The weak references keep the addresses from being used again, and the contents from being changed in place.
struct InstanceKey {
    cloud: Weak<Cloud>,
    hidden: Option<Weak<Selection>>,
    subset: Option<Weak<[u32]>>,
    tint: Option<Weak<[[u8; 4]]>>,
    deformation: Option<Weak<Deformation>>,
    transform: Similarity,
}

/// Whether both are absent or the same.
fn same<T: ?Sized>(key: &Option<Weak<T>>, now: &Option<Arc<T>>) -> bool {
    match (key, now) {
        (None, None) => true,
        (Some(a), Some(b)) => std::ptr::addr_eq(a.as_ptr(), Arc::as_ptr(b)),
        _ => false,
    }
}

impl Key {
    /// Whether lists made for this serve `scene` from `view`.
    fn serves(&self, scene: &Scene, view: &View, color: bool) -> bool {
        self.view == Some(*view)
            && (self.color || !color)
            && self.instances.len() == scene.instances.len()
            && self.instances.iter().zip(&scene.instances).all(|(key, instance)| {
                same(&key.hidden, &instance.hidden)
                    && same(&key.subset, &instance.subset)
                    && (!color || same(&key.tint, &instance.tint))
                    && same(&key.deformation, &instance.deformation)
                    && key.cloud.as_ptr() == Arc::as_ptr(&instance.cloud)
                    && key.transform == instance.transform
            })
    }

    fn set(&mut self, scene: &Scene, view: &View, color: bool) {
        self.instances.clear();
        self.instances.extend(scene.instances.iter().map(|i| InstanceKey {
            cloud: Arc::downgrade(&i.cloud),
            hidden: i.hidden.as_ref().map(Arc::downgrade),
            subset: i.subset.as_ref().map(Arc::downgrade),
            tint: i.tint.as_ref().map(Arc::downgrade),
            deformation: i.deformation.as_ref().map(Arc::downgrade),
            transform: i.transform,
        }));
        (self.view, self.color) = (Some(*view), color);
    }
}

impl std::fmt::Debug for CpuRasterizer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CpuRasterizer").field("set", &self.set).finish_non_exhaustive()
    }
}

impl Default for CpuRasterizer {
    fn default() -> Self {
        Self::new()
    }
}

impl CpuRasterizer {
    /// A rasteriser that takes the fastest instruction set of this machine.
    pub fn new() -> Self {
        Self::with(InstructionSet::best())
    }

    /// A rasteriser that takes this instruction set, the portable one where the machine lacks it.
    pub fn with(set: InstructionSet) -> Self {
        Self {
            set: if set.available() { set } else { InstructionSet::Portable },
            splats: Vec::new(),
            covers: Vec::new(),
            keys: Vec::new(),
            blocks: Vec::new(),
            sorter: Sorter::default(),
            bins: Bins::default(),
            pixels: Vec::new(),
            key: Key::default(),
            fresh: false,
            timings: Timings::default(),
        }
    }

    /// The instruction set in use.
    pub fn instruction_set(&self) -> InstructionSet {
        self.set
    }

    /// What the stages of the last draw took.
    pub fn timings(&self) -> Timings {
        self.timings
    }

    /// Stages 1 to 3, unless the last draw's lists serve.
    fn prepare(&mut self, scene: &Scene, view: &View, color: bool) {
        let watch = Watch::start();
        let count = scene.len();
        // Only grown: entries of earlier frames are never read, since only keys lead to them.
        if self.splats.len() < count {
            self.splats.resize(count, Splat::default());
            self.covers.resize(count, Cover::default());
            self.keys.resize(count, 0);
        }
        self.blocks.clear();
        let mut first = 0;
        for instance in &scene.instances {
            let len = instance.len();
            let known = self.blocks.len();
            self.blocks.resize(known + len.div_ceil(BLOCK), Block::default());
            let setup = Setup::new(instance, first as u32, view, color);
            let set = self.set;
            self.splats[first..first + len]
                .par_chunks_mut(BLOCK)
                .zip(self.covers[first..first + len].par_chunks_mut(BLOCK))
                .zip(self.keys[first..first + len].par_chunks_mut(BLOCK))
                .zip(&mut self.blocks[known..])
                .enumerate()
                .for_each(|(k, (((splats, covers), keys), block))| {
                    *block = watch.work(|| set.run(Project { setup: &setup, start: k * BLOCK, splats, covers, keys }));
                });
            first += len;
        }
        self.timings.project = watch.read();
        let watch = Watch::start();
        self.sorter.sort(&self.keys, &self.blocks, &watch);
        self.timings.sort = watch.read();
        let watch = Watch::start();
        let binning = Binning {
            sorted: self.sorter.sorted(),
            splats: &self.splats,
            covers: &self.covers,
            tiles: (view.width.div_ceil(TILE as u32), view.height.div_ceil(TILE as u32)),
        };
        self.bins.start(binning, &watch);
        self.timings.bin = watch.read();
        self.key.set(scene, view, color);
    }

    /// Stage 4 for the tiles whose lists are there.
    fn blend(&self, request: Request, across: usize, watch: &Watch) {
        let next = AtomicUsize::new(0);
        let order = self.bins.order();
        self.pixels.par_iter().with_max_len(1).for_each(|pixels| {
            // Never contended: there is one for each task.
            let mut pixels = pixels.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            watch.work(|| {
                while let Some(&tile) = order.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let tile = tile as usize;
                    self.set.run(Blend {
                        request,
                        list: self.bins.list(tile),
                        corner: (tile % across * TILE, tile / across * TILE),
                        pixels: &mut pixels,
                    });
                }
            });
        });
    }
}

impl Rasterizer for CpuRasterizer {
    fn draw(&mut self, scene: &Scene, view: &View, outputs: &Outputs, frame: &mut Frame) -> Result<(), RasterError> {
        check(scene, view, outputs)?;
        self.timings = Timings::default();
        if !(self.fresh && self.key.serves(scene, view, outputs.color)) {
            self.fresh = false;
            self.prepare(scene, view, outputs.color);
        }
        let watch = Watch::start();
        let threads = rayon::current_num_threads();
        if self.pixels.len() != threads {
            self.pixels.resize_with(threads, Mutex::default);
        }
        watch.work(|| frame.reset(view, outputs, scene.len()));
        let mut visible = std::mem::take(&mut frame.visibility).into_words();
        let mut votes = std::mem::take(&mut frame.votes);
        let total = shared::atomic(&mut votes.total);
        let inside: Vec<_> = votes.inside.iter_mut().map(|words| shared::atomic(words)).collect();
        let sums = Sums { visible: shared::atomic(&mut visible), total, inside: &inside };
        let (width, height) = (view.width as usize, view.height as usize);
        let across = width.div_ceil(TILE);
        let canvas = Canvas::new(frame);
        let request = Request { splats: &self.splats, size: (width, height), outputs, sums, canvas: &canvas };
        self.blend(request, across, &watch);
        // After several rounds only the lists of the last one are left.
        self.fresh = self.bins.done();
        while !self.bins.done() {
            self.bins.fill(
                Binning {
                    sorted: self.sorter.sorted(),
                    splats: &self.splats,
                    covers: &self.covers,
                    tiles: (across as u32, height.div_ceil(TILE) as u32),
                },
                &watch,
            );
            self.blend(request, across, &watch);
        }
        drop(inside);
        votes.inside.par_iter_mut().for_each(|sums| {
            watch.work(|| sums.iter_mut().for_each(|sum| *sum /= 255));
        });
        frame.votes = votes;
        if outputs.visibility.is_some() {
            frame.visibility = Selection::from_words(scene.len(), visible);
        }
        self.timings.raster = watch.read();
        Ok(())
    }
}

/// Everything that can be wrong with a request.
pub(crate) fn check(scene: &Scene, view: &View, outputs: &Outputs) -> Result<(), RasterError> {
    view.check()?;
    if u64::from(view.width) * u64::from(view.height) > LARGEST_PICTURE {
        return Err(RasterError::TooLarge { width: view.width, height: view.height });
    }
    if u32::try_from(scene.len()).is_err() {
        return Err(RasterError::TooMany { found: scene.len() });
    }
    for (k, instance) in scene.instances.iter().enumerate() {
        let count = instance.cloud.len();
        if let Some(ids) = &instance.subset {
            let rising = ids.is_sorted_by(|a, b| a < b) && ids.last().is_none_or(|&last| (last as usize) < count);
            if !rising {
                return Err(RasterError::Subset { instance: k, count });
            }
        }
        if let Some(tint) = instance.tint.as_ref().filter(|tint| tint.len() != count) {
            return Err(RasterError::Length { what: "tint", found: tint.len(), expected: count });
        }
        if let Some(hidden) = instance.hidden.as_ref().filter(|hidden| hidden.len() != count) {
            return Err(RasterError::Length { what: "hidden", found: hidden.len(), expected: count });
        }
    }
    if let Some(features) = &outputs.features {
        let expected = scene.len() * features.channels.max(1);
        if features.channels == 0 || features.values.len() != expected {
            return Err(RasterError::Length { what: "features", found: features.values.len(), expected });
        }
    }
    let pixels = view.width as usize * view.height as usize;
    if let Some(limit) = outputs.limit.filter(|limit| limit.len() != pixels) {
        return Err(RasterError::Length { what: "limit", found: limit.len(), expected: pixels });
    }
    for mask in outputs.votes.unwrap_or_default() {
        if (mask.width(), mask.height()) != (view.width, view.height) {
            return Err(RasterError::SizeMismatch {
                mask: (mask.width(), mask.height()),
                view: (view.width, view.height),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use splat_core::glam::{Mat3, Quat, Vec3};
    use splat_core::{CloudArrays, Pose};

    use super::*;

    #[test]
    fn a_frame_in_many_rounds_of_tiles_equals_one_in_a_single_round() {
        let count = 2000;
        let noise = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 1000) as f32 / 500.0 - 1.0;
        let cloud = Cloud::new(CloudArrays {
            means: (0..count).map(|i| Vec3::new(noise(i, 1), noise(i, 2), 3.0 + noise(i, 3))).collect(),
            log_scales: (0..count).map(|i| Vec3::splat(-3.0 + noise(i, 4))).collect(),
            rotations: vec![Quat::IDENTITY; count],
            opacity_logits: (0..count).map(|i| noise(i, 5)).collect(),
            sh: (0..3 * count).map(|i| noise(i, 6)).collect(),
            ..CloudArrays::default()
        })
        .unwrap();
        let scene = Scene::of(Arc::new(cloud));
        let pose = Pose { world_from_view: Mat3::IDENTITY, position: Vec3::ZERO };
        let view = View::perspective(pose, 0.9, 200, 150);
        let whole = CpuRasterizer::new().render(&scene, &view).unwrap();
        for largest in [1, 500, 20_000] {
            let mut rasterizer = CpuRasterizer::new();
            rasterizer.bins.largest_round = largest;
            for _ in 0..2 {
                assert_eq!(rasterizer.render(&scene, &view).unwrap(), whole, "rounds of {largest} entries");
            }
        }
    }
}
