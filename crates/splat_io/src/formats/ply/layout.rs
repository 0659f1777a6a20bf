//! What an untouched cloud needs beside its arrays to become the same file again.
//!
//! Stored in [`Source::layout`](splat_core::Source), opaque to everybody else: the header as it was, the bytes of other
//! elements, and columns whose values changed on the way into the arrays (doubles, fused filters).

use std::sync::Arc;

/// First bytes of a layout, so that another format's is never taken for one.
const MAGIC: &[u8; 8] = b"ply lay1";

/// Raw column of a field, in the file's byte order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kept<'a> {
    /// Position of the field within the schema.
    pub(super) field: usize,
    pub(super) bytes: &'a [u8],
}

#[derive(Clone, Debug)]
pub(super) struct Layout<'a> {
    /// Text of the header with its last line feed.
    pub(super) header: &'a [u8],
    /// Data of the elements before the Gaussians.
    pub(super) before: &'a [u8],
    /// Data after the Gaussians, whatever it is.
    pub(super) after: &'a [u8],
    pub(super) kept: Vec<Kept<'a>>,
}

impl<'a> Layout<'a> {
    pub(super) fn to_bytes(&self) -> Arc<[u8]> {
        let mut out = MAGIC.to_vec();
        let mut part = |bytes: &[u8]| {
            out.extend((bytes.len() as u64).to_le_bytes());
            out.extend_from_slice(bytes);
        };
        part(self.header);
        part(self.before);
        part(self.after);
        for kept in &self.kept {
            part(&(kept.field as u64).to_le_bytes());
            part(kept.bytes);
        }
        out.into()
    }

    /// `None` if the bytes are not one of these layouts.
    pub(super) fn parse(bytes: &'a [u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(MAGIC)?;
        let mut part = || {
            let (length, tail) = rest.split_first_chunk::<8>()?;
            let (part, tail) = tail.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
            rest = tail;
            Some(part)
        };
        let (header, before, after) = (part()?, part()?, part()?);
        let mut kept = Vec::new();
        while let Some(field) = part() {
            let field = u64::from_le_bytes(field.try_into().ok()?);
            kept.push(Kept { field: usize::try_from(field).ok()?, bytes: part()? });
        }
        Some(Self { header, before, after, kept })
    }
}
