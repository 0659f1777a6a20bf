//! Where the records of an element lie after the header, and text turned into binary records.

use super::header::{Element, Encoding, Header, Kind, Scalar};
use crate::{ReadError, SourceName};

/// The parts of a file: what precedes the element asked for, the element, what follows.
pub(crate) struct Parts<'a> {
    pub(crate) before: &'a [u8],
    pub(crate) records: &'a [u8],
    pub(crate) after: &'a [u8],
    /// How much of `after` no element of the header accounts for.
    pub(crate) trailing: u64,
}

/// Finds the records of element number `index` in a binary file; all lengths are checked, nothing is allocated.
pub(crate) fn split<'a>(
    header: &Header,
    bytes: &'a [u8],
    index: usize,
    name: &SourceName,
) -> Result<Parts<'a>, ReadError> {
    let body = &bytes[header.len..];
    let mut at = 0;
    let mut range = 0..0;
    for (i, element) in header.elements.iter().enumerate() {
        let start = at;
        at = skip(element, body, at, header.encoding == Encoding::Big, name)?;
        if i == index {
            range = start..at;
        }
    }
    Ok(Parts {
        before: &body[..range.start],
        records: &body[range.clone()],
        after: &body[range.end..],
        trailing: (body.len() - at) as u64,
    })
}

/// End of an element that starts at `at`.
pub(crate) fn skip(
    element: &Element,
    body: &[u8],
    at: usize,
    big: bool,
    name: &SourceName,
) -> Result<usize, ReadError> {
    let what = || format!("bytes of the element `{}` ({} records)", element.name, element.count);
    let left = (body.len() - at) as u64;
    if let Some(stride) = element.stride() {
        let expected = element.count.saturating_mul(stride as u64);
        if expected > left {
            return Err(ReadError::truncated(what(), expected, left, name));
        }
        return Ok(at + expected as usize);
    }
    let mut at = at as u64;
    let end = body.len() as u64;
    // Every record takes at least the byte of a list's length, so that a false count ends with the file.
    for _ in 0..element.count {
        for property in &element.properties {
            at += match property.kind {
                Kind::One(scalar) => scalar.size() as u64,
                Kind::List { count, item } => {
                    let Some(bytes) = body.get(at as usize..).and_then(|b| b.get(..count.size())) else {
                        return Err(ReadError::truncated(what(), end + 1, end, name));
                    };
                    let items = super::decode::to_f64(bytes, count, big);
                    if items < 0.0 || items.is_nan() {
                        return Err(ReadError::malformed("the length of a list", "0 or more", items.to_string(), name));
                    }
                    (count.size() as u64).saturating_add((items as u64).saturating_mul(item.size() as u64))
                }
            };
            if at > end {
                return Err(ReadError::truncated(what(), at, end, name));
            }
        }
    }
    Ok(at as usize)
}

/// Turns element number `index` of a text file into little-endian binary records.
pub(crate) fn from_text(header: &Header, bytes: &[u8], index: usize, name: &SourceName) -> Result<Vec<u8>, ReadError> {
    let mut words = Words { bytes: &bytes[header.len..], at: 0 };
    let mut out = Vec::new();
    for (i, element) in header.elements.iter().enumerate().take(index + 1) {
        if i == index {
            // A value takes at least a digit and a separator.
            let least = element.count.saturating_mul(2 * element.properties.len() as u64).saturating_sub(1);
            let left = (words.bytes.len() - words.at) as u64;
            if least > left {
                return Err(ReadError::truncated(
                    format!("bytes that the {} records of the element `{}` need at least", element.count, element.name),
                    least,
                    left,
                    name,
                ));
            }
            out.reserve_exact(element.count as usize * element.stride().unwrap_or(0));
        }
        if element.properties.is_empty() {
            continue;
        }
        for record in 0..element.count {
            for property in &element.properties {
                let cut = || {
                    ReadError::truncated(
                        format!("records of the element `{}`", element.name),
                        element.count,
                        record,
                        name,
                    )
                };
                let word = words.next().ok_or_else(cut)?;
                let bad = || {
                    let found = word.iter().take(40).flat_map(|b| b.escape_ascii()).map(char::from).collect::<String>();
                    let what = format!("property `{}` of record {record} of `{}`", property.name, element.name);
                    ReadError::malformed(what, "a number", format!("`{found}`"), name)
                };
                match property.kind {
                    Kind::One(scalar) if i == index => append(&mut out, word, scalar).ok_or_else(bad)?,
                    Kind::One(_) => {}
                    Kind::List { .. } => {
                        let items: u64 = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok()).ok_or_else(bad)?;
                        for _ in 0..items {
                            words.next().ok_or_else(cut)?;
                        }
                    }
                }
            }
        }
    }
    Ok(out)
}

fn append(out: &mut Vec<u8>, word: &[u8], scalar: Scalar) -> Option<()> {
    let word = std::str::from_utf8(word).ok()?;
    // Some writers print whole numbers with a point.
    let whole = || {
        let value = word.parse::<f64>().ok()?;
        (value.fract() == 0.0).then_some(value as i64)
    };
    match scalar {
        Scalar::F32 => out.extend(word.parse::<f32>().ok()?.to_le_bytes()),
        Scalar::F64 => out.extend(word.parse::<f64>().ok()?.to_le_bytes()),
        Scalar::I8 => out.extend(i8::try_from(whole()?).ok()?.to_le_bytes()),
        Scalar::U8 => out.extend(u8::try_from(whole()?).ok()?.to_le_bytes()),
        Scalar::I16 => out.extend(i16::try_from(whole()?).ok()?.to_le_bytes()),
        Scalar::U16 => out.extend(u16::try_from(whole()?).ok()?.to_le_bytes()),
        Scalar::I32 => out.extend(i32::try_from(whole()?).ok()?.to_le_bytes()),
        Scalar::U32 => out.extend(u32::try_from(whole()?).ok()?.to_le_bytes()),
    }
    Some(())
}

struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let rest = &rest[start..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += start + length;
        Some(&rest[..length])
    }
}
