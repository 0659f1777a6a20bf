//! Tiles of ellipses against all pixels of all tiles.

use splat_shaders::constants::{COUNTERS, LEVELS, TILE};

use super::*;
use crate::gpu::sort::tests::best;

/// What the shader gets of a splat.
#[derive(Clone, Copy, Debug)]
struct Ellipse {
    mean: [f32; 2],
    along: f32,
    shear: f32,
    across: f32,
    level: f32,
}

impl Ellipse {
    /// Of covariance (a b; b c) and an opacity.
    fn new(mean: [f32; 2], [a, b, c]: [f64; 3], opacity: f32) -> Self {
        let half_log2_e = 0.5 * std::f64::consts::LOG2_E;
        Self {
            mean,
            along: (half_log2_e * c / (a * c - b * b)).sqrt() as f32,
            shear: (b / c) as f32,
            across: (half_log2_e / c).sqrt() as f32,
            level: opacity.log2(),
        }
    }

    /// Log2 of alpha at an offset from the mean.
    fn power(&self, dx: f64, dy: f64) -> f64 {
        let e = f64::from(self.along) * (dx - f64::from(self.shear) * dy);
        f64::from(self.level) - e * e - (f64::from(self.across) * dy).powi(2)
    }

    /// Whether a pixel of a tile counts: all of them are asked.
    fn is_needed(&self, x: u32, y: u32) -> bool {
        (0..TILE * TILE).any(|p| {
            let [px, py] = [x * TILE + p % TILE, y * TILE + p / TILE].map(|p| f64::from(p) + 0.5);
            let power = self.power(px - f64::from(self.mean[0]), py - f64::from(self.mean[1]));
            power >= -f64::from(LEVELS)
        })
    }

    /// Whether the ellipse, a little larger, reaches a place between the tile's outermost pixel centres: the least power is
    /// on an edge, unless the mean is inside.
    fn may_be_listed(&self, x: u32, y: u32) -> bool {
        let around = |t: u32, m: f32| {
            let first = f64::from(t * TILE) + 0.5 - f64::from(m);
            (first - 0.05, first + f64::from(TILE - 1) + 0.05)
        };
        let ((x0, x1), (y0, y1)) = (around(x, self.mean[0]), around(y, self.mean[1]));
        let (along, shear, across) = (f64::from(self.along), f64::from(self.shear), f64::from(self.across));
        // Where on a column the splat is strongest.
        let lean = along * along * shear / (along * along * shear * shear + across * across);
        let mut best = if x0 <= 0.0 && x1 >= 0.0 && y0 <= 0.0 && y1 >= 0.0 { self.power(0.0, 0.0) } else { f64::MIN };
        for x in [x0, x1] {
            best = best.max(self.power(x, (lean * x).clamp(y0, y1)));
        }
        for y in [y0, y1] {
            best = best.max(self.power((shear * y).clamp(x0, x1), y));
        }
        best >= -f64::from(LEVELS) - 0.01
    }
}

/// Lists as the CPU reads them.
struct Lists {
    tiles: Vec<Vec<u32>>,
    counters: Vec<u32>,
}

/// Bins splats that are given in order of depth; slots are shuffled.
fn binned(context: &Context, splats: &[Ellipse], tiles: [u32; 2], pairs: u32, visible: u32) -> Lists {
    binned_in_turn(context, splats, &[(tiles, visible)], pairs).remove(0)
}

/// As [`binned`], for pictures of several sizes with so many visible splats, each with the memory of the one before.
fn binned_in_turn(context: &Context, splats: &[Ellipse], pictures: &[([u32; 2], u32)], pairs: u32) -> Vec<Lists> {
    let bin = BinKernels::new(context).unwrap();
    let (scan, sort) = (ScanKernels::new(context).unwrap(), SortKernels::new(context).unwrap());
    let kernels = Kernels { bin: &bin, scan: &scan, sort: &sort };
    let len = splats.len() as u32;
    let slot_of = |k: u32| slot(k, len);
    let by_slot = |value: &dyn Fn(&Ellipse) -> [f32; 2]| {
        let mut values = vec![[f32::NAN; 2]; splats.len()];
        for (k, splat) in splats.iter().enumerate() {
            values[slot_of(k as u32) as usize] = value(splat);
        }
        context.buffer_of("splats", &values, wgpu::BufferUsages::empty())
    };
    let sorted: Vec<u32> = (0..len).map(slot_of).collect();
    let counters = context.words("counters", COUNTERS as usize);
    let mut binning = Binning {
        sorted: &context.buffer_of("sorted", &sorted, wgpu::BufferUsages::empty()),
        mean: &by_slot(&|s| s.mean),
        shape_a: &by_slot(&|s| [s.along, s.shear]),
        shape_b: &by_slot(&|s| [s.across, s.level]),
        counters: &counters,
        splats: len,
        pairs,
        tiles: pictures[0].0,
    };
    let mut place = vec![u32::MAX; splats.len()];
    for k in 0..len {
        place[slot_of(k) as usize] = k;
    }
    let mut binner = Binner::new(context, kernels, &binning);
    let mut all = Vec::new();
    for &(tiles, visible) in pictures {
        context.write(&counters, 4 * u64::from(COUNTER_VISIBLE), &[visible]);
        if tiles != binning.tiles {
            binning.tiles = tiles;
            binner = binner.renewed(context, kernels, &binning);
        }
        // Twice: the second must not see what the first left.
        context.run(|pass| binner.encode(kernels, pass));
        context.run(|pass| binner.encode(kernels, pass));
        all.push(lists_of(context, &binner, &counters, tiles, &place));
    }
    all
}

