//! Four lanes: SSE2, which every x86-64 has.

use std::arch::x86_64::*;

use super::{GROUP, Group, Simd};

/// Proof that the machine has these instructions: all of this architecture have.
#[derive(Clone, Copy)]
pub(in crate::cpu) struct Sse2;

/// Wraps intrinsics of the token's feature set.
macro_rules! intrinsics {
    ($body:expr) => {
        // SAFETY: every x86-64 has these instructions; the pointers used are to whole groups, aligned to 64 bytes, of
        // which `part * LANES ..` is inside since LANES divides their length.
        unsafe { $body }
    };
}

impl Simd for Sse2 {
    const LANES: usize = 4;
    type F = __m128;
    type I = __m128i;
    type M = __m128;

    #[inline(always)]
    fn splat(self, x: f32) -> Self::F {
        intrinsics!(_mm_set1_ps(x))
    }

    #[inline(always)]
    fn load(self, from: &Group<f32>, part: usize) -> Self::F {
        intrinsics!(_mm_load_ps(from.0.as_ptr().add(part * Self::LANES)))
    }

    #[inline(always)]
    fn store(self, to: &mut Group<f32>, part: usize, x: Self::F) {
        intrinsics!(_mm_store_ps(to.0.as_mut_ptr().add(part * Self::LANES), x))
    }

    #[inline(always)]
    fn add(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm_add_ps(a, b))
    }

    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm_sub_ps(a, b))
    }

    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm_mul_ps(a, b))
    }

    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm_div_ps(a, b))
    }

    #[inline(always)]
    fn sqrt(self, a: Self::F) -> Self::F {
        intrinsics!(_mm_sqrt_ps(a))
    }

    #[inline(always)]
    fn min(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm_min_ps(a, b))
    }

    #[inline(always)]
    fn max(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm_max_ps(a, b))
    }

    #[inline(always)]
    fn fma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        self.add(self.mul(a, b), c)
    }

    #[inline(always)]
    fn fnma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        self.sub(c, self.mul(a, b))
    }

    #[inline(always)]
    fn ge(self, a: Self::F, b: Self::F) -> Self::M {
        intrinsics!(_mm_cmpge_ps(a, b))
    }

    #[inline(always)]
    fn gt(self, a: Self::F, b: Self::F) -> Self::M {
        intrinsics!(_mm_cmpgt_ps(a, b))
    }

    #[inline(always)]
    fn and(self, a: Self::M, b: Self::M) -> Self::M {
        intrinsics!(_mm_and_ps(a, b))
    }

    #[inline(always)]
    fn and_not(self, a: Self::M, b: Self::M) -> Self::M {
        intrinsics!(_mm_andnot_ps(b, a))
    }

    #[inline(always)]
    fn bits(self, m: Self::M) -> u32 {
        intrinsics!(_mm_movemask_ps(m) as u32)
    }

    #[inline(always)]
    fn select(self, m: Self::M, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm_or_ps(_mm_and_ps(m, a), _mm_andnot_ps(m, b)))
    }

    #[inline(always)]
    fn zero_unless(self, m: Self::M, a: Self::F) -> Self::F {
        intrinsics!(_mm_and_ps(m, a))
    }

    #[inline(always)]
    fn negative_where(self, m: Self::M, a: Self::F) -> Self::F {
        intrinsics!(_mm_or_ps(a, _mm_and_ps(m, _mm_set1_ps(-0.0))))
    }

    #[inline(always)]
    fn signs(self, a: Self::F) -> u32 {
        intrinsics!(_mm_movemask_ps(a) as u32)
    }

    #[inline(always)]
    fn splat_i(self, x: i32) -> Self::I {
        intrinsics!(_mm_set1_epi32(x))
    }

    #[inline(always)]
    fn load_u8(self, from: &[u8; GROUP], part: usize) -> Self::I {
        let four = &from[part * Self::LANES..][..Self::LANES];
        intrinsics!(_mm_setr_epi32(four[0].into(), four[1].into(), four[2].into(), four[3].into()))
    }

    #[inline(always)]
    fn add_i(self, a: Self::I, b: Self::I) -> Self::I {
        intrinsics!(_mm_add_epi32(a, b))
    }

    #[inline(always)]
    fn sub_i(self, a: Self::I, b: Self::I) -> Self::I {
        intrinsics!(_mm_sub_epi32(a, b))
    }

    #[inline(always)]
    fn mul_i(self, a: Self::I, b: Self::I) -> Self::I {
        // Two products of 32 bits each, twice, of which the low halves are put together.
        intrinsics!({
            let even = _mm_mul_epu32(a, b);
            let odd = _mm_mul_epu32(_mm_srli_epi64::<32>(a), _mm_srli_epi64::<32>(b));
            _mm_unpacklo_epi32(_mm_shuffle_epi32::<0b00_00_10_00>(even), _mm_shuffle_epi32::<0b00_00_10_00>(odd))
        })
    }

    #[inline(always)]
    fn and_i(self, a: Self::I, b: Self::I) -> Self::I {
        intrinsics!(_mm_and_si128(a, b))
    }

    #[inline(always)]
    fn shift_left_23(self, a: Self::I) -> Self::I {
        intrinsics!(_mm_slli_epi32::<23>(a))
    }

    #[inline(always)]
    fn shift_right_23(self, a: Self::I) -> Self::I {
        intrinsics!(_mm_srai_epi32::<23>(a))
    }

    #[inline(always)]
    fn as_int(self, a: Self::F) -> Self::I {
        intrinsics!(_mm_castps_si128(a))
    }

    #[inline(always)]
    fn as_float(self, a: Self::I) -> Self::F {
        intrinsics!(_mm_castsi128_ps(a))
    }

    #[inline(always)]
    fn to_float(self, a: Self::I) -> Self::F {
        intrinsics!(_mm_cvtepi32_ps(a))
    }

    #[inline(always)]
    fn sum_i(self, a: Self::I) -> u32 {
        intrinsics!({
            let two = _mm_add_epi32(a, _mm_shuffle_epi32::<0b00_00_11_10>(a));
            let one = _mm_add_epi32(two, _mm_shuffle_epi32::<0b00_00_00_01>(two));
            _mm_cvtsi128_si32(one) as u32
        })
    }
}
