//! [`Splat`]: the image of one Gaussian, and which squares of pixels it reaches.

use super::simd::{GROUP, Group, Simd};

/// Pixels across and down a tile.
pub(super) const TILE: usize = 16;
/// log2(255): how far an opacity of 1 is above the smallest alpha that counts, as a power of two.
pub(super) const LEVELS: f32 = 7.994_353_3;
/// Added to [`LEVELS`] where squares are left out, so that rounding never loses a pixel; the test per pixel decides.
const MARGIN: f32 = 1e-3;

/// The image of one Gaussian, ready to be blended: one line of cache.
///
/// `alpha(p) = 2^(level - (along * (dx - shear * dy))^2 - (across * dy)^2)` with (dx, dy) from the mean to p: the
/// Cholesky factors of the conic, which cannot become negative by rounding and need no determinant of the conic.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(super) struct Splat {
    /// Mean in pixels.
    pub(super) mean: [f32; 2],
    /// `sqrt(log2(e) / 2 * c / det)` for the covariance (a b; b c).
    pub(super) along: f32,
    /// `b / c`: where on a row the splat is strongest.
    pub(super) shear: f32,
    /// `sqrt(log2(e) / 2 / c)`
    pub(super) across: f32,
    /// `b / a`: where on a column the splat is strongest.
    pub(super) lean: f32,
    /// log2 of the opacity.
    pub(super) level: f32,
    /// Camera z of the mean.
    pub(super) z: f32,
    /// Red, green, blue.
    pub(super) color: [f32; 3],
    /// Scene-wide id.
    pub(super) id: u32,
    /// First and last tile across, first and last tile down.
    pub(super) tiles: [u16; 4],
}

/// The parts of a [`Splat`] that decide what it reaches, in all lanes.
#[derive(Clone, Copy)]
pub(super) struct Shape<S: Simd> {
    along: S::F,
    shear: S::F,
    across: S::F,
    lean: S::F,
    reach: S::F,
}

impl<S: Simd> Shape<S> {
    #[inline(always)]
    pub(super) fn new(s: S, splat: &Splat) -> Self {
        Self {
            along: s.splat(splat.along),
            shear: s.splat(splat.shear),
            across: s.splat(splat.across),
            lean: s.splat(splat.lean),
            reach: s.splat(splat.level + LEVELS + MARGIN),
        }
    }

    /// Which rectangles hold a point with alpha of at least 1/255; coordinates relative to the mean.
    #[inline(always)]
    pub(super) fn touches(&self, s: S, x0: S::F, y0: S::F, x1: S::F, y1: S::F) -> u32 {
        let zero = s.splat(0.0);
        // The least distance is on one of the (at most two) edges that face the mean, or 0 inside.
        let (x, y) = (clamp(s, zero, x0, x1), clamp(s, zero, y0, y1));
        let on_column = self.distance(s, x, clamp(s, s.mul(x, self.lean), y0, y1));
        let on_row = self.distance(s, clamp(s, s.mul(y, self.shear), x0, x1), y);
        s.bits(s.ge(self.reach, s.min(on_column, on_row)))
    }

    #[inline(always)]
    fn distance(&self, s: S, dx: S::F, dy: S::F) -> S::F {
        let e = s.mul(self.along, s.fnma(self.shear, dy, dx));
        let f = s.mul(self.across, dy);
        s.fma(e, e, s.mul(f, f))
    }
}

#[inline(always)]
fn clamp<S: Simd>(s: S, x: S::F, low: S::F, high: S::F) -> S::F {
    s.min(s.max(x, low), high)
}

/// Which tiles a splat reaches, in one word: first tile across (11 bits) and down (11) and tiles across (5 bits) of
/// its box, and one bit per tile of the box, row by row. Zero tiles across: the box has too many tiles for that.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cover(u64);

impl Cover {
    /// Tiles of the largest box with a bit per tile.
    const TILES: u32 = 32;
    /// More tiles than fit a word: see [`Splat::tiles`] and [`row_of_tiles`].
    const LARGE: Self = Self(0);

    fn small(x: u32, y: u32, across: u32, mask: u32) -> Self {
        Self(u64::from(mask) << 32 | u64::from(x) << 21 | u64::from(y) << 10 | u64::from(across))
    }