/// Reads the lists, with the sorted splats' numbers in place of slots.
fn lists_of(context: &Context, binner: &Binner, counters: &wgpu::Buffer, tiles: [u32; 2], place: &[u32]) -> Lists {
    let counters = context.read(counters, COUNTERS as usize).unwrap();
    let slots: Vec<u32> = context.read(binner.pair_slots(), counters[COUNTER_KEPT as usize] as usize).unwrap();
    let ranges: Vec<[u32; 2]> = context.read(binner.tile_ranges(), (tiles[0] * tiles[1]) as usize).unwrap();
    let mut end = 0;
    let lists = ranges.into_iter().map(|[first, last]| {
        if first == last {
            assert_eq!((first, last), (0, 0), "tiles without splats have no range");
        } else {
            assert_eq!(first, end, "lists follow each other");
            end = last;
        }
        slots[first as usize..last as usize].iter().map(|&slot| place[slot as usize]).collect()
    });
    let tiles = lists.collect();
    assert_eq!(end, counters[COUNTER_KEPT as usize], "every pair belongs to a tile");
    Lists { tiles, counters }
}

/// Slots in no order.
fn slot(k: u32, len: u32) -> u32 {
    // 7919 is a prime that divides none of the lengths used.
    (u64::from(k) * 7919 % u64::from(len)) as u32
}

fn random_splats(count: usize) -> Vec<Ellipse> {
    let mut random = 11u64;
    let mut next = |low: f64, high: f64| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (random >> 40) as f64 / (1u64 << 24) as f64 * (high - low)
    };
    (0..count)
        .map(|n| {
            let kind = n % 8;
            // Small, large, huge, thin, thin and long; in the picture and far outside.
            let (long, short) = match kind {
                0..3 => (next(0.6, 12.0), next(0.6, 3.0)),
                3 => (next(20.0, 80.0), next(5.0, 40.0)),
                4 => (next(300.0, 5000.0), next(100.0, 2000.0)),
                5 => (next(10.0, 200.0), 0.56),
                6 => (next(500.0, 1e6), 0.56),
                _ => (next(1e4, 1e8), next(1e3, 1e8)),
            };
            let far = if n % 3 == 0 { long.min(2e4) * 2.0 } else { 30.0 };
            let mean = [next(-far, 320.0 + far) as f32, next(-far, 240.0 + far) as f32];
            let angle = if n % 5 == 0 { 0.0 } else { next(0.0, 3.2) };
            let (sin, cos) = angle.sin_cos();
            let (long, short) = (long * long, short * short);
            let a = long * cos * cos + short * sin * sin + 0.3;
            let c = long * sin * sin + short * cos * cos + 0.3;
            let b = (long - short) * sin * cos;
            let faintest = if n % 7 == 0 { 1.01 / 255.0 } else { 0.02 };
            Ellipse::new(mean, [a, b, c], next(faintest, 1.0) as f32)
        })
        .collect()
}

#[test]
fn every_tile_with_a_pixel_that_counts_lists_the_splat_in_order_and_few_others_do() {
    let Some(context) = Context::for_test() else { return };
    let splats = random_splats(400);
    // A picture whose last tiles are cut off is binned as if they were whole.
    let tiles = [20, 15];
    let lists = binned(&context, &splats, tiles, 1 << 17, 400);
    let (mut needed, mut listed) = (0, 0);
    for (tile, list) in lists.tiles.iter().enumerate() {
        assert!(list.is_sorted_by(|a, b| a < b), "tile {tile}: by depth, each once");
        let (x, y) = (tile as u32 % tiles[0], tile as u32 / tiles[0]);
        for (k, splat) in splats.iter().enumerate() {
            let is_listed = list.binary_search(&(k as u32)).is_ok();
            let is_needed = splat.is_needed(x, y);
            assert!(is_listed || !is_needed, "tile ({x}, {y}) lacks splat {k}: {splat:?}");
            // Far away or long, the slack for rounding is more than this test's.
            let near = splat.mean.iter().all(|m| m.abs() < 1000.0) && splat.across > 1e-3 && splat.along > 1e-3;
            assert!(
                !near || !is_listed || splat.may_be_listed(x, y),
                "tile ({x}, {y}) does not need splat {k}: {splat:?}"
            );
            needed += usize::from(is_needed);
            listed += usize::from(is_listed);
        }
    }
    assert!(needed > 5000 && listed * 100 < needed * 110, "{listed} listed, {needed} needed");
    assert_eq!(lists.counters[COUNTER_PAIRS as usize] as usize, listed);
    assert_eq!(lists.counters[COUNTER_KEPT as usize] as usize, listed);
}

