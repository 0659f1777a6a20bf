// One pass of a stable radix sort of keys with values, by a digit of up to 8 bits; the count is read on the GPU.
//
// In: `sort_counters[count_at]` keys (at most `limit`) in `keys_in` with `values_in`. Out: `keys_out`, `values_out`, sorted by
// `key >> shift & mask`, equal digits in the order they had.
// sort_prepare: size of the next two indirect dispatches. sort_histogram: digits of each block. sort_rows: a group per digit,
// sums of that digit in the blocks before. sort_scatter: a block's keys in order of digits, and from there to their places.
// Blocks of SORT_BLOCK keys, BLOCK threads; SUBGROUPS: keys with the same digit are found by ballots, for any size of subgroup.
// No group waits for another. Rust twin: a stable sort by the bits, in gpu/sort.rs.

struct SortParams {
    limit: u32,
    count_at: u32,
    shift: u32,
    mask: u32,
}

@group(0) @binding(0) var<uniform> sort: SortParams;
@group(0) @binding(1) var<storage, read> sort_counters: array<u32>;

//#if PREPARE
@group(0) @binding(2) var<storage, read_write> sort_arguments: array<u32>;

@compute @workgroup_size(1)
fn sort_prepare() {
    let groups = fold((min(sort_counters[sort.count_at], sort.limit) + SORT_BLOCK - 1u) / SORT_BLOCK);
    sort_arguments[0] = groups.x;
    sort_arguments[1] = groups.y;
    sort_arguments[2] = groups.z;
}
//#else
// [digit][block]
@group(0) @binding(2) var<storage, read_write> sort_table: array<u32>;

const DIGITS: u32 = 256u;
const KEYS: u32 = SORT_BLOCK / BLOCK;
// Digit of places beyond the end: with the largest number of the block, they come last.
const BEYOND: u32 = 255u;

fn sort_count() -> u32 {
    return min(sort_counters[sort.count_at], sort.limit);
}

fn sort_blocks() -> u32 {
    return (sort_count() + SORT_BLOCK - 1u) / SORT_BLOCK;
}

// Keys of a block; 0 beyond the end.
fn keys_of(block: u32) -> u32 {
    let first = min(block * SORT_BLOCK, sort_count());
    return min(sort_count() - first, SORT_BLOCK);
}
//#end

//#if HISTOGRAM
@group(0) @binding(3) var<storage, read> keys_in: array<u32>;

// The first digit of depths has a handful of values: threads that would wait for each other at one counter have several.
const COPIES: u32 = 4u;

var<workgroup> histogram: array<atomic<u32>, COPIES * DIGITS>;

@compute @workgroup_size(BLOCK)
fn sort_histogram(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = folded(group);
    let count = keys_of(block);
    for (var k = thread; k < COPIES * DIGITS; k += BLOCK) {
        atomicStore(&histogram[k], 0u);
    }
    workgroupBarrier();
    let copy = (thread % COPIES) * DIGITS;
    for (var i = thread; i < count; i += BLOCK) {
        atomicAdd(&histogram[copy + ((keys_in[block * SORT_BLOCK + i] >> sort.shift) & sort.mask)], 1u);
    }
    workgroupBarrier();
    if count != 0u {
        var sum = 0u;
        for (var k = thread; k < COPIES * DIGITS; k += DIGITS) {
            sum += atomicLoad(&histogram[k]);
        }
        sort_table[thread * sort_blocks() + block] = sum;
    }
}
//#end

//#if SCANS
//#if ROWS
const SCAN_THREADS: u32 = 64u;
const SCAN_WIDTH: u32 = 8u;
//#else
const SCAN_THREADS: u32 = BLOCK;
const SCAN_WIDTH: u32 = 16u;
//#end
const SCAN_ROWS: u32 = SCAN_THREADS / SCAN_WIDTH;

//#if SUBGROUPS
// Of each subgroup, which has 4 threads or more: its sum; and what is before it, at last of all.
var<workgroup> row_totals: array<u32, SCAN_THREADS / 4u>;
var<workgroup> row_sums: array<u32, SCAN_THREADS / 4u + 1u>;