    /// Finds the tiles of a splat, by [`Splat::tiles`].
    #[inline(always)]
    pub(super) fn of<S: Simd>(s: S, splat: &Splat) -> Self {
        let t = splat.tiles;
        let (x0, x1, y0, y1) = (u32::from(t[0]), u32::from(t[1]), u32::from(t[2]), u32::from(t[3]));
        let (across, down) = (x1 - x0 + 1, y1 - y0 + 1);
        let tiles = across * down;
        if (across == 1 || down == 1) && tiles < 32 {
            // An ellipse reaches every tile of a box of one row or column.
            return Self::small(x0, y0, across, (1 << tiles) - 1);
        }
        if tiles > Self::TILES || across > 31 {
            return Self::LARGE;
        }
        let shape = Shape::new(s, splat);
        let (x, y) = origin(splat, x0, y0);
        let mut mask = 0;
        for part in 0..(tiles as usize).div_ceil(S::LANES) {
            let grid = &GRIDS[across as usize][part * S::LANES / GROUP];
            let part_of = part % (GROUP / S::LANES);
            let left = s.add(s.load(&grid[0], part_of), s.splat(x));
            let top = s.add(s.load(&grid[1], part_of), s.splat(y));
            let span = s.splat((TILE - 1) as f32);
            mask |= shape.touches(s, left, top, s.add(left, span), s.add(top, span)) << (part * S::LANES);
        }
        let all = if tiles == 32 { u32::MAX } else { (1 << tiles) - 1 };
        Self::small(x0, y0, across, mask & all)
    }

    /// Whether the box has too many tiles for a bit each: see [`row_of_tiles`].
    pub(super) fn is_large(self) -> bool {
        self.0 == 0
    }

    /// Calls back with each tile of a cover that is not large.
    #[inline(always)]
    pub(super) fn each(self, tiles_across: u32, mut tile: impl FnMut(usize)) {
        let (x, y) = ((self.0 >> 21) as u32 & 0x7ff, (self.0 >> 10) as u32 & 0x7ff);
        let across = self.0 as u32 & 31;
        let mut mask = (self.0 >> 32) as u32;
        let first = y * tiles_across + x;
        if mask == 1 {
            return tile(first as usize);
        }
        while mask != 0 {
            let k = mask.trailing_zeros();
            mask &= mask - 1;
            // k / across for k < 32 and across < 32, without a division.
            let row = (k * RECIPROCALS[across as usize]) >> 16;
            tile((first + row * tiles_across + (k - row * across)) as usize);
        }
    }
}

/// Pixel centre of the first pixel of a tile, relative to the mean.
fn origin(splat: &Splat, x: u32, y: u32) -> (f32, f32) {
    ((x * TILE as u32) as f32 + 0.5 - splat.mean[0], (y * TILE as u32) as f32 + 0.5 - splat.mean[1])
}

/// First and last tile of row `y` of the box of a large splat that it may reach, or none.
///
/// The exact interval of the ellipse over the rows of pixels of the tile row (facts: right limit at the height where the
/// ellipse is widest if that is in the strip, else at the nearer end of the strip).
pub(super) fn row_of_tiles(splat: &Splat, y: u32) -> Option<(u32, u32)> {
    let [first, last, ..] = splat.tiles.map(u32::from);
    let y0 = (y * TILE as u32) as f32 + 0.5 - splat.mean[1];
    let y1 = y0 + (TILE - 1) as f32;
    let reach = splat.level + LEVELS + MARGIN;
    let high = reach.max(0.0).sqrt() / splat.across;
    let (low, high) = (y0.max(-high), y1.min(high));
    if low > high {
        return None;
    }
    // Right branch: shear * y + sqrt(reach - (across * y)^2) / along, concave in y with its top at `top`.
    let a = splat.shear * splat.along / splat.across;
    let top = reach.max(0.0).sqrt() * a / (1.0 + a * a).sqrt() / splat.across;
    let half = |y: f32| (reach - (splat.across * y) * (splat.across * y)).max(0.0).sqrt() / splat.along;
    let (yr, yl) = (top.clamp(low, high), (-top).clamp(low, high));
    let right = splat.mean[0] + splat.shear * yr + half(yr) + 0.01;
    let left = splat.mean[0] + splat.shear * yl - half(yl) - 0.01;
    let x0 = (((left - 0.5) / TILE as f32).floor().max(0.0) as u32).max(first);
    let x1 = (((right - 0.5) / TILE as f32).floor().max(-1.0) as i64).min(i64::from(last));
    (i64::from(x0) <= x1).then_some((x0, x1 as u32))
}

/// 2^16 / n, rounded up: exact quotients for dividends below 32.
const RECIPROCALS: [u32; 32] = {
    let mut table = [0; 32];
    let mut n = 1;
    while n < 32 {
        table[n] = 65_536_u32.div_ceil(n as u32);
        n += 1;
    }
    table
};

