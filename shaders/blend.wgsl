// The splats of a tile, front to back, into its pixels.
//
// In: `pair_slots` of each tile between `tile_ranges`, in order of depth; `mean`, `shape_a`, `shape_b`, `color`, `z` by slot.
// Out, by switches: COLOR, MEDIAN, EXPECTED (pictures); HITS, STRONGEST (slots per pixel); VISIBLE (a bit per slot);
// FEATURES (four channels a dispatch); VOTES (up to VOTE_MASKS masks a dispatch; sums as two words, the low one first).
// DEPTH goes with MEDIAN, EXPECTED and LIMIT, SUMS with VISIBLE and VOTES; WIDE: colours as f32.
// LIMIT: what is at or beyond a pixel's limit adds nothing to it.
// A group of TILE x TILE threads per tile, a thread per pixel. CPU twin: cpu/blend.rs; slow twin: the tests of gpu/blend.rs.

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
// Squares of 4 x 4 pixels, 4 across a tile: neighbouring threads, which go through the same splats.
const SQUARES: u32 = 16u;
const SQUARE: u32 = 4u;
const WORDS: u32 = BATCH / 32u;

var<workgroup> range: vec2<u32>;
// Of this batch and the next: whether a pixel has not ended; per square a bit for each splat that reaches it.
var<workgroup> open: array<u32, 2>;
var<workgroup> reached: array<atomic<u32>, 2u * SQUARES * WORDS>;
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

// Marks the squares of the tile that a splat reaches.
fn mark(k: u32, words: u32, corner: vec2<u32>, a: vec4<f32>, b: vec2<f32>) {
    let reach = b.y + LEVELS + MARGIN;
    let ratio = b.x / a.z;
    // Where on a column the splat is strongest.
    let lean = a.w / (ratio * ratio + a.w * a.w);
    let first = vec2<f32>(corner) + 0.5 - a.xy;
    for (var square = 0u; square < SQUARES; square++) {
        let low = first + f32(SQUARE) * vec2<f32>(f32(square % 4u), f32(square / 4u));
        if !(least_fall(a, b.x, lean, low, low + f32(SQUARE - 1u)) > reach) {
            atomicOr(&reached[words + square * WORDS + k / 32u], 1u << (k % 32u));
        }
    }
}

