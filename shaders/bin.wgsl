// Which tiles each splat reaches, as pairs of tile and slot in order of depth; where each tile's pairs are once sorted by tile.
//
// In: `sorted` (slots in order of depth, as many as COUNTER_VISIBLE), `mean`, `shape_a`, `shape_b` by slot.
// bin_splats: tiles of each sorted splat (`bin_offsets`, to be summed up) and, where its box is small, which (`bin_covers`).
// bin_prepare, after the sum: counters and indirect dispatches. bin_pairs: a thread for a few pairs, so that no thread
// has more to do for a splat of ten thousand tiles than for one of two; pairs beyond the capacity, the farthest, are left out.
// bin_ranges, after the sort: first pair and one past the last of each tile, (0, 0) where there is none.
// Rust twin: `pairs_of` in gpu/bin.rs, pixel by pixel.

struct BinParams {
    // Across and down.
    tiles: vec2<u32>,
    // Splats and pairs that there is room for.
    splats: u32,
    pairs: u32,
}

@group(0) @binding(0) var<uniform> bin: BinParams;

//#if SHAPES
struct Ellipse {
    mean: vec2<f32>,
    along: f32,
    shear: f32,
    across: f32,
    // Power at the mean above that of the smallest alpha that counts.
    reach: f32,
    // Half its height and the height above the mean of its right end, in pixels.
    high: f32,
    right: f32,
}

fn ellipse(mean: vec2<f32>, a: vec2<f32>, b: vec2<f32>) -> Ellipse {
    var e: Ellipse;
    e.mean = mean;
    e.along = a.x;
    e.shear = a.y;
    e.across = b.x;
    e.reach = max(b.y + LEVELS + MARGIN, 0.0);
    e.high = sqrt(e.reach) / e.across;
    // On the right branch, shear * y + sqrt(reach - (across * y)^2) / along, x is largest here.
    let slope = e.shear * e.along / e.across;
    e.right = e.high * slope / sqrt(1.0 + slope * slope);
    return e;
}

// Tiles, first and one past the last, with a pixel centre between two places.
fn tiles_between(low: f32, high: f32, tiles: u32) -> vec2<u32> {
    let side = f32(TILE);
    let first = ceil((low + 0.5) / side) - 1.0;
    let end = floor((high - 0.5) / side) + 1.0;
    let limits = clamp(vec2<f32>(first, end), vec2<f32>(0.0), vec2<f32>(f32(tiles)));
    return vec2<u32>(u32(limits.x), u32(max(limits.x, limits.y)));
}

// How far limits are grown: what rounding may cost places that are so far apart, with room to spare.
fn slack(far: f32) -> f32 {
    return fma(far, 2e-6, 1e-3);
}

// Rows of tiles that the ellipse may reach, first and one past the last.
fn rows_of(e: Ellipse) -> vec2<u32> {
    let high = e.high + slack(e.high + abs(e.mean.y));
    return tiles_between(e.mean.y - high, e.mean.y + high, bin.tiles.y);
}

// Tiles of a row that the ellipse reaches, first and one past the last: its exact extent over the row's pixel centres.
fn tiles_of(e: Ellipse, row: u32) -> vec2<u32> {
    let top = f32(row * TILE) + 0.5 - e.mean.y;
    let grow = slack(e.high + abs(e.mean.y));
    let low = max(top - grow, -e.high);
    let high = min(top + f32(TILE - 1u) + grow, e.high);
    if !(low <= high) {
        // Only the slack of the rows let it in: its end is there.
        return tiles_at(e, clamp(top, -e.high, e.high), clamp(top, -e.high, e.high));
    }
    return tiles_at(e, clamp(-e.right, low, high), clamp(e.right, low, high));
}

// Tiles between the left branch at one height above the mean and the right branch at another.
fn tiles_at(e: Ellipse, left_y: f32, right_y: f32) -> vec2<u32> {
    let left_half = half_width(e, left_y);
    let right_half = half_width(e, right_y);
    let left = fma(e.shear, left_y, -left_half);
    let right = fma(e.shear, right_y, right_half);
    let left_slack = slack(abs(e.mean.x) + abs(e.shear * left_y) + left_half);
    let right_slack = slack(abs(e.mean.x) + abs(e.shear * right_y) + right_half);
    return tiles_between(e.mean.x + left - left_slack, e.mean.x + right + right_slack, bin.tiles.x);
}

fn half_width(e: Ellipse, y: f32) -> f32 {
    let f = e.across * y;
    return sqrt(max(fma(-f, f, e.reach), 0.0)) / e.along;
}

// Covers: the box's first row and first tile (12 bits each) and its tiles across (6 bits), then a bit per tile of the box.
const COVER_TILES: u32 = 32u;
// No cover: the box has more tiles than bits.
const LARGE: u32 = 0xffffffffu;
//#end

//#if SPLATS
@group(0) @binding(1) var<storage, read> bin_counters: array<u32>;
@group(0) @binding(2) var<storage, read> sorted: array<u32>;
@group(0) @binding(3) var<storage, read> mean: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> shape_a: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> shape_b: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> bin_offsets: array<u32>;
@group(0) @binding(7) var<storage, read_write> bin_covers: array<vec2<u32>>;

