//! PNG pictures: masks and label maps in; colours, masks, depths and ids out.

use std::io::{BufReader, Write};
use std::path::Path;

use png::{BitDepth, ColorType, Transformations};
use splat_core::Mask2d;

use crate::write::write_file;
use crate::{ReadError, SourceName, WriteError};

/// Largest side of a picture read, in pixels.
const MAX_SIDE: u32 = 32_768;
/// Largest number of pixels of a picture read: a small PNG can claim to hold a huge picture.
const MAX_PIXELS: u64 = 1 << 28;

/// Pixels of a PNG, 8 bits a channel, row-major from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Channels per pixel: 1 (gray), 2 (gray, alpha), 3 (red, green, blue), 4 (and alpha).
    pub channels: usize,
    /// `width * height * channels` bytes, channels innermost.
    pub values: Vec<u8>,
}

/// Reads a PNG; palettes are expanded, 16-bit values lose their lower byte, 1 to 4 bit grays are spread to 0..=255.
///
/// # Errors
/// [`ReadError`] if the file is no PNG, is damaged, or is larger than 32768 pixels a side or 2^28 in all.
pub fn read_png(path: impl AsRef<Path>) -> Result<Picture, ReadError> {
    decode(path.as_ref(), Transformations::EXPAND | Transformations::STRIP_16)
}

/// Reads a soft mask: gray as it is, colours by their largest channel; times alpha where there is one.
///
/// # Errors
/// As [`read_png`].
pub fn read_mask(path: impl AsRef<Path>) -> Result<Mask2d, ReadError> {
    let picture = read_png(path.as_ref())?;
    let scaled = |v: u8, alpha: u8| ((u32::from(v) * u32::from(alpha) + 127) / 255) as u8;
    let values = match picture.channels {
        1 => picture.values,
        2 => picture.values.as_chunks::<2>().0.iter().map(|p| scaled(p[0], p[1])).collect(),
        3 => picture.values.as_chunks::<3>().0.iter().map(|p| p[0].max(p[1]).max(p[2])).collect(),
        _ => picture.values.as_chunks::<4>().0.iter().map(|p| scaled(p[0].max(p[1]).max(p[2]), p[3])).collect(),
    };
    Mask2d::new(picture.width, picture.height, values).map_err(|e| {
        ReadError::malformed("the picture", "one value per pixel", e.to_string(), &SourceName::from(path.as_ref()))
    })
}

/// A map of labels: one byte per pixel, the number stored in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelMap {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// One label per pixel, row-major from the top left.
    pub labels: Vec<u8>,
}

/// Reads a label map: an 8-bit gray PNG as it is, or the indices of one with a palette.
///
/// # Errors
/// As [`read_png`], and [`ReadError::Other`] for a picture in colours.
pub fn read_labels(path: impl AsRef<Path>) -> Result<LabelMap, ReadError> {
    let picture = decode(path.as_ref(), Transformations::IDENTITY)?;
    if picture.channels != 1 || picture.values.len() as u64 != u64::from(picture.width) * u64::from(picture.height) {
        return Err(ReadError::Other {
            found: format!("{} channels of colour or another depth than 8 bits", picture.channels),
            expected: "a map of labels".to_owned(),
            advice: "store it as an 8-bit gray PNG".to_owned(),
            path: SourceName::from(path.as_ref()),
        });
    }
    Ok(LabelMap { width: picture.width, height: picture.height, labels: picture.values })
}

fn decode(path: &Path, transform: Transformations) -> Result<Picture, ReadError> {
    let name = SourceName::from(path);
    let file = std::fs::File::open(path).map_err(ReadError::io(&name))?;
    let bad = |e: png::DecodingError| ReadError::malformed("the picture", "a PNG", e.to_string(), &name);
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(transform);
    let mut reader = decoder.read_info().map_err(bad)?;
    let (width, height) = (reader.info().width, reader.info().height);
    if width > MAX_SIDE || height > MAX_SIDE || u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(ReadError::Limit {
            what: format!("the size {width}x{height} in pixels"),
            found: u64::from(width) * u64::from(height),
            limit: MAX_PIXELS,
            path: name,
        });
    }
    let Some(size) = reader.output_buffer_size() else {
        return Err(ReadError::malformed("the picture", "a size that fits memory", format!("{width}x{height}"), &name));
    };
    let mut values = vec![0; size];
    let frame = reader.next_frame(&mut values).map_err(bad)?;
    values.truncate(frame.buffer_size());
    Ok(Picture { width, height, channels: frame.color_type.samples(), values })
}

