//! Pictures of frames: 8-bit colours from what the rasteriser gives.

use splat_core::Mask2d;
use splat_core::glam::Vec3;
use splat_raster::Frame;

/// Colour over which half-transparent pixels are shown: 0..=1 per channel, sRGB-encoded.
pub(crate) type Background = [f32; 3];

fn byte(v: f32) -> u8 {
    // NaN becomes 0 in this conversion.
    (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Red, green, blue over a background. `color`: premultiplied, as in [`Frame::color`].
pub(crate) fn over(color: &[[f32; 4]], background: Background) -> Vec<u8> {
    let pixel = |c: &[f32; 4]| std::array::from_fn::<u8, 3, _>(|k| byte(c[k] + (1.0 - c[3]) * background[k]));
    color.iter().flat_map(pixel).collect()
}

/// Red, green, blue, alpha, not premultiplied.
pub(crate) fn cut_out(color: &[[f32; 4]]) -> Vec<u8> {
    let pixel = |c: &[f32; 4]| {
        let k = if c[3] > 0.0 { 1.0 / c[3] } else { 0.0 };
        [byte(c[0] * k), byte(c[1] * k), byte(c[2] * k), byte(c[3])]
    };
    color.iter().flat_map(pixel).collect()
}

/// Alpha as gray.
pub(crate) fn alpha(color: &[[f32; 4]]) -> Vec<u8> {
    color.iter().map(|c| byte(c[3])).collect()
}

/// Least and largest finite value; `None` if there is none.
pub(crate) fn range(values: &[f32]) -> Option<(f32, f32)> {
    let finite = values.iter().copied().filter(|v| v.is_finite());
    finite.fold(None, |range, v| Some(range.map_or((v, v), |(a, b): (f32, f32)| (a.min(v), b.max(v)))))
}

/// Position of a value in a range, 0..=1.
fn share(v: f32, (from, to): (f32, f32)) -> f32 {
    if to > from { (v - from) / (to - from) } else { 0.0 }
}

/// Depth in colours from near (warm) to far (cold); black where there is none.
pub(crate) fn depth_colors(depth: &[f32], range: (f32, f32)) -> Vec<u8> {
    // Even steps of hue with rising and falling brightness, so that neighbours differ and the ends are not confused.
    const RAMP: [[f32; 3]; 8] = [
        [0.50, 0.02, 0.05],
        [0.86, 0.20, 0.06],
        [0.98, 0.55, 0.14],
        [0.90, 0.87, 0.25],
        [0.45, 0.93, 0.35],
        [0.12, 0.78, 0.75],
        [0.20, 0.44, 0.90],
        [0.19, 0.10, 0.36],
    ];
    let pixel = |&d: &f32| {
        if !d.is_finite() {
            return [0; 3];
        }
        let at = share(d, range) * (RAMP.len() - 1) as f32;
        let k = (at as usize).min(RAMP.len() - 2);
        let t = at - k as f32;
        std::array::from_fn::<u8, 3, _>(|c| byte(RAMP[k][c] * (1.0 - t) + RAMP[k + 1][c] * t))
    };
    depth.iter().flat_map(pixel).collect()
}

/// Depth in 16 bits: 1 is the near and 65535 the far end of the range, 0 is none.
pub(crate) fn depth_16(depth: &[f32], range: (f32, f32)) -> Vec<u16> {
    let pixel = |&d: &f32| if d.is_finite() { 1 + (share(d, range) * 65_534.0 + 0.5) as u16 } else { 0 };
    depth.iter().map(pixel).collect()
}

/// One colour per id, the same in every picture; black where there is none.
pub(crate) fn id_colors(ids: &[u32]) -> Vec<u8> {
    ids.iter().flat_map(|&id| if id == Frame::NO_ID { [0; 3] } else { id_color(id) }).collect()
}

/// A colour for an id, never darker than a third.
pub(crate) fn id_color(id: u32) -> [u8; 3] {
    // Any mixing of bits does, as long as neighbours differ: the finaliser of a 64-bit counter-based generator.
    let mut z = (u64::from(id) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z ^= z >> 27;
    std::array::from_fn(|k| 85 + ((z >> (8 * k)) as u8 as u16 * 170 / 255) as u8)
}

/// Normals in camera space (x right, y down, z forward; three per pixel, any length) as colours: red is right, green
/// up, blue towards the viewer; black where less than half is covered.
pub(crate) fn normal_colors(normals: &[f32], color: &[[f32; 4]]) -> Vec<u8> {
    let pixel = |(n, c): (&[f32], &[f32; 4])| match Vec3::from_slice(n).try_normalize() {
        Some(n) if c[3] >= 0.5 => [byte(0.5 + 0.5 * n.x), byte(0.5 - 0.5 * n.y), byte(0.5 - 0.5 * n.z)],
        _ => [0; 3],
    };
    normals.chunks_exact(3).zip(color).flat_map(pixel).collect()
}

/// Tints a picture where a mask is in, in proportion, and draws the mask's edge.
pub(crate) fn tint(picture: &mut [u8], mask: &Mask2d, tint: [u8; 3]) {
    let (width, height) = (mask.width(), mask.height());
    let edge = |x: u32, y: u32| {
        let around = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
        mask.contains(x, y) && around.iter().any(|&(x, y)| x < width && y < height && !mask.contains(x, y))
    };
    for (k, pixel) in picture.chunks_exact_mut(3).enumerate() {
        let (x, y) = (k as u32 % width, k as u32 / width);
        let share = if edge(x, y) { 1.0 } else { 0.5 * f32::from(mask.values()[k]) / 255.0 };
        for (v, t) in pixel.iter_mut().zip(tint) {
            *v = (f32::from(*v) * (1.0 - share) + f32::from(t) * share + 0.5) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn premultiplied_colours_are_laid_over_and_cut_out() {
        let half = [[0.5, 0.25, 0.0, 0.5]];
        assert_eq!(over(&half, [0.0, 0.0, 1.0]), [128, 64, 128]);
        assert_eq!(cut_out(&half), [255, 128, 0, 128]);
        assert_eq!(cut_out(&[[0.0; 4]]), [0; 4]);
        assert_eq!(over(&[[f32::NAN, 2.0, -1.0, 1.0]], [0.0; 3]), [0, 255, 0]);
    }

    #[test]
    fn depth_pictures_keep_none_apart_from_the_nearest() {
        let depth = [1.0, 3.0, f32::NAN, 2.0];
        let range = range(&depth).unwrap();
        assert_eq!(range, (1.0, 3.0));
        assert_eq!(depth_16(&depth, range), [1, 65_535, 0, 32_768]);
        let colors = depth_colors(&depth, range);
        assert_eq!(colors[6..9], [0, 0, 0]);
        assert_ne!(colors[0..3], [0, 0, 0]);
        assert_eq!(depth_16(&[5.0], (5.0, 5.0)), [1]);
    }

    #[test]
    fn ids_next_to_each_other_differ_in_colour() {
        assert!((0..1000).all(|id| id_color(id) != id_color(id + 1)));
        assert_eq!(id_colors(&[Frame::NO_ID]), [0; 3]);
    }
}
