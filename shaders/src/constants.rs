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
    /// Pixels across and down a tile; a workgroup of the blend stage has a thread per pixel.
    TILE: u32 = 16;
    /// Threads of a workgroup of the stages that go through lists.
    BLOCK: u32 = 256;
    /// Workgroups across a folded dispatch: workgroup `(x, y)` is number `y * FOLD + x`. Devices take at most 65535 a dimension.
    FOLD: u32 = 32768;
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