#[test]
fn far_from_the_origin_of_a_large_picture_no_tile_is_missed() {
    let Some(context) = Context::for_test() else { return };
    let tiles = [1000, 3];
    let moved = |s: Ellipse| Ellipse { mean: [s.mean[0] + 15_600.0, s.mean[1] * 0.3 - 60.0], ..s };
    let splats: Vec<Ellipse> = random_splats(64).into_iter().map(moved).collect();
    let lists = binned(&context, &splats, tiles, 1 << 17, 64);
    for (tile, list) in lists.tiles.iter().enumerate() {
        let (x, y) = (tile as u32 % tiles[0], tile as u32 / tiles[0]);
        for (k, splat) in splats.iter().enumerate() {
            let is_listed = list.binary_search(&(k as u32)).is_ok();
            assert!(is_listed || !splat.is_needed(x, y), "tile ({x}, {y}) lacks splat {k}: {splat:?}");
        }
    }
}

#[test]
fn a_picture_of_another_size_is_binned_with_the_memory_of_the_one_before() {
    let Some(context) = Context::for_test() else { return };
    let splats = random_splats(50);
    let pictures = [([20, 15], 50), ([3, 4], 50), ([33, 9], 7), ([33, 9], 50)];
    let renewed = binned_in_turn(&context, &splats, &pictures, 1 << 16);
    for (lists, (tiles, visible)) in renewed.iter().zip(pictures) {
        let fresh = binned(&context, &splats, tiles, 1 << 16, visible);
        assert!(lists.tiles == fresh.tiles && lists.counters == fresh.counters, "{tiles:?}");
    }
}

#[test]
fn where_there_is_no_room_the_farthest_are_left_out_and_the_number_needed_is_told() {
    let Some(context) = Context::for_test() else { return };
    let splats = random_splats(120);
    let all = binned(&context, &splats, [20, 15], 1 << 16, 120);
    let needed = all.counters[COUNTER_PAIRS as usize];
    // Splats in order with the tiles of each.
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    for (tile, list) in all.tiles.iter().enumerate() {
        pairs.extend(list.iter().map(|&k| (k, tile as u32)));
    }
    pairs.sort_unstable();
    assert_eq!(pairs.len(), needed as usize);
    for room in [1, 1000, needed - 1, needed, needed + 1] {
        let lists = binned(&context, &splats, [20, 15], room, 120);
        assert_eq!(lists.counters[COUNTER_PAIRS as usize], needed);
        assert_eq!(lists.counters[COUNTER_KEPT as usize], room.min(needed));
        let mut kept: Vec<(u32, u32)> = Vec::new();
        for (tile, list) in lists.tiles.iter().enumerate() {
            kept.extend(list.iter().map(|&k| (k, tile as u32)));
        }
        kept.sort_unstable();
        assert!(kept == pairs[..kept.len()], "room for {room}");
    }
}

#[test]
fn only_visible_splats_are_listed_and_none_leaves_all_tiles_empty() {
    let Some(context) = Context::for_test() else { return };
    let splats = random_splats(40);
    let all = binned(&context, &splats, [20, 15], 1 << 15, 40);
    // In turn, also after more.
    let numbers = [17, 40, 1, 4000, 0, 5];
    let pictures = numbers.map(|visible| ([20, 15], visible));
    for (lists, visible) in binned_in_turn(&context, &splats, &pictures, 1 << 15).iter().zip(numbers) {
        for (list, all) in lists.tiles.iter().zip(&all.tiles) {
            let expected: Vec<u32> = all.iter().copied().filter(|&k| k < visible).collect();
            assert_eq!(*list, expected, "{visible} visible");
        }
    }
}

