//! Random numbers that are a function of a seed and a place, so that work can stop and go on anywhere.

/// SplitMix64 (Steele, Lea, Flood 2014) of one counter.
pub(super) fn bits(seed: u64, stream: u64, k: u64) -> u64 {
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let base = mix(seed ^ mix(stream.wrapping_add(0x9e37_79b9_7f4a_7c15)));
    mix(base.wrapping_add((k.wrapping_add(1)).wrapping_mul(0x9e37_79b9_7f4a_7c15)))
}

/// 0..1.
pub(super) fn unit(seed: u64, stream: u64, k: u64) -> f64 {
    (bits(seed, stream, k) >> 11) as f64 / (1_u64 << 53) as f64
}
