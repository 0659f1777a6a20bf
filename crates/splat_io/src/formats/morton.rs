//! Order along a Z curve: neighbours in space become neighbours in the file.

use glam::Vec3;
use rayon::prelude::*;

/// Bits per axis; three of them fill a 64-bit code.
const BITS: u32 = 21;

/// Ids sorted by their cell on a grid of 2^21 cells a side over the box of all finite means; equal cells by id.
pub(crate) fn order(means: &[Vec3]) -> Vec<u32> {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let grow = |(low, high): (Vec3, Vec3), v: &Vec3| {
        if v.is_finite() { (low.min(*v), high.max(*v)) } else { (low, high) }
    };
    let join = |a: (Vec3, Vec3), b: (Vec3, Vec3)| (a.0.min(b.0), a.1.max(b.1));
    let (low, high) = means.par_iter().with_min_len(1 << 14).fold(|| empty, grow).reduce(|| empty, join);
    let cells = (1u32 << BITS) as f32 - 1.0;
    let extent = (high - low).max(Vec3::splat(f32::MIN_POSITIVE));
    let mut codes: Vec<(u64, u32)> = means
        .par_iter()
        .enumerate()
        .with_min_len(1 << 14)
        .map(|(id, &mean)| {
            // A NaN becomes cell 0.
            let cell = ((mean - low) / extent * cells).to_array().map(|v| spread(v as u32));
            (cell[0] | cell[1] << 1 | cell[2] << 2, id as u32)
        })
        .collect();
    codes.par_sort_unstable();
    codes.into_par_iter().map(|(_, id)| id).collect()
}

/// Puts two zero bits after each of the lower 21 bits.
fn spread(v: u32) -> u64 {
    let mut v = u64::from(v.min((1 << BITS) - 1));
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_visited_in_z_order_and_every_id_once() {
        let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
        let shuffled = [5, 0, 7, 2, 6, 1, 4, 3];
        let means: Vec<Vec3> = shuffled.iter().map(|&i| corner(i)).collect();
        let order = order(&means);
        assert_eq!(order.iter().map(|&i| shuffled[i as usize]).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 6, 7]);
        let odd = [Vec3::NAN, Vec3::splat(1e30), Vec3::splat(f32::INFINITY), Vec3::ZERO, Vec3::ZERO];
        let mut ids = super::order(&odd);
        ids.sort_unstable();
        assert_eq!(ids, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn spreading_keeps_every_bit_apart() {
        for bit in 0..BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
    }
}
