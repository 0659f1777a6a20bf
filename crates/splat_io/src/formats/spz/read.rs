//! From a file to arrays: inflating and decoding at the same time.

use bytemuck::zeroed_vec;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use splat_core::CloudArrays;

use super::super::flip::{Flip, RUB_RDF};
use super::super::turn;
use super::decode::{self, Harmonics};
use super::gzip::Gzip;
use super::header::{ARRAYS, Extensions, Header, INNER_HEADER, MAGIC, PLAIN_HEADER, axes_name, rdf_from, word};
use crate::format::ReadReport;
use crate::{ReadError, SourceName};

/// Which axes the arrays shall have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axes {
    /// Those of the file.
    AsStored,
    /// Right, down, forward.
    Rdf,
}

impl Axes {
    /// Signs applied while decoding; a file with other axes than usual is turned once more at the end.
    fn flip(self) -> Flip {
        Flip::new(if self == Self::Rdf { RUB_RDF } else { Vec3::ONE })
    }
}

/// Gaussians whose harmonics are inflated, then decoded by another thread while the next are inflated.
const BLOCK: usize = 1 << 15;
/// Bytes of extension records kept.
const EXTENSION_BYTES: usize = 1 << 16;

/// Versions 1 to 3.
pub(super) fn gzip(
    bytes: &[u8],
    name: &SourceName,
    axes: Axes,
    report: &mut ReadReport,
) -> Result<CloudArrays, ReadError> {
    let mut gzip = Gzip::new(bytes, name);
    let mut head = [0; INNER_HEADER];
    head.copy_from_slice(&gzip.take(INNER_HEADER, "header")?);
    let header = Header::parse(&head, bytes.len(), name)?;
    if header.version > 3 {
        return Err(ReadError::malformed(
            "the version inside a gzip stream",
            "1 to 3",
            header.version.to_string(),
            name,
        ));
    }
    let flip = axes.flip();
    let mut arrays = CloudArrays { sh_degree: header.degree, ..CloudArrays::default() };
    let [positions, opacities, colors, scales, rotations, _] = header.sizes();
    let colors = {
        let CloudArrays { means, log_scales, rotations: turns, opacity_logits, .. } = &mut arrays;
        let (gzip, header, flip) = (&mut gzip, &header, &flip);
        rayon::scope(|scope| -> Result<Vec<u8>, ReadError> {
            let raw = gzip.take(positions, ARRAYS[0])?;
            scope.spawn(move |_| *means = decode::means(header, &raw, flip));
            let raw = gzip.take(opacities, ARRAYS[1])?;
            scope.spawn(move |_| *opacity_logits = decode::opacity_logits(&raw));
            let colors = gzip.take(colors, ARRAYS[2])?;
            let raw = gzip.take(scales, ARRAYS[3])?;
            scope.spawn(move |_| *log_scales = decode::log_scales(&raw));
            let raw = gzip.take(rotations, ARRAYS[4])?;
            scope.spawn(move |_| *turns = decode::rotations(header, &raw, flip));
            Ok(colors)
        })?
    };
    // What has been inflated by now justifies the largest array, which is made only here.
    let harmonics = Harmonics::new(&header, &flip);
    let stride = harmonics.stride();
    arrays.sh = zeroed_vec::<f32>(header.count * stride);
    rayon::scope(|scope| -> Result<(), ReadError> {
        for (colors, out) in colors.chunks(3 * BLOCK).zip(arrays.sh.chunks_mut(stride * BLOCK)) {
            let raw = gzip.take(colors.len() / 3 * (stride - 3), ARRAYS[5])?;
            let harmonics = &harmonics;
            scope.spawn(move |_| harmonics.decode(colors, &raw, out));
        }
        Ok(())
    })?;
    let (rest, dropped) = gzip.rest(if header.extensions { EXTENSION_BYTES } else { 0 })?;
    let extensions = if header.extensions { Extensions::parse(&rest, name)? } else { Extensions::default() };
    report.trailing_bytes = dropped + extensions.trailing as u64;
    finish(&mut arrays, &header, &extensions, axes, report);
    Ok(arrays)
}

