//! One-dimensional numpy arrays (`.npy`, format version 1.0): labels, weights and selections per Gaussian.
//!
//! Read: little-endian `u8`, `bool`, `i8`, `u16`, `i32`, `u32`, `i64`, `u64`, `f32`, `f64`, C order, one axis (or several
//! of which all but one are 1). Write: `u8`, `u32`, `f32`.

use std::path::Path;

use crate::read::map;
use crate::write::write_file;
use crate::{ReadError, SourceName, WriteError};

/// Values of an array as typed in the file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the variants are named after the type they hold")]
pub enum Array {
    Bool(Vec<bool>),
    I8(Vec<i8>),
    U8(Vec<u8>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    I64(Vec<i64>),
    U64(Vec<u64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Array {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Bool(v) => v.len(),
            Self::I8(v) => v.len(),
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::I32(v) => v.len(),
            Self::U32(v) => v.len(),
            Self::I64(v) => v.len(),
            Self::U64(v) => v.len(),
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
        }
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All values as `f64`, exact for all types but 64-bit integers beyond 2^53.
    pub fn to_f64(&self) -> Vec<f64> {
        match self {
            Self::Bool(v) => v.iter().map(|&x| f64::from(u8::from(x))).collect(),
            Self::I8(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::U8(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::U16(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::I32(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::U32(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::I64(v) => v.iter().map(|&x| x as f64).collect(),
            Self::U64(v) => v.iter().map(|&x| x as f64).collect(),
            Self::F32(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Self::F64(v) => v.clone(),
        }
    }

    /// All values as bytes, if every one is a whole number in 0..=255.
    pub fn to_u8(&self) -> Option<Vec<u8>> {
        if let Self::U8(v) = self {
            return Some(v.clone());
        }
        self.to_f64().into_iter().map(|x| (x == f64::from(x as u8)).then_some(x as u8)).collect()
    }
}

/// Reads a `.npy` file.
///
/// # Errors
/// [`ReadError`] if the file is no such array or was cut off.
pub fn read(path: impl AsRef<Path>) -> Result<Array, ReadError> {
    let name = SourceName::from(path.as_ref());
    parse(&map(path.as_ref(), &name)?, &name)
}

/// Reads a `.npy` file of whole numbers in 0..=255 (labels, selections).
///
/// # Errors
/// As [`read`], and [`ReadError::Malformed`] if a value is not such a number.
pub fn read_u8(path: impl AsRef<Path>) -> Result<Vec<u8>, ReadError> {
    let name = SourceName::from(path.as_ref());
    read(path)?
        .to_u8()
        .ok_or_else(|| ReadError::malformed("a value", "a whole number in 0..=255", "outside that range", &name))
}

/// Reads a `.npy` file as 32-bit floats, rounding other types.
///
/// # Errors
/// As [`read`].
pub fn read_f32(path: impl AsRef<Path>) -> Result<Vec<f32>, ReadError> {
    Ok(match read(path)? {
        Array::F32(values) => values,
        other => other.to_f64().into_iter().map(|x| x as f32).collect(),
    })
}

/// Reads an array from memory.
///
/// # Errors
/// As [`read`].
pub fn parse(bytes: &[u8], name: &SourceName) -> Result<Array, ReadError> {
    let bad = |what: &str, expected: &str, found: String| ReadError::malformed(what, expected, found, name);
    if bytes.len() < 10 || &bytes[..6] != b"\x93NUMPY" {
        let head = bytes[..bytes.len().min(6)].escape_ascii().to_string();
        return Err(bad("the start", "a numpy array (\\x93NUMPY)", format!("\"{head}\"")));
    }
    let (start, length): (usize, usize) = match bytes[6] {
        1 => (10, usize::from(u16::from_le_bytes([bytes[8], bytes[9]]))),
        2 | 3 if bytes.len() >= 12 => (12, u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize),
        v => return Err(bad("the version", "1 to 3", v.to_string())),
    };
    let Some(header) = bytes.get(start..start.saturating_add(length)) else {
        return Err(ReadError::truncated("bytes of the header", length as u64, (bytes.len() - start) as u64, name));
    };
    let header = String::from_utf8_lossy(header);
    let field = |key: &str| {
        let at = header.find(&format!("'{key}'"))?;
        Some(header[at + key.len() + 2..].trim_start_matches([':', ' ']).to_owned())
    };
    let missing = |key: &str| bad(&format!("`{key}` of the header"), "a value", "missing".to_owned());
    let kind = field("descr").ok_or_else(|| missing("descr"))?;
    let kind = kind.split('\'').nth(1).unwrap_or_default().to_owned();
    // One axis has the same order both ways, so Fortran order needs no care.
    let shape = field("shape").ok_or_else(|| missing("shape"))?;
    let shape = shape.split(['(', ')']).nth(1).unwrap_or_default().to_owned();
    let axes: Option<Vec<u64>> =
        shape.split(',').map(str::trim).filter(|s| !s.is_empty()).map(|s| s.parse().ok()).collect();
    let axes = axes.ok_or_else(|| bad("the shape", "whole numbers", format!("({shape})")))?;
    if axes.iter().filter(|&&n| n != 1).count() > 1 {
        return Err(bad("the shape", "one axis", format!("({shape})")));
    }
    let count = axes.iter().product::<u64>();
    let body = &bytes[start + length..];
    let size = match kind.trim_start_matches(['<', '|', '=']) {
        "b1" | "i1" | "u1" => 1,
        "u2" => 2,
        "i4" | "u4" | "f4" => 4,
        "i8" | "u8" | "f8" => 8,
        _ => {
            return Err(bad(
                "the type",
                "a little-endian u1, b1, i1, u2, i4, u4, i8, u8, f4 or f8",
                format!("`{kind}`"),
            ));
        }
    };
    let expected = count.saturating_mul(size);
    if expected > body.len() as u64 {
        return Err(ReadError::truncated("bytes of the values", expected, body.len() as u64, name));
    }
    let body = &body[..expected as usize];
    macro_rules! values {
        ($t:ty, $n:literal) => {
            body.as_chunks::<$n>().0.iter().map(|b| <$t>::from_le_bytes(*b)).collect()
        };
    }
    Ok(match kind.trim_start_matches(['<', '|', '=']) {
        "b1" => Array::Bool(body.iter().map(|&b| b != 0).collect()),
        "i1" => Array::I8(values!(i8, 1)),
        "u1" => Array::U8(body.to_vec()),
        "u2" => Array::U16(values!(u16, 2)),
        "i4" => Array::I32(values!(i32, 4)),
        "u4" => Array::U32(values!(u32, 4)),
        "i8" => Array::I64(values!(i64, 8)),
        "u8" => Array::U64(values!(u64, 8)),
        "f4" => Array::F32(values!(f32, 4)),
        _ => Array::F64(values!(f64, 8)),
    })
}

/// Writes bytes as `|u1`.
///
/// # Errors
/// [`WriteError::Io`]; what was there before is unchanged then.
pub fn write_u8(path: impl AsRef<Path>, values: &[u8]) -> Result<(), WriteError> {
    write_bytes(path.as_ref(), "|u1", values.len(), values)
}

/// Writes `<u4`.
///
/// # Errors
/// As [`write_u8`].
pub fn write_u32(path: impl AsRef<Path>, values: &[u32]) -> Result<(), WriteError> {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    write_bytes(path.as_ref(), "<u4", values.len(), &bytes)
}

/// Writes `<f4`.
///
/// # Errors
/// As [`write_u8`].
pub fn write_f32(path: impl AsRef<Path>, values: &[f32]) -> Result<(), WriteError> {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    write_bytes(path.as_ref(), "<f4", values.len(), &bytes)
}

fn write_bytes(path: &Path, kind: &str, count: usize, bytes: &[u8]) -> Result<(), WriteError> {
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({count},), }}");
    // Magic, version, length and header together are a multiple of 64 bytes, ended by a line feed.
    let padded = (10 + header.len() + 1).next_multiple_of(64) - 10;
    while header.len() < padded - 1 {
        header.push(' ');
    }
    header.push('\n');
    write_file(path, |sink| {
        sink.write_all(b"\x93NUMPY\x01\x00")?;
        sink.write_all(&(header.len() as u16).to_le_bytes())?;
        sink.write_all(header.as_bytes())?;
        Ok(sink.write_all(bytes)?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_survive_a_round_trip() {
        let folder = std::env::temp_dir().join(format!("splat_io_npy_{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("a.npy");
        write_u8(&file, &[0, 1, 255]).unwrap();
        assert_eq!(read(&file).unwrap(), Array::U8(vec![0, 1, 255]));
        write_u32(&file, &[0, u32::MAX]).unwrap();
        assert_eq!(read(&file).unwrap(), Array::U32(vec![0, u32::MAX]));
        assert!(read_u8(&file).is_err());
        write_f32(&file, &[]).unwrap();
        assert_eq!(read(&file).unwrap(), Array::F32(vec![]));
        write_f32(&file, &[1.5, f32::INFINITY]).unwrap();
        assert_eq!(read_f32(&file).unwrap(), [1.5, f32::INFINITY]);
        let whole = std::fs::read(&file).unwrap();
        assert_eq!(whole.len() % 64, 8, "the values start at a multiple of 64");
        for cut in 0..whole.len() {
            assert!(parse(&whole[..cut], &SourceName::from("cut")).is_err(), "{cut} bytes");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_huge_shape_is_refused_without_allocating() {
        let mut bytes = b"\x93NUMPY\x01\x00\x60\x00".to_vec();
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (18446744073709551615,), }";
        bytes.extend(format!("{header:<95}\n").bytes());
        let error = parse(&bytes, &SourceName::from("huge")).unwrap_err();
        assert!(matches!(error, ReadError::Truncated { .. }), "{error}");
    }
}