/// Left and top edges of the tiles of boxes of so many tiles across, 32 tiles in row order.
static GRIDS: [[[Group<f32>; 2]; 2]; 32] = {
    let mut grids = [[[Group([0.0; GROUP]); 2]; 2]; 32];
    let mut across = 1;
    while across < 32 {
        let mut k = 0;
        while k < 32 {
            grids[across][k / GROUP][0].0[k % GROUP] = (k % across * TILE) as f32;
            grids[across][k / GROUP][1].0[k % GROUP] = (k / across * TILE) as f32;
            k += 1;
        }
        across += 1;
    }
    grids
};

#[cfg(test)]
mod tests {
    use super::super::simd::{InstructionSet, Kernel};
    use super::*;

    struct CoverOf(Splat);

    impl Kernel for CoverOf {
        type Output = Cover;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Cover {
            Cover::of(s, &self.0)
        }
    }

    /// A splat of covariance (a b; b c) in a picture of 40 x 30 tiles; none where its box is outside.
    fn splat(mean: [f32; 2], [a, b, c]: [f32; 3], opacity: f32) -> Option<Splat> {
        let half_log2_e = 0.5 * std::f32::consts::LOG2_E;
        let k = 2.0 * (255.0 * opacity).ln();
        let first = |m: f32, v: f32| ((m - (k * v).sqrt() - 0.5) / TILE as f32).floor().max(0.0) as u16;
        let last = |m: f32, v: f32, n: f32| ((m + (k * v).sqrt() - 0.5) / TILE as f32).floor().clamp(0.0, n) as u16;
        let tiles = [first(mean[0], a), last(mean[0], a, 39.0), first(mean[1], c), last(mean[1], c, 29.0)];
        (tiles[0] <= tiles[1] && tiles[2] <= tiles[3]).then(|| Splat {
            mean,
            along: (half_log2_e * c / (a * c - b * b)).sqrt(),
            shear: b / c,
            across: (half_log2_e / c).sqrt(),
            lean: b / a,
            level: opacity.log2(),
            tiles,
            ..Splat::default()
        })
    }

    #[test]
    fn covers_have_every_tile_with_a_pixel_that_counts_and_few_others() {
        let mut random = 5u64;
        let mut next = |low: f32, high: f32| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            low + (random >> 40) as f32 / (1u64 << 24) as f32 * (high - low)
        };
        let (mut needed, mut listed) = (0, 0);
        for n in 0..400 {
            let mean = [next(-40.0, 680.0), next(-40.0, 520.0)];
            let (long, short) = (next(0.3, 12.0).powi(2), next(0.3, 3.0).powi(2));
            let (sin, cos) = next(0.0, 3.2).sin_cos();
            let scale = if n % 4 == 0 { 40.0 } else { 1.0 };
            let a = scale * (long * cos * cos + short * sin * sin);
            let c = scale * (long * sin * sin + short * cos * cos);
            let b = scale * (long - short) * sin * cos;
            let opacity = next(0.01, 1.0);
            let Some(splat) = splat(mean, [a, b, c], opacity) else { continue };
            let mut brute = std::collections::BTreeSet::new();
            for y in 0..480 {
                for x in 0..640 {
                    let (dx, dy) = (f64::from(x as f32 + 0.5 - mean[0]), f64::from(y as f32 + 0.5 - mean[1]));
                    let [a, b, c] = [a, b, c].map(f64::from);
                    let q = (c * dx * dx - 2.0 * b * dx * dy + a * dy * dy) / (a * c - b * b);
                    if f64::from(opacity) * (-0.5 * q).exp() >= 1.0 / 255.0 {
                        brute.insert(y / TILE * 40 + x / TILE);
                    }
                }
            }
            for set in InstructionSet::ALL {
                let mut tiles = std::collections::BTreeSet::new();
                let cover = set.run(CoverOf(splat));
                if cover.is_large() {
                    for y in splat.tiles[2]..=splat.tiles[3] {
                        let Some((x0, x1)) = row_of_tiles(&splat, y.into()) else { continue };
                        tiles.extend((x0..=x1).map(|x| usize::from(y) * 40 + x as usize));
                    }
                } else {
                    cover.each(40, |tile| assert!(tiles.insert(tile), "tile {tile} twice"));
                }
                assert!(tiles.is_superset(&brute), "{}: {splat:?}: {tiles:?} lack some of {brute:?}", set.name());
                needed += brute.len();
                listed += tiles.len();
            }
        }
        assert!(listed * 10 < needed * 12, "{listed} tiles are listed where {needed} are needed");
    }
}
