//! Pictures and `meta.json` into arrays, in parallel.

use bytemuck::zeroed_vec;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use splat_core::{CloudArrays, sh};

use super::super::limit;
use super::super::shared::logit_of_byte;
use super::image::Image;
use super::meta::{Images, Meta};
use crate::{ReadError, SourceName};

/// Gaussians of a block.
const BLOCK: usize = 4096;
/// Palette entries in a row of the picture of centroids.
pub(super) const PALETTE_COLUMNS: usize = 64;
/// Entries of a codebook.
const CODES: usize = 256;

/// Names of all pictures, in a fixed order.
pub(super) fn files(meta: &Meta, name: &SourceName) -> Result<Vec<String>, ReadError> {
    let mut files = Vec::new();
    let mut add = |property: &str, given: &[String], expected: usize| {
        if given.len() != expected {
            let what = format!("the number of files of `{property}` in `meta.json`");
            return Err(ReadError::malformed(what, expected.to_string(), given.len().to_string(), name));
        }
        files.extend_from_slice(given);
        Ok(())
    };
    add("means", &meta.means.files, 2)?;
    add("quats", &meta.quats.files, 1)?;
    add("scales", &meta.scales.files, 1)?;
    add("sh0", &meta.sh0.files, 1)?;
    if let Some(rest) = &meta.rest {
        add("shN", &rest.files, 2)?;
    }
    Ok(files)
}

/// Decodes everything. `packed`: the pictures in the order of [`files`]; `total_len`: bytes of all files together.
pub(super) fn decode(
    meta: &Meta,
    files: &[String],
    packed: &[impl AsRef<[u8]> + Sync],
    total_len: usize,
    name: &SourceName,
) -> Result<CloudArrays, ReadError> {
    let count = meta.count(name)?;
    let images = files
        .par_iter()
        .zip(packed)
        .map(|(file, data)| Image::decode(file, data.as_ref(), total_len, name))
        .collect::<Result<Vec<Image>, ReadError>>()?;
    for (k, image) in images.iter().enumerate() {
        // The centroids are the only picture that is not one pixel per Gaussian.
        if k != 5 && image.len() < count {
            let what = format!("pixels of `{}`", files[k]);
            return Err(ReadError::truncated(what, count as u64, image.len() as u64, name));
        }
    }
    let palette = Palette::new(meta, &images, name)?;
    let degree = palette.as_ref().map_or(0, |p| p.degree);
    let stride = 3 * sh::coefficient_count(degree);
    limit::check("the unpacked size of all Gaussians", (count * (20 + stride)) as u64, total_len, name)?;

    let means = Means::new(meta, &images[0], &images[1], count, name)?;
    let scales = Axes::new("scales", &meta.scales, 3, meta.has_codebooks(), name)?;
    let colors = Axes::new("sh0", &meta.sh0, if meta.has_codebooks() { 3 } else { 4 }, meta.has_codebooks(), name)?;
    let logits = if meta.has_codebooks() { logit_of_byte() } else { colors.tables[3] };
    let (quats, scale_image, color_image) = (&images[2], &images[3], &images[4]);

    let mut arrays = CloudArrays {
        means: zeroed_vec::<Vec3>(count),
        log_scales: zeroed_vec::<Vec3>(count),
        rotations: zeroed_vec::<Quat>(count),
        opacity_logits: zeroed_vec::<f32>(count),
        sh_degree: degree,
        sh: zeroed_vec::<f32>(count * stride),
        ..CloudArrays::default()
    };
    let columns = (
        arrays.means.par_chunks_mut(BLOCK),
        arrays.log_scales.par_chunks_mut(BLOCK),
        arrays.rotations.par_chunks_mut(BLOCK),
        arrays.opacity_logits.par_chunks_mut(BLOCK),
        arrays.sh.par_chunks_mut(stride * BLOCK),
    );
    columns.into_par_iter().enumerate().for_each(|(block, (out, log_scales, rotations, opacity_logits, sh))| {
        for (k, sh) in sh.chunks_exact_mut(stride).enumerate() {
            let i = block * BLOCK + k;
            out[k] = means.get(i);
            log_scales[k] = Vec3::from_array(scales.get(scale_image.pixel(i)));
            rotations[k] = rotation(quats.pixel(i));
            let color = color_image.pixel(i);
            sh[..3].copy_from_slice(&colors.get(color));
            opacity_logits[k] = logits[usize::from(color[3])];
            if let Some(palette) = &palette {
                palette.get(i, &mut sh[3..]);
            }
        }
    });
    Ok(arrays)
}

