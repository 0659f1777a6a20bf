//! `cameras.bin` and `images.bin`, little-endian.

use super::{Image, Lens, MODELS};
use crate::{ReadError, SourceName};

/// Bytes of the two coordinates and the point's id that an image lists per feature.
const FEATURE: u64 = 24;

pub(super) fn lenses(bytes: &[u8], name: &SourceName) -> Result<Vec<Lens>, ReadError> {
    let mut cursor = Cursor { bytes, at: 0, what: "cameras", name };
    let count = cursor.u64()?;
    cursor.plausible(count, 24)?;
    let mut lenses = Vec::new();
    for _ in 0..count {
        let id = cursor.u32()?;
        let model = cursor.u32()?;
        let size = [cursor.u64()?, cursor.u64()?];
        let Some(&(_, _, parameters)) = MODELS.get(model as usize) else {
            let what = format!("COLMAP's camera model {model}");
            return Err(ReadError::unsupported(what, "undistort the pictures to PINHOLE", name));
        };
        let mut values = [0.0; 12];
        for value in &mut values[..parameters] {
            *value = cursor.f64()?;
        }
        lenses.push(Lens::new(id, model as usize, size, &values[..parameters]));
    }
    Ok(lenses)
}

pub(super) fn images(bytes: &[u8], name: &SourceName) -> Result<Vec<Image>, ReadError> {
    let mut cursor = Cursor { bytes, at: 0, what: "images", name };
    let count = cursor.u64()?;
    cursor.plausible(count, 73)?;
    let mut images = Vec::new();
    for _ in 0..count {
        let id = cursor.u32()?;
        let rotation = [cursor.f64()?, cursor.f64()?, cursor.f64()?, cursor.f64()?];
        let translation = [cursor.f64()?, cursor.f64()?, cursor.f64()?];
        let lens = cursor.u32()?;
        let picture = cursor.text()?;
        let features = cursor.u64()?;
        cursor.skip(features.saturating_mul(FEATURE))?;
        images.push(Image { id, rotation, translation, lens, name: picture });
    }
    Ok(images)
}

pub(super) fn write_lenses(lenses: &[Lens]) -> Vec<u8> {
    let mut out = (lenses.len() as u64).to_le_bytes().to_vec();
    for lens in lenses {
        let p = &lens.pinhole;
        out.extend(lens.id.to_le_bytes());
        // PINHOLE
        out.extend(1u32.to_le_bytes());
        out.extend(u64::from(p.width).to_le_bytes());
        out.extend(u64::from(p.height).to_le_bytes());
        out.extend([p.fx, p.fy, p.cx, p.cy].iter().flat_map(|v| v.to_le_bytes()));
    }
    out
}

pub(super) fn write_images(images: &[Image]) -> Vec<u8> {
    let mut out = (images.len() as u64).to_le_bytes().to_vec();
    for image in images {
        out.extend(image.id.to_le_bytes());
        out.extend(image.rotation.iter().chain(&image.translation).flat_map(|v| v.to_le_bytes()));
        out.extend(image.lens.to_le_bytes());
        out.extend(image.name.bytes().filter(|&b| b != 0));
        out.push(0);
        out.extend(0u64.to_le_bytes());
    }
    out
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    what: &'static str,
    name: &'a SourceName,
}

impl Cursor<'_> {
    fn truncated(&self, expected: u64) -> ReadError {
        ReadError::truncated(format!("bytes of the {}", self.what), expected, self.bytes.len() as u64, self.name)
    }

    /// Refuses a count whose records of at least `least` bytes the file cannot hold.
    fn plausible(&self, count: u64, least: u64) -> Result<(), ReadError> {
        let expected = count.saturating_mul(least).saturating_add(self.at as u64);
        if expected > self.bytes.len() as u64 { Err(self.truncated(expected)) } else { Ok(()) }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let value = self.bytes[self.at..].first_chunk::<N>().copied();
        let value = value.ok_or_else(|| self.truncated((self.at + N) as u64))?;
        self.at += N;
        Ok(value)
    }

    fn u32(&mut self) -> Result<u32, ReadError> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, ReadError> {
        self.take().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, ReadError> {
        self.take().map(f64::from_le_bytes)
    }

    fn text(&mut self) -> Result<String, ReadError> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == 0).ok_or_else(|| self.truncated(self.bytes.len() as u64 + 1))?;
        self.at += end + 1;
        Ok(String::from_utf8_lossy(&rest[..end]).into_owned())
    }

    fn skip(&mut self, length: u64) -> Result<(), ReadError> {
        let end = length.saturating_add(self.at as u64);
        if end > self.bytes.len() as u64 {
            return Err(self.truncated(end));
        }
        self.at = end as usize;
        Ok(())
    }
}