@compute @workgroup_size(BLOCK)
fn bin_splats(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let k = folded(group) * BLOCK + thread;
    if k >= min(bin_counters[COUNTER_VISIBLE], bin.splats) {
        return;
    }
    let slot = sorted[k];
    let e = ellipse(mean[slot], shape_a[slot], shape_b[slot]);
    let rows = rows_of(e);
    var count = 0u;
    var mask = 0u;
    var box = vec2<u32>(bin.tiles.x, 0u);
    // A box of few rows: its columns first, which say what the bits mean.
    let small = rows.y - rows.x <= COVER_TILES;
    if small {
        for (var row = rows.x; row < rows.y; row++) {
            let tiles = tiles_of(e, row);
            if tiles.x < tiles.y {
                box = vec2<u32>(min(box.x, tiles.x), max(box.y, tiles.y));
            }
        }
    }
    let across = max(box.y, box.x) - box.x;
    let fits = small && across <= COVER_TILES && across * (rows.y - rows.x) <= COVER_TILES;
    for (var row = rows.x; row < rows.y; row++) {
        let tiles = tiles_of(e, row);
        let here = tiles.y - tiles.x;
        count += here;
        if fits && here != 0u {
            let bits = select((1u << here) - 1u, 0xffffffffu, here == 32u);
            mask |= bits << ((row - rows.x) * across + tiles.x - box.x);
        }
    }
    if fits {
        count = countOneBits(mask);
    }
    bin_offsets[k] = count;
    bin_covers[k] = select(vec2<u32>(LARGE, 0u), vec2<u32>(rows.x << 20u | box.x << 8u | across, mask), fits);
}
//#end

//#if PREPARE
@group(0) @binding(1) var<storage, read_write> bin_counters: array<u32>;
// Two indirect dispatches of 4 words each: bin_splats, bin_pairs. Then the splats and the pairs there are.
@group(0) @binding(2) var<storage, read_write> bin_arguments: array<u32>;

@compute @workgroup_size(1)
fn bin_start() {
    let splats = min(bin_counters[COUNTER_VISIBLE], bin.splats);
    let groups = fold(blocks_of(splats));
    bin_arguments[0] = groups.x;
    bin_arguments[1] = groups.y;
    bin_arguments[2] = groups.z;
}

@compute @workgroup_size(1)
fn bin_prepare() {
    let kept = min(bin_counters[COUNTER_PAIRS], bin.pairs);
    bin_counters[COUNTER_KEPT] = kept;
    let groups = fold((kept + PAIR_BLOCK - 1u) / PAIR_BLOCK);
    bin_arguments[4] = groups.x;
    bin_arguments[5] = groups.y;
    bin_arguments[6] = groups.z;
    bin_arguments[8] = min(bin_counters[COUNTER_VISIBLE], bin.splats);
    bin_arguments[9] = kept;
}
//#end

//#if PAIRS
struct BinArguments {
    splats_dispatch: vec4<u32>,
    pairs_dispatch: vec4<u32>,
    // Splats and pairs.
    counts: vec4<u32>,
}

@group(0) @binding(1) var<uniform> bin_arguments: BinArguments;
@group(0) @binding(2) var<storage, read> bin_offsets: array<u32>;
@group(0) @binding(3) var<storage, read> bin_covers: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> sorted: array<u32>;
@group(0) @binding(5) var<storage, read> mean: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read> shape_a: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read> shape_b: array<vec2<f32>>;
@group(0) @binding(8) var<storage, read_write> pair_tiles: array<u32>;
@group(0) @binding(9) var<storage, read_write> pair_slots: array<u32>;

const PAIR_ITEMS: u32 = PAIR_BLOCK / BLOCK;

// Sorted splats of the block's first and last pair.
var<workgroup> ends: array<u32, 2>;

// The last of the splats `low..=high` whose pairs do not start after `pair`; `low` is one.
fn splat_of(pair: u32, low: u32, high: u32) -> u32 {
    var first = low;
    var last = high;
    while first < last {
        let middle = last - (last - first) / 2u;
        if bin_offsets[middle] <= pair {
            first = middle;
        } else {
            last = middle - 1u;
        }
    }
    return first;
}

// Position of the set bit that has `n` set bits below it.
fn bit_number(bits: u32, n: u32) -> u32 {
    var rest = bits;
    var left = n;
    var at = 0u;
    for (var width = 16u; width > 0u; width /= 2u) {
        let lower = countOneBits(rest & ((1u << width) - 1u));
        if left >= lower {
            left -= lower;
            rest >>= width;
            at += width;
        }
    }
    return at;
}

// Goes through the tiles of one splat after the other.
struct Walk {
    // Sorted splat and its slot.
    k: u32,
    slot: u32,
    // Pairs from here on are the next splat's.
    end: u32,
    // First tile of the box and its tiles across; bits of those that are left. Across 0: a box too large for bits.
    first: u32,
    across: u32,
    bits: u32,
    // The tile row, the tile that is next and one past the last of the row; of a large box.
    row: u32,
    tile: u32,
    tiles_end: u32,
}