/// Three components of w, x, y, z in 8 bits, and which one, the largest, was left out.
fn rotation([a, b, c, tag]: [u8; 4]) -> Quat {
    let [a, b, c] = [a, b, c].map(|b| (f32::from(b) / 255.0 * 2.0 - 1.0) * std::f32::consts::FRAC_1_SQRT_2);
    let m = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
    match tag {
        252 => Quat::from_xyzw(a, b, c, m),
        253 => Quat::from_xyzw(m, b, c, a),
        254 => Quat::from_xyzw(b, m, c, a),
        255 => Quat::from_xyzw(b, c, m, a),
        _ => Quat::IDENTITY,
    }
}

/// The coordinate of `t = mins + (maxs - mins) * v / 65535`: `sign(t) * (exp(|t|) - 1)`.
fn unfold(t: f32) -> f32 {
    t.abs().exp_m1().copysign(t)
}

/// Positions: 16 bits per axis, low and high bytes in two pictures.
struct Means<'a> {
    low: &'a Image,
    high: &'a Image,
    mins: [f32; 3],
    spans: [f32; 3],
    /// All coordinates that can occur, for clouds that are large enough to use most of them.
    tables: Option<Vec<f32>>,
}

impl<'a> Means<'a> {
    fn new(meta: &Meta, low: &'a Image, high: &'a Image, count: usize, name: &SourceName) -> Result<Self, ReadError> {
        const STEPS: usize = 1 << 16;
        let (mins, maxs) = range("means", &meta.means, 3, name)?;
        let span = |k: usize| if maxs[k] == mins[k] { 1.0 } else { maxs[k] - mins[k] };
        let mut means =
            Self { low, high, mins: [mins[0], mins[1], mins[2]], spans: [span(0), span(1), span(2)], tables: None };
        if count > 2 * STEPS {
            let mut tables = vec![0.0; 3 * STEPS];
            for (axis, table) in tables.chunks_exact_mut(STEPS).enumerate() {
                table
                    .par_iter_mut()
                    .with_min_len(BLOCK)
                    .enumerate()
                    .for_each(|(v, out)| *out = means.coordinate(axis, v));
            }
            means.tables = Some(tables);
        }
        Ok(means)
    }

    fn coordinate(&self, axis: usize, v: usize) -> f32 {
        unfold(self.mins[axis] + self.spans[axis] * (v as f32 / 65535.0))
    }

    fn get(&self, i: usize) -> Vec3 {
        let (low, high) = (self.low.pixel(i), self.high.pixel(i));
        Vec3::from_array(std::array::from_fn(|axis| {
            let v = usize::from(low[axis]) | usize::from(high[axis]) << 8;
            self.tables.as_ref().map_or_else(|| self.coordinate(axis, v), |tables| tables[axis << 16 | v])
        }))
    }
}

/// `mins` and `maxs` of a property, of the expected number.
fn range<'a>(
    property: &str,
    images: &'a Images,
    axes: usize,
    name: &SourceName,
) -> Result<(&'a [f32], &'a [f32]), ReadError> {
    for (what, values) in [("mins", &images.mins), ("maxs", &images.maxs)] {
        if values.len() != axes || values.iter().any(|v| !v.is_finite()) {
            let found = format!("{} values", values.len());
            let what = format!("`{what}` of `{property}` in `meta.json`");
            return Err(ReadError::malformed(what, format!("{axes} finite numbers"), found, name));
        }
    }
    Ok((&images.mins, &images.maxs))
}

