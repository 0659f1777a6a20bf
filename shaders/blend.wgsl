// The splats of a tile, front to back, into its pixels.
//
// In: `pair_slots` of each tile between `tile_ranges`, in order of depth; `mean`, `shape_a`, `shape_b`, `color`, `z` by slot.
// Out, by switches: COLOR, MEDIAN, EXPECTED (pictures); HITS, STRONGEST (slots per pixel); VISIBLE (a bit per slot);
// FEATURES (four channels a dispatch); VOTES (up to VOTE_MASKS masks a dispatch; sums as two words, the low one first).
// DEPTH goes with MEDIAN, EXPECTED and LIMIT, SUMS with VISIBLE and VOTES; WIDE: colours as f32.
// LIMIT: what is at or beyond a pixel's limit adds nothing to it.
// A group of BLEND_THREADS threads per tile, a thread for four pixels of a row, so that what a splat is is read once for
// four. CPU twin: cpu/blend.rs; slow twin: the tests of gpu/blend.rs.

struct BlendParams {
    size: vec2<u32>,
    tiles_across: u32,
    tiles: u32,
    // T at or below which a pixel is hit.
    hit: f32,
    // Largest weight that does not count as visible.
    unseen: f32,
    // First of the channels of this dispatch, and how many there are altogether.
    channel: u32,
    channels: u32,
    // First of the masks of this dispatch, and how many are in it.
    mask: u32,
    masks: u32,
    slots: u32,
    // Bits of infinity: no depth.
    none: u32,
}

@group(0) @binding(next) var<uniform> blend: BlendParams;
@group(0) @binding(next) var<storage, read> tile_ranges: array<vec2<u32>>;
@group(0) @binding(next) var<storage, read> pair_slots: array<u32>;
@group(0) @binding(next) var<storage, read> mean: array<vec2<f32>>;
@group(0) @binding(next) var<storage, read> shape_a: array<vec2<f32>>;
@group(0) @binding(next) var<storage, read> shape_b: array<vec2<f32>>;
//#if COLOR
@group(0) @binding(next) var<storage, read> color: array<vec2<u32>>;
//#end
//#if DEPTH
@group(0) @binding(next) var<storage, read> z: array<f32>;
//#end
//#if LIMIT
@group(0) @binding(next) var limit: texture_2d<f32>;
//#end
//#if COLOR
//#if WIDE
@group(0) @binding(next) var color_picture: texture_storage_2d<rgba32float, write>;
//#else
@group(0) @binding(next) var color_picture: texture_storage_2d<rgba16float, write>;
//#end
//#end
//#if MEDIAN
@group(0) @binding(next) var median_picture: texture_storage_2d<r32float, write>;
//#end
//#if EXPECTED
@group(0) @binding(next) var expected_picture: texture_storage_2d<r32float, write>;
//#end
//#if HITS
@group(0) @binding(next) var<storage, read_write> hits: array<u32>;
//#end
//#if STRONGEST
@group(0) @binding(next) var<storage, read_write> strongest: array<u32>;
//#end
//#if VISIBLE
@group(0) @binding(next) var<storage, read_write> seen_bits: array<atomic<u32>>;
//#end
//#if FEATURES
// By slot, then by pixel: `channels` values each.
@group(0) @binding(next) var<storage, read> features: array<f32>;
@group(0) @binding(next) var<storage, read_write> feature_picture: array<f32>;
//#end
//#if VOTES
// Per mask a byte per pixel, rows one after the other, four pixels a word.
@group(0) @binding(next) var<storage, read> masks: array<u32>;
// Sums of all slots: total, then each mask's.
@group(0) @binding(next) var<storage, read_write> votes: array<atomic<u32>>;
//#end

const BATCH: u32 = TILE * TILE;
// Pixels of a thread.
const LANES: u32 = TILE * TILE / BLEND_THREADS;
// Parts of 8 x 4 pixels, 2 across a tile: neighbouring threads, which go through the same splats.
const PARTS: u32 = 8u;
const PART: vec2<u32> = vec2<u32>(8u, 4u);
const WORDS: u32 = BATCH / 32u;

