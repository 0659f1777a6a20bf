//! sRGB and CIE Lab (D65, 2 degrees).

use glam::Vec3;

/// CIE Lab (L 0..=100, a and b about -100..=100) of an sRGB-encoded colour (0..=1 per channel; values outside are
/// extrapolated by the same formulas).
pub fn lab_from_srgb(srgb: Vec3) -> Vec3 {
    let [r, g, b] = srgb.to_array().map(linear_from_encoded);
    // IEC 61966-2-1 primaries, divided by the D65 white point.
    let x = (0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b) / 0.950_47;
    let y = 0.212_672_9 * r + 0.715_152_2 * g + 0.072_175 * b;
    let z = (0.019_333_9 * r + 0.119_192 * g + 0.950_304_1 * b) / 1.088_83;
    let [x, y, z] = [x, y, z].map(|t| if t > 0.008_856_452 { t.cbrt() } else { 7.787_037 * t + 16.0 / 116.0 });
    Vec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// sRGB-encoded colour of a CIE Lab one; the inverse of [`lab_from_srgb`]. Colours that sRGB lacks come out beyond 0..=1.
pub fn srgb_from_lab(lab: Vec3) -> Vec3 {
    let y = (lab.x + 16.0) / 116.0;
    let [x, y, z] = [y + lab.y / 500.0, y, y - lab.z / 200.0]
        .map(|t| if t > 0.206_896_55 { t * t * t } else { (t - 16.0 / 116.0) / 7.787_037 });
    let (x, z) = (x * 0.950_47, z * 1.088_83);
    Vec3::new(
        encoded_from_linear(3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z),
        encoded_from_linear(-0.969_266 * x + 1.876_010_8 * y + 0.041_556 * z),
        encoded_from_linear(0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z),
    )
}

/// Linear light of one sRGB-encoded channel.
pub fn linear_from_encoded(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// sRGB encoding of one channel of linear light.
pub fn encoded_from_linear(v: f32) -> f32 {
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_colors_have_their_known_lab() {
        for (srgb, lab) in [
            ([1.0, 1.0, 1.0], [100.0, 0.0, 0.0]),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ([1.0, 0.0, 0.0], [53.24, 80.09, 67.20]),
            ([0.0, 0.0, 1.0], [32.30, 79.19, -107.86]),
        ] {
            let found = lab_from_srgb(Vec3::from_array(srgb));
            assert!((found - Vec3::from_array(lab)).length() < 0.05, "{srgb:?}: {found}");
        }
    }

    #[test]
    fn encoding_is_undone_by_decoding() {
        for k in 0..=100 {
            let v = k as f32 / 100.0;
            assert!((encoded_from_linear(linear_from_encoded(v)) - v).abs() < 1e-5);
        }
    }

    #[test]
    fn lab_and_back_is_the_same_colour() {
        for k in 0..1000 {
            let srgb = Vec3::new((k % 10) as f32, (k / 10 % 10) as f32, (k / 100) as f32) / 9.0;
            let back = srgb_from_lab(lab_from_srgb(srgb));
            assert!(back.distance(srgb) < 1e-4, "{srgb} {back}");
        }
    }
}
