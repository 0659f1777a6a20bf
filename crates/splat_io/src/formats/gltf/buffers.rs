//! Bytes of a glTF file: chunks of a GLB, buffers, buffer views, and accessors as typed tables.

use std::borrow::Cow;

use super::json::{Accessor, Document};
use crate::format::Siblings;
use crate::{ReadError, SourceName};

pub(super) const GLB_MAGIC: [u8; 4] = *b"glTF";
pub(super) const JSON_CHUNK: [u8; 4] = *b"JSON";
pub(super) const BIN_CHUNK: [u8; 4] = *b"BIN\0";
/// Bytes of the header of a GLB, and of each chunk's.
pub(super) const GLB_HEADER: usize = 12;
pub(super) const CHUNK_HEADER: usize = 8;

/// The text and the binary chunk of a file.
pub(super) fn split<'a>(bytes: &'a [u8], name: &SourceName) -> Result<(&'a [u8], Option<&'a [u8]>), ReadError> {
    if !bytes.starts_with(&GLB_MAGIC) {
        return Ok((bytes, None));
    }
    let word = |at: usize| bytes.get(at..at + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    if word(4) != 2 {
        return Err(ReadError::unsupported(format!("glTF version {}", word(4)), "version 2 is", name));
    }
    let length = word(8) as usize;
    if length > bytes.len() {
        return Err(ReadError::truncated("bytes of the GLB", length as u64, bytes.len() as u64, name));
    }
    let (mut text, mut binary) = (None, None);
    let mut at = GLB_HEADER;
    while at + CHUNK_HEADER <= length {
        let size = word(at) as usize;
        let Some(chunk) = bytes[at + CHUNK_HEADER..length].get(..size) else {
            let left = (length - at - CHUNK_HEADER) as u64;
            return Err(ReadError::truncated("bytes of a chunk of the GLB", size as u64, left, name));
        };
        match &bytes[at + 4..at + 8] {
            kind if *kind == JSON_CHUNK && text.is_none() => text = Some(chunk),
            kind if *kind == BIN_CHUNK && binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        // Chunks start at multiples of four.
        at += CHUNK_HEADER + size.next_multiple_of(4);
    }
    let text = text.ok_or_else(|| ReadError::malformed("the JSON chunk of the GLB", "present", "missing", name))?;
    Ok((text, binary))
}

/// All buffers of a document.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    data: Vec<Option<Cow<'a, [u8]>>>,
    name: &'a SourceName,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(document: &'a Document, binary: Option<&'a [u8]>, name: &'a SourceName) -> Self {
        let mut data: Vec<Option<Cow<'a, [u8]>>> = document.buffers.iter().map(|_| None).collect();
        if let (Some(first), Some(buffer)) = (data.first_mut(), document.buffers.first())
            && buffer.uri.is_none()
        {
            *first = binary.map(Cow::Borrowed);
        }
        Self { document, data, name }
    }

    /// Gets the buffer of a view if it lies outside the file. Returns the bytes that this has added.
    pub(super) fn load(&mut self, view: usize, files: &dyn Siblings) -> Result<usize, ReadError> {
        let buffer = self.view(view)?.buffer;
        let Some(entry) = self.document.buffers.get(buffer) else { return Err(self.missing("buffer", buffer)) };
        if self.data[buffer].is_some() {
            return Ok(0);
        }
        let Some(uri) = &entry.uri else {
            return Err(ReadError::malformed("the binary chunk of the GLB", "present", "missing", self.name));
        };
        let bytes = match uri.strip_prefix("data:") {
            Some(data) => self.data_uri(data)?,
            None => files.get(&percent_decoded(uri))?,
        };
        let added = bytes.len();
        self.data[buffer] = Some(Cow::Owned(bytes));
        Ok(added)
    }

    fn data_uri(&self, data: &str) -> Result<Vec<u8>, ReadError> {
        let bad = || ReadError::malformed("a `data:` URI of the glTF file", "base64 text", "something else", self.name);
        let (kind, text) = data.split_once(',').ok_or_else(bad)?;
        if !kind.ends_with(";base64") {
            return Err(bad());
        }
        base64(text.as_bytes()).ok_or_else(bad)
    }

    fn view(&self, view: usize) -> Result<&'a super::json::BufferView, ReadError> {
        self.document.buffer_views.get(view).ok_or_else(|| self.missing("buffer view", view))
    }

    fn missing(&self, what: &str, number: usize) -> ReadError {
        ReadError::malformed(format!("{what} {number} of the glTF file"), "present", "missing", self.name)
    }

    /// Bytes of a view whose buffer is loaded.
    pub(super) fn bytes(&self, view: usize) -> Result<&[u8], ReadError> {
        let entry = self.view(view)?;
        let Some(Some(data)) = self.data.get(entry.buffer) else { return Err(self.missing("buffer", entry.buffer)) };
        let declared = self.document.buffers[entry.buffer].byte_length;
        let data = &data[..data.len().min(usize::try_from(declared).unwrap_or(usize::MAX))];
        let range = usize::try_from(entry.byte_offset).ok().zip(usize::try_from(entry.byte_length).ok());
        let bytes = range.and_then(|(at, length)| data.get(at..)?.get(..length));
        bytes.ok_or_else(|| {
            let expected = entry.byte_offset.saturating_add(entry.byte_length);
            ReadError::truncated(format!("bytes of a buffer up to view {view}"), expected, data.len() as u64, self.name)
        })
    }

    /// An accessor by number.
    pub(super) fn accessor(&self, number: usize) -> Result<&'a Accessor, ReadError> {
        self.document.accessors.get(number).ok_or_else(|| self.missing("accessor", number))
    }

    /// The values of an accessor; `what` names it in errors, `components` is how many a value has (at least).
    pub(super) fn table(&self, number: usize, what: &str, components: usize) -> Result<Table<'_>, ReadError> {
        let accessor = self.accessor(number)?;
        let malformed = |expected: &str, found: String| {
            Err(ReadError::malformed(format!("the attribute `{what}`"), expected, found, self.name))
        };
        if accessor.sparse.is_some() {
            let what = format!("a sparse accessor (attribute `{what}`)");
            return Err(ReadError::unsupported(what, "export it again without", self.name));
        }
        let found = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 0,
        };
        if found != components {
            return malformed(&format!("{components} components"), accessor.shape.clone());
        }
        let Some(component) = Component::of(accessor.component_type, accessor.normalized) else {
            let found = format!("{} (normalized: {})", accessor.component_type, accessor.normalized);
            return malformed("component type 5120 to 5123 or 5126", found);
        };
        if accessor.count == 0 {
            return Ok(Table { bytes: &[], stride: 0, component, count: 0 });
        }
        let Some(view) = accessor.buffer_view else {
            return malformed("a buffer view", "none, and no compression that is known".to_owned());
        };
        let size = component.size() * components;
        let stride = match self.view(view)?.byte_stride {
            None => size,
            Some(stride) => match usize::try_from(stride) {
                Ok(stride) if stride >= size => stride,
                _ => return malformed(&format!("a stride of at least {size}"), stride.to_string()),
            },
        };
        let bytes = self.bytes(view)?;
        let start = usize::try_from(accessor.byte_offset).unwrap_or(usize::MAX);
        let bytes = bytes.get(start..).unwrap_or(&[]);
        let needed = (accessor.count - 1).saturating_mul(stride as u64).saturating_add(size as u64);
        if needed > bytes.len() as u64 {
            return Err(ReadError::truncated(
                format!("bytes of the attribute `{what}`"),
                needed,
                bytes.len() as u64,
                self.name,
            ));
        }
        Ok(Table { bytes, stride, component, count: accessor.count as usize })
    }
}