@compute @workgroup_size(TILE * TILE)
fn blend_tile(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = folded(group);
    let corner = vec2<u32>(tile % blend.tiles_across, tile / blend.tiles_across) * TILE;
    let square = thread / (SQUARE * SQUARE);
    let at = corner + SQUARE * vec2<u32>(square % 4u, square / 4u) + vec2<u32>(thread % 4u, thread / 4u % 4u);
    let inside = tile < blend.tiles && at.x < blend.size.x && at.y < blend.size.y;
    let pixel = at.y * blend.size.x + at.x;
    let center = vec2<f32>(at) + 0.5;
    if thread == 0u {
        open[0] = 0u;
        range = vec2<u32>(0u);
        if tile < blend.tiles {
            range = tile_ranges[tile];
        }
    }
    if thread < SQUARES * WORDS {
        atomicStore(&reached[thread], 0u);
    }
    let pairs = workgroupUniformLoad(&range);
    // Which half of the marks is in use.
    var phase = 0u;

    var t = 1.0;
    var ended = !inside;
//#if LIMIT
    var farthest = 0.0;
    if inside {
        farthest = textureLoad(limit, at, 0).x;
    }
//#end
//#if COLOR
    var sum = vec3<f32>(0.0);
//#end
//#if MEDIAN
    var median = bitcast<f32>(blend.none);
//#end
//#if EXPECTED
    var depth_sum = 0.0;
//#end
//#if HITS
    var hit = NO_ID;
//#end
//#if STRONGEST
    var strong = NO_ID;
    var largest = 0.0;
//#end
//#if FEATURES
    var feature_sum = vec4<f32>(0.0);
//#end
//#if VOTES
    var mask: array<u32, VOTE_MASKS>;
    if inside {
        for (var m = 0u; m < blend.masks; m++) {
            mask[m] = mask_value(m, pixel);
        }
    }
//#end

    for (var begin = pairs.x; begin < pairs.y; begin += BATCH) {
        // The batch before is no longer read once all threads are here.
        workgroupBarrier();
        let words = phase * SQUARES * WORDS;
        if thread < SQUARES * WORDS {
            atomicStore(&reached[(1u - phase) * SQUARES * WORDS + thread], 0u);
        }
        if thread == 0u {
            open[1u - phase] = 0u;
        }
        if !ended {
            // Whichever thread is last writes the same.
            open[phase] = 1u;
        }
        let count = min(pairs.y - begin, BATCH);
        var slot = 0u;
        if thread < count {
            slot = pair_slots[begin + thread];
            var depth = 0.0;
//#if DEPTH
            depth = z[slot];
//#end
            let a = vec4<f32>(mean[slot], shape_a[slot]);
            let b = shape_b[slot];
            batch_a[thread] = a;
            batch_b[thread] = vec4<f32>(b, depth, bitcast<f32>(slot));
            mark(thread, words, corner, a, b);
//#if COLOR
            batch_color[thread] = color[slot];
//#end
//#if FEATURES
            var values = vec4<f32>(0.0);
            let first = slot * blend.channels + blend.channel;
            for (var c = 0u; c < min(blend.channels - blend.channel, 4u); c++) {
                values[c] = features[first + c];
            }
            batch_features[thread] = values;
//#end
        }
//#if VISIBLE
        if thread < BATCH / 32u {
            atomicStore(&batch_seen[thread], 0u);
        }
//#end
//#if VOTES
        atomicStore(&batch_total[thread], 0u);
        for (var m = 0u; m < blend.masks; m++) {
            atomicStore(&batch_inside[m * BATCH + thread], 0u);
        }
//#end
        if workgroupUniformLoad(&open[phase]) == 0u {
            break;
        }
        for (var w = 0u; w < WORDS && !ended; w++) {
            var bits = atomicLoad(&reached[words + square * WORDS + w]);
            while bits != 0u {
                let k = 32u * w + firstTrailingBit(bits);
                bits &= bits - 1u;
                let a = batch_a[k];
                let b = batch_b[k];
//#if LIMIT
                if b.z >= farthest {
                    continue;
                }
//#end
                let d = center - a.xy;
                let e = a.z * (d.x - a.w * d.y);
                let f = b.x * d.y;
                let alpha = min(exp2(b.y - e * e - f * f), LARGEST_ALPHA);
                if !(alpha >= SMALLEST_ALPHA) {
                    continue;
                }
                let after = t - alpha * t;
                if after < LEAST_TRANSMITTANCE {
                    ended = true;
                    break;
                }
                let weight = alpha * t;
//#if COLOR
                let packed = batch_color[k];
                sum += weight * vec3<f32>(unpack2x16float(packed.x), unpack2x16float(packed.y).x);
//#end
//#if MEDIAN
                if t > 0.5 && after <= 0.5 {
                    median = b.z;
                }
//#end
//#if EXPECTED
                depth_sum += weight * b.z;
//#end
//#if HITS
                if t > blend.hit && after <= blend.hit {
                    hit = bitcast<u32>(b.w);
                }
//#end
//#if STRONGEST
                if weight > largest {
                    largest = weight;
                    strong = bitcast<u32>(b.w);
                }
//#end
//#if VISIBLE
                if weight > blend.unseen {
                    atomicOr(&batch_seen[k / 32u], 1u << (k % 32u));
                }
//#end
//#if FEATURES
                feature_sum += weight * batch_features[k];
//#end
//#if VOTES
                let unit = u32(weight * VOTE_SCALE + 0.5);
                atomicAdd(&batch_total[k], unit);
                for (var m = 0u; m < blend.masks; m++) {
                    if mask[m] != 0u {
                        atomicAdd(&batch_inside[m * BATCH + k], unit * mask[m]);
                    }
                }
//#end
                t = after;
            }
        }
        phase = 1u - phase;
//#if SUMS
        workgroupBarrier();
        if thread < count {
//#if VISIBLE
            if (atomicLoad(&batch_seen[thread / 32u]) >> (thread % 32u) & 1u) != 0u {
                atomicOr(&seen_bits[slot / 32u], 1u << (slot % 32u));
            }
//#end
//#if VOTES
            if blend.mask == 0u {
                add_wide(slot, atomicLoad(&batch_total[thread]));
            }
            for (var m = 0u; m < blend.masks; m++) {
                add_wide((1u + blend.mask + m) * blend.slots + slot, atomicLoad(&batch_inside[m * BATCH + thread]));
            }
//#end
        }
//#end
    }
    if !inside {
        return;
    }
//#if COLOR
    textureStore(color_picture, at, vec4<f32>(sum, 1.0 - t));
//#end
//#if MEDIAN
    textureStore(median_picture, at, vec4<f32>(median, 0.0, 0.0, 0.0));
//#end
//#if EXPECTED
    var expected = bitcast<f32>(blend.none);
    if 1.0 - t > LEAST_WEIGHT {
        expected = depth_sum / (1.0 - t);
    }
    textureStore(expected_picture, at, vec4<f32>(expected, 0.0, 0.0, 0.0));
//#end
//#if HITS
    hits[pixel] = hit;
//#end
//#if STRONGEST
    strongest[pixel] = strong;
//#end
//#if FEATURES
    let first = pixel * blend.channels + blend.channel;
    for (var c = 0u; c < min(blend.channels - blend.channel, 4u); c++) {
        feature_picture[first + c] = feature_sum[c];
    }
//#end
}