/// One entry for every byte, the last one repeated where the codebook is shorter.
fn codes(property: &str, codebook: &[f32], name: &SourceName) -> Result<[f32; CODES], ReadError> {
    match codebook.last() {
        Some(last) if codebook.len() <= CODES => Ok(std::array::from_fn(|b| codebook.get(b).copied().unwrap_or(*last))),
        _ => {
            let what = format!("the codebook of `{property}` in `meta.json`");
            Err(ReadError::malformed(what, "1 to 256 values", codebook.len().to_string(), name))
        }
    }
}

/// The value of every byte on a line from `min` to `max`.
fn line(min: f32, max: f32) -> [f32; CODES] {
    std::array::from_fn(|b| min + (max - min) * (b as f32 / 255.0))
}

/// The value of every byte, per channel.
struct Axes {
    tables: [[f32; CODES]; 4],
}

impl Axes {
    fn new(property: &str, images: &Images, axes: usize, codebook: bool, name: &SourceName) -> Result<Self, ReadError> {
        if codebook {
            return Ok(Self { tables: [codes(property, &images.codebook, name)?; 4] });
        }
        let (mins, maxs) = range(property, images, axes, name)?;
        Ok(Self { tables: std::array::from_fn(|k| if k < axes { line(mins[k], maxs[k]) } else { [0.0; CODES] }) })
    }

    fn get(&self, pixel: [u8; 4]) -> [f32; 3] {
        std::array::from_fn(|k| self.tables[k][usize::from(pixel[k])])
    }
}

/// Spherical harmonics of degree 1 to 3.
struct Palette<'a> {
    degree: u8,
    coefficients: usize,
    /// Entries that the picture and `meta.json` have.
    count: usize,
    table: [f32; CODES],
    centroids: &'a Image,
    labels: &'a Image,
}

impl<'a> Palette<'a> {
    fn new(meta: &Meta, images: &'a [Image], name: &SourceName) -> Result<Option<Self>, ReadError> {
        let (Some(rest), [_, _, _, _, _, centroids, labels]) = (&meta.rest, images) else { return Ok(None) };
        let degree_of_width = match centroids.width {
            192 => 1,
            512 => 2,
            960 => 3,
            _ => 0,
        };
        let degree = rest.bands.unwrap_or(degree_of_width);
        let coefficients = sh::coefficient_count(degree.min(3)) - 1;
        if !(1..=3).contains(&degree) || centroids.width != PALETTE_COLUMNS * coefficients {
            return Err(ReadError::malformed(
                format!("the width of `{}`", rest.files[0]),
                "192, 512 or 960 for 1, 2 or 3 bands",
                format!("{} for {degree} bands", centroids.width),
                name,
            ));
        }
        let held = PALETTE_COLUMNS * centroids.height;
        let count = rest.count.map_or(held, |count| usize::try_from(count).unwrap_or(held).min(held));
        let table = if meta.has_codebooks() {
            codes("shN", &rest.codebook, name)?
        } else {
            let (Some(min), Some(max)) = (rest.mins, rest.maxs) else {
                let what = "`mins` and `maxs` of `shN` in `meta.json`";
                return Err(ReadError::malformed(what, "two numbers", "missing", name));
            };
            line(min, max)
        };
        Ok(Some(Self { degree, coefficients, count, table, centroids, labels }))
    }

    /// Fills the coefficients of Gaussian `i`; they stay zero where its label points nowhere.
    fn get(&self, i: usize, out: &mut [f32]) {
        let pixel = self.labels.pixel(i);
        let label = usize::from(pixel[0]) | usize::from(pixel[1]) << 8;
        if label >= self.count {
            return;
        }
        // Rows are as wide as 64 entries, so that entries follow each other without a gap.
        let first = label * self.coefficients;
        for (k, out) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let pixel = self.centroids.pixel(first + k);
            *out = std::array::from_fn(|channel| self.table[usize::from(pixel[channel])]);
        }
    }
}
