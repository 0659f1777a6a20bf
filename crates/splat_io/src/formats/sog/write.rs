//! Arrays into pictures and `meta.json`, zipped (version 2).

use std::io::Write;

use rayon::prelude::*;
use splat_core::{Cloud, sh};

use super::super::morton;
use super::super::shared::{alpha_byte, finite_or, usual_losses, wxyz};
use super::codebook::Codebook;
use super::image;
use super::meta::{Asset, Images, Meta, Palette};
use super::read::PALETTE_COLUMNS;
use super::{META, palette, zip};
use crate::WriteError;
use crate::format::Written;

/// Highest degree of the format.
const MAX_DEGREE: u8 = 3;
/// Log scale of Gaussians that have none.
const NO_SCALE: f32 = -10.0;
const BLOCK: usize = 1 << 12;

/// A picture to be compressed.
struct Table {
    name: &'static str,
    width: usize,
    height: usize,
    /// Bytes per pixel: 3 or 4.
    channels: usize,
    bytes: Vec<u8>,
}

/// Ids in file order and the shape of pictures with one pixel for each.
struct Layout<'a> {
    order: &'a [u32],
    width: usize,
    height: usize,
}

impl Layout<'_> {
    /// One pixel per Gaussian, filled in parallel.
    fn table<const N: usize>(&self, name: &'static str, pixel: impl Fn(usize, usize) -> [u8; N] + Sync) -> Table {
        let mut bytes = vec![0; self.width * self.height * N];
        let pixels = bytes.par_chunks_exact_mut(N).with_min_len(BLOCK).zip(self.order.par_iter().with_min_len(BLOCK));
        pixels.enumerate().for_each(|(place, (out, &id))| out.copy_from_slice(&pixel(place, id as usize)));
        Table { name, width: self.width, height: self.height, channels: N, bytes }
    }
}

pub(super) fn write(cloud: &Cloud, sink: &mut dyn Write) -> Result<Written, WriteError> {
    let degree = cloud.sh_degree().min(MAX_DEGREE);
    let mut losses = usual_losses(cloud, MAX_DEGREE);
    let order = morton::order(cloud.means());
    let count = order.len();
    let width = ((count as f64).sqrt().ceil() as usize).next_multiple_of(4).max(4);
    let layout = Layout { order: &order, width, height: count.div_ceil(width).max(1) };

    let mut meta = Meta {
        version: Some(2),
        asset: Some(Asset { generator: concat!("splat_io ", env!("CARGO_PKG_VERSION")).to_owned() }),
        count: Some(count as u64),
        antialias: cloud.source().antialiased.then_some(true),
        ..Meta::default()
    };
    let mut tables = Vec::with_capacity(7);
    means(cloud, &layout, &mut meta, &mut tables);
    tables.push(layout.table("quats.webp", |_, id| rotation(cloud, id)));
    meta.quats.files = vec!["quats.webp".to_owned()];

    let scale = |id: usize| cloud.log_scales()[id].to_array().map(|s| finite_or(s, NO_SCALE));
    let color = |id: usize| {
        let sh = cloud.sh_of(id);
        [sh[0], sh[1], sh[2]].map(|v| finite_or(v, 0.0))
    };
    let (scales, colors) = rayon::join(
        || Codebook::fit((0..count).into_par_iter().flat_map_iter(scale).collect()),
        || Codebook::fit((0..count).into_par_iter().flat_map_iter(color).collect()),
    );
    tables.push(layout.table("scales.webp", |_, id| scale(id).map(|s| scales.code(s))));
    meta.scales = Images { codebook: scales.values, files: vec!["scales.webp".to_owned()], ..Images::default() };
    tables.push(layout.table("sh0.webp", |_, id| {
        let [r, g, b] = color(id).map(|c| colors.code(c));
        [r, g, b, alpha_byte(cloud, id)]
    }));
    meta.sh0 = Images { codebook: colors.values, files: vec!["sh0.webp".to_owned()], ..Images::default() };
    // Harmonics that are all zero need no palette.
    let bands = 3..3 * sh::coefficient_count(degree);
    let lit = |i: usize| cloud.sh_of(i)[bands.clone()].iter().any(|v| *v != 0.0);
    if degree > 0 && (0..count).into_par_iter().with_min_len(BLOCK).any(lit) {
        harmonics(cloud, &layout, degree, &mut meta, &mut tables, &mut losses);
    }

    let packed = tables
        .par_iter()
        .map(|table| image::encode(table.width, table.height, table.channels, &table.bytes))
        .collect::<Result<Vec<Vec<u8>>, _>>()?;
    let text = serde_json::to_vec(&meta).map_err(std::io::Error::other)?;
    let mut files: Vec<(&str, &[u8])> = vec![(META, &text)];
    files.extend(tables.iter().zip(&packed).map(|(table, bytes)| (table.name, bytes.as_slice())));
    let bytes = zip::write(&files, sink)?;
    Ok(Written { bytes, losses, order: Some(order) })
}

