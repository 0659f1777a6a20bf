//! Four lanes as arrays, which the compiler maps to SSE2 or NEON.

use super::{GROUP, Group, Simd};

/// Needs nothing of the machine.
#[derive(Clone, Copy)]
pub(in crate::cpu) struct Portable;

/// `a * b + c`, fused where that is an instruction and not a call.
#[inline(always)]
fn fused(a: f32, b: f32, c: f32) -> f32 {
    if cfg!(any(target_arch = "aarch64", target_feature = "fma")) { a.mul_add(b, c) } else { a * b + c }
}

/// All ones for yes.
#[inline(always)]
fn mask(yes: bool) -> u32 {
    if yes { u32::MAX } else { 0 }
}

impl Simd for Portable {
    const LANES: usize = 4;
    type F = [f32; 4];
    type I = [i32; 4];
    type M = [u32; 4];

    #[inline(always)]
    fn splat(self, x: f32) -> Self::F {
        [x; 4]
    }

    #[inline(always)]
    fn load(self, from: &Group<f32>, part: usize) -> Self::F {
        std::array::from_fn(|i| from.0[part * 4 + i])
    }

    #[inline(always)]
    fn store(self, to: &mut Group<f32>, part: usize, x: Self::F) {
        to.0[part * 4..part * 4 + 4].copy_from_slice(&x);
    }

    #[inline(always)]
    fn add(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|i| a[i] + b[i])
    }

    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|i| a[i] - b[i])
    }

    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|i| a[i] * b[i])
    }

    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|i| a[i] / b[i])
    }

    #[inline(always)]
    fn sqrt(self, a: Self::F) -> Self::F {
        std::array::from_fn(|i| a[i].sqrt())
    }

    #[inline(always)]
    fn min(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|i| if a[i] < b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn max(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn fma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        std::array::from_fn(|i| fused(a[i], b[i], c[i]))
    }

    #[inline(always)]
    fn fnma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        std::array::from_fn(|i| fused(-a[i], b[i], c[i]))
    }

    #[inline(always)]
    fn ge(self, a: Self::F, b: Self::F) -> Self::M {
        std::array::from_fn(|i| mask(a[i] >= b[i]))
    }

    #[inline(always)]
    fn gt(self, a: Self::F, b: Self::F) -> Self::M {
        std::array::from_fn(|i| mask(a[i] > b[i]))
    }

    #[inline(always)]
    fn and(self, a: Self::M, b: Self::M) -> Self::M {
        std::array::from_fn(|i| a[i] & b[i])
    }

    #[inline(always)]
    fn and_not(self, a: Self::M, b: Self::M) -> Self::M {
        std::array::from_fn(|i| a[i] & !b[i])
    }

    #[inline(always)]
    fn bits(self, m: Self::M) -> u32 {
        m.iter().enumerate().fold(0, |bits, (i, m)| bits | (m >> 31) << i)
    }

    #[inline(always)]
    fn select(self, m: Self::M, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|i| f32::from_bits(a[i].to_bits() & m[i] | b[i].to_bits() & !m[i]))
    }

    #[inline(always)]
    fn zero_unless(self, m: Self::M, a: Self::F) -> Self::F {
        std::array::from_fn(|i| f32::from_bits(a[i].to_bits() & m[i]))
    }

    #[inline(always)]
    fn negative_where(self, m: Self::M, a: Self::F) -> Self::F {
        std::array::from_fn(|i| f32::from_bits(a[i].to_bits() | m[i] & 0x8000_0000))
    }

    #[inline(always)]
    fn signs(self, a: Self::F) -> u32 {
        a.iter().enumerate().fold(0, |bits, (i, a)| bits | (a.to_bits() >> 31) << i)
    }

    #[inline(always)]
    fn splat_i(self, x: i32) -> Self::I {
        [x; 4]
    }

    #[inline(always)]
    fn load_u8(self, from: &[u8; GROUP], part: usize) -> Self::I {
        std::array::from_fn(|i| i32::from(from[part * 4 + i]))
    }

    #[inline(always)]
    fn add_i(self, a: Self::I, b: Self::I) -> Self::I {
        std::array::from_fn(|i| a[i].wrapping_add(b[i]))
    }

    #[inline(always)]
    fn sub_i(self, a: Self::I, b: Self::I) -> Self::I {
        std::array::from_fn(|i| a[i].wrapping_sub(b[i]))
    }

    #[inline(always)]
    fn mul_i(self, a: Self::I, b: Self::I) -> Self::I {
        std::array::from_fn(|i| a[i].wrapping_mul(b[i]))
    }

    #[inline(always)]
    fn and_i(self, a: Self::I, b: Self::I) -> Self::I {
        std::array::from_fn(|i| a[i] & b[i])
    }

    #[inline(always)]
    fn shift_left_23(self, a: Self::I) -> Self::I {
        a.map(|a| a << 23)
    }

    #[inline(always)]
    fn shift_right_23(self, a: Self::I) -> Self::I {
        a.map(|a| a >> 23)
    }

    #[inline(always)]
    fn as_int(self, a: Self::F) -> Self::I {
        a.map(|a| a.to_bits() as i32)
    }

    #[inline(always)]
    fn as_float(self, a: Self::I) -> Self::F {
        a.map(|a| f32::from_bits(a as u32))
    }

    #[inline(always)]
    fn to_float(self, a: Self::I) -> Self::F {
        a.map(|a| a as f32)
    }

    #[inline(always)]
    fn sum_i(self, a: Self::I) -> u32 {
        a[0].wrapping_add(a[1]).wrapping_add(a[2].wrapping_add(a[3])) as u32
    }
}
