//! The numbers that shaders and Rust share: declared once, emitted as WGSL text.

use std::fmt::Write as _;

/// A constant's value as WGSL spells it.
trait Literal {
    fn literal(self) -> String;
}

impl Literal for u32 {
    fn literal(self) -> String {
        format!("{self}u")
    }
}

impl Literal for f32 {
    fn literal(self) -> String {
        // The shortest decimal that reads back as the same bits.
        format!("{self:e}f")
    }
}

macro_rules! constants {
    ($($(#[$doc:meta])* $name:ident: $kind:ident = $value:expr;)*) => {
        $($(#[$doc])* pub const $name: $kind = $value;)*

        /// All constants as WGSL declarations, one a line.
        pub fn wgsl() -> String {
            let mut text = String::new();
            $(writeln!(text, "const {}: {} = {};", stringify!($name), stringify!($kind), $name.literal())
                .expect("writing to a string");)*
            text
        }

        /// Name and bits of all constants; a test holds what a WGSL parser read against them.
        #[cfg(test)]
        pub(crate) fn bits() -> Vec<(&'static str, u32)> {
            vec![$((stringify!($name), Bits::bits($name))),*]
        }
    };
}

#[cfg(test)]
trait Bits {
    fn bits(self) -> u32;
}

#[cfg(test)]
impl Bits for u32 {
    fn bits(self) -> u32 {
        self
    }
}

#[cfg(test)]
impl Bits for f32 {
    fn bits(self) -> u32 {
        self.to_bits()
    }
}

constants! {
    /// Pixels across and down a tile; a workgroup of the blend stage has one.
    TILE: u32 = 16;
    /// Threads of a workgroup of the stages that go through lists.
    BLOCK: u32 = 256;
    /// Workgroups across a folded dispatch: workgroup `(x, y)` is number `y * FOLD + x`. Devices take at most 65535 a dimension.
    FOLD: u32 = 32768;
    /// Numbers that a workgroup of the scan adds up.
    SCAN_BLOCK: u32 = 2048;
    /// Keys that a workgroup of the sort keeps in its 16 KiB: an odd multiple of [`BLOCK`], so that no two of its threads want
    /// the same bank of memory.
    SORT_BLOCK: u32 = 13 * 256;
    /// Pairs that a workgroup of the binning writes.
    PAIR_BLOCK: u32 = 2048;
    /// Stands for "no place": a count that the CPU knows.
    NO_PLACE: u32 = u32::MAX;
    /// Stands for "no Gaussian" in pictures of ids.
    NO_ID: u32 = u32::MAX;
    /// Contributions below this are skipped.
    SMALLEST_ALPHA: f32 = 1.0 / 255.0;
    /// No splat is more opaque than this.
    LARGEST_ALPHA: f32 = 0.99;
    /// A pixel ends before its transmittance would fall below this.
    LEAST_TRANSMITTANCE: f32 = 1e-4;
    /// Sum of weights from which on a pixel has an expected depth.
    LEAST_WEIGHT: f32 = 1e-3;
    /// Variance added to both axes of a splat, in px^2 (INRIA's low-pass).
    LOW_PASS: f32 = 0.3;
    /// Variance of a splat beyond which both axes are shrunk alike, in px^2, so that products stay finite.
    LARGEST_VARIANCE: f32 = 1e18;
    /// No colour is brighter: an infinity would spoil pixels that its splat has weight 0 in. Half floats end at 65504.
    BRIGHTEST: f32 = 6e4;
    /// log2(255): how far an opacity of 1 is above the smallest alpha that counts, as a power of two.
    LEVELS: f32 = 7.994_353_3;
    /// Added to [`LEVELS`] where tiles are left out, so that rounding never loses a pixel; the test per pixel decides.
    MARGIN: f32 = 1e-3;
    /// Weights are voted with in units of 1 / VOTE_SCALE.
    VOTE_SCALE: f32 = 65536.0;
    /// Words of a Gaussian's geometry as [packed](crate::PROJECT): mean 3, rotation 2, log scales and logit 2.
    PACKED_GEOMETRY: u32 = 7;
    /// Words of a Gaussian's geometry as f32: mean 3, rotation 4, log scales 3, logit 1.
    FULL_GEOMETRY: u32 = 11;
    /// Least of the three smaller parts of a unit quaternion whose largest is positive.
    SMALL_LEAST: f32 = -std::f32::consts::FRAC_1_SQRT_2;
    /// From one 15-bit part of a packed quaternion to the next.
    SMALL_STEP: f32 = std::f32::consts::SQRT_2 / 32767.0;
    /// Least logarithm of a scale that the packed form tells apart; the low-pass is far larger.
    LOG_SCALE_LEAST: f32 = -24.0;
    /// From one 20-bit logarithm of a scale to the next; the largest is 28, where the projection ends too.
    LOG_SCALE_STEP: f32 = 52.0 / 1048575.0;
    /// Least logit of the packed form: too faint to be drawn.
    LOGIT_LEAST: f32 = -8.0;
    /// From one 21-bit logit to the next; the largest is 16, beyond [`LARGEST_ALPHA`].
    LOGIT_STEP: f32 = 24.0 / 2097151.0;
    /// First word of a Gaussian that cannot be drawn: bits of a NaN.
    DEAD: u32 = 0x7fc0_0000;
    /// Project: write colours.
    FLAG_COLOR: u32 = 1;
    /// Project: no perspective.
    FLAG_PARALLEL: u32 = 2;
    /// Project: the cloud was trained with the antialiased low-pass.
    FLAG_ANTIALIASED: u32 = 4;
    /// Project: heed the hidden bits.
    FLAG_HIDDEN: u32 = 8;
    /// Project: draw the subset only.
    FLAG_SUBSET: u32 = 16;
    /// Project: mix the tint over the colours.
    FLAG_TINT: u32 = 32;
    /// Threads that blend a tile: each four pixels of a row.
    BLEND_THREADS: u32 = 64;
    /// Masks that one dispatch votes for: what fits workgroup memory beside the splats.
    VOTE_MASKS: u32 = 3;
    /// Natural logarithm of 2.
    LN_2: f32 = std::f32::consts::LN_2;
    /// Binary logarithm of e.
    LOG2_E: f32 = std::f32::consts::LOG2_E;
    /// Word of the counters: splats that may be seen, written by the scan of the blocks' counts.
    COUNTER_VISIBLE: u32 = 0;
    /// Word of the counters: pairs of a tile and a splat that the frame needs, whether there was room or not.
    COUNTER_PAIRS: u32 = 1;
    /// Word of the counters: pairs that are in the lists; fewer than needed where there was no room.
    COUNTER_KEPT: u32 = 2;
    /// Words of the counters.
    COUNTERS: u32 = 16;
}

#[cfg(test)]
mod tests {
    use naga::{Expression, Literal};

    #[test]
    fn shaders_read_every_constant_as_rust_has_it() {
        let module = naga::front::wgsl::parse_str(&super::wgsl()).expect("the table is WGSL");
        assert_eq!(module.constants.len(), super::bits().len());
        for ((_, read), (name, bits)) in module.constants.iter().zip(super::bits()) {
            assert_eq!(read.name.as_deref(), Some(name));
            let read = match module.global_expressions[read.init] {
                Expression::Literal(Literal::U32(v)) => v,
                Expression::Literal(Literal::F32(v)) => v.to_bits(),
                ref other => panic!("{name} is {other:?}"),
            };
            assert_eq!(read, bits, "{name}");
        }
    }
}