/// Positions: 16 bits per axis of `sign(x) ln(1 + |x|)`.
fn means(cloud: &Cloud, layout: &Layout<'_>, meta: &mut Meta, tables: &mut Vec<Table>) {
    let fold = |id: usize| {
        cloud.means()[id].to_array().map(|v| {
            let v = f64::from(finite_or(v, 0.0));
            v.abs().ln_1p().copysign(v)
        })
    };
    let (mut mins, mut maxs) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for id in 0..cloud.len() {
        for (axis, v) in fold(id).into_iter().enumerate() {
            mins[axis] = v.min(mins[axis]);
            maxs[axis] = v.max(maxs[axis]);
        }
    }
    if cloud.is_empty() {
        (mins, maxs) = ([0.0; 3], [0.0; 3]);
    }
    // What is written are 32-bit floats: codes must be counted from those.
    let (mins, maxs) = (mins.map(|v| v as f32), maxs.map(|v| v as f32));
    let code = |id: usize| {
        let v = fold(id);
        std::array::from_fn::<u16, 3, _>(|axis| {
            let (low, high) = (f64::from(mins[axis]), f64::from(maxs[axis]));
            let span = if high > low { high - low } else { 1.0 };
            ((v[axis] - low) / span * 65535.0).round() as u16
        })
    };
    tables.push(layout.table("means_l.webp", |_, id| code(id).map(|c| c as u8)));
    tables.push(layout.table("means_u.webp", |_, id| code(id).map(|c| (c >> 8) as u8)));
    meta.means = Images {
        mins: mins.to_vec(),
        maxs: maxs.to_vec(),
        files: vec!["means_l.webp".to_owned(), "means_u.webp".to_owned()],
        ..Images::default()
    };
}

/// The three smaller components of w, x, y, z in 8 bits, and which one was left out.
fn rotation(cloud: &Cloud, id: usize) -> [u8; 4] {
    let (q, largest) = wxyz(cloud.rotations()[id]);
    let sign = if q[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut out = [0, 0, 0, 252 + largest as u8];
    let rest = (0..4).filter(|k| *k != largest);
    for (out, k) in out.iter_mut().zip(rest) {
        *out = ((q[k] * sign * std::f32::consts::SQRT_2 * 0.5 + 0.5) * 255.0 + 0.5) as u8;
    }
    out
}

fn harmonics(
    cloud: &Cloud,
    layout: &Layout<'_>,
    degree: u8,
    meta: &mut Meta,
    tables: &mut Vec<Table>,
    losses: &mut Vec<String>,
) {
    let coefficients = sh::coefficient_count(degree) - 1;
    let size = 3 * coefficients;
    let mut vectors = vec![0.0; layout.order.len() * size];
    let rows = vectors.par_chunks_exact_mut(size).with_min_len(BLOCK).zip(layout.order.par_iter().with_min_len(BLOCK));
    rows.for_each(|(row, &id)| {
        for (out, v) in row.iter_mut().zip(&cloud.sh_of(id as usize)[3..]) {
            // Adding zero makes one zero of both, so that equal vectors are found.
            *out = finite_or(*v, 0.0) + 0.0;
        }
    });
    let palette = palette::fit(&vectors, size);
    let book = Codebook::fit(palette.entries.clone());
    let count = palette.entries.len() / size;
    let rows = count.div_ceil(PALETTE_COLUMNS);
    let mut bytes = vec![0; PALETTE_COLUMNS * size * rows];
    bytes.par_chunks_mut(BLOCK).zip(palette.entries.par_chunks(BLOCK)).for_each(|(out, values)| {
        for (out, v) in out.iter_mut().zip(values) {
            *out = book.code(*v);
        }
    });
    if !palette.exact {
        let squares: f64 = vectors
            .par_chunks(size * BLOCK)
            .zip(palette.labels.par_chunks(BLOCK))
            .map(|(vectors, labels)| {
                let entry = |l: u16| &bytes[usize::from(l) * size..][..size];
                let pairs = vectors.chunks_exact(size).zip(labels);
                let errors =
                    pairs.flat_map(|(v, &l)| v.iter().zip(entry(l)).map(|(v, c)| v - book.values[usize::from(*c)]));
                errors.map(|e| f64::from(e).powi(2)).sum::<f64>()
            })
            // In order, so that the sentence is the same on any number of threads.
            .collect::<Vec<f64>>()
            .into_iter()
            .sum();
        let error = (squares / vectors.len() as f64).sqrt();
        losses.push(format!(
            "spherical harmonics were grouped into {count} sets; a coefficient is off by {error:.4} (root mean square)"
        ));
    }
    let name = "shN_centroids.webp";
    tables.push(Table { name, width: PALETTE_COLUMNS * coefficients, height: rows, channels: 3, bytes });
    tables.push(layout.table("shN_labels.webp", |place, _| {
        let [low, high] = palette.labels[place].to_le_bytes();
        // Blue means nothing; equal to green it costs nothing, as the encoder subtracts green.
        [low, high, high]
    }));
    meta.rest = Some(Palette {
        count: Some(count as u64),
        bands: Some(degree),
        codebook: book.values,
        files: vec![name.to_owned(), "shN_labels.webp".to_owned()],
        ..Palette::default()
    });
}
