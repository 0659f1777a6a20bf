// Exclusive prefix sums of u32, in place: reduce, then scan.
//
// In: `scan_data`, `scan_counters[count_at]` numbers of it (at most `limit`; no more than `limit` where count_at is NO_PLACE).
// Out: `scan_data[i]` = sum of those before i; the sum of all at `scan_counters[total_at]`. Sums end at 2^32 - 1 and stay there.
// Groups of BLOCK threads for SCAN_BLOCK numbers each; groups beyond the count end at once. No group waits for another.
// Rust twin: `exclusive_sums` in gpu/scan.rs.

struct ScanParams {
    limit: u32,
    count_at: u32,
    total_at: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> scan: ScanParams;
@group(0) @binding(1) var<storage, read_write> scan_data: array<u32>;
// Sum of each block.
@group(0) @binding(2) var<storage, read_write> scan_sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> scan_counters: array<u32>;

const SCAN_ITEMS: u32 = SCAN_BLOCK / BLOCK;
const SCAN_ROWS: u32 = BLOCK / 16u;

var<workgroup> scan_count: u32;
// Of each thread: its numbers, and its share of the blocks before.
var<workgroup> scan_lanes: array<vec2<u32>, BLOCK>;
var<workgroup> scan_rows: array<vec2<u32>, SCAN_ROWS + 1u>;

fn add_saturating(a: u32, b: u32) -> u32 {
    let sum = a + b;
    return select(sum, 0xffffffffu, sum < a);
}

fn add_both(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let sum = a + b;
    return select(sum, vec2<u32>(0xffffffffu), sum < a);
}

// How many numbers there are; the same for all threads.
fn scan_read_count(thread: u32) -> u32 {
    if thread == 0u {
        var count = scan.limit;
        if scan.count_at != NO_PLACE {
            count = min(count, scan_counters[scan.count_at]);
        }
        scan_count = count;
    }
    return workgroupUniformLoad(&scan_count);
}

// Sum of the values of the threads before, and of all: a thread adds up a row of 16, then one the rows.
fn scan_threads(thread: u32, value: vec2<u32>) -> array<vec2<u32>, 2> {
    scan_lanes[thread] = value;
    workgroupBarrier();
    if thread < SCAN_ROWS {
        var sum = vec2<u32>(0u);
        for (var k = thread * 16u; k < thread * 16u + 16u; k++) {
            let here = scan_lanes[k];
            scan_lanes[k] = sum;
            sum = add_both(sum, here);
        }
        scan_rows[thread] = sum;
    }
    workgroupBarrier();
    if thread == 0u {
        var sum = vec2<u32>(0u);
        for (var row = 0u; row < SCAN_ROWS; row++) {
            let here = scan_rows[row];
            scan_rows[row] = sum;
            sum = add_both(sum, here);
        }
        scan_rows[SCAN_ROWS] = sum;
    }
    workgroupBarrier();
    return array<vec2<u32>, 2>(add_both(scan_lanes[thread], scan_rows[thread / 16u]), scan_rows[SCAN_ROWS]);
}

@compute @workgroup_size(BLOCK)
fn scan_reduce(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let block = folded(group);
    let count = scan_read_count(thread);
    if block * SCAN_BLOCK >= count {
        return;
    }
    var sum = 0u;
    for (var j = 0u; j < SCAN_ITEMS; j++) {
        let i = block * SCAN_BLOCK + j * BLOCK + thread;
        if i < count {
            sum = add_saturating(sum, scan_data[i]);
        }
    }
    let sums = scan_threads(thread, vec2<u32>(sum, 0u));
    if thread == 0u {
        scan_sums[block] = sums[1].x;
    }
}

@compute @workgroup_size(BLOCK)
fn scan_blocks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let block = folded(group);
    let count = scan_read_count(thread);
    // The first block writes the total of no numbers at all.
    if block != 0u && block * SCAN_BLOCK >= count {
        return;
    }
    // The blocks before this one: all groups read the same few sums, from the caches.
    var earlier = 0u;
    for (var k = thread; k < block; k += BLOCK) {
        earlier = add_saturating(earlier, scan_sums[k]);
    }
    let first = block * SCAN_BLOCK + thread * SCAN_ITEMS;
    var values: array<u32, SCAN_ITEMS>;
    var sum = 0u;
    for (var j = 0u; j < SCAN_ITEMS; j++) {
        if first + j < count {
            values[j] = scan_data[first + j];
            sum = add_saturating(sum, values[j]);
        }
    }
    let sums = scan_threads(thread, vec2<u32>(sum, earlier));
    var before = add_saturating(sums[0].x, sums[1].y);
    for (var j = 0u; j < SCAN_ITEMS; j++) {
        if first + j < count {
            scan_data[first + j] = before;
            before = add_saturating(before, values[j]);
        }
    }
    if thread == 0u && count <= (block + 1u) * SCAN_BLOCK {
        scan_counters[scan.total_at] = add_saturating(sums[1].x, sums[1].y);
    }
}
