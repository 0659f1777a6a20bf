//! A frame after the first ones takes its memory from them.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use splat_core::Mask2d;
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Frame, Outputs, Rasterizer, Scene};

static BYTES: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, counting.
struct Counting;

// SAFETY: hands every call on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        BYTES.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_warm_rasteriser_draws_without_allocating() {
    let scene = Scene::of(Arc::new(common::cloud(1, 50_000, 1)));
    let mask = Mask2d::from_fn(640, 480, |x, _| x < 300);
    let masks = [&mask];
    let outputs = Outputs {
        color: true,
        median_depth: true,
        first_hits: Some(0.5),
        visibility: Some(0.01),
        votes: Some(&masks),
        ..Outputs::default()
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    pool.install(|| {
        let mut rasterizer = CpuRasterizer::new();
        let mut frame = Frame::default();
        let views = [1, 2].map(|seed| common::view(seed, 640, 480));
        let mut bytes = Vec::with_capacity(8);
        for round in 0..8 {
            let before = BYTES.load(Ordering::Relaxed);
            rasterizer.draw(&scene, &views[round % 2], &outputs, &mut frame).unwrap();
            bytes.push(BYTES.load(Ordering::Relaxed) - before);
        }
        assert!(bytes[0] > 10 << 20, "the first frame needs memory: {bytes:?}");
        // A list of references to the masks, and what the thread pool keeps for itself.
        assert!(bytes[4..].iter().all(|&bytes| bytes < 16 << 10), "{bytes:?}");
    });
}
