//! Lanes of f32 on each instruction set, behind one small trait.
//!
//! A kernel is written once as an `#[inline(always)]` function over [`Simd`] and instantiated per instruction set inside
//! a function with the matching `#[target_feature]` ([`InstructionSet::run`]). The value `s: S` is a token: it exists only
//! where the machine has the instructions, so that the kernels themselves are safe code.
//!
//! AVX2 and AVX-512 do the same operations in the same order with the same rounding: equal bits. SSE2 and the portable
//! lanes have no fused multiply-add on x86; they equal each other and may differ from the others in the last places.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod math;
mod portable;
#[cfg(target_arch = "x86_64")]
mod sse2;

#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(super) use avx512::Avx512;
pub(super) use math::{exp2, exp2_precise, log2};
pub(super) use portable::Portable;

/// Pixels or Gaussians that are worked on together, whatever the width of a register.
pub(super) const GROUP: usize = 16;

/// Sixteen values, aligned for whole-register loads.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(super) struct Group<T>(pub(super) [T; GROUP]);

/// An instruction set that the CPU back end can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// Four lanes without instructions of any one architecture, which the compiler maps to NEON and the like.
    Portable,
    /// Four lanes, on every x86-64.
    Sse2,
    /// Eight lanes with fused multiply-add (x86-64-v3).
    Avx2,
    /// Sixteen lanes (x86-64-v4).
    Avx512,
}

impl InstructionSet {
    /// All instruction sets, slowest first.
    pub const ALL: [Self; 4] = [Self::Portable, Self::Sse2, Self::Avx2, Self::Avx512];

    /// The fastest one of this machine.
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|set| set.available()).unwrap_or(Self::Portable)
    }

    /// Whether this machine has it.
    pub fn available(self) -> bool {
        match self {
            Self::Portable => true,
            Self::Sse2 => cfg!(target_arch = "x86_64"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => Avx2::new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => Avx512::new().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// Its name, as in figures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Sse2 => "SSE2",
            Self::Avx2 => "AVX2",
            Self::Avx512 => "AVX-512",
        }
    }
}

/// Registers of [`Simd::LANES`] values and what can be done with them; each method is one or two instructions.
///
/// Comparisons with NaN are false. `min` and `max` give the second operand where one is NaN.
pub(super) trait Simd: Copy + Send + Sync {
    /// Values per register, a divisor of [`GROUP`].
    const LANES: usize;
    /// f32 lanes.
    type F: Copy;
    /// i32 lanes.
    type I: Copy;
    /// A yes or no per lane.
    type M: Copy;

    /// `x` in all lanes.
    fn splat(self, x: f32) -> Self::F;
    /// Lanes `part * LANES ..` of a group.
    fn load(self, from: &Group<f32>, part: usize) -> Self::F;
    fn store(self, to: &mut Group<f32>, part: usize, x: Self::F);
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    fn sqrt(self, a: Self::F) -> Self::F;
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a * b + c`
    fn fma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// `c - a * b`
    fn fnma(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;

    /// `a >= b`
    fn ge(self, a: Self::F, b: Self::F) -> Self::M;
    /// `a > b`
    fn gt(self, a: Self::F, b: Self::F) -> Self::M;
    fn and(self, a: Self::M, b: Self::M) -> Self::M;
    /// `a` and not `b`
    fn and_not(self, a: Self::M, b: Self::M) -> Self::M;
    /// One bit per lane, lane 0 lowest.
    fn bits(self, m: Self::M) -> u32;
    /// `a` where `m`, else `b`.
    fn select(self, m: Self::M, a: Self::F, b: Self::F) -> Self::F;
    /// `a` where `m`, else 0.
    fn zero_unless(self, m: Self::M, a: Self::F) -> Self::F;
    /// `a` with its sign bit set where `m`.
    fn negative_where(self, m: Self::M, a: Self::F) -> Self::F;
    /// Sign bits, lane 0 lowest.
    fn signs(self, a: Self::F) -> u32;

    fn splat_i(self, x: i32) -> Self::I;
    /// Lanes `part * LANES ..` of a group of bytes, widened.
    fn load_u8(self, from: &[u8; GROUP], part: usize) -> Self::I;
    fn add_i(self, a: Self::I, b: Self::I) -> Self::I;
    fn sub_i(self, a: Self::I, b: Self::I) -> Self::I;
    /// Low 32 bits of the product.
    fn mul_i(self, a: Self::I, b: Self::I) -> Self::I;
    fn and_i(self, a: Self::I, b: Self::I) -> Self::I;
    /// Shift towards the high bits by 23, the width of a mantissa.
    fn shift_left_23(self, a: Self::I) -> Self::I;
    /// Arithmetic shift towards the low bits by 23.
    fn shift_right_23(self, a: Self::I) -> Self::I;
    /// Same bits, other type.
    fn as_int(self, a: Self::F) -> Self::I;
    /// Same bits, other type.
    fn as_float(self, a: Self::I) -> Self::F;
    /// Nearest float of an integer.
    fn to_float(self, a: Self::I) -> Self::F;
    /// Sum of all lanes, modulo 2^32.
    fn sum_i(self, a: Self::I) -> u32;
}

/// Work that is compiled once per instruction set.
pub(super) trait Kernel {
    /// What it returns.
    type Output;
    /// Does the work; must be `#[inline(always)]`, as must all it calls with `s`, so that it takes over the caller's instructions.
    fn run<S: Simd>(self, s: S) -> Self::Output;
}

impl InstructionSet {
    /// Runs a kernel with these instructions, with portable ones where the machine lacks them.
    pub(super) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        match self {
            Self::Portable => {}
            Self::Sse2 => return kernel.run(sse2::Sse2),
            Self::Avx2 => {
                if let Some(token) = Avx2::new() {
                    return token.run(kernel);
                }
            }
            Self::Avx512 => {
                if let Some(token) = Avx512::new() {
                    return token.run(kernel);
                }
            }
        }
        kernel.run(Portable)
    }
}
