// Keys of the splats that may be seen, from the front, in order of slots.
//
// In: `z` by slot, 0 where culled. count_visible: how many each block of BLOCK slots has. compact_visible, after an exclusive
// sum of those: `keys` (bits of z, which rise with z) and `values` (slots). Groups of BLOCK threads, a thread per slot.
// Rust twin: `compact_slow` in gpu/compact.rs.

struct CompactParams {
    slots: u32,
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
}

@group(0) @binding(0) var<uniform> compact: CompactParams;
@group(0) @binding(1) var<storage, read> z: array<f32>;
@group(0) @binding(2) var<storage, read_write> block_counts: array<u32>;

// Of each row of 32 threads: a bit per thread with a visible splat.
var<workgroup> rows: array<atomic<u32>, BLOCK / 32u>;

fn visible(slot: u32) -> bool {
    return slot < compact.slots && z[min(slot, compact.slots - 1u)] > 0.0;
}

// Marks what the threads see; ends with a barrier.
fn mark(thread: u32, seen: bool) {
    if thread < BLOCK / 32u {
        atomicStore(&rows[thread], 0u);
    }
    workgroupBarrier();
    if seen {
        atomicOr(&rows[thread / 32u], 1u << (thread % 32u));
    }
    workgroupBarrier();
}

//#if COUNT
@compute @workgroup_size(BLOCK)
fn count_visible(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = folded(group);
    mark(thread, visible(block * BLOCK + thread));
    // Blocks without slots too: the sum is over all that there is room for.
    if thread == 0u && block < arrayLength(&block_counts) {
        var count = 0u;
        for (var row = 0u; row < BLOCK / 32u; row++) {
            count += countOneBits(atomicLoad(&rows[row]));
        }
        block_counts[block] = count;
    }
}
//#else
@group(0) @binding(3) var<storage, read_write> keys: array<u32>;
@group(0) @binding(4) var<storage, read_write> values: array<u32>;

@compute @workgroup_size(BLOCK)
fn compact_visible(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let block = folded(group);
    let slot = block * BLOCK + thread;
    let seen = visible(slot);
    mark(thread, seen);
    if seen {
        var place = block_counts[block] + countOneBits(atomicLoad(&rows[thread / 32u]) & ((1u << (thread % 32u)) - 1u));
        for (var row = 0u; row < thread / 32u; row++) {
            place += countOneBits(atomicLoad(&rows[row]));
        }
        keys[place] = bitcast<u32>(z[slot]);
        values[place] = slot;
    }
}
//#end
