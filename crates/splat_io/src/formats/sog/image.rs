//! Lossless WebP pictures as plain tables of bytes: no colour management, no premultiplied alpha.

use std::io::Cursor;

use image_webp::{ColorType, EncoderParams, EncodingError, WebPDecoder, WebPEncoder};

use super::super::limit;
use super::vp8l;
use crate::{ReadError, SourceName};

/// A decoded picture.
#[derive(Debug)]
pub(super) struct Image {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Red, green, blue, alpha, row after row.
    pixels: Vec<[u8; 4]>,
}

impl Image {
    /// Decodes a file. `total_len`: bytes of all files of the capture, which bound the size of any picture.
    pub(super) fn decode(file: &str, data: &[u8], total_len: usize, name: &SourceName) -> Result<Self, ReadError> {
        let bad = |found: String| ReadError::malformed(format!("the picture `{file}`"), "a lossless WebP", found, name);
        let damaged = |error: image_webp::DecodingError| bad(error.to_string());
        let mut decoder = WebPDecoder::new(Cursor::new(data)).map_err(damaged)?;
        if decoder.is_animated() || decoder.is_lossy() {
            let found = if decoder.is_animated() { "an animation" } else { "a lossy one; its values are lost" };
            return Err(bad(found.to_owned()));
        }
        let (width, height) = decoder.dimensions();
        let size = 4 * u64::from(width) * u64::from(height);
        limit::check(&format!("the unpacked size of `{file}`"), size, total_len, name)?;
        decoder.set_memory_limit(limit::unpacked_limit(total_len) as usize);
        let size = decoder.output_buffer_size().ok_or_else(|| bad(format!("{width} x {height}")))?;
        let (width, height) = (width as usize, height as usize);
        let mut pixels = vec![[0; 4]; width * height];
        if decoder.has_alpha() {
            decoder.read_image(pixels.as_flattened_mut()).map_err(damaged)?;
        } else {
            let mut bytes = vec![0; size];
            decoder.read_image(&mut bytes).map_err(damaged)?;
            for (pixel, [r, g, b]) in pixels.iter_mut().zip(bytes.as_chunks::<3>().0) {
                *pixel = [*r, *g, *b, 255];
            }
        }
        Ok(Self { width, height, pixels })
    }

    /// Number of pixels.
    pub(super) fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Pixel `i`, which must be below [`Image::len`].
    pub(super) fn pixel(&self, i: usize) -> [u8; 4] {
        self.pixels[i]
    }
}

/// Compresses a picture of 3 or 4 bytes per pixel, in the best of three ways.
///
/// # Errors
/// Those of the encoder: a side of 0 or above 16,384 pixels.
pub(super) fn encode(width: usize, height: usize, channels: usize, bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let color = if channels == 4 { ColorType::Rgba8 } else { ColorType::Rgb8 };
    let attempt = |predict: bool| -> std::io::Result<Vec<u8>> {
        let mut out = Vec::new();
        let mut params = EncoderParams::default();
        params.use_predictor_transform = predict;
        let mut encoder = WebPEncoder::new(&mut out);
        encoder.set_params(params);
        encoder.encode(bytes, width as u32, height as u32, color).map_err(|error| match error {
            EncodingError::IoError(error) => error,
            error => std::io::Error::new(std::io::ErrorKind::InvalidInput, error),
        })?;
        Ok(out)
    };
    // Neighbours in the picture are neighbours in space: similar in some tables, equal in others, unrelated in the rest.
    let ((similar, unrelated), equal) = rayon::join(
        || rayon::join(|| attempt(true), || attempt(false)),
        || vp8l::encode(width, height, channels, bytes),
    );
    let mut best = similar?;
    for other in [unrelated?, equal] {
        if other.len() < best.len() {
            best = other;
        }
    }
    Ok(best)
}
