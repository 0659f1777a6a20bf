
// What all stages may use.

// Number of a workgroup of a dispatch that was folded into two dimensions.
fn folded(workgroup: vec3<u32>) -> u32 {
    return workgroup.y * FOLD + workgroup.x;
}

// Size of a folded dispatch of so many workgroups.
fn fold(groups: u32) -> vec3<u32> {
    return vec3<u32>(min(groups, FOLD), (groups + FOLD - 1u) / FOLD, 1u);
}

// Blocks of `BLOCK` that hold so many entries.
fn blocks_of(count: u32) -> u32 {
    return (count + BLOCK - 1u) / BLOCK;
}

