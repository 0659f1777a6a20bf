//! What is asked of a frame and what comes back.

use splat_core::{Mask2d, Selection, View, ViewError};

/// One unit of a vote: weights are summed as integers in units of 2^-16.
pub const VOTE_UNIT: f64 = 1.0 / 65_536.0;

/// Which depth of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Depth {
    /// Camera z of the Gaussian at which T first falls to 0.5 or below.
    #[default]
    Median,
    /// `sum w z / sum w`, where `sum w` is above 1e-3.
    Expected,
}

/// Any number of channels per Gaussian.
#[derive(Clone, Copy, Debug)]
pub struct Features<'a> {
    /// Channels per Gaussian, at least 1.
    pub channels: usize,
    /// Values, Gaussian-major: `scene.len() * channels`.
    pub values: &'a [f32],
}

/// What a frame shall contain. The default asks for nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outputs<'a> {
    /// [`Frame::color`].
    pub color: bool,
    /// [`Frame::median_depth`].
    pub median_depth: bool,
    /// [`Frame::expected_depth`].
    pub expected_depth: bool,
    /// [`Frame::features`] of these values.
    pub features: Option<Features<'a>>,
    /// [`Frame::visibility`] above this weight.
    pub visibility: Option<f32>,
    /// [`Frame::first_hits`] at this tau, 0.5 by convention.
    pub first_hits: Option<f32>,
    /// [`Frame::strongest`]: the Gaussian with the largest weight per pixel.
    pub strongest: bool,
    /// [`Frame::votes`] of these masks, each of the view's size; may be an empty list for totals alone.
    pub votes: Option<&'a [&'a Mask2d]>,
    /// Per pixel a camera z; a Gaussian at or beyond it adds nothing to that pixel, in any output (so meshes hide
    /// splats). NaN, as in a picture of depth: no limit.
    pub limit: Option<&'a [f32]>,
}

/// Votes of one view: `inside[m][i] = sum_p w_i(p) mask_m(p)` and `total[i] = sum_p w_i(p)`, in units of [`VOTE_UNIT`]
/// (a mask counts as 0..=1). Integers: views may be added in any order and taken away again, exactly.
///
/// Per pixel the summands are `round(w * 65536)` and, for a soft mask value m, `round(w * 65536) * m / 255` summed
/// as `round(w * 65536) * m` and divided once, rounding down, so that `inside <= total`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Votes {
    /// Per mask, per Gaussian.
    pub inside: Vec<Vec<u64>>,
    /// Per Gaussian.
    pub total: Vec<u64>,
}

/// One drawn frame; buffers not asked for are empty. Pictures are row-major from the top left.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Premultiplied red, green, blue, sRGB-encoded, and alpha = 1 - T.
    pub color: Vec<[f32; 4]>,
    /// Camera z at which T first falls to 0.5 or below; NaN where it never does.
    pub median_depth: Vec<f32>,
    /// Weighted mean of camera z; NaN where the weights sum to 1e-3 or less.
    pub expected_depth: Vec<f32>,
    /// `channels` values per pixel.
    pub features: Vec<f32>,
    /// Gaussians whose largest weight over the picture is above the threshold.
    pub visibility: Selection,
    /// Scene-wide id per pixel, or [`Frame::NO_ID`].
    pub first_hits: Vec<u32>,
    /// Scene-wide id of the Gaussian with the largest weight per pixel (the nearer of equals), or [`Frame::NO_ID`].
    pub strongest: Vec<u32>,
    /// Sums per Gaussian.
    pub votes: Votes,
}

impl Frame {
    /// Stands for "no Gaussian" in pictures of ids.
    pub const NO_ID: u32 = u32::MAX;

    /// Gives every buffer asked for its size, with sums per Gaussian at 0, and empties the others; memory is kept.
    pub(crate) fn reset(&mut self, view: &View, outputs: &Outputs, gaussians: usize) {
        /// Pictures keep what they had: every pixel is written.
        fn size<T: Copy>(buffer: &mut Vec<T>, len: usize, blank: T) {
            buffer.truncate(len);
            buffer.resize(len, blank);
        }
        (self.width, self.height) = (view.width, view.height);
        let pixels = view.width as usize * view.height as usize;
        let sized = |on: bool| if on { pixels } else { 0 };
        size(&mut self.color, sized(outputs.color), [0.0; 4]);
        size(&mut self.median_depth, sized(outputs.median_depth), f32::NAN);
        size(&mut self.expected_depth, sized(outputs.expected_depth), f32::NAN);
        size(&mut self.features, pixels * outputs.features.map_or(0, |f| f.channels), 0.0);
        size(&mut self.first_hits, sized(outputs.first_hits.is_some()), Self::NO_ID);
        size(&mut self.strongest, sized(outputs.strongest), Self::NO_ID);

        let clear = |words: &mut Vec<u64>, len: usize| {
            words.clear();
            words.resize(len, 0);
        };
        let mut visible = std::mem::take(&mut self.visibility).into_words();
        let bits = if outputs.visibility.is_some() { gaussians } else { 0 };
        clear(&mut visible, bits.div_ceil(64));
        self.visibility = Selection::from_words(bits, visible);
        let (masks, gaussians) = outputs.votes.map_or((0, 0), |masks| (masks.len(), gaussians));
        clear(&mut self.votes.total, gaussians);
        self.votes.inside.resize_with(masks, Vec::new);
        for inside in &mut self.votes.inside {
            clear(inside, gaussians);
        }
    }
}

/// Why a frame could not be drawn.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The GPU failed.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] crate::gpu::GpuError),
    /// The view itself is unusable.
    #[error(transparent)]
    View(#[from] ViewError),
    /// The picture has more pixels than can be drawn at once.
    #[error(
        "a picture of {width}x{height} pixels is too large; at most 268435456 pixels (16384x16384) are drawn at once"
    )]
    TooLarge {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// The instances have more Gaussians together than 32-bit ids can name.
    #[error("the scene has {found} Gaussians, at most 4294967295 can be drawn together")]
    TooMany {
        /// Gaussians of all instances.
        found: usize,
    },
    /// A mask has another size than the view.
    #[error("the mask has {}x{} pixels, the view {}x{}; draw or scale the mask at the view's size", mask.0, mask.1, view.0, view.1)]
    SizeMismatch {
        /// Width and height of the mask.
        mask: (u32, u32),
        /// Width and height of the view.
        view: (u32, u32),
    },
    /// The ids of an instance's subset do not rise, or are not all in its cloud.
    #[error("the subset of instance {instance} is not a list of rising ids below {count}")]
    Subset {
        /// Which instance of the scene.
        instance: usize,
        /// Gaussians of its cloud.
        count: usize,
    },
    /// An input does not have one entry (or `channels` entries) per Gaussian or per pixel.
    #[error("`{what}` has {found} values, {expected} were expected")]
    Length {
        /// Which input.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Values expected.
        expected: usize,
    },
}