/// How a component is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    F32,
    I8,
    I8Normalized,
    U8,
    U8Normalized,
    I16,
    I16Normalized,
    U16,
    U16Normalized,
}

impl Component {
    fn of(number: u32, normalized: bool) -> Option<Self> {
        Some(match (number, normalized) {
            (5126, _) => Self::F32,
            (5120, false) => Self::I8,
            (5120, true) => Self::I8Normalized,
            (5121, false) => Self::U8,
            (5121, true) => Self::U8Normalized,
            (5122, false) => Self::I16,
            (5122, true) => Self::I16Normalized,
            (5123, false) => Self::U16,
            (5123, true) => Self::U16Normalized,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::I8 | Self::I8Normalized | Self::U8 | Self::U8Normalized => 1,
            _ => 2,
        }
    }
}

/// Values of an accessor, all inside `bytes`.
pub(super) struct Table<'a> {
    bytes: &'a [u8],
    stride: usize,
    component: Component,
    pub(super) count: usize,
}

impl Table<'_> {
    /// Value `i`, which must be below `count`.
    pub(super) fn get<const N: usize>(&self, i: usize) -> [f32; N] {
        let bytes = &self.bytes[i * self.stride..];
        let two = |k: usize| [bytes[2 * k], bytes[2 * k + 1]];
        match self.component {
            Component::F32 => {
                let words = &bytes.as_chunks::<4>().0[..N];
                std::array::from_fn(|k| f32::from_le_bytes(words[k]))
            }
            Component::I8 => std::array::from_fn(|k| f32::from(bytes[k] as i8)),
            Component::I8Normalized => std::array::from_fn(|k| (f32::from(bytes[k] as i8) / 127.0).max(-1.0)),
            Component::U8 => std::array::from_fn(|k| f32::from(bytes[k])),
            Component::U8Normalized => std::array::from_fn(|k| f32::from(bytes[k]) / 255.0),
            Component::I16 => std::array::from_fn(|k| f32::from(i16::from_le_bytes(two(k)))),
            Component::I16Normalized => {
                std::array::from_fn(|k| (f32::from(i16::from_le_bytes(two(k))) / 32767.0).max(-1.0))
            }
            Component::U16 => std::array::from_fn(|k| f32::from(u16::from_le_bytes(two(k)))),
            Component::U16Normalized => std::array::from_fn(|k| f32::from(u16::from_le_bytes(two(k))) / 65535.0),
        }
    }
}

