//! 16-bit floats (IEEE 754 binary16).

/// The value of a 16-bit float; exact.
pub(crate) fn from_bits(bits: u16) -> f32 {
    let sign = u32::from(bits & 0x8000) << 16;
    let rest = u32::from(bits & 0x7fff) << 13;
    if bits & 0x7c00 == 0x7c00 {
        return f32::from_bits(sign | 0x7f80_0000 | rest);
    }
    // The exponent is off by 112; a multiplication corrects it, subnormal numbers included.
    let magnitude = f32::from_bits(rest) * f32::from_bits(0x7780_0000);
    f32::from_bits(sign | magnitude.to_bits())
}

#[cfg(test)]
mod tests {
    use super::from_bits;

    #[test]
    fn every_number_is_its_sign_exponent_and_fraction() {
        for bits in 0..=u16::MAX {
            let exponent = i32::from(bits >> 10 & 31);
            let fraction = f64::from(bits & 1023) / 1024.0;
            let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
            let expected = match exponent {
                0 => sign * fraction * f64::powi(2.0, -14),
                31 if fraction == 0.0 => sign * f64::INFINITY,
                31 => f64::NAN,
                e => sign * (1.0 + fraction) * f64::powi(2.0, e - 15),
            };
            let found = f64::from(from_bits(bits));
            assert!(found == expected || (found.is_nan() && expected.is_nan()), "{bits:04x}");
        }
    }
}