var<workgroup> range: vec2<u32>;
// Of this batch and the next: whether a pixel has not ended; per part a bit for each splat that reaches it.
var<workgroup> open: array<u32, 2>;
var<workgroup> reached: array<atomic<u32>, 2u * PARTS * WORDS>;
// Of each splat of the batch: mean and (along, shear), then (across, level), z and the slot's bits.
var<workgroup> batch_a: array<vec4<f32>, BATCH>;
var<workgroup> batch_b: array<vec4<f32>, BATCH>;
//#if COLOR
var<workgroup> batch_color: array<vec2<u32>, BATCH>;
//#end
//#if FEATURES
var<workgroup> batch_features: array<vec4<f32>, BATCH>;
//#end
//#if VISIBLE
var<workgroup> batch_seen: array<atomic<u32>, BATCH / 32u>;
//#end
//#if VOTES
// Fits: 256 pixels * 65536 * 0.99 * 255 is below 2^32.
var<workgroup> batch_total: array<atomic<u32>, BATCH>;
var<workgroup> batch_inside: array<atomic<u32>, BATCH * VOTE_MASKS>;

// Adds to a sum of two words.
fn add_wide(at: u32, value: u32) {
    if value != 0u {
        let before = atomicAdd(&votes[2u * at], value);
        if before + value < before {
            atomicAdd(&votes[2u * at + 1u], 1u);
        }
    }
}

fn mask_value(mask: u32, pixel: u32) -> u32 {
    let at = (blend.mask + mask) * ((blend.size.x * blend.size.y + 3u) / 4u) + pixel / 4u;
    return masks[at] >> (8u * (pixel % 4u)) & 255u;
}
//#end

// Least power by which the splat is weaker in a rectangle than at its mean; coordinates relative to that.
fn least_fall(a: vec4<f32>, across: f32, lean: f32, low: vec2<f32>, high: vec2<f32>) -> f32 {
    // It is on one of the (at most two) edges that face the mean, or 0 inside.
    let near = clamp(vec2<f32>(0.0), low, high);
    return min(
        fall(a, across, vec2<f32>(near.x, clamp(near.x * lean, low.y, high.y))),
        fall(a, across, vec2<f32>(clamp(near.y * a.w, low.x, high.x), near.y)),
    );
}

fn fall(a: vec4<f32>, across: f32, d: vec2<f32>) -> f32 {
    let e = a.z * (d.x - a.w * d.y);
    let f = across * d.y;
    return e * e + f * f;
}

// Marks the parts of the tile that a splat reaches.
fn mark(k: u32, words: u32, corner: vec2<u32>, a: vec4<f32>, b: vec2<f32>) {
    let reach = b.y + LEVELS + MARGIN;
    let ratio = b.x / a.z;
    // Where on a column the splat is strongest.
    let lean = a.w / (ratio * ratio + a.w * a.w);
    let first = vec2<f32>(corner) + 0.5 - a.xy;
    for (var part = 0u; part < PARTS; part++) {
        let low = first + vec2<f32>(PART * vec2<u32>(part % 2u, part / 2u));
        if !(least_fall(a, b.x, lean, low, low + vec2<f32>(PART - 1u)) > reach) {
            atomicOr(&reached[words + part * WORDS + k / 32u], 1u << (k % 32u));
        }
    }
}