/// Writes red, green, blue; 8 bits each, row-major.
///
/// # Errors
/// [`WriteError::CannotHold`] if the number of bytes does not fit the size, [`WriteError::Io`] if the file cannot be
/// written; what was there before is unchanged then.
pub fn write_png_rgb8(path: impl AsRef<Path>, width: u32, height: u32, values: &[u8]) -> Result<(), WriteError> {
    encode(path.as_ref(), [width, height], ColorType::Rgb, BitDepth::Eight, values)
}

/// Writes red, green, blue, alpha (not premultiplied); 8 bits each, row-major.
///
/// # Errors
/// As [`write_png_rgb8`].
pub fn write_png_rgba8(path: impl AsRef<Path>, width: u32, height: u32, values: &[u8]) -> Result<(), WriteError> {
    encode(path.as_ref(), [width, height], ColorType::Rgba, BitDepth::Eight, values)
}

/// Writes one byte a pixel, row-major.
///
/// # Errors
/// As [`write_png_rgb8`].
pub fn write_png_gray8(path: impl AsRef<Path>, width: u32, height: u32, values: &[u8]) -> Result<(), WriteError> {
    encode(path.as_ref(), [width, height], ColorType::Grayscale, BitDepth::Eight, values)
}

/// Writes 16 bits a pixel, row-major.
///
/// # Errors
/// As [`write_png_rgb8`].
pub fn write_png_gray16(path: impl AsRef<Path>, width: u32, height: u32, values: &[u16]) -> Result<(), WriteError> {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
    encode(path.as_ref(), [width, height], ColorType::Grayscale, BitDepth::Sixteen, &bytes)
}

/// Writes a mask as an 8-bit gray PNG.
///
/// # Errors
/// As [`write_png_rgb8`].
pub fn write_mask(path: impl AsRef<Path>, mask: &Mask2d) -> Result<(), WriteError> {
    write_png_gray8(path, mask.width(), mask.height(), mask.values())
}

fn encode(path: &Path, size: [u32; 2], color: ColorType, depth: BitDepth, values: &[u8]) -> Result<(), WriteError> {
    let [width, height] = size;
    let sample = if depth == BitDepth::Sixteen { 2 } else { 1 };
    let expected = u64::from(width) * u64::from(height) * (color.samples() * sample) as u64;
    if values.len() as u64 != expected || expected == 0 {
        return Err(WriteError::CannotHold {
            format: "png",
            what: format!("{} bytes in {width}x{height} pixels", values.len()),
            advice: format!("{expected} bytes and at least one pixel were expected"),
        });
    }
    write_file(path, |sink| encode_to(sink, size, color, depth, values))
}

fn encode_to(
    sink: &mut dyn Write,
    size: [u32; 2],
    color: ColorType,
    depth: BitDepth,
    values: &[u8],
) -> Result<(), WriteError> {
    let failed = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => WriteError::Sink(e),
        other => WriteError::Sink(std::io::Error::other(other)),
    };
    let mut encoder = png::Encoder::new(sink, size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(values).map_err(failed)?;
    writer.finish().map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> std::path::PathBuf {
        let folder = std::env::temp_dir().join(format!("splat_io_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn pictures_survive_a_round_trip_and_become_masks() {
        let folder = folder("picture");
        let file = folder.join("a.png");
        write_png_rgb8(&file, 2, 1, &[1, 2, 3, 250, 0, 9]).unwrap();
        assert_eq!(read_png(&file).unwrap().values, [1, 2, 3, 250, 0, 9]);
        assert_eq!(read_mask(&file).unwrap().values(), [3, 250]);
        assert!(read_labels(&file).is_err());
        write_png_rgba8(&file, 1, 2, &[255, 255, 255, 128, 0, 200, 0, 255]).unwrap();
        assert_eq!(read_mask(&file).unwrap().values(), [128, 200]);
        let mask = Mask2d::new(3, 1, vec![0, 7, 255]).unwrap();
        write_mask(&file, &mask).unwrap();
        assert_eq!(read_mask(&file).unwrap(), mask);
        assert_eq!(read_labels(&file).unwrap().labels, [0, 7, 255]);
        write_png_gray16(&file, 1, 1, &[0x1234]).unwrap();
        assert_eq!(read_png(&file).unwrap().values, [0x12]);
        assert!(write_png_gray8(&file, 2, 2, &[0]).is_err());
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn what_is_no_picture_is_one_clear_error() {
        let folder = folder("no_picture");
        let file = folder.join("a.png");
        std::fs::write(&file, b"not a picture").unwrap();
        let text = read_mask(&file).unwrap_err().to_string();
        assert!(text.contains("PNG") && text.contains("a.png"), "{text}");
        assert!(matches!(read_mask(folder.join("none.png")), Err(ReadError::Io { .. })));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