// Sum of the values of the threads before, and of all: by subgroups, then over them.
fn scan_threads(thread: u32, value: u32, size: u32, lane: u32) -> vec2<u32> {
    let rows = SCAN_THREADS / size;
    let before = subgroupExclusiveAdd(value);
    if lane == size - 1u {
        row_totals[thread / size] = before + value;
    }
    workgroupBarrier();
    if thread < rows {
        var sum = 0u;
        for (var row = 0u; row < thread; row++) {
            sum += row_totals[row];
        }
        row_sums[thread] = sum;
        if thread == rows - 1u {
            row_sums[rows] = sum + row_totals[thread];
        }
    }
    workgroupBarrier();
    // No barrier here: the next call has one between what it writes first and what is read here, and one before it writes this.
    return vec2<u32>(before + row_sums[thread / size], row_sums[rows]);
}
//#else
var<workgroup> partial: array<u32, SCAN_THREADS>;
// Of each row of threads what is before it, at last of all.
var<workgroup> row_sums: array<u32, SCAN_ROWS + 1u>;

// Sum of the values of the threads before, and of all: a thread adds up a row, then one the rows.
fn scan_threads(thread: u32, value: u32) -> vec2<u32> {
    partial[thread] = value;
    workgroupBarrier();
    if thread < SCAN_ROWS {
        var sum = 0u;
        for (var k = thread * SCAN_WIDTH; k < (thread + 1u) * SCAN_WIDTH; k++) {
            let here = partial[k];
            partial[k] = sum;
            sum += here;
        }
        row_sums[thread] = sum;
    }
    workgroupBarrier();
    if thread == 0u {
        var sum = 0u;
        for (var row = 0u; row < SCAN_ROWS; row++) {
            let here = row_sums[row];
            row_sums[row] = sum;
            sum += here;
        }
        row_sums[SCAN_ROWS] = sum;
    }
    workgroupBarrier();
    // No barrier here: a thread writes only its own of `partial` before the next call's first barrier.
    return vec2<u32>(partial[thread] + row_sums[thread / SCAN_WIDTH], row_sums[SCAN_ROWS]);
}
//#end
//#end

//#if ROWS
@group(0) @binding(3) var<storage, read_write> sort_totals: array<u32>;

@compute @workgroup_size(SCAN_THREADS)
fn sort_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let blocks = sort_blocks();
    // Each thread has some blocks that follow each other.
    let each = (blocks + SCAN_THREADS - 1u) / SCAN_THREADS;
    let first = group.x * blocks + min(thread * each, blocks);
    let end = group.x * blocks + min((thread + 1u) * each, blocks);
    var sum = 0u;
    for (var i = first; i < end; i++) {
        sum += sort_table[i];
    }
    let sums = scan_threads(thread, sum);
    var before = sums.x;
    for (var i = first; i < end; i++) {
        let here = sort_table[i];
        sort_table[i] = before;
        before += here;
    }
    if thread == 0u {
        sort_totals[group.x] = sums.y;
    }
}
//#end

//#if SCATTER
@group(0) @binding(3) var<storage, read> sort_totals: array<u32>;
@group(0) @binding(4) var<storage, read> keys_in: array<u32>;
@group(0) @binding(5) var<storage, read> values_in: array<u32>;
@group(0) @binding(6) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(7) var<storage, read_write> values_out: array<u32>;

// Digit and number within the block of each key, `digit << 12 | number`, first by number, at last by digit and number.
// In between the same memory holds counters.
//#if SUBGROUPS
var<workgroup> exchange: array<atomic<u32>, SORT_BLOCK>;

fn entry_at(i: u32) -> u32 {
    return atomicLoad(&exchange[i]);
}

fn set_entry(i: u32, value: u32) {
    atomicStore(&exchange[i], value);
}
//#else
var<workgroup> exchange: array<u32, SORT_BLOCK>;

fn entry_at(i: u32) -> u32 {
    return exchange[i];
}

fn set_entry(i: u32, value: u32) {
    exchange[i] = value;
}
//#end
// Of each digit: where in the block it starts; then what leads from there to its place in the output.
var<workgroup> places: array<u32, DIGITS>;

const NUMBER_BITS: u32 = 12u;

fn digit_at(block: u32, i: u32, count: u32) -> u32 {
    if i < count {
        return (keys_in[block * SORT_BLOCK + i] >> sort.shift) & sort.mask;
    }
    return BEYOND;
}

