//! Sixteen lanes: AVX-512, x86-64-v4.

use std::arch::x86_64::*;

use super::{GROUP, Group, Kernel, Simd};

/// Proof that the machine has these instructions.
#[derive(Clone, Copy)]
pub(in crate::cpu) struct Avx512(());

impl Avx512 {
    /// The token, if the machine has the instructions.
    pub(in crate::cpu) fn new() -> Option<Self> {
        let available = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        available.then_some(Self(()))
    }

    /// Runs a kernel compiled with these instructions.
    pub(in crate::cpu) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn inner<K: Kernel>(token: Avx512, kernel: K) -> K::Output {
            kernel.run(token)
        }
        // SAFETY: a token is made only where the features were detected.
        unsafe { inner(self, kernel) }
    }
}

/// Wraps intrinsics of the token's feature set.
macro_rules! intrinsics {
    ($body:expr) => {
        // SAFETY: `self` is a token, which exists only where the machine has these features; the pointers used are to
        // whole groups, aligned to 64 bytes, of which `part * LANES ..` is inside since LANES divides their length.
        unsafe { $body }
    };
}

impl Simd for Avx512 {
    const LANES: usize = 16;
    type F = __m512;
    type I = __m512i;
    type M = __mmask16;

    #[inline(always)]
    fn splat(self, x: f32) -> Self::F {
        intrinsics!(_mm512_set1_ps(x))
    }

    #[inline(always)]
    fn load(self, from: &Group<f32>, part: usize) -> Self::F {
        intrinsics!(_mm512_load_ps(from.0.as_ptr().add(part * Self::LANES)))
    }

    #[inline(always)]
    fn store(self, to: &mut Group<f32>, part: usize, x: Self::F) {
        intrinsics!(_mm512_store_ps(to.0.as_mut_ptr().add(part * Self::LANES), x))
    }

    #[inline(always)]
    fn add(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm512_add_ps(a, b))
    }

    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm512_sub_ps(a, b))
    }

    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm512_mul_ps(a, b))
    }

    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm512_div_ps(a, b))
    }

    #[inline(always)]
    fn sqrt(self, a: Self::F) -> Self::F {
        intrinsics!(_mm512_sqrt_ps(a))
    }

    #[inline(always)]
    fn min(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm512_min_ps(a, b))
    }

    #[inline(always)]
    fn max(self, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm512_max_ps(a, b))
    }

    #[inline(always)]
    fn fma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        intrinsics!(_mm512_fmadd_ps(a, b, c))
    }

    #[inline(always)]
    fn fnma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        intrinsics!(_mm512_fnmadd_ps(a, b, c))
    }

    #[inline(always)]
    fn ge(self, a: Self::F, b: Self::F) -> Self::M {
        intrinsics!(_mm512_cmp_ps_mask::<_CMP_GE_OQ>(a, b))
    }

    #[inline(always)]
    fn gt(self, a: Self::F, b: Self::F) -> Self::M {
        intrinsics!(_mm512_cmp_ps_mask::<_CMP_GT_OQ>(a, b))
    }

    #[inline(always)]
    fn and(self, a: Self::M, b: Self::M) -> Self::M {
        a & b
    }

    #[inline(always)]
    fn and_not(self, a: Self::M, b: Self::M) -> Self::M {
        a & !b
    }

    #[inline(always)]
    fn bits(self, m: Self::M) -> u32 {
        u32::from(m)
    }

    #[inline(always)]
    fn select(self, m: Self::M, a: Self::F, b: Self::F) -> Self::F {
        intrinsics!(_mm512_mask_blend_ps(m, b, a))
    }

    #[inline(always)]
    fn zero_unless(self, m: Self::M, a: Self::F) -> Self::F {
        intrinsics!(_mm512_maskz_mov_ps(m, a))
    }

    #[inline(always)]
    fn negative_where(self, m: Self::M, a: Self::F) -> Self::F {
        intrinsics!(_mm512_mask_or_ps(a, m, a, _mm512_set1_ps(-0.0)))
    }

    #[inline(always)]
    fn signs(self, a: Self::F) -> u32 {
        intrinsics!(u32::from(_mm512_movepi32_mask(_mm512_castps_si512(a))))
    }

    #[inline(always)]
    fn splat_i(self, x: i32) -> Self::I {
        intrinsics!(_mm512_set1_epi32(x))
    }

    #[inline(always)]
    fn load_u8(self, from: &[u8; GROUP], part: usize) -> Self::I {
        intrinsics!(_mm512_cvtepu8_epi32(_mm_loadu_si128(from.as_ptr().add(part * Self::LANES).cast())))
    }

    #[inline(always)]
    fn add_i(self, a: Self::I, b: Self::I) -> Self::I {
        intrinsics!(_mm512_add_epi32(a, b))
    }

    #[inline(always)]
    fn sub_i(self, a: Self::I, b: Self::I) -> Self::I {
        intrinsics!(_mm512_sub_epi32(a, b))
    }

    #[inline(always)]
    fn mul_i(self, a: Self::I, b: Self::I) -> Self::I {
        intrinsics!(_mm512_mullo_epi32(a, b))
    }

    #[inline(always)]
    fn and_i(self, a: Self::I, b: Self::I) -> Self::I {
        intrinsics!(_mm512_and_si512(a, b))
    }

    #[inline(always)]
    fn shift_left_23(self, a: Self::I) -> Self::I {
        intrinsics!(_mm512_slli_epi32::<23>(a))
    }

    #[inline(always)]
    fn shift_right_23(self, a: Self::I) -> Self::I {
        intrinsics!(_mm512_srai_epi32::<23>(a))
    }

    #[inline(always)]
    fn as_int(self, a: Self::F) -> Self::I {
        intrinsics!(_mm512_castps_si512(a))
    }

    #[inline(always)]
    fn as_float(self, a: Self::I) -> Self::F {
        intrinsics!(_mm512_castsi512_ps(a))
    }

    #[inline(always)]
    fn to_float(self, a: Self::I) -> Self::F {
        intrinsics!(_mm512_cvtepi32_ps(a))
    }

    #[inline(always)]
    fn sum_i(self, a: Self::I) -> u32 {
        intrinsics!(_mm512_reduce_add_epi32(a) as u32)
    }
}