@compute @workgroup_size(BLEND_THREADS)
fn blend_tile(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = folded(group);
    let corner = vec2<u32>(tile % blend.tiles_across, tile / blend.tiles_across) * TILE;
    let part = thread / 8u;
    // The first of the thread's pixels.
    let at = corner + PART * vec2<u32>(part % 2u, part / 2u) + vec2<u32>(thread % 2u * LANES, thread / 2u % 4u);
    let across = vec4<u32>(at.x) + vec4<u32>(0u, 1u, 2u, 3u);
    let inside = (across < vec4<u32>(blend.size.x)) & vec4<bool>(tile < blend.tiles && at.y < blend.size.y);
    let pixel = at.y * blend.size.x + at.x;
    let center_x = vec4<f32>(across) + 0.5;
    let center_y = f32(at.y) + 0.5;
    if thread == 0u {
        open[0] = 0u;
        range = vec2<u32>(0u);
        if tile < blend.tiles {
            range = tile_ranges[tile];
        }
    }
    atomicStore(&reached[thread], 0u);
    let pairs = workgroupUniformLoad(&range);
    // Which half of the marks is in use.
    var phase = 0u;

    var t = vec4<f32>(1.0);
    var live = inside;
//#if LIMIT
    var farthest = vec4<f32>(0.0);
    for (var i = 0u; i < LANES; i++) {
        if inside[i] {
            farthest[i] = textureLoad(limit, vec2<u32>(across[i], at.y), 0).x;
        }
    }
//#end
//#if COLOR
    var red = vec4<f32>(0.0);
    var green = vec4<f32>(0.0);
    var blue = vec4<f32>(0.0);
//#end
//#if MEDIAN
    var median = vec4<f32>(bitcast<f32>(blend.none));
//#end
//#if EXPECTED
    var depth_sum = vec4<f32>(0.0);
//#end
//#if HITS
    var hit = vec4<u32>(NO_ID);
//#end
//#if STRONGEST
    var strong = vec4<u32>(NO_ID);
    var largest = vec4<f32>(0.0);
//#end
//#if FEATURES
    var feature_sums: array<vec4<f32>, LANES>;
//#end
//#if VOTES
    var mask: array<vec4<u32>, VOTE_MASKS>;
    for (var m = 0u; m < blend.masks; m++) {
        for (var i = 0u; i < LANES; i++) {
            if inside[i] {
                mask[m][i] = mask_value(m, pixel + i);
            }
        }
    }
//#end

    for (var begin = pairs.x; begin < pairs.y; begin += BATCH) {
        // The batch before is no longer read once all threads are here.
        workgroupBarrier();
        let words = phase * PARTS * WORDS;
        atomicStore(&reached[(1u - phase) * PARTS * WORDS + thread], 0u);
        if thread == 0u {
            open[1u - phase] = 0u;
        }
        if any(live) {
            // Whichever thread is last writes the same.
            open[phase] = 1u;
        }
        let count = min(pairs.y - begin, BATCH);
        for (var k = thread; k < count; k += BLEND_THREADS) {
            let slot = pair_slots[begin + k];
            var depth = 0.0;
//#if DEPTH
            depth = z[slot];
//#end
            let a = vec4<f32>(mean[slot], shape_a[slot]);
            let b = shape_b[slot];
            batch_a[k] = a;
            batch_b[k] = vec4<f32>(b, depth, bitcast<f32>(slot));
            mark(k, words, corner, a, b);
//#if COLOR
            batch_color[k] = color[slot];
//#end
//#if FEATURES
            var values = vec4<f32>(0.0);
            let first = slot * blend.channels + blend.channel;
            for (var c = 0u; c < min(blend.channels - blend.channel, 4u); c++) {
                values[c] = features[first + c];
            }
            batch_features[k] = values;
//#end
//#if VOTES
            atomicStore(&batch_total[k], 0u);
            for (var m = 0u; m < blend.masks; m++) {
                atomicStore(&batch_inside[m * BATCH + k], 0u);
            }
//#end
        }
//#if VISIBLE
        if thread < BATCH / 32u {
            atomicStore(&batch_seen[thread], 0u);
        }
//#end
        if workgroupUniformLoad(&open[phase]) == 0u {
            break;
        }
        for (var w = 0u; w < WORDS && any(live); w++) {
            var bits = atomicLoad(&reached[words + part * WORDS + w]);
            while bits != 0u {
                let k = 32u * w + firstTrailingBit(bits);
                bits &= bits - 1u;
                let a = batch_a[k];
                let b = batch_b[k];
                let dy = center_y - a.y;
                let e = a.z * (center_x - (a.x + a.w * dy));
                let f = b.x * dy;
                let alpha = min(exp2(b.y - f * f - e * e), vec4<f32>(LARGEST_ALPHA));
//#if LIMIT
                // What comes later is deeper still: the pixel ends.
                live = live & (vec4<f32>(b.z) < farthest);
//#end
                var drawn = live & (alpha >= vec4<f32>(SMALLEST_ALPHA));
                if !any(drawn) {
                    continue;
                }
                let after = t - alpha * t;
                let ends = drawn & (after < vec4<f32>(LEAST_TRANSMITTANCE));
                live = live & !ends;
                drawn = drawn & !ends;
                let weight = select(vec4<f32>(0.0), alpha * t, drawn);
//#if COLOR
                let packed = batch_color[k];
                let rg = unpack2x16float(packed.x);
                red += weight * rg.x;
                green += weight * rg.y;
                blue += weight * unpack2x16float(packed.y).x;
//#end
//#if MEDIAN
                median = select(median, vec4<f32>(b.z), drawn & (t > vec4<f32>(0.5)) & (after <= vec4<f32>(0.5)));
//#end
//#if EXPECTED
                depth_sum += weight * b.z;
//#end
//#if HITS
                let falls = drawn & (t > vec4<f32>(blend.hit)) & (after <= vec4<f32>(blend.hit));
                hit = select(hit, vec4<u32>(bitcast<u32>(b.w)), falls);
//#end
//#if STRONGEST
                strong = select(strong, vec4<u32>(bitcast<u32>(b.w)), weight > largest);
                largest = max(largest, weight);
//#end
//#if VISIBLE
                if any(weight > vec4<f32>(blend.unseen)) {
                    atomicOr(&batch_seen[k / 32u], 1u << (k % 32u));
                }
//#end
//#if FEATURES
                let values = batch_features[k];
                for (var i = 0u; i < LANES; i++) {
                    feature_sums[i] += weight[i] * values;
                }
//#end
//#if VOTES
                // To even at ties, as the CPU rounds.
                let units = vec4<u32>(round(weight * VOTE_SCALE));
                atomicAdd(&batch_total[k], units.x + units.y + units.z + units.w);
                for (var m = 0u; m < blend.masks; m++) {
                    let votes_for = units * mask[m];
                    atomicAdd(&batch_inside[m * BATCH + k], votes_for.x + votes_for.y + votes_for.z + votes_for.w);
                }
//#end
                t = select(t, after, drawn);
                if !any(live) {
                    break;
                }
            }
        }
        phase = 1u - phase;
//#if SUMS
        workgroupBarrier();
        for (var k = thread; k < count; k += BLEND_THREADS) {
            let slot = bitcast<u32>(batch_b[k].w);
//#if VISIBLE
            if (atomicLoad(&batch_seen[k / 32u]) >> (k % 32u) & 1u) != 0u {
                atomicOr(&seen_bits[slot / 32u], 1u << (slot % 32u));
            }
//#end
//#if VOTES
            if blend.mask == 0u {
                add_wide(slot, atomicLoad(&batch_total[k]));
            }
            for (var m = 0u; m < blend.masks; m++) {
                add_wide((1u + blend.mask + m) * blend.slots + slot, atomicLoad(&batch_inside[m * BATCH + k]));
            }
//#end
        }
//#end
    }
    for (var i = 0u; i < LANES; i++) {
        if !inside[i] {
            break;
        }
        let place = vec2<u32>(across[i], at.y);
//#if COLOR
        textureStore(color_picture, place, vec4<f32>(red[i], green[i], blue[i], 1.0 - t[i]));
//#end
//#if MEDIAN
        textureStore(median_picture, place, vec4<f32>(median[i], 0.0, 0.0, 0.0));
//#end
//#if EXPECTED
        var expected = bitcast<f32>(blend.none);
        if 1.0 - t[i] > LEAST_WEIGHT {
            expected = depth_sum[i] / (1.0 - t[i]);
        }
        textureStore(expected_picture, place, vec4<f32>(expected, 0.0, 0.0, 0.0));
//#end
//#if HITS
        hits[pixel + i] = hit[i];
//#end
//#if STRONGEST
        strongest[pixel + i] = strong[i];
//#end
//#if FEATURES
        let first = (pixel + i) * blend.channels + blend.channel;
        for (var c = 0u; c < min(blend.channels - blend.channel, 4u); c++) {
            feature_picture[first + c] = feature_sums[i][c];
        }
//#end
    }
}