//#if SUBGROUPS
// Rows of counters, two to a word: digit d and digit d + 128. A row is for a subgroup; where subgroups are so small that there
// are more of them than rows, for some that follow each other and take turns.
const ROWS: u32 = 16u;
const ROW_WORDS: u32 = DIGITS / 2u;

// Threads of the subgroup whose key has this digit.
fn same_digit(digit: u32) -> vec4<u32> {
    var same = subgroupBallot(true);
    for (var bit = 0u; bit < 8u; bit++) {
        let one = ((digit >> bit) & 1u) != 0u;
        let ballot = subgroupBallot(one);
        same &= select(~ballot, ballot, one);
    }
    return same;
}

// Bits of the threads below `lane`.
fn below(lane: u32) -> vec4<u32> {
    let bits = vec4<i32>(i32(lane)) - vec4<i32>(0, 32, 64, 96);
    let some = (vec4<u32>(1u) << vec4<u32>(clamp(bits, vec4<i32>(0), vec4<i32>(31)))) - 1u;
    return select(some, vec4<u32>(0xffffffffu), bits >= vec4<i32>(32));
}

fn ones(bits: vec4<u32>) -> u32 {
    let counts = countOneBits(bits);
    return counts.x + counts.y + counts.z + counts.w;
}

fn first_lane(bits: vec4<u32>) -> u32 {
    if bits.x != 0u { return firstTrailingBit(bits.x); }
    if bits.y != 0u { return 32u + firstTrailingBit(bits.y); }
    if bits.z != 0u { return 64u + firstTrailingBit(bits.z); }
    return 96u + firstTrailingBit(bits.w);
}

// Fills `exchange` with the block's keys in order of digits.
fn order(block: u32, count: u32, subgroup: u32, size: u32, lane: u32) {
    let thread = subgroup * size + lane;
    let turns = max(BLOCK / size / ROWS, 1u);
    let row = subgroup / turns * ROW_WORDS;
    for (var k = thread; k < ROWS * ROW_WORDS; k += BLOCK) {
        set_entry(k, 0u);
    }
    workgroupBarrier();
    // Digit and rank among the equal digits of the row.
    var entries: array<u32, KEYS>;
    for (var turn = 0u; turn < turns; turn++) {
        if subgroup % turns == turn {
            for (var j = 0u; j < KEYS; j++) {
                let digit = digit_at(block, (subgroup * KEYS + j) * size + lane, count);
                let same = same_digit(digit);
                let rank = ones(same & below(lane));
                let half = (digit / ROW_WORDS) * 16u;
                var before = 0u;
                if rank == 0u {
                    before = atomicAdd(&exchange[row + digit % ROW_WORDS], ones(same) << half);
                }
                before = (subgroupShuffle(before, first_lane(same)) >> half) & 0xffffu;
                entries[j] = (digit << NUMBER_BITS) | (before + rank);
            }
        }
        workgroupBarrier();
    }
    // Sums over the rows, then over the digits. A thread has two digits, or none.
    var sums = 0u;
    if thread < ROW_WORDS {
        for (var k = thread; k < ROWS * ROW_WORDS; k += ROW_WORDS) {
            let here = entry_at(k);
            set_entry(k, sums);
            sums += here;
        }
    }
    let lower = scan_threads(thread, sums, size, lane);
    if thread < ROW_WORDS {
        places[thread] = lower.x & 0xffffu;
        places[thread + ROW_WORDS] = (lower.y & 0xffffu) + (lower.x >> 16u);
    }
    workgroupBarrier();
    for (var j = 0u; j < KEYS; j++) {
        let digit = entries[j] >> NUMBER_BITS;
        let half = (digit / ROW_WORDS) * 16u;
        let earlier = (entry_at(row + digit % ROW_WORDS) >> half) & 0xffffu;
        entries[j] += places[digit] + earlier;
    }
    workgroupBarrier();
    for (var j = 0u; j < KEYS; j++) {
        let number = (subgroup * KEYS + j) * size + lane;
        let place = entries[j] & ((1u << NUMBER_BITS) - 1u);
        set_entry(place, ((entries[j] >> NUMBER_BITS) << NUMBER_BITS) | number);
    }
    workgroupBarrier();
}
//#else
// Fills `exchange` with the block's keys in order of digits: by their lower four bits, then by their upper four. Each thread
// counts the digits of KEYS consecutive entries, two counters to a word: digit d and digit d + 8.
fn order(block: u32, count: u32, thread: u32) {
    for (var i = thread; i < SORT_BLOCK; i += BLOCK) {
        set_entry(i, (digit_at(block, i, count) << NUMBER_BITS) | i);
    }
    workgroupBarrier();
    for (var shift = NUMBER_BITS; shift < NUMBER_BITS + 8u; shift += 4u) {
        var entries: array<u32, KEYS>;
        for (var j = 0u; j < KEYS; j++) {
            entries[j] = entry_at(thread * KEYS + j);
        }
        workgroupBarrier();
        for (var k = 0u; k < 8u; k++) {
            set_entry(k * BLOCK + thread, 0u);
        }
        for (var j = 0u; j < KEYS; j++) {
            let digit = (entries[j] >> shift) & 15u;
            let counter = (digit & 7u) * BLOCK + thread;
            let half = (digit >> 3u) * 16u;
            let counts = entry_at(counter);
            set_entry(counter, counts + (1u << half));
            entries[j] |= ((counts >> half) & 0xffffu) << (NUMBER_BITS + 8u);
        }
        workgroupBarrier();
        var sum = 0u;
        for (var k = 0u; k < 8u; k++) {
            sum += entry_at(thread * 8u + k);
        }
        let sums = scan_threads(thread, sum);
        // The upper digits come after all of the lower ones.
        var before = sums.x + (sums.y << 16u);
        for (var k = 0u; k < 8u; k++) {
            let here = entry_at(thread * 8u + k);
            set_entry(thread * 8u + k, before);
            before += here;
        }
        workgroupBarrier();
        for (var j = 0u; j < KEYS; j++) {
            let digit = (entries[j] >> shift) & 15u;
            let half = (digit >> 3u) * 16u;
            let earlier = (entry_at((digit & 7u) * BLOCK + thread) >> half) & 0xffffu;
            entries[j] += earlier << (NUMBER_BITS + 8u);
        }
        workgroupBarrier();
        for (var j = 0u; j < KEYS; j++) {
            let place = entries[j] >> (NUMBER_BITS + 8u);
            set_entry(place, entries[j] & ((1u << (NUMBER_BITS + 8u)) - 1u));
        }
        workgroupBarrier();
    }
}
//#end