/// `%20` and its like as bytes; what is not UTF-8 then stays as it was.
fn percent_decoded(uri: &str) -> String {
    let mut out = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let digits = after.get(..2).and_then(|d| std::str::from_utf8(d).ok());
        match digits.and_then(|d| u8::from_str_radix(d, 16).ok()) {
            Some(byte) if first == b'%' => {
                out.push(byte);
                rest = &after[2..];
            }
            _ => {
                out.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8(out).unwrap_or_else(|_| uri.to_owned())
}

/// Decodes base64 (RFC 4648), with or without padding.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.trim_ascii_end();
    let text = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 2);
    for group in text.chunks(4) {
        let mut bits = 0u32;
        for &c in group {
            let digit = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' | b'-' => 62,
                b'/' | b'_' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(digit);
        }
        bits <<= 6 * (4 - group.len());
        let count = match group.len() {
            4 => 3,
            3 => 2,
            2 => 1,
            _ => return None,
        };
        out.extend_from_slice(&bits.to_be_bytes()[1..1 + count]);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent_signs_are_decoded() {
        assert_eq!(base64(b"Zm9vYmFy").unwrap(), b"foobar");
        assert_eq!(base64(b"Zm9vYg==").unwrap(), b"foob");
        assert_eq!(base64(b"Zm9vYmE=").unwrap(), b"fooba");
        assert!(base64(b"Zm9v!").is_none() && base64(b"Zm9vY").is_none());
        assert_eq!(percent_decoded("a%20b%2e%zz%"), "a b.%zz%");
    }
}