// Begins with tile number `n` of the sorted splat `k`.
fn walk_from(k: u32, n: u32, splats: u32) -> Walk {
    var walk: Walk;
    walk.k = k;
    walk.slot = sorted[k];
    walk.end = 0xffffffffu;
    if k + 1u < splats {
        walk.end = bin_offsets[k + 1u];
    }
    let cover = bin_covers[k];
    if cover.x != LARGE {
        walk.first = (cover.x >> 20u) * bin.tiles.x + ((cover.x >> 8u) & 0xfffu);
        walk.across = cover.x & 0xffu;
        walk.bits = cover.y;
        if n != 0u {
            walk.bits &= ~((1u << bit_number(cover.y, n)) - 1u);
        }
        return walk;
    }
    let e = ellipse(mean[walk.slot], shape_a[walk.slot], shape_b[walk.slot]);
    let rows = rows_of(e);
    var left = n;
    for (walk.row = rows.x; walk.row < rows.y; walk.row++) {
        let tiles = tiles_of(e, walk.row);
        let here = tiles.y - tiles.x;
        if left < here {
            walk.tile = tiles.x + left;
            walk.tiles_end = tiles.y;
            break;
        }
        left -= here;
    }
    return walk;
}

// The next tile of the splat.
fn next_tile(walk: ptr<function, Walk>) -> u32 {
    if (*walk).across != 0u {
        let bit = firstTrailingBit((*walk).bits);
        (*walk).bits &= (*walk).bits - 1u;
        let row = bit / (*walk).across;
        return (*walk).first + row * bin.tiles.x + bit - row * (*walk).across;
    }
    if (*walk).tile >= (*walk).tiles_end {
        let slot = (*walk).slot;
        let e = ellipse(mean[slot], shape_a[slot], shape_b[slot]);
        let end = rows_of(e).y;
        for ((*walk).row += 1u; (*walk).row < end; (*walk).row++) {
            let tiles = tiles_of(e, (*walk).row);
            (*walk).tile = tiles.x;
            (*walk).tiles_end = tiles.y;
            if tiles.x < tiles.y {
                break;
            }
        }
        if (*walk).row >= end {
            // Not reached where the device computes the same twice; no tile has this number: nothing is drawn twice.
            return bin.tiles.x * bin.tiles.y;
        }
    }
    (*walk).tile += 1u;
    return (*walk).row * bin.tiles.x + (*walk).tile - 1u;
}

@compute @workgroup_size(BLOCK)
fn bin_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let splats = bin_arguments.counts.x;
    let pairs = bin_arguments.counts.y;
    let start = folded(group) * PAIR_BLOCK;
    if start >= pairs {
        return;
    }
    if thread < 2u {
        let pair = select(start, min(start + PAIR_BLOCK, pairs) - 1u, thread == 1u);
        ends[thread] = splat_of(pair, 0u, splats - 1u);
    }
    workgroupBarrier();
    // Neighbouring pairs, most of them of one splat: one search for all.
    let first = start + thread * PAIR_ITEMS;
    let end = min(first + PAIR_ITEMS, pairs);
    if first >= end {
        return;
    }
    let k = splat_of(first, ends[0], ends[1]);
    var walk = walk_from(k, first - bin_offsets[k], splats);
    for (var pair = first; pair < end; pair++) {
        if pair == walk.end {
            // Not simply the next one: it may have no tile.
            walk = walk_from(splat_of(pair, walk.k + 1u, ends[1]), 0u, splats);
        }
        pair_tiles[pair] = next_tile(&walk);
        pair_slots[pair] = walk.slot;
    }
}
//#end

//#if RANGES
@group(0) @binding(1) var<storage, read> bin_counters: array<u32>;
@group(0) @binding(2) var<storage, read> pair_tiles: array<u32>;
@group(0) @binding(3) var<storage, read_write> tile_ranges: array<vec2<u32>>;

var<workgroup> firsts: array<u32, BLOCK>;

// The first pair of this tile or a later one.
fn first_pair(tile: u32, pairs: u32) -> u32 {
    var first = 0u;
    var end = pairs;
    while first < end {
        let middle = first + (end - first) / 2u;
        if pair_tiles[middle] < tile {
            first = middle + 1u;
        } else {
            end = middle;
        }
    }
    return first;
}

@compute @workgroup_size(BLOCK)
fn bin_ranges(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = folded(group) * BLOCK + thread;
    let pairs = bin_counters[COUNTER_KEPT];
    firsts[thread] = first_pair(tile, pairs);
    workgroupBarrier();
    if tile >= bin.tiles.x * bin.tiles.y {
        return;
    }
    var end = 0u;
    if thread + 1u < BLOCK {
        end = firsts[thread + 1u];
    } else {
        end = first_pair(tile + 1u, pairs);
    }
    let begin = firsts[thread];
    tile_ranges[tile] = select(vec2<u32>(0u), vec2<u32>(begin, end), begin < end);
}
//#end
