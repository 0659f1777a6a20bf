//! Functions over lanes: powers of two, logarithms.

use super::Simd;

/// 2^x for x in -126..=127, relative error below 3e-6 (minimax polynomial of degree 4 on -0.5..=0.5).
///
/// Below -126 the result is 2^-126; above 127 it is not defined.
#[inline(always)]
pub(in crate::cpu) fn exp2<S: Simd>(s: S, x: S::F) -> S::F {
    let (scale, f) = split(s, x);
    let p = s.fma(f, s.splat(0.009_570_069), s.splat(0.055_917_808));
    let p = s.fma(f, p, s.splat(0.240_247_45));
    let p = s.fma(f, p, s.splat(0.693_121_8));
    let p = s.fma(f, p, s.splat(0.999_999_3));
    s.as_float(s.add_i(s.as_int(p), scale))
}

/// 2^x for x in -126..=127, relative error below 2e-7 (Taylor polynomial of degree 7 on -0.5..=0.5).
#[inline(always)]
pub(in crate::cpu) fn exp2_precise<S: Simd>(s: S, x: S::F) -> S::F {
    let (scale, f) = split(s, x);
    let p = s.fma(f, s.splat(1.525_273_4e-5), s.splat(1.540_353e-4));
    let p = s.fma(f, p, s.splat(1.333_355_8e-3));
    let p = s.fma(f, p, s.splat(9.618_129e-3));
    let p = s.fma(f, p, s.splat(5.550_411e-2));
    let p = s.fma(f, p, s.splat(0.240_226_5));
    let p = s.fma(f, p, s.splat(std::f32::consts::LN_2));
    let p = s.fma(f, p, s.splat(1.0));
    s.as_float(s.add_i(s.as_int(p), scale))
}

/// The nearest integer, shifted to where exponents are, and what is left.
#[inline(always)]
fn split<S: Simd>(s: S, x: S::F) -> (S::I, S::F) {
    // 1.5 * 2^23: adding it leaves the nearest integer in the low bits, and only those survive the shift.
    let magic = s.splat(12_582_912.0);
    let shifted = s.add(s.max(x, s.splat(-126.0)), magic);
    let f = s.sub(s.max(x, s.splat(-126.0)), s.sub(shifted, magic));
    (s.shift_left_23(s.as_int(shifted)), f)
}

/// log2(x) for normal x > 0, absolute error below 3e-7; not defined for others.
#[inline(always)]
pub(in crate::cpu) fn log2<S: Simd>(s: S, x: S::F) -> S::F {
    // x = m * 2^n with m in sqrt(1/2)..sqrt(2); log2(m) = 2 / ln 2 * atanh((m - 1) / (m + 1)).
    let bits = s.as_int(x);
    let n = s.shift_right_23(s.sub_i(bits, s.splat_i(0x3f35_04f3)));
    let m = s.as_float(s.sub_i(bits, s.shift_left_23(n)));
    let r = s.div(s.sub(m, s.splat(1.0)), s.add(m, s.splat(1.0)));
    let r2 = s.mul(r, r);
    let p = s.fma(r2, s.splat(0.412_198_57), s.splat(0.577_078));
    let p = s.fma(r2, p, s.splat(0.961_796_7));
    let p = s.fma(r2, p, s.splat(2.885_39));
    s.fma(r, p, s.to_float(n))
}

#[cfg(test)]
mod tests {
    use super::super::{GROUP, Group, InstructionSet, Kernel};
    use super::*;

    /// Applies the functions to 16 values.
    struct All(Group<f32>);

    impl Kernel for All {
        type Output = [Group<f32>; 3];

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> [Group<f32>; 3] {
            let mut out = [Group([0.0; GROUP]); 3];
            for part in 0..GROUP / S::LANES {
                let x = s.load(&self.0, part);
                s.store(&mut out[0], part, exp2(s, x));
                s.store(&mut out[1], part, exp2_precise(s, x));
                s.store(&mut out[2], part, log2(s, s.max(x, s.splat(1e-30))));
            }
            out
        }
    }

    #[test]
    fn functions_are_as_precise_as_they_say_on_every_instruction_set() {
        for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
            for k in -126 * 64..127 * 64 {
                let x: [f32; GROUP] = std::array::from_fn(|i| (k as f32 + i as f32 / 16.0) / 64.0);
                let [fast, precise, logarithm] = set.run(All(Group(x)));
                for (i, x) in x.into_iter().enumerate() {
                    let exact = f64::from(x).exp2();
                    assert!((f64::from(fast.0[i]) / exact - 1.0).abs() < 3e-6, "2^{x} is {}", fast.0[i]);
                    assert!((f64::from(precise.0[i]) / exact - 1.0).abs() < 2e-7, "2^{x} is {}", precise.0[i]);
                    let error = f64::from(logarithm.0[i]) - f64::from(x).max(1e-30).log2();
                    assert!(x <= 0.0 || error.abs() < 5e-7, "log2({x}) is {}", logarithm.0[i]);
                }
            }
        }
    }

    #[test]
    fn powers_far_below_the_range_are_nearly_nothing_and_nan_is_too() {
        for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
            for x in [-126.5, -1e4, -3e38, f32::NEG_INFINITY, f32::NAN] {
                let [fast, precise, _] = set.run(All(Group([x; GROUP])));
                assert!((0.0..1e-37).contains(&fast.0[5]) && (0.0..1e-37).contains(&precise.0[5]), "2^{x}");
            }
        }
    }
}