#[test]
fn pictures_of_one_tile_of_256_and_of_more_than_one_pass_of_the_sort_are_binned() {
    let Some(context) = Context::for_test() else { return };
    let round = |x, y, variance| Ellipse::new([x, y], [variance, 0.0, variance], 0.9);
    for tiles in [[1, 1], [1, 300], [300, 1], [16, 16], [17, 15], [15, 17]] {
        let splats = [round(8.0, 8.0, 1.0), round(0.0, 0.0, 1e9), round(16.0 * 14.0 + 8.0, 8.0, 4.0)];
        let lists = binned(&context, &splats, tiles, 1 << 12, 3);
        for (tile, list) in lists.tiles.iter().enumerate() {
            let (x, y) = (tile as u32 % tiles[0], tile as u32 / tiles[0]);
            let expected: Vec<u32> = (0..3).filter(|&k| splats[k as usize].is_needed(x, y)).collect();
            assert_eq!(*list, expected, "tile ({x}, {y}) of {tiles:?}");
        }
    }
}

#[test]
fn sums_beyond_32_bits_are_told_as_the_largest_number() {
    let Some(context) = Context::for_test() else { return };
    // 70 000 splats, each on 256 x 256 tiles.
    let splats = vec![Ellipse::new([2000.0, 2000.0], [1e12, 0.0, 1e12], 0.9); 70_000];
    let lists = binned(&context, &splats, [256, 256], 70_000, 70_000);
    assert_eq!(lists.counters[COUNTER_PAIRS as usize], u32::MAX);
    assert!(lists.tiles.iter().take(4000).all(|list| list[..] == [0, 1][..list.len()] && !list.is_empty()));
}

#[test]
#[ignore = "prints figures: cargo test -p splat_raster --features gpu --lib -- --ignored --nocapture time_of_binning"]
fn time_of_binning() {
    let Some(context) = Context::for_test() else { return };
    let bin = BinKernels::new(&context).unwrap();
    let (scan, sort) = (ScanKernels::new(&context).unwrap(), SortKernels::new(&context).unwrap());
    let kernels = Kernels { bin: &bin, scan: &scan, sort: &sort };
    // As many and as large as those of a photographed square at 1920 x 1080.
    let (count, pairs, tiles) = (600_000, 1 << 22, [120, 68]);
    let mut random = 3u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f32 / (1u64 << 24) as f32
    };
    let splats: Vec<Ellipse> = (0..count)
        .map(|_| {
            let deviation = 1.2 / next().max(1e-5).powf(0.7);
            let (a, c) = (deviation * (0.3 + next()), deviation * (0.3 + next()));
            let (a, c) = (f64::from(a * a + 0.3), f64::from(c * c + 0.3));
            let b = f64::from(next() - 0.5) * (a * c).sqrt();
            Ellipse::new([next() * 1920.0, next() * 1080.0], [a, b, c], 0.02 + 0.98 * next())
        })
        .collect();
    let pack = |value: &dyn Fn(&Ellipse) -> [f32; 2]| {
        let values: Vec<_> = splats.iter().map(value).collect();
        context.buffer_of("splats", &values, wgpu::BufferUsages::empty())
    };
    let sorted: Vec<u32> = (0..count).map(|k| slot(k, count)).collect();
    let mut counters = vec![0; COUNTERS as usize];
    counters[COUNTER_VISIBLE as usize] = count;
    let counters = context.buffer_of("counters", &counters, wgpu::BufferUsages::empty());
    let binning = Binning {
        sorted: &context.buffer_of("sorted", &sorted, wgpu::BufferUsages::empty()),
        mean: &pack(&|s| s.mean),
        shape_a: &pack(&|s| [s.along, s.shear]),
        shape_b: &pack(&|s| [s.across, s.level]),
        counters: &counters,
        splats: count,
        pairs,
        tiles,
    };
    let b = Binner::new(&context, kernels, &binning);
    context.run(|pass| b.encode(kernels, pass));
    let counted: Vec<u32> = context.read(&counters, COUNTERS as usize).unwrap();
    println!("{count} splats, {} pairs", counted[COUNTER_PAIRS as usize]);
    let show = |what: &str, record: &dyn Fn(&mut wgpu::ComputePass<'_>)| {
        let (wall, cpu) = best(|| context.run(|pass| record(pass)));
        println!("{:8.2} ms, {:8.2} ms CPU  {what}", wall * 1e3, cpu * 1e3);
    };
    show("all", &|pass| b.encode(kernels, pass));
    // In an order in which each finds what it needs; the sums are those of sums after the first run.
    show("splats", &|pass| bin.splats.dispatch_indirect(pass, &b.splats, &b.arguments, 0));
    context.run(|pass| b.encode(kernels, pass));
    show("pairs", &|pass| bin.pairs.dispatch_indirect(pass, &b.pairs, &b.arguments, 16));
    show("sort", &|pass| b.sorter.encode(&sort, pass));
    show("ranges", &|pass| bin.ranges.dispatch(pass, &b.ranges, b.tiles.div_ceil(BLOCK)));
    show("sums", &|pass| b.scanner.encode(&scan, pass));
}