/// Version 4: all streams at once.
pub(super) fn streams(
    bytes: &[u8],
    name: &SourceName,
    axes: Axes,
    report: &mut ReadReport,
) -> Result<CloudArrays, ReadError> {
    let (Some(head), true) = (bytes.first_chunk::<INNER_HEADER>(), bytes.len() >= PLAIN_HEADER) else {
        return Err(ReadError::truncated("bytes of the header", PLAIN_HEADER as u64, bytes.len() as u64, name));
    };
    debug_assert!(head.starts_with(&MAGIC), "the caller has seen the magic number");
    let header = Header::parse(head, bytes.len(), name)?;
    if header.version < 4 {
        return Err(ReadError::malformed("the version of a plain header", "4", header.version.to_string(), name));
    }
    let table = word(bytes, 16) as usize;
    let sizes = header.sizes();
    let used: Vec<usize> = (0..6).filter(|&k| sizes[k] > 0).collect();
    let found = usize::from(bytes[15]);
    if found != used.len() {
        return Err(ReadError::malformed("the number of streams", used.len().to_string(), found.to_string(), name));
    }
    let body = table.saturating_add(16 * used.len());
    if table < PLAIN_HEADER || body > bytes.len() {
        let what = "bytes up to the end of the table of streams";
        return Err(ReadError::truncated(what, body.max(PLAIN_HEADER) as u64, bytes.len() as u64, name));
    }
    let extensions =
        if header.extensions { Extensions::parse(&bytes[PLAIN_HEADER..table], name)? } else { Extensions::default() };

    let mut packed: [&[u8]; 6] = [&[]; 6];
    let mut at = body;
    for (k, &array) in used.iter().enumerate() {
        let entry = table + 16 * k;
        let long = |at: usize| u64::from(word(bytes, at)) | u64::from(word(bytes, at + 4)) << 32;
        let (length, unpacked) = (long(entry), long(entry + 8));
        if unpacked != sizes[array] as u64 {
            let what = format!("the size of the {}", ARRAYS[array]);
            return Err(ReadError::malformed(what, sizes[array].to_string(), unpacked.to_string(), name));
        }
        let left = bytes.len() - at;
        let Some(length) = usize::try_from(length).ok().filter(|length| *length <= left) else {
            return Err(ReadError::truncated(format!("bytes of the {}", ARRAYS[array]), length, left as u64, name));
        };
        packed[array] = &bytes[at..at + length];
        at += length;
    }
    report.trailing_bytes = (bytes.len() - at) as u64;

    let flip = axes.flip();
    let mut arrays = CloudArrays { sh_degree: header.degree, ..CloudArrays::default() };
    let CloudArrays { means, log_scales, rotations, opacity_logits, sh, .. } = &mut arrays;
    let unpack = |k: usize| unpack(packed[k], sizes[k], ARRAYS[k], name);
    let ((a, b), (c, (d, e))) = rayon::join(
        || {
            rayon::join(
                || -> Result<(), ReadError> {
                    let (colors, rest) = rayon::join(|| unpack(2), || unpack(5));
                    let (colors, rest) = (colors?, rest?);
                    let harmonics = Harmonics::new(&header, &flip);
                    let stride = harmonics.stride();
                    *sh = zeroed_vec::<f32>(header.count * stride);
                    sh.par_chunks_mut(stride * BLOCK).enumerate().for_each(|(block, out)| {
                        let from = block * BLOCK;
                        let to = (from + BLOCK).min(header.count);
                        let rest = &rest[from * (stride - 3)..to * (stride - 3)];
                        harmonics.decode(&colors[3 * from..3 * to], rest, out);
                    });
                    Ok(())
                },
                || unpack(0).map(|raw| *means = decode::means(&header, &raw, &flip)),
            )
        },
        || {
            rayon::join(
                || unpack(4).map(|raw| *rotations = decode::rotations(&header, &raw, &flip)),
                || {
                    rayon::join(
                        || unpack(3).map(|raw| *log_scales = decode::log_scales(&raw)),
                        || unpack(1).map(|raw| *opacity_logits = decode::opacity_logits(&raw)),
                    )
                },
            )
        },
    );
    a.and(b).and(c).and(d).and(e)?;
    finish(&mut arrays, &header, &extensions, axes, report);
    Ok(arrays)
}

/// One zstd stream, which must hold exactly `size` bytes.
fn unpack(packed: &[u8], size: usize, what: &str, name: &SourceName) -> Result<Vec<u8>, ReadError> {
    if size == 0 {
        return Ok(Vec::new());
    }
    let damaged =
        |found: String| ReadError::malformed(format!("the zstd stream of the {what}"), "sound data", found, name);
    // The size is bounded by the file's (`Header::parse`), whatever the stream's own header says.
    let unpacked = zstd::bulk::decompress(packed, size).map_err(|error| damaged(error.to_string()))?;
    if unpacked.len() == size { Ok(unpacked) } else { Err(damaged(format!("{} bytes", unpacked.len()))) }
}

/// Axes, flags and notes.
fn finish(arrays: &mut CloudArrays, header: &Header, extensions: &Extensions, axes: Axes, report: &mut ReadReport) {
    report.notes.extend_from_slice(&extensions.notes);
    let stored = axes_name(extensions.system);
    arrays.source.antialiased = header.antialiased;
    arrays.source.axes = if axes == Axes::Rdf { "RDF" } else { stored }.to_owned();
    if axes == Axes::AsStored {
        return;
    }
    if stored != "RUB" {
        // Undo the usual flip, then turn the axes that the file names.
        turn::apply(arrays, rdf_from(stored) * Mat3::from_diagonal(RUB_RDF), 1.0, Vec3::ZERO);
    }
    if stored == "RDF" {
        report.notes.push("the file says that its axes are right, down, forward; nothing was turned".to_owned());
    } else {
        report.notes.push(format!(
            "the axes of the file ({stored}) were turned to right, down, forward (RDF), those of PLY files; if the \
             capture appears upside down, its writer had not turned them"
        ));
    }
}