@compute @workgroup_size(BLOCK)
fn sort_scatter(
    @builtin(workgroup_id) group: vec3<u32>,
//#if SUBGROUPS
    @builtin(subgroup_id) subgroup: u32,
    @builtin(num_subgroups) subgroups: u32,
    @builtin(subgroup_invocation_id) lane: u32,
//#else
    @builtin(local_invocation_index) thread: u32,
//#end
) {
    let block = folded(group);
    let count = keys_of(block);
//#if SUBGROUPS
    // Not `subgroup_size`: drivers may report a larger one than they use.
    let size = BLOCK / subgroups;
    let thread = subgroup * size + lane;
    order(block, count, subgroup, size, lane);
//#else
    order(block, count, thread);
//#end
    for (var i = thread; i < count; i += BLOCK) {
        let digit = entry_at(i) >> NUMBER_BITS;
        if i == 0u || entry_at(i - 1u) >> NUMBER_BITS != digit {
            places[digit] = i;
        }
    }
//#if SUBGROUPS
    let start = scan_threads(thread, sort_totals[thread], size, lane).x;
//#else
    let start = scan_threads(thread, sort_totals[thread]).x;
//#end
    if count != 0u {
        places[thread] = start + sort_table[thread * sort_blocks() + block] - places[thread];
    }
    workgroupBarrier();
    // Neighbours in `exchange` are neighbours in the output: whole lines are written. Reads are from the block's few lines.
    for (var i = thread; i < count; i += BLOCK) {
        let entry = entry_at(i);
        let source = block * SORT_BLOCK + (entry & ((1u << NUMBER_BITS) - 1u));
        let place = places[entry >> NUMBER_BITS] + i;
        keys_out[place] = keys_in[source];
        values_out[place] = values_in[source];
    }
}
//#end
